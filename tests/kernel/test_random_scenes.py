"""Random scenes of the whole space: CPython and the compiled kernel make the same bits.

What support refuses is left out beforehand; what depends on numbers (accurate runs in clay too
stiff for them) is refused by both alike.
"""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import event, given, reject
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from tests.hunt import examples
from tests.kernel.test_engines import native, same
from tests.kernel.test_kick import ZEROS
from tests.kernel.test_own_controller import to_pose
from tests.kernel.test_parts import OWN
from tests.kernel.test_signals_in_runs import CASES as SIGNALS

VARYING = {name: signal for name, (signal, *_) in SIGNALS.items() if signal.varies}
METHODS = {
    "fast": {},
    "accurate": dict(integrator="accurate"),
    "held": dict(control="sampled"),
    "physical": dict(control="sampled", render="physical"),
}
LAWS = "none", "layers", "growth", "cells", "smooth", "yield", "springs", "groove"
SHAPES = [*OWN.values(), *ZEROS]
maybe = st.booleans()


def between(low, high, digits=4):
    """Numbers of a few digits, even in the logarithm."""
    ends = math.log10(low), math.log10(high)
    return st.floats(*ends).map(lambda x: float(f"{10**x:.{digits}g}"))


def evenly(low, high, digits=4):
    """Numbers of a few digits."""
    return st.floats(low, high).map(lambda x: float(f"{x:.{digits}g}"))


def pair(x, y=None):
    """Of both axes."""
    return st.tuples(x, x if y is None else y)


@st.composite
def some_edges(draw, most=4):
    """Ascending borders, near the start for the most part."""
    found = draw(st.lists(evenly(-0.005, 0.03), min_size=0, max_size=most, unique=True))
    return tuple(sorted(found))


@st.composite
def some_profile(draw, along, hard, **more):
    """Damping by layers; `more`: the strategy of a number of each region, by field."""
    edges = draw(some_edges())
    b = st.just(0.0) | between(1.0, 1e6 if hard else 200.0)
    each = {"values": b} | more
    fields = {name: tuple(draw(x) for _ in range(len(edges) + 1)) for name, x in each.items()}
    return Profile(edges, fields.pop("values"), along, **fields)


@st.composite
def some_grid(draw, smooth):
    """Cells or smooth clay of random dampings."""
    rng, n, k = np.random.default_rng(draw(st.integers(0, 999))), *draw(pair(st.integers(3, 7)))
    top = draw(between(10.0, 300.0))
    if smooth:
        return hc.Smooth((0.0, 0.03), (-0.01, 0.02), np.round(rng.uniform(0.0, top, (n, k)), 1))
    xs, ys = (tuple(np.round(0.002 * np.arange(1, m), 4).tolist()) for m in (n, k))
    shape = len(xs) + 1, len(ys) + 1
    grown = dict(growth=rng.uniform(0.0, 9.0, shape)) if draw(maybe) else {}
    return hc.Grid(xs, ys, np.round(rng.uniform(0.0, top, shape), 1), **grown)


@st.composite
def some_spring(draw):
    """A spring, one that relaxes, both or none."""
    k, k1 = draw(pair(st.just(0.0) | between(50.0, 2e4)))
    limit = draw(st.none() | between(0.5, 5.0)) if k else None
    tau = dict(tau=draw(between(0.01, 1.0))) if k1 else {}
    return hc.Spring(k=k, limit=limit, k1=k1, unilateral=bool(k or k1) and draw(maybe), **tau)


some_groove = st.builds(
    hc.Groove, x=st.just((-0.02, 0.05)), y=st.just((-0.02, 0.02)), pressure=between(1e3, 4e4),
    gradient=st.just(0.0) | between(1e4, 2e6), damping=st.just(0.0) | between(1e4, 3e5),
)  # fmt: skip


@st.composite
def some_clay(draw, law, method):
    """Clay of a law, soft enough for explicit methods."""
    hard = method in ("fast", "physical") and draw(maybe)
    along = draw(pair(st.sampled_from("xy")))
    angle = draw(st.just(0.0) | evenly(-3.0, 3.0)) if law != "springs" and not hard else 0.0
    if law in ("cells", "smooth"):
        x, y = (draw(some_grid(law == "smooth")) for _ in "xy")
        return Clay(x, draw(st.just(y) | some_profile(along[1], hard)), angle)
    more = {}
    if law == "growth":
        more = dict(growth=st.just(0.0) | between(1.0, 500.0))
    elif law == "springs":
        more = dict(springs=some_spring())
    elif law == "yield":
        n = st.just(1.0) | evenly(0.3, 2.0)
        more = dict(Fy=st.just(0.0) | between(0.1, 5.0), K=st.just(0.0) | between(0.5, 20.0), n=n)
    if law == "springs" and draw(maybe):
        more |= dict(Fy=st.just(0.0) | between(0.1, 2.0))
    x = draw(some_profile(along[0], hard, **more))
    y = draw(st.just(dataclasses.replace(x)) | some_profile(along[1], hard, **more))
    alike = all(getattr(x, k) == getattr(y, k) for k in ("Fy", "K", "n", "edges", "along"))
    both = law == "yield" and alike
    groove = draw(some_groove) if law == "groove" else None
    return Clay(x, y, angle, isotropic=both and draw(maybe), groove=groove)


