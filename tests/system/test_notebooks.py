"""The notebooks of examples/ run from top to bottom: one in a kernel, the others in a shell."""

import os
import shlex
import sys
from pathlib import Path

import nbclient
import nbformat
import pytest
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output

from hapticclay.cli import app
from hapticclay.studies import labs
from tests.waiting import PATIENCE

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
IN_A_KERNEL = "lab4_jnd"


def test_there_are_two():
    assert len(NOTEBOOKS) >= 2 and IN_A_KERNEL in {path.stem for path in NOTEBOOKS}


def in_a_kernel(book, folder, monkeypatch):
    """Runs a notebook as Jupyter does."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    client = nbclient.NotebookClient(
        book, timeout=PATIENCE, resources={"metadata": {"path": str(folder)}}
    )
    client.execute()
    assert any(cell.get("outputs") for cell in book.cells)


def command(line):
    """Runs a line of the shell, `hapticclay sweep ...`, in steps of 2 ms, fewer, without maps."""
    program, *words = shlex.split(line)
    assert program == "hapticclay" and words[0] == "sweep"
    words[words.index("--fixed") + 1] += " dt=0.002"
    grid = words.index("--grid") + 1
    words[grid] = words[grid].replace(":8log", ":4log")
    assert app.main([*words, "--workers", "1", "--no-maps"]) == 0


def in_process(book, folder, monkeypatch):
    """Runs the cells of a notebook in a shell with a namespace of its own."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("IPYTHONDIR", str(folder / "ipython"))
    monkeypatch.setitem(sys.modules, "__main__", sys.modules["__main__"])  # a shell replaces it
    shell = InteractiveShell()
    shell.history_manager.enabled = False
    shell.system = lambda line: command(shell.var_expand(line, depth=1))
    shown = False
    for cell in (cell for cell in book.cells if cell.cell_type == "code"):
        with capture_output() as out:
            result = shell.run_cell(cell.source)
        result.raise_error()
        shown |= bool(out.outputs or out.stdout)
    assert shown


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
@pytest.mark.filterwarnings("ignore")  # of the notebook's own machinery
def test_notebook_runs(path, tmp_path, monkeypatch):
    # of a pair: one gain, of two, in a quick lab, and shorter runs; tests/studies has the lab's own
    monkeypatch.setattr(labs, "GAINS", labs.GAINS[-2:])
    monkeypatch.setattr(labs, "SWUNG", 0.5 * labs.SWUNG)
    run = in_a_kernel if path.stem == IN_A_KERNEL else in_process
    run(nbformat.read(path, as_version=4), tmp_path, monkeypatch)
