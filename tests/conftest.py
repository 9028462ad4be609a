import os
import signal

import pytest
from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "agg")
if (
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):  # as a background job's, and then its children's
    signal.signal(signal.SIGINT, signal.default_int_handler)

# deterministic in CI, no deadline: run times on shared machines mean nothing
settings.register_profile("default", deadline=None, derandomize=True, max_examples=100)
settings.load_profile("default")


@pytest.fixture(scope="session")
def paper_runs():
    """The runs behind the ledger, made once."""
    from hapticclay.paper.ledger import Runs

    return Runs()


@pytest.fixture(scope="session")
def ledger_rows(paper_runs):
    """The rows of the ledger."""
    from hapticclay.paper import claims

    return claims.ledger_rows(paper_runs)
