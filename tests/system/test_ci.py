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
    'echo $(env | sed "s/=.*//") >> {seen}\n'
    'echo "$HOME" "$TMPDIR" "$(find "$HOME" "$TMPDIR" -mindepth 1 | wc -l)" >> {seen}\n'
    'mkdir -p "$HOME/.cache/x"; touch "$TMPDIR/y"; exit {status}'
)
SHELL = {"PWD", "OLDPWD", "SHLVL", "_"}  # which it sets itself


@pytest.mark.skipif(not (ROOT / ".ci/run").is_file(), reason="not in the source distribution")
@pytest.mark.parametrize("status", [0, 2])
def test_a_run_sees_a_new_machine_and_leaves_nothing(tmp_path, status):
    seen = tmp_path / "seen"
    look = LOOK.format(seen=seen, status=status)
    bodies = dict.fromkeys(STAND_INS, "") | {"ldconfig": LIBRARIES, "make": look}
    for name, body in bodies.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    old = tmp_path / "old"
    (old / ".cache").mkdir(parents=True)
    (old / ".cache" / "used").touch()
    names = ("HOME", "TMPDIR", "XDG_CACHE_HOME", "MPLCONFIGDIR", "PYTHONUNBUFFERED", "PIP_RETRIES")
    env = os.environ | dict.fromkeys(names, str(old))
    env["PATH"] = f"{tmp_path}:{env['PATH']}"
    assert subprocess.run([ROOT / ".ci/run"], env=env, timeout=PATIENCE).returncode == status
    names, found = (line.split() for line in seen.read_text().splitlines()[:2])
    of_pip = {x for x in env if x.startswith("PIP_")}
    assert set(names) - SHELL == {"PATH", "LANG", "HOME", "TMPDIR"} | of_pip
    home, tmp, files = found
    assert files == "0" and home != tmp and str(old) not in found  # as on a new machine
    assert not os.path.exists(home) and not os.path.exists(tmp)
    assert [x.name for x in old.rglob("*")] == [".cache", "used"]
