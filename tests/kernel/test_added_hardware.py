"""The cost of an imperfection of the hardware: the edits that CONTRIBUTING.md lists, in a copy."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import hapticclay as hc

PACKAGE = Path(hc.__file__).parent
FIELD = "    dead_band: Annotated[float, Bound(0.0, 10.0, 'N.m')] = 0.0\n"
TRAIT = """    ("dead band", lambda x: x.dead_band > 0.0, LEFT_OUT, {},
     lambda x: told_values("dead band {}", (x.dead_band,), "N.m")),
"""
PART = "    band = float(io.dead_band) if io.dead_band > 0.0 else None\n"
FUNCTION = '''
def without_small(band, x):
    """Torques of which those within a dead band are none [N.m]."""
    if band is None:
        return x
    return 0.0 if abs(x[0]) < band else x[0], 0.0 if abs(x[1]) < band else x[1]
'''
CONVERTED = "hardware.converted(part, clipped(tau, limits))"
EDITS = {  # a dead band, below which motors hold no torque: by file, what stands, and what then
    "model/hardware.py": [
        ("    friction: Annotated[", FIELD + "    friction: Annotated["),
        ('    ("joint friction",', TRAIT + '    ("joint friction",'),
    ],
    "stepping/parts.py": [
        ("    friction: Any\n    passivity", "    band: Any\n    friction: Any\n    passivity")
    ],
    "stepping/scene.py": [
        ("    more = difference", PART + "    more = difference"),
        ("adc, dac, delay, friction, pass", "adc, dac, delay, band, friction, pass"),
    ],
    "stepping/hardware.py": [("# ---- joints ---", FUNCTION + "# ---- joints ---")],
    "stepping/sampled.py": [
        ("def driven_torques(part, limits,", "def driven_torques(part, band, limits,"),
        (f"return {CONVERTED}", f"return hardware.without_small(band, {CONVERTED})"),
        ("driven_torques(sampler.dac, parts", "driven_torques(sampler.dac, sampler.band, parts"),
    ],
}
RUN = """
import dataclasses
import numpy as np
import hapticclay as hc
from hapticclay.model import support
from hapticclay.stepping.many import kind_key

s = hc.constant_cut(control="sampled", t_max=0.05)
plain = hc.simulate(s, engine="python")
runs = [
    hc.simulate(dataclasses.replace(s, hardware=hc.Hardware(dead_band=band)), engine="python")
    for band in (1e-9, 0.02)
]
assert plain.p.tobytes() == runs[0].p.tobytes()
tau = np.abs(runs[1].tau)
assert (np.abs(plain.tau) < 0.02).any() and ((tau == 0.0) | (tau >= 0.02)).all()
assert not np.array_equal(plain.tau, runs[1].tau)
assert "| dead band |" in support.page() and "dead band 0.02 N.m" in repr(runs[1].scenario)
try:
    dataclasses.replace(hc.constant_cut(), hardware=hc.Hardware(dead_band=0.02))
except hc.ParameterError as error:
    print(error)
both = [hc.Hardware(dead_band=band) for band in (0.01, 0.02)]
kinds = {kind_key(dataclasses.replace(s, hardware=x)) for x in both}
assert len(kinds) == 2 and None not in kinds  # a batch does not make them of one pattern
with_name = hc.with_fields(s, {"hardware": True, "hardware.dead_band": "20 mN.m"})
assert with_name.hardware.dead_band == 0.02
"""


def test_an_imperfection_is_five_files_of_the_package(tmp_path):
    """Motors with a dead band: no torque within it is held, and what is not within it stays."""
    shutil.copytree(PACKAGE, tmp_path / "hapticclay", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(PACKAGE.parent / "mjcf", tmp_path / "mjcf")
    for name, edits in EDITS.items():
        file = tmp_path / "hapticclay" / name
        text = file.read_text()
        for old, new in edits:
            assert old in text, (name, old)
            text = text.replace(old, new)
        file.write_text(text)
    out = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert out.returncode == 0, out.stderr
    assert "must be 'sampled'" in out.stdout or "must be None" in out.stdout, out.stdout
    told = (PACKAGE.parent / "CONTRIBUTING.md").read_text()
    assert all(f"`hapticclay/{name}`" in told or f"`{Path(name).name}`" in told for name in EDITS)
