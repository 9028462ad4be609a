"""Damaged files of logs: refused in a line, never a crash of the process."""

import io
import random
import subprocess
import sys

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_matrix

import hapticclay as hc
from hapticclay.columns.matlab_elements import check_elements

N = 200
T = 1e-3 * np.arange(N)
LOG = {
    "t": T,
    "force": np.sin(T),
    "pos": 1e-3 * np.cos(T),
    "scope": {"time": T, "signals": [{"label": "F [N]", "values": T}, {"label": "", "values": T}]},
    "cells": np.array([np.arange(3.0), "text", np.eye(2)], dtype=object),
    "complex": np.array([[1j, 2.0]]),
    "sparse": csc_matrix(np.eye(4)),
    "empty": np.zeros((0, 0)),
}
READ = """
import sys, warnings
warnings.simplefilter("ignore")
import hapticclay as hc
for path in sys.argv[1:]:
    try:
        hc.studies.log_report(hc.Log.read(path))
        print("read")
    except hc.ParameterError as error:
        print("refused", str(error).count(chr(10)))
"""


def saved(log=LOG, **kw):
    file = io.BytesIO()
    savemat(file, log, oned_as="column", **kw)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_whole_files_pass(compressed):
    check_elements(saved(do_compression=compressed))


def damaged(seed, whole):
    """Some bytes, most of them of tags, replaced; or the end cut off."""
    rng = random.Random(seed)
    data = bytearray(rng.choice(whole))
    if seed % 7 == 0:
        return bytes(data[: rng.randrange(1, len(data))])
    for _ in range(rng.randrange(1, 5)):
        at = 128 + 8 * rng.randrange(len(data) // 8 - 17) + rng.randrange(8)
        data[at] = rng.choice((0, 1, 5, 14, 15, 19, 32, 127, 128, 255))
    return bytes(data)


def test_damaged_files_of_matlab_are_read_or_refused_in_a_line(tmp_path):
    """In a process of their own, which SciPy's reader alone ends at some of them."""
    flat = {k: LOG[k] for k in ("t", "force", "pos", "cells", "sparse", "complex")}
    whole = [saved(log, do_compression=x) for log in (LOG, flat) for x in (False, True)]
    paths = [tmp_path / f"{i}.mat" for i in range(300)]
    for i, path in enumerate(paths):
        path.write_bytes(damaged(i, whole))
    ran = subprocess.run(
        [sys.executable, "-c", READ, *map(str, paths)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    lines = ran.stdout.splitlines()
    assert len(lines) == len(paths) and set(lines) == {"read", "refused 0"}


def at_first(data, old, new):
    return data.replace(old, new, 1)


@pytest.mark.parametrize(
    "old, new, told",
    [
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x13\x00\x00\x00\x40\x06\x00\x00", "unknown type"),
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x0e\x00\x00\x00\x40\x06\x00\x00", "other parts"),
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x09\x00\x00\x00\x41\xff\x00\x00", "longer"),
        (b"\x05\x00\x00\x00\x08\x00\x00\x00\xc8", b"\x05\x00\x00\x00\x08\x00\x00\x00\xc9", "parts"),
    ],
)
def test_what_is_wrong_is_told(old, new, told, tmp_path):
    data = saved()
    assert old in data and "t" in loadmat(io.BytesIO(data))
    (tmp_path / "log.mat").write_bytes(at_first(data, old, new))
    with pytest.raises(hc.ParameterError, match=told):
        hc.Log.read(tmp_path / "log.mat")


def test_numbers_beyond_all_measure_are_told(tmp_path):
    """Their squares, and counters as wide, overflow."""
    x = np.cumsum(np.ones(300))
    x[100], x[200] = 1.7e308, -1.7e308
    rows = [f"{1e-3 * i},{v!r}" for i, v in enumerate(x.tolist())]
    (tmp_path / "log.csv").write_text("\n".join(["t [s],pos [m]", *rows]))
    report = hc.studies.log_report(hc.Log.read(tmp_path / "log.csv"))
    assert "2 beyond 1e+50" in report.table["remarks"][1]
