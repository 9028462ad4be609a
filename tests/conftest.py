"""The suite in parallel: who shares a worker, and what runs alone.

Workers are processes of pytest-xdist, three for two cores: tests of windows, streams and child
processes wait for much of their time. The tests of a file share a worker, and with it fixtures and
runs; so do those of some files (TOGETHER). A test marked `perf` compares run times: while it runs,
the other workers wait.
"""

import contextlib
import functools
import gc
import importlib
import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

os.environ.setdefault("MPLBACKEND", "agg")
# before NumPy: workers share the cores, and oracles, which are no questions, have small matrices
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# what is compiled is kept, as on a user's machine: a hundred child processes import the package,
# and each worker the tests
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

gc.set_threshold(20_000, 20, 20)  # modules and figures are many objects and little garbage
from tests.hunt import EXAMPLES, HUNTS, MORE  # noqa: E402

try:
    import fcntl
except ImportError:  # Windows: no locks, so ratios of run times are disturbed there
    fcntl = None

# a background job and its children ignore the one, what nohup starts the other
for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    number = getattr(signal, name, None)  # Windows has no SIGHUP
    if number and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# deterministic but in a hunt, no deadline: run times on shared machines mean nothing
settings.register_profile(
    "default",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=not HUNTS,
    max_examples=MORE * EXAMPLES,
    phases=[x for x in Phase if x is not Phase.explain],  # which takes minutes where runs are tried
)
settings.load_profile("default")
HERE = Path(__file__).parent

TOGETHER = {  # files that share a dear fixture, or the processor's time for a screen
    "paper/test_ledger.py": "ledger",
    "paper/test_report.py": "ledger",
    "studies/test_impedance.py": "passivity",
    "studies/test_passivity_runs.py": "passivity",
    "studies/test_port_energy.py": "passivity",
    "system/test_page.py": "screen",
    "system/test_window.py": "screen",
}
# folders with long files have the first turns, lest one be the last
LONG = ("system", "views", "live", "kernel", "studies")
# these wait for a browser, a window or child processes for much of their time: one at a time, while
# the other workers compute
WAITS = tuple(
    f"system/test_{name}.py"
    for name in ("page", "window", "pair_page", "sweep_faults", "native", "workers", "notebooks")
)


def pytest_xdist_auto_num_workers():
    """How many workers `-n logical` starts."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return 3 * cores // 2


def pytest_collection(session):
    """Imports this worker's share of the files, before each worker imports them all.

    pytest rewrites the assertions of a file when it imports it, and keeps what it made for the next
    one, which takes twenty times as long as to import that. A file that fails is told of later.
    """
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    if not number or [Path(x).resolve() for x in session.config.args] != [HERE]:
        return
    count = int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    for file in sorted(HERE.rglob("test_*.py"))[int(number) :: count]:
        name = ".".join(file.relative_to(HERE.parent).with_suffix("").parts)
        with contextlib.suppress(Exception, pytest.skip.Exception):
            importlib.import_module(name)


def file_of(item):
    """The file of a test, from this folder."""
    return name_of(item.path)


@functools.cache  # for thousands of tests
def name_of(path):
    """The name of a file, from this folder."""
    return path.relative_to(HERE).as_posix()


def folder_turn(file):
    """When the files of a folder have their turn."""
    name = file.partition("/")[0]
    return LONG.index(name) if name in LONG else len(LONG)


def turns(files):
    """Files in the order of their turns: behind each that waits, two that compute."""
    files = sorted(dict.fromkeys(files), key=folder_turn)
    waits, rest = [x for x in files if x in WAITS], [x for x in files if x not in WAITS]
    out = []
    while waits or rest:
        out += waits[:1] + rest[:2]
        del waits[:1], rest[:2]
    return {x: i for i, x in enumerate(out)}


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items):
    turn = turns(map(file_of, items))
    items.sort(key=lambda item: turn[file_of(item)])
    for item in items:
        file = file_of(item)
        group = TOGETHER.get(file, file)
        item.add_marker(pytest.mark.xdist_group(group))
        # xdist 3.8 appends the group to `_nodeid`, which pytest 9.2 no longer has
        if "PYTEST_XDIST_WORKER" in os.environ and not hasattr(item, "_nodeid"):
            item._id = type(item._id).parse(f"{item.nodeid}@{group}")


def pytest_collection_finish():
    """Takes what was collected out of the search for cycles: it stays to the end.

    A trace of lines handles SIGTERM from the beginning of the session on; tests are about the
    default.
    """
    gc.collect()
    gc.freeze()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextlib.contextmanager
def locked(file, kind):
    """Hold a lock of this file among all workers; kind is shared or exclusive."""
    with open(file) as f:
        fcntl.flock(f, kind)
        try:
            yield
        finally:
            fcntl.flock(f, fcntl.LOCK_UN)  # a child may have inherited the file


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Run a `perf` test while no other one runs: all go through a turnstile, in which it waits."""
    if not fcntl or "PYTEST_XDIST_WORKER" not in os.environ:
        return (yield)
    kind = fcntl.LOCK_EX if item.get_closest_marker("perf") else fcntl.LOCK_SH
    with contextlib.ExitStack() as held:
        with locked(__file__, fcntl.LOCK_EX):
            held.enter_context(locked(item.config.inipath, kind))
        return (yield)


@pytest.fixture(autouse=True)
def no_layout(request):
    """Figures are drawn as they are, but in a test that is marked `layout`.

    To find room for all texts takes most of the time of a figure; each kind of figure has it found
    in views/test_figures.py.
    """
    if request.node.get_closest_marker("layout"):
        yield
        return
    from hapticclay.views import style

    with pytest.MonkeyPatch.context() as patch:
        for parameters in (style.STYLE, style.PRINT):
            patch.setitem(parameters, "figure.constrained_layout.use", False)
        yield


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
