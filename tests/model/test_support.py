"""What can be combined, cell by cell: one that says yes runs, another is refused as it says."""

import dataclasses
import itertools
from pathlib import Path

import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model import support
from tests.views.test_clay_laws import CLAYS

METHODS = {
    "fast": dict(control="continuous"),
    "accurate": dict(integrator="accurate"),
    "held": dict(control="sampled"),
    "physical": dict(control="sampled", render="physical"),
}
LAW = {  # fields of a Profile
    "viscous": {}, "growth": dict(growth=(0.0, 5.0)), "yield by axis": dict(Fy=(0.0, 0.5)),
    "springs": dict(springs=(hc.Spring(), hc.Spring(k=100.0))),
}  # fmt: skip
OF_CLAY = ("smooth", "cells", "rotated axes", "yield along the motion", "groove")
ADDED = {name: clay.x for name, clay in CLAYS.items() if name not in (*LAW, *OF_CLAY)}
WIRED = {
    "hardware": {}, "jitter": dict(jitter=1e-5), "dropouts": dict(dropout_probability=0.1),
    "encoder": dict(encoder=65536), "velocity by difference": dict(velocity="difference"),
    "converters": dict(adc_bits=12, dac_bits=12), "force noise": dict(force_noise=0.01),
    "force filter": dict(force_filter=300.0), "delay": dict(delay=2e-4),
    "joint friction": dict(friction=(0.02, 0.01)), "passivity controller": dict(passivity=True),
    "virtual coupling": dict(coupling=hc.Coupling(3e3, 3.0)),
}  # fmt: skip
PARTS = {
    "operator": dict(operator=hc.Operator()),
    "inertia shaping": dict(inertia_shaping=True),
    "signals": dict(muscle=hc.Multisine(rms=(0.5, 0.5), high=3.0)),
    "own controller": dict(controller=hc.Controller("tests.model.test_support:still")),
    "joint law": dict(controller=hc.JointPD((1.0, 1.0), (0.1, 0.1))),
    "arm from a file": dict(arm=hc.MjcfArm("planar_2r", friction=(0, 0), torque_limit=(5.0, 5.0))),
}
BY_CONTROLLER = ("own controller", "joint law", "arm from a file")


def still(t, q, w, f, state, params):
    return (0.0, 0.0), state


def law_of(name):
    """A law of one axis."""
    if name == "smooth":
        return hc.Smooth((0.0, 0.1), (-0.1, 0.1), ((5.0, 20.0), (5.0, 20.0)))
    if name == "cells":
        return hc.Grid((0.02,), (0.0,), ((1.0, 2.0), (3.0, 20.0)))
    return ADDED.get(name) or hc.Profile((0.02,), (5.0, 20.0), **LAW.get(name, {}))


def is_of_axis(name):
    """Whether a trait is the law of an axis."""
    return name in LAW or name in ADDED or name in ("smooth", "cells")


def clay_of(names):
    """Clay with some traits: the law of the first lies along x, that of the second along y."""
    if "groove" in names:
        others = [law_of(x) for x in names if is_of_axis(x)]
        law = others[0] if others else hc.Profile((), (0.0,))
        if "yield along the motion" in names:
            law = hc.Profile((0.02,), (5.0, 20.0), **LAW["yield by axis"])
        more = dict(angle=0.3 * ("rotated axes" in names))
        more |= dict(isotropic="yield along the motion" in names)
        return hc.Clay(
            law, law, groove=hc.Groove((0.02, 0.08), (-0.02, 0.02), pressure=1e4), **more
        )
    along, own = (
        "yield along the motion" in names,
        [x for x in names if is_of_axis(x)],
    )
    laws = [law_of(own[0] if own else "viscous"), law_of(own[-1] if own else "viscous")]
    if along and "cells" in own:
        values, Fy = ((1.0, 2.0), (3.0, 20.0)), ((0.0, 0.5), (0.5, 0.5))
        laws = [hc.Grid((0.02,), (0.0,), values, Fy=Fy)] * 2
    elif along:
        fields = LAW["yield by axis"] | LAW.get(own[0] if own else "", {})
        laws = [hc.Profile((0.02,), (5.0, 20.0), **fields)] * 2
    return hc.Clay(*laws, angle=0.3 * ("rotated axes" in names), isotropic=along)


def scene_of(*names):
    """A short run with these traits, sampled where it is said or hardware needs it."""
    method = next((x for x in names if x in METHODS), None)
    sampled = any(x in WIRED or x in BY_CONTROLLER for x in names)
    kw = dict(METHODS[method] if method else METHODS["held"] if sampled else {})
    wires = [WIRED[x] for x in names if x in WIRED]
    if wires:
        kw["hardware"] = hc.Hardware(**{k: v for x in wires for k, v in x.items()})
    for name in names:
        kw |= PARTS.get(name, {})
    if any(x.name in names for x in support.LAWS):
        kw["clay"] = clay_of(names)
    kw |= dict(t_max=0.0015, dt=1e-4, length=None)
    if "arm" in kw:
        return hc.Scenario(force=(1.0, 0.2), **(PARTS["own controller"] | kw))
    return hc.Scenario(force=(1.0, 0.2), start=(0.019, 0.0), **kw)


NAMES = [x.name for x in (*support.LAWS, *support.PARTS)]
IMPOSSIBLE = {frozenset(x) for x in (
    ("yield by axis", "yield along the motion"),  # one or the other
    ("smooth", "yield along the motion"),  # smooth laws do not yield, and both axes must be alike
    ("own controller", "joint law"),  # one or the other
)}  # fmt: skip
CELLS = [
    (a, b)
    for a, b in (*itertools.product(NAMES, METHODS), *itertools.combinations(NAMES, 2))
    if frozenset((a, b)) not in IMPOSSIBLE
]


@pytest.mark.parametrize("a", NAMES)
def test_a_cell_that_says_yes_runs_and_another_is_refused(a):
    for b in [b for x, b in CELLS if x == a]:
        why = support.refusal(a, b)
        if why is None:
            s = scene_of(a, b)
            found = {x.name for x in support.present(s.clay, support.LAWS)} if s.clay else set()
            found |= {x.name for x in support.present(s, (*support.METHODS, *support.PARTS))}
            assert {a, b} <= found, (a, b)
            assert hc.simulate(s, engine="python").outcome.code == "time limit", (a, b)
        else:
            with pytest.raises(ParameterError) as e:
                scene_of(a, b)
            assert (e.value.field, e.value.bound) == (why.field, why.bound), (a, b)


@pytest.mark.parametrize("name", NAMES)
def test_linear_theory_knows_leaves_out_or_refuses_a_part(name):
    base = [x for x in ("hardware",) if name in WIRED]
    with_, without = scene_of("viscous", *base, name), scene_of("viscous", *base)
    trait = support.TRAITS[name]
    if trait.theory == "no":
        with pytest.raises(ParameterError):
            hc.theory.gain_limit(with_, "x")
    elif trait.theory == "left out":
        if name == "groove":
            with_ = dataclasses.replace(without, clay=dataclasses.replace(with_.clay, groove=None))
        assert hc.theory.gain_limit(with_, "x") == hc.theory.gain_limit(without, "x")
    else:
        assert hc.theory.gain_limit(with_, "x") > 0.0


def test_the_page_is_that_of_the_table():
    page = Path(__file__).parents[2] / "docs" / "support.md"
    assert page.read_text() == support.page()
