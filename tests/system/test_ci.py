"""The scripts of `.ci`, with stand-ins for the programs that they call."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.waiting import PATIENCE

ROOT = Path(__file__).parents[2]
STAND_INS = ("python3", "cc", "Xvfb", "xdotool", "chromium", "make", "ldconfig")
LIBRARIES = "echo libEGL.so.1 libGL.so.1 libatomic.so.1"
LOOK = (  # what `make` finds, and what it leaves behind
    'echo "$HOME" "$TMPDIR" "$(find "$HOME" "$TMPDIR" -mindepth 1 | wc -l)" "${XDG_CACHE_HOME-}" '
    '"${NUMBA_CACHE_DIR-}" "${MPLCONFIGDIR-}" "$PIP_CACHE_DIR" >> "$SEEN"\n'
    'mkdir -p "$HOME/.cache/x"; touch "$TMPDIR/y"; exit "$STATUS"'
)


@pytest.mark.skipif(not (ROOT / ".ci/run").is_file(), reason="not in the source distribution")
@pytest.mark.parametrize("status", [0, 2])
def test_a_run_sees_a_new_machine_and_leaves_nothing(tmp_path, status):
    bodies = dict.fromkeys(STAND_INS, "") | {"ldconfig": LIBRARIES, "make": LOOK}
    for name, body in bodies.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    old = tmp_path / "old"
    (old / ".cache").mkdir(parents=True)
    (old / ".cache" / "used").touch()
    names = ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "TMPDIR")
    env = {k: v for k, v in os.environ.items() if k != "PIP_CACHE_DIR"} | {
        **dict.fromkeys(names, str(old)),
        "HOME": str(old),
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "SEEN": str(tmp_path / "seen"),
        "STATUS": str(status),
    }
    assert subprocess.run([ROOT / ".ci/run"], env=env, timeout=PATIENCE).returncode == status
    first = (tmp_path / "seen").read_text().splitlines()[0].split(" ")
    home, tmp, files, *caches, pip = first
    assert files == "0" and home != tmp and caches == ["", "", ""]  # as on a new machine
    assert pip == str(old / "pip")  # downloads are kept
    assert not os.path.exists(home) and not os.path.exists(tmp)
    assert [x.name for x in old.rglob("*")] == [".cache", "used"]
