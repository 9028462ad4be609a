"""Where worker processes cannot be started, a line says why, and what helps; as child processes."""

import os
import shutil
import subprocess
import sys
import types

import pytest

from hapticclay.errors import ParameterError
from hapticclay.studies import Range, Sweep, run_sweep, store
from tests.hunt import HUNTS
from tests.waiting import PATIENCE

STUDIES = {
    "sweep": """
hc.studies.run_sweep(hc.studies.Sweep(
    "constant", {"b": hc.studies.Range(10.0, 90.0, 8)}, {"t_max": 0.01}, chunk=2
), "out", workers=2)
""",
    "columns": """
scene = hc.with_fields(hc.constant_cut(operator=hc.Operator()), {"t_max": 0.01})
masses = {"operator.mass": np.linspace(0.5, 1.0, 8)}
hc.studies.run_columns(scene, masses, "out", chunk=2, workers=2)
""",
    "trials": """
trials = hc.studies.Trials(
    hc.studies.PushedLoop("x", K=2.0), {"b": hc.studies.Distribution("uniform", 20.0, 30.0)},
    runs=8, chunk=2,
)
hc.studies.monte_carlo(trials, out="out", workers=2)
""",
}
HEAD = "import numpy as np\nimport hapticclay as hc\n"


def guarded(text):
    return 'if __name__ == "__main__":\n' + "".join(f"    {x}\n" for x in text.splitlines())


def run(words, folder, **kw):
    return subprocess.run(
        words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False, **kw
    )


def run_script(text, folder):
    (folder / "script.py").write_text(text)
    return run([sys.executable, "script.py"], folder)


def last_line(done):
    """The line of a failure; only the one process tells of it."""
    assert done.returncode == 1 and done.stderr.count("Traceback") == 1
    assert "another sweep" not in done.stderr and "memory?" not in done.stderr
    return done.stderr.splitlines()[-1]


@pytest.mark.parametrize("study", STUDIES if HUNTS else ["trials"])  # all by the same pool
def test_a_script_without_main_guard_is_told_of_it(tmp_path, study):
    said = last_line(run_script(HEAD + STUDIES[study], tmp_path))
    assert said.startswith("ChildProcessError: the study must stand below")
    assert 'if __name__ == "__main__":' in said and "workers=1" in said


def test_a_script_without_main_guard_runs_in_one_process(tmp_path):
    text = HEAD + STUDIES["sweep"].replace("workers=2", "workers=1")
    assert run_script(text, tmp_path).returncode == 0


def test_a_script_with_main_guard_runs_by_name_too(tmp_path):
    (tmp_path / "script.py").write_text(HEAD + guarded(STUDIES["columns"]))
    done = run([sys.executable, "-m", "script"], tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(list((tmp_path / "out" / "data").glob("part-*"))) == 4


def test_a_script_from_standard_input_is_told_to_be_a_file(tmp_path):
    said = last_line(run([sys.executable, "-"], tmp_path, input=HEAD + STUDIES["sweep"]))
    assert "comes from no file: save it" in said


def test_a_worker_of_a_pool_is_told_that_it_can_start_none(tmp_path):
    text = f"{HEAD}import multiprocessing\ndef f():\n"
    text += "".join(f"    {x}\n" for x in STUDIES["sweep"].splitlines())
    text += guarded('with multiprocessing.get_context("fork").Pool(1) as p:\n    p.apply(f)')
    done = run_script(text, tmp_path)
    assert done.returncode == 1
    assert "a daemonic process" in done.stderr.splitlines()[-1]


def test_a_script_that_fails_when_it_is_imported_is_told_so(tmp_path):
    fails = 'if __name__ != "__main__":\n    raise OSError("no such data")\n'
    done = run_script(HEAD + fails + guarded(STUDIES["sweep"]), tmp_path)
    said = done.stderr.splitlines()[-1]
    assert done.returncode == 1 and "ended while they imported the script" in said


def test_a_script_that_a_shell_runs_in_its_own_process_is_no_worker(tmp_path, monkeypatch):
    """As %run of IPython: it replaces `__main__` after multiprocessing noted the first one."""
    for name in ("__mp_main__", "__main__"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType("__main__"))
    plan = Sweep("constant", {"b": Range(10.0, 90.0, 2)}, {"t_max": 0.01})
    with store.claimed(plan, tmp_path), pytest.raises(ParameterError, match="is at work"):
        run_sweep(plan, tmp_path, workers=1)


@pytest.mark.untraced
def test_a_machine_without_shared_memory_is_one_line(tmp_path):
    """In a name space of its own, where /dev/shm can be read only."""
    unshare = shutil.which("unshare")
    words = [unshare, "-m", "bash", "-c"]
    if not unshare or run([*words, "mount -t tmpfs -o ro,size=4k none /dev/shm"], ".").returncode:
        pytest.skip("may not mount a file system here")
    grid = "--grid b=10:100:8 --chunk 2 --fixed t_max=0.01 --no-maps"
    text = f"""mount -t tmpfs -o ro,size=4k none /dev/shm
    {sys.executable} -m hapticclay sweep {grid} --workers 2 --out many; echo $? >&2
    {sys.executable} -m hapticclay sweep {grid} --workers 1 --out one >&2; echo $? >&2"""
    done = run([*words, text], tmp_path, env={**os.environ, "COLUMNS": "80"})
    first, code, *others = [x for x in done.stderr.splitlines() if " to go" not in x]
    assert "Read-only file system" in first and "/dev/shm" in first and "--workers 1" in first
    assert code == "1" and others[-1] == "0" and "8 runs in one/data" in others[-2]
