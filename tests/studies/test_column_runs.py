"""run_columns: what simulate_columns gives, in a folder, whatever interrupts it."""

import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies.column_runs import ColumnRuns, run_columns
from hapticclay.studies.store import read_sweep
from tests.waiting import PATIENCE

pytest.importorskip("pyarrow")
BASE = replace(hc.constant_cut(operator=hc.Operator()), length=None, t_max=0.004)
HANDS = {"operator.mass": np.linspace(0.1, 1.0, 13), "force.x": np.linspace(4.0, 1.0, 13)}


def assert_whole(folder):
    table, want = read_sweep(folder), hc.simulate_columns(BASE, HANDS)
    assert table["run"].to_pylist() == list(range(13))
    for name, values in HANDS.items():
        assert np.array_equal(table[name].to_numpy(), values)
    assert table["status"].to_pylist() == want["code"].tolist()
    for i, axis in enumerate("xy"):
        assert np.array_equal(table[f"v_{axis}"].to_numpy(), want["v"][:, i])
        assert np.array_equal(table[f"p_{axis}"].to_numpy(), want["p"][:, i])
    assert table["end_time"].to_pylist() == want["time"].tolist()


def test_an_interrupted_call_goes_on(tmp_path):
    def stop(n):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_columns(BASE, HANDS, tmp_path, chunk=5, workers=1, progress=stop)
    assert run_columns(BASE, HANDS, tmp_path, chunk=5, workers=1) == 8
    assert_whole(tmp_path)
    assert run_columns(BASE, HANDS, tmp_path, chunk=5, workers=1) == 0


KILLED = """
import os, signal, sys
from hapticclay.studies.column_runs import run_columns
from tests.studies.test_column_runs import BASE, HANDS

end = lambda n: os.kill(os.getpid(), signal.SIGKILL)
run_columns(BASE, HANDS, sys.argv[1], chunk=5, workers=1, progress=end)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX")
def test_a_killed_process_goes_on_from_its_whole_files(tmp_path):
    killed = subprocess.run([sys.executable, "-c", KILLED, tmp_path], timeout=PATIENCE)
    assert killed.returncode == -signal.SIGKILL
    assert run_columns(BASE, HANDS, tmp_path, chunk=5, workers=1) == 8
    assert_whole(tmp_path)


def test_two_workers_of_a_cluster(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert run_columns(BASE, HANDS, tmp_path, chunk=5, scheduler=address) == 13
    assert_whole(tmp_path)


def test_other_columns_have_another_folder(tmp_path):
    run_columns(BASE, HANDS, tmp_path, chunk=20, workers=1)
    with pytest.raises(ParameterError, match="another sweep"):
        run_columns(BASE, HANDS | {"force.x": HANDS["force.x"] + 1e-9}, tmp_path, workers=1)
    with pytest.raises(ParameterError, match=r"force.x\[3\]"):
        ColumnRuns(BASE, {"force.x": [1.0, 2.0, 3.0, np.inf]}, 5)


def test_columns_have_their_units_and_descriptions(tmp_path):
    run_columns(BASE, HANDS, tmp_path, chunk=20, workers=1)
    table = read_sweep(tmp_path)
    notes = {
        f.name: [f.metadata[k].decode() for k in (b"unit", b"description")] for f in table.schema
    }
    assert notes["p_y"] == ["m", "position at the end"]
    assert notes["b_x"] == ["N.s/m", "damping of the clay at the end"]
    assert notes["operator.mass"] == ["kg", "parameter of the run"]
