"""An installation without numba: long studies run in Python, and nothing asks for its version."""

import subprocess
import sys

SCRIPT = """
import sys
from importlib.machinery import PathFinder

HIDDEN = ("numba", "llvmlite")

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        hidden = name.partition(".")[0] in HIDDEN
        return None if hidden else PathFinder.find_spec(name, path, target)

    @classmethod
    def find_distributions(cls, *context, **given):
        found = PathFinder.find_distributions(*context, **given)
        return (d for d in found if d.metadata["Name"].lower() not in HIDDEN)

sys.meta_path = [Without if f is PathFinder else f for f in sys.meta_path]
import hapticclay as hc

found = hc.walls.zwidth(hc.VirtualWall(100.0, 1.0, device=hc.Device(0.1, 1.0)))
print(found.headline())
assert not set(HIDDEN) & set(sys.modules)
"""


def test_a_study_of_many_runs_is_made_in_python(tmp_path):
    words = [sys.executable, "-W", "error", "-c", SCRIPT]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("K to ")
