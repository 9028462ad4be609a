"""What type checkers make of public names: quantities are numbers, or texts with a unit."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pyright")
ROOT = Path(__file__).parents[2]
FITS = """
import hapticclay as hc

scene = hc.constant_cut(b="90 N.s/m", dt="1 ms", t_max=2.0, gain=("1 1/kg", 2.0))
scene = hc.Scenario(control="sampled", Ts="2 ms", dt=0.001)
hand = hc.Operator(mass="300 g", damper=2, spring="0.5 N/mm")
law = hc.JointPD(Kp=("100 N.m/rad", 50.0), Kd=(1.0, 1.0))
hardware = hc.Hardware(delay="2 ms", friction=("20 mN.m", 0.02))
wall = hc.VirtualWall(K="1 N/mm", Ts="1 ms")
limits = hc.theory.joint_limits(hc.MjcfArm("planar_2r"), law, Ts="2 ms", delay="2 ms")
mass: float = hand.mass  # a number where it is read
ratio: float = scene.dt / mass
cutoff: float | None = law.cutoff
"""
MISFITS = """
import hapticclay as hc

hc.Scenario(control="sampling")
hc.Hand(mass="300 g")
hc.Operator(weight="300 g")
hc.Hardware(delay="2 ms", encoder="many")
hc.constant_cut(b="90 N.s/m").dt.seconds
"""


def test_quantities_may_be_texts_and_are_read_as_numbers(tmp_path):
    exec(FITS, names := {})
    assert (names["hand"].mass, names["hand"].spring, names["scene"].Ts) == (0.3, 500.0, 0.002)
    for name, text in (("fits", FITS), ("misfits", MISFITS)):
        (tmp_path / f"{name}.py").write_text(text)
    settings = {"extraPaths": [str(ROOT)], "pythonVersion": "3.11"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    errors = [x for x in json.loads(done.stdout)["generalDiagnostics"] if x["severity"] == "error"]
    by_file = {"fits": [], "misfits": []}
    for x in errors:
        by_file[Path(x["file"]).stem].append((x["range"]["start"]["line"], x["message"]))
    assert by_file["fits"] == []
    assert {line for line, _ in by_file["misfits"]} == {3, 4, 5, 6, 7}
