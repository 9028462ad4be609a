"""The cost of a law of clay: the edits that CONTRIBUTING.md lists, in a copy."""

import re
from pathlib import Path

from tests.kernel.edited import PACKAGE, missing_in, run_edited
from tests.oracles import hardening_law

STEPPED = Path(hardening_law.__file__).read_text()
NUMBERS = "(DAMPING, WAY) if scenario.clay else None"
OWN = "(scenario.clay.hardening, WAY) if scenario.clay and scenario.clay.hardening else None"
GROOVE = "    groove: Groove | None = None\n"
FIELD = f'{GROOVE}    hardening: Annotated[float, Bound(0.0, 1e4, "N.s/m")] = 0.0\n'
MODEL = '''"""Clay that hardens with the way that the handle has gone."""

from .traits import LEFT_OUT, Law, Refusal, told_pair, told_values

TRAITS = (
    Law(
        "hardening", "clay", lambda c: c.hardening > 0.0, LEFT_OUT,
        viscous=False, of_velocity=False,
        refuses={"virtual coupling": Refusal("hardware.coupling", "must be None")},
        words=lambda c: told_values("hardens from {}", (c.hardening,), "N.s/m"),
        here=lambda c, place: told_pair("hardens from {}", 2 * (c.hardening,), "N.s/m"),
    ),
)
'''
EDITS = {  # a damper that hardens: by file, what stands, and what then; two files are new
    "model/NAME.py": MODEL,
    "kernel/NAME.py": STEPPED.replace(NUMBERS, OWN),
    "model/clay.py": [
        (GROOVE, FIELD),
        ("from . import flow, groove, spring\n", "from . import NAME, flow, groove, spring\n"),
        ("*flow.TRAITS, *TRAITS,", "*flow.TRAITS, *NAME.TRAITS, *TRAITS,"),
    ],
    "kernel/user_laws.py": [
        ("from . import records\n", "from . import NAME, records\n"),
        ("TABLE: list[ModuleType] = []", "TABLE: list[ModuleType] = [NAME]"),
    ],
}
RUN = """
import dataclasses
import numpy as np
import hapticclay as hc
from hapticclay.model import support

flat = hc.Profile((), (5.0,))
s = hc.free(inertia_shaping=True, force=(1.0, 0.0), t_max=0.2)
soft = dataclasses.replace(s, length=None, clay=hc.Clay(flat, flat))
hard = hc.with_fields(soft, {"clay.hardening": "4 N.s/m"})
for how in ({}, dict(integrator="accurate"), dict(control="sampled", render="physical")):
    plain, r = (hc.simulate(dataclasses.replace(x, **how), engine="python") for x in (soft, hard))
    assert r.p[-1, 0] < plain.p[-1, 0]
    gone = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(r.p, axis=0).T))))
    b = 5.0 + 4.0 * (1.0 + gone / 0.02)
    some = slice(20, -1)
    np.testing.assert_allclose(r.fe[some, 0], (b * r.v[:, 0])[some], rtol=2e-3)
(one,) = hc.simulate_batch([hard])
assert one.p.tobytes() == hc.simulate(hard).p.tobytes()
assert "| hardening |" in support.page() and "hardens from 4 N.s/m" in repr(hard)
limits = [hc.theory.gain_limit(x, "y") for x in (soft, hard)]
assert limits[0] == limits[1]  # of the clay without the law
try:
    held = dataclasses.replace(hard, control="sampled")
    dataclasses.replace(held, hardware=hc.Hardware(coupling=hc.Coupling(3e3, 3.0)))
except hc.ParameterError as error:
    print(error)
"""


def test_a_law_is_four_files_of_the_package_and_four_beside(tmp_path):
    """A damper that hardens with the way gone, in its own field, words, methods and batches."""
    assert "hardware.coupling" in run_edited(tmp_path, EDITS, RUN)
    assert not missing_in("Add a law of clay", EDITS)
    text = (PACKAGE.parent / "CONTRIBUTING.md").read_text().partition("### Add a law of clay\n")[2]
    assert len(re.findall(r"^\| `", text.partition("\n#")[0], re.M)) <= 8
