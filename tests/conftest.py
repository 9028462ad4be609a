import os
import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))  # oracles
os.environ.setdefault("MPLBACKEND", "agg")

# deterministic in CI, no deadline: run times on shared machines mean nothing
settings.register_profile("default", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("default")