@st.composite
def some_hardware(draw, held, guarded):
    """Imperfections, each there or not."""
    parts = dict(
        jitter=between(1e-6, 8e-5), dropout_probability=evenly(0.01, 0.3),
        encoder=st.integers(1000, 100_000), adc_bits=st.integers(8, 16),
        force_noise=between(1e-3, 0.1), force_filter=between(50.0, 1000.0),
        filter_order=st.integers(1, 2), dac_bits=st.integers(8, 16),
        dac_range=st.just((30.0, 20.0)), delay=between(1e-4, 2e-3),
        friction=pair(between(1e-3, 0.05)), seed=st.integers(0, 99),
    )  # fmt: skip
    if held and guarded:
        parts |= dict(
            passivity=st.just(True),
            coupling=st.builds(hc.Coupling, between(500.0, 5e3), between(10.0, 300.0)),
        )
    found = {name: draw(x) for name, x in parts.items() if draw(maybe)}
    if draw(maybe):
        found |= dict(velocity="difference", velocity_window=draw(st.integers(1, 8)))
        found |= dict(velocity_filter=draw(st.none() | between(50.0, 500.0)))
    return hc.Hardware(**found)


some_second_order = st.builds(
    hc.SecondOrder, between(400.0, 1000.0), between(20.0, 60.0), between(400.0, 1000.0)
)
some_servo = st.builds(
    hc.Servo, some_second_order,
    st.builds(hc.SecondOrder, between(0.1, 1.0), between(20.0, 60.0), between(300.0, 800.0)),
)  # fmt: skip
some_hand = st.builds(hc.Operator, evenly(0.0, 0.5), evenly(0.0, 5.0), evenly(0.0, 20.0))


@st.composite
def scenes(draw, law):
    """A scene with a law of clay, of any method and other parts that support takes."""
    try:
        return some_scene(draw, law)
    except hc.ParameterError as error:  # of numbers: stiff clay with rotated axes, a short reach
        event(f"no scene: {error.field}")
        reject()


def some_scene(draw, law):
    explicit = law not in ("springs", "groove")
    method = draw(st.sampled_from([x for x in METHODS if explicit or x != "accurate"]))
    sampled = method in ("held", "physical")
    fields = METHODS[method] | dict(
        clay=None if law == "none" else draw(some_clay(law, method)),
        gain=draw(pair(st.just(0.0) | between(0.05, 3.0))),
        force=draw(pair(evenly(-5.0, 5.0))),
        start=draw(pair(evenly(-0.005, 0.01))),
        velocity=draw(st.just((0.0, 0.0)) | pair(evenly(-0.2, 0.2))),
        length=draw(st.none() | evenly(0.01, 0.05)),
        torque_limit=draw(st.sampled_from([(30.0, 20.0), (0.3, 0.2), (1e5, 1e5)])),
        stop_when_unstable=draw(maybe),
        operator=draw(st.none() | some_hand | pair(st.none() | some_hand)),
        inertia_shaping=draw(maybe),
    )
    dt = draw(between(3e-4, 2e-3)) if not sampled else draw(between(1e-4, 7e-4))
    fields |= dict(dt=dt, t_max=float(f"{dt * draw(evenly(20.0, 150.0)):.5g}"))
    if sampled and draw(maybe):
        fields |= dict(Ts=dt * draw(st.integers(1, 4)))
    if draw(maybe):
        fields |= dict(servo=draw(pair(some_servo)))
    if draw(maybe):
        shape = st.sampled_from(SHAPES)
        fields |= dict(compensator=draw(shape | pair(shape)))
    if draw(maybe):
        arm = st.builds(hc.Arm, *[evenly(0.24, 0.4)] * 2, *[between(0.03, 0.5)] * 2)
        fields |= dict(arm=draw(arm))
    for name, size in (("muscle", 2.0), ("command", 1e-3)):
        if draw(maybe):
            fields[name] = size * VARYING[draw(st.sampled_from([*VARYING]))]
    guarded = explicit and not (fields["clay"] and fields["clay"].angle)
    if sampled and draw(st.integers(0, 3)) == 0:
        fields |= dict(controller=hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01)))
        fields |= dict(inertia_shaping=False)
        guarded = False
    if sampled and draw(maybe):
        fields |= dict(hardware=draw(some_hardware(method == "held", guarded)))
    event(method)
    return hc.Scenario(**fields)


def made(scene, engine):
    """A run, or why there is none."""
    try:
        return hc.simulate(scene, engine=engine)
    except hc.ParameterError as error:
        return str(error)


@native
@pytest.mark.parametrize("law", LAWS)
@examples(8)
@given(st.data())
def test_both_engines_make_the_same_bits_of_any_scene(law, data):
    scene = data.draw(scenes(law))
    a, b = made(scene, "python"), made(scene, "native")
    if isinstance(a, str):
        event("refused")
        assert a == b
    else:
        event(a.outcome.code)
        same(b, a, "scene")
