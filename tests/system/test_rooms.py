"""What `import hapticclay` and a run load, how fast, and who imports whom."""

import subprocess
import sys
from pathlib import Path

import grimp
import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

HEAVY = (
    "matplotlib",
    "imageio",
    "viser",
    "dask",
    "cyclopts",
    "tqdm",
    "scipy",
    "mujoco.viewer",
)


def loaded(code, names):
    """Which of these modules a fresh process has loaded after the code."""
    code += f"; import sys; print(*[m for m in {names!r} if m in sys.modules])"
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.mark.parametrize(
    "code, names",
    [
        ("import hapticclay", (*HEAVY, "mujoco", "numpy")),
        ("import hapticclay as hc; hasattr(hc, '__wrapped__')", (*HEAVY, "mujoco", "numpy")),
        ("import hapticclay as hc; hc.constant_cut()", (*HEAVY, "mujoco")),
        ("import hapticclay as hc; hc.simulate(hc.constant_cut(t_max=0.01))", HEAVY),
        (
            "import hapticclay as hc; hc.theory.gain_limit('x', 90.0)",
            ("matplotlib", "mujoco", "cyclopts"),
        ),
    ],
)
def test_what_is_not_needed_is_not_loaded(code, names):
    assert loaded(code, names) == []


def test_the_rooms_stand_as_drawn():
    """import-linter's contracts in pyproject.toml."""
    out = subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        capture_output=True,
        text=True,
    )
    assert out.returncode == 0, out.stdout


def test_no_imports_run_in_a_circle():
    """Those within functions and for types alone included."""
    graph = grimp.build_graph("hapticclay", cache_dir=None)
    modules = sorted(graph.modules)
    ties = np.array(
        [[b in graph.find_modules_directly_imported_by(a) for b in modules] for a in modules]
    )
    _, rings = connected_components(ties, connection="strong")
    circles = {n: [m for m, k in zip(modules, rings, strict=True) if k == n] for n in rings}
    assert [x for x in circles.values() if len(x) > 1] == []
    assert ties.sum() > len(modules)  # it sees imports


@pytest.mark.perf
def test_import_is_quick_beside_mujoco():
    """A ratio: all that a run loads against MuJoCo alone, best of three, in fresh processes.

    All of it comes from compiled files, as after the first import on a user's machine.
    """
    code = (
        "import time; a = time.perf_counter(); import mujoco; b = time.perf_counter(); "
        "import hapticclay.simulation.simulate; c = time.perf_counter(); print((c - b) / (b - a))"
    )
    _, *ratios = [
        float(
            subprocess.run(
                [sys.executable, "-c", code], capture_output=True, text=True, check=True
            ).stdout
        )
        for _ in range(4)
    ]
    assert min(ratios) < 1.0
