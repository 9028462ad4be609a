"""Who may import whom, and what `import hapticclay` must not pull in."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hapticclay

PACKAGE = Path(hapticclay.__file__).parent
LEVELS = [
    {"engine", "errors", "inline", "memory"},
    {"hardware"},
    {"params", "interface"},
    {"arm", "lti", "clay", "human", "signals", "estimate"},
    {"servo", "record", "energy", "limits"},
    {"loop", "scene", "outcome", "stability", "removal", "verdict"},
    {"run", "robust", "design", "passive", "stage", "glide"},
    {"leapfrog", "rungekutta"},
    {"sampled", "stride", "session"},
    {"march", "wired"},
    {"native"},
    {"sim"},
    {"batch"},
    {"experiments", "identify", "boundary"},
    {"plot", "entries", "space", "drift", "maps"},
    {"plot_stability", "plot_identify", "paper_model", "paper_cuts", "sweep"},
    {"ledger", "plot_sweep", "plot_boundary", "identify_command", "gate", "player", "pane", "running"},
    {"report", "sweep_command", "cli_stability", "cli_run", "cli_words", "video", "view", "web"},
    {"cli_view"},
    {"cli"},
]
LEVEL = {name: i for i, names in enumerate(LEVELS) for name in names}
HEAVY = {  # outside package -> the only modules that may import it
    "jinja2": {"report"},
    "pyarrow": {"sweep"},
    "distributed": {"sweep"},
    "mujoco": {
        "engine",
        "paper_model",
        "scene",
        "run",
        "leapfrog",
        "rungekutta",
        "sampled",
        "native",
        "stage",
        "pane",
        "video",
    },
    "glfw": {"pane"},
    "matplotlib": {"plot", "plot_stability", "plot_identify", "plot_sweep", "plot_boundary", "running"},
    "tyro": {"cli", "cli_run", "cli_view", "sweep_command"},
    "tqdm": {"cli", "cli_run", "sweep_command", "identify_command", "cli_stability", "cli_view"},
    "tabulate": {"cli_run", "identify_command", "cli_stability"},
    "scipy": {"lti", "limits", "design", "space", "estimate", "identify", "interface"},
    "imageio": {"video"},
    "imageio_ffmpeg": {"video"},
    "PIL": {"video"},
    "viser": {"web"},
    "numba": {"native"},
    "dask": set(),
}


def imports(module):
    tree = ast.parse((PACKAGE / f"{module}.py").read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            yield from ([node.module] if node.module else [a.name for a in node.names])
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield f"/{node.module.partition('.')[0]}"
        elif isinstance(node, ast.Import):
            yield from (f"/{a.name.partition('.')[0]}" for a in node.names)


def test_every_module_has_a_level():
    found = {p.stem for p in PACKAGE.glob("*.py")} - {"__init__", "__main__"}
    assert found == set(LEVEL)


@pytest.mark.parametrize("module", sorted(LEVEL))
def test_imports_go_down(module):
    for name in imports(module):
        if not name.startswith("/"):
            assert LEVEL[name] < LEVEL[module], f"{module} (level {LEVEL[module]}) imports {name} (level {LEVEL[name]})"


@pytest.mark.parametrize("module", sorted(LEVEL))
def test_heavy_packages_enter_where_they_belong(module):
    for name in imports(module):
        if name[1:] in HEAVY:
            assert module in HEAVY[name[1:]], f"{module} imports {name[1:]}"


@pytest.mark.parametrize("module", sorted(LEVEL))
def test_no_module_is_long(module):
    assert len((PACKAGE / f"{module}.py").read_text().splitlines()) <= 400


def test_importing_the_package_and_running_a_scene_loads_nothing_else():
    code = (
        "import sys, hapticclay as hc; hc.simulate(hc.constant_cut(t_max=0.01)); "
        "print([m for m in ('matplotlib', 'imageio', 'viser', 'numba', 'dask', 'tyro', 'tqdm', 'scipy', "
        "'mujoco.viewer') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_import_is_quick_beside_numpy():
    """A ratio: importing hapticclay (mujoco included) against NumPy alone, best of five, in fresh processes.

    0.3 s beyond NumPy's 0.1 s is a ratio of 4.
    """
    code = (
        "import time; a = time.perf_counter(); import numpy; b = time.perf_counter(); import hapticclay; "
        "c = time.perf_counter(); print((c - b) / (b - a))"
    )
    ratios = []
    for _ in range(5):
        out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        ratios.append(float(out.stdout))
    assert min(ratios) < 4.0
