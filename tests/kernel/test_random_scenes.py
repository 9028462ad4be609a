"""Random scenes of the whole space: CPython and the compiled kernel make the same bits.

Half of the scenes are usual. In the others each number may be one that nobody would choose:
encoders of four counts, dry friction that no motor overcomes, steps of 20 ms, springs of 1e5 N/m.
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
from hapticclay.kernel import user_laws
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from tests.hunt import HUNTS, examples
from tests.kernel.test_engines import native, same
from tests.kernel.test_kick import ZEROS
from tests.kernel.test_own_controller import to_pose
from tests.kernel.test_parts import OWN
from tests.kernel.test_signals_in_runs import CASES as SIGNALS
from tests.oracles import hardening_law

VARYING = {name: signal for name, (signal, *_) in SIGNALS.items() if signal.varies}
METHODS = {
    "fast": {},
    "accurate": dict(integrator="accurate"),
    "held": dict(control="sampled"),
    "physical": dict(control="sampled", render="physical"),
}
LAWS = "none", "layers", "growth", "cells", "smooth", "yield", "springs", "groove", "own"
SHAPES = [*OWN.values(), *ZEROS]
CARDS = "planar_2r", "five_bar", "haptic_3", "leader_7"
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


def either(x):
    """Nothing, or this."""
    return st.just(0.0) | x


class Reach:
    """The numbers of scenes: usual ones, or `far` any that are allowed."""

    def __init__(self, far):
        self.far = far

    def __call__(self, usual, extreme):
        return usual | extreme if self.far else usual

    def edges(self, most=4):
        """Ascending borders, near the start for the most part."""
        return st.lists(evenly(-0.005, 0.03), max_size=most, unique=True).map(
            lambda found: tuple(sorted(found))
        )

    @property
    def damping(self):
        return either(self(between(1.0, 200.0), between(1.0, 1e4)))

    @property
    def spring(self):
        """A spring, one that relaxes, both or none."""
        size = either(self(between(50.0, 2e4), between(1.0, 1e5)))
        return st.builds(
            spring_of, size, size, self(between(0.5, 5.0), between(1e-3, 100.0)),
            self(between(0.01, 1.0), between(1e-4, 10.0)), maybe, maybe,
        )  # fmt: skip

    @property
    def groove(self):
        plain = st.builds(
            hc.Groove, x=st.just((-0.02, 0.05)), y=st.just((-0.02, 0.02)),
            pressure=self(between(1e3, 4e4), between(1.0, 1e6)),
            gradient=either(between(1e4, 2e6)), damping=either(between(1e4, 3e5)),
        )  # fmt: skip
        wide = st.builds(
            hc.Groove, x=st.just((0.0, 0.15)), y=st.just((-0.03, 0.001)),
            pressure=between(1.0, 1e5), damping=either(between(1.0, 1e5)),
            tool=st.builds(hc.Tool, width=st.sampled_from([0.01, 0.1])),
        )  # fmt: skip
        return self(plain, wide)

    @property
    def hand(self):
        usual = st.builds(hc.Operator, evenly(0.0, 0.5), evenly(0.0, 5.0), evenly(0.0, 20.0))
        extreme = st.builds(
            hc.Operator, either(between(1e-3, 100.0)), either(between(0.01, 1e4)),
            either(between(1.0, 1e6)),
        )  # fmt: skip
        return self(usual, extreme)

    @property
    def servo(self):
        def of(gain, disturbance, damping, stiffness):
            return st.builds(
                hc.Servo,
                st.builds(hc.SecondOrder, between(*gain), between(*damping), between(*stiffness)),
                st.builds(
                    hc.SecondOrder, between(*disturbance), between(*damping), between(*stiffness)
                ),
            )

        usual = of((400.0, 1000.0), (0.1, 1.0), (20.0, 60.0), (300.0, 1000.0))
        return self(usual, of((1.0, 1e5), (1e-3, 10.0), (0.1, 1e3), (1.0, 1e5)))


def spring_of(k, k1, limit, tau, limited, unilateral):
    """A spring whose numbers go together."""
    more = (dict(tau=tau) if k1 else {}) | (dict(limit=limit) if k and limited else {})
    return hc.Spring(k=k, k1=k1, unilateral=bool(k or k1) and unilateral, **more)


@st.composite
def some_profile(draw, reach, along, hard, **more):
    """Damping by layers; `more`: the strategy of a number of each region, by field."""
    edges = draw(reach.edges())
    b = either(between(1.0, 1e6)) if hard else reach.damping
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


def numbers_of_law(reach, law, also_yields):
    """Numbers of each region beside its damping, by field."""
    if law == "growth":
        return dict(growth=either(reach(between(1.0, 500.0), between(1e-3, 1e5))))
    if law == "springs":
        force = dict(Fy=either(reach(between(0.1, 2.0), between(1e-3, 100.0))))
        return dict(springs=reach.spring) | (force if also_yields else {})
    if law == "yield":
        return dict(
            Fy=either(reach(between(0.1, 5.0), between(1e-4, 100.0))),
            K=either(reach(between(0.5, 20.0), between(1e-3, 1e3))),
            n=st.just(1.0) | evenly(0.3, 2.0),
        )
    return {}


@st.composite
def some_clay(draw, reach, law, method):
    """Clay of a law, soft enough for explicit methods."""
    hard = method in ("fast", "physical") and draw(maybe)
    along = draw(pair(st.sampled_from("xy")))
    angle = draw(either(evenly(-3.0, 3.0))) if law not in ("springs", "own") and not hard else 0.0
    if law in ("cells", "smooth"):
        x, y = (draw(some_grid(law == "smooth")) for _ in "xy")
        return Clay(x, draw(st.just(y) | some_profile(reach, along[1], hard)), angle)
    more = numbers_of_law(reach, law, draw(maybe))
    x = draw(some_profile(reach, along[0], hard, **more))
    y = draw(st.just(dataclasses.replace(x)) | some_profile(reach, along[1], hard, **more))
    alike = all(getattr(x, k) == getattr(y, k) for k in ("Fy", "K", "n", "edges", "along"))
    both = law == "yield" and alike
    groove = draw(reach.groove) if law == "groove" else None
    return Clay(x, y, angle, isotropic=both and draw(maybe), groove=groove)


@st.composite
def some_hardware(draw, reach, held, guarded, dt):
    """Imperfections, each there or not."""
    parts = dict(
        jitter=reach(between(1e-6, 8e-5), between(1e-3, 0.9).map(lambda x: x * dt)),
        dropout_probability=reach(evenly(0.01, 0.3), evenly(0.3, 0.99)),
        encoder=reach(st.integers(1000, 100_000), st.integers(4, 100)),
        adc_bits=reach(st.integers(8, 16), st.integers(2, 32)),
        force_noise=reach(between(1e-3, 0.1), between(0.1, 1e3)),
        force_filter=reach(between(50.0, 1000.0), between(1e-2, 1e5)),
        filter_order=st.integers(1, 2), dac_bits=reach(st.integers(8, 16), st.integers(2, 32)),
        dac_range=reach(st.just((30.0, 20.0)), pair(between(1e-2, 1e5))),
        delay=reach(between(1e-4, 2e-3), between(1e-3, 20.0).map(lambda x: min(x * dt, 1.0))),
        friction=reach(pair(between(1e-3, 0.05)), pair(either(between(1e-3, 1e6)))),
        seed=st.integers(0, 99),
    )  # fmt: skip
    if held and guarded:
        coupling = st.builds(
            hc.Coupling, reach(between(500.0, 5e3), between(1.0, 1e5)),
            reach(between(10.0, 300.0), between(0.1, 1e4)),
        )  # fmt: skip
        parts |= dict(passivity=st.just(True), coupling=coupling)
    found = {name: draw(x) for name, x in parts.items() if draw(maybe)}
    if draw(maybe):
        found |= dict(velocity="difference", velocity_window=draw(st.integers(1, 8)))
        cutoff = reach(between(50.0, 500.0), between(1e-2, 1e5))
        found |= dict(velocity_filter=draw(st.none() | cutoff))
    return hc.Hardware(**found)


@st.composite
def scenes(draw, law, far=False):
    """A scene with a law of clay, of any method and other parts that support takes."""
    try:
        return some_scene(draw, law, Reach(far))
    except hc.ParameterError as error:  # of numbers: stiff clay with rotated axes, a short reach
        event(f"no scene: {error.field}")
        reject()


def some_scene(draw, law, reach):
    explicit = law not in ("springs", "groove")
    # accurate steps of scenes so extreme are divided by thousands: only a hunt makes them
    accurate = explicit and (HUNTS or not reach.far)
    method = draw(st.sampled_from([x for x in METHODS if accurate or x != "accurate"]))
    sampled = method in ("held", "physical")
    limits = st.sampled_from([(30.0, 20.0), (0.3, 0.2), (1e5, 1e5)])
    fields = METHODS[method] | dict(
        clay=None if law == "none" else draw(some_clay(reach, law, method)),
        gain=draw(pair(either(reach(between(0.05, 3.0), between(1e-3, 1e4))))),
        force=draw(pair(reach(evenly(-5.0, 5.0), evenly(-300.0, 300.0)))),
        start=draw(pair(evenly(-0.005, 0.01))),
        velocity=draw(pair(either(reach(evenly(-0.2, 0.2), evenly(-10.0, 10.0))))),
        length=draw(st.none() | evenly(0.01, 0.05)),
        torque_limit=draw(reach(limits, pair(between(1e-2, 1e5)))),
        stop_when_unstable=draw(maybe),
        operator=draw(st.none() | reach.hand | pair(st.none() | reach.hand)),
        inertia_shaping=draw(maybe),
    )
    steps = evenly(20.0, 150.0)
    if reach.far:
        steps = evenly(5.0, 20.0) if method == "accurate" else evenly(20.0, 400.0)
    usual = between(3e-4, 2e-3) if not sampled else between(1e-4, 7e-4)
    dt = draw(reach(usual, between(1e-4, 2e-2)))
    fields |= dict(dt=dt, t_max=float(f"{dt * draw(steps):.5g}"))
    if sampled and draw(maybe):
        fields |= dict(Ts=dt * draw(st.integers(1, 4)))
    if draw(maybe):
        fields |= dict(servo=draw(pair(reach.servo)))
    if draw(maybe):
        shape = st.sampled_from(SHAPES)
        fields |= dict(compensator=draw(shape | pair(shape)))
    if draw(maybe):
        arm = st.builds(hc.Arm, *[evenly(0.24, 0.4)] * 2, *[between(0.03, 0.5)] * 2)
        fields |= dict(arm=draw(arm))
    sizes = ("muscle", reach(st.just(2.0), between(1.0, 300.0))), (
        "command", reach(st.just(1e-3), between(1e-4, 1.0)),
    )  # fmt: skip
    for name, size in sizes:
        if draw(maybe):
            fields[name] = draw(size) * VARYING[draw(st.sampled_from([*VARYING]))]
    guarded = explicit and not (fields["clay"] and fields["clay"].angle)
    if sampled and draw(st.integers(0, 3)) == 0:
        fields |= dict(controller=hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01)))
        fields |= dict(inertia_shaping=False)
        guarded = False
    if sampled and draw(maybe):
        fields |= dict(hardware=draw(some_hardware(reach, method == "held", guarded, dt)))
    event(method)
    return hc.Scenario(**fields)


@st.composite
def arm_scenes(draw, far=False):
    """A scene of an arm from a file."""
    try:
        return some_arm_scene(draw, Reach(far))
    except hc.ParameterError as error:
        event(f"no scene: {error.field}")
        reject()


def some_arm_scene(draw, reach):
    card = draw(st.sampled_from(CARDS))
    n = len(hc.MjcfArm(card).names)
    planes = [None] if card in CARDS[:2] else [None, "zx", "yz"]
    limit, loss = draw(either(reach(between(0.5, 10.0), between(1e-2, 1e5)))), draw(maybe)
    friction = either(reach(between(1e-3, 0.1), between(1e-3, 1e6)))
    arm = hc.MjcfArm(
        card, plane=draw(st.sampled_from(planes)), torque_limit=[limit] * n if limit else None,
        friction=[draw(friction) for _ in range(n)] if loss else None,
    )  # fmt: skip
    kind = draw(st.sampled_from(["exact", "difference", "filter"]))
    law = hc.JointPD(
        (draw(either(reach(between(1.0, 50.0), between(1e-3, 1e5)))),) * n,
        (draw(either(reach(between(1e-2, 1.0), between(1e-3, 1e3)))),) * n,
        velocity=kind, cutoff=draw(between(10.0, 300.0)) if kind == "filter" else None,
        reference=tuple(arm.q + draw(reach(evenly(-0.2, 0.2), evenly(-3.0, 3.0)))),
    )  # fmt: skip
    own = hc.Controller(pulls_back)
    Ts = draw(reach(between(3e-4, 2e-3), between(1e-4, 2e-2)))
    clay = draw(st.sampled_from(["none", "layers", "springs"]))
    wires = some_hardware(reach, False, False, Ts).map(
        lambda h: dataclasses.replace(h, friction=(0.0, 0.0), dac_range=None)
    )
    return hc.Scenario(
        arm=arm, controller=draw(st.sampled_from([law, own])), Ts=Ts,
        dt=Ts / draw(st.integers(1, 3)), t_max=float(f"{Ts * draw(evenly(5.0, 40.0)):.5g}"),
        clay=None if clay == "none" else draw(some_clay(reach, clay, "held")),
        render=draw(st.sampled_from(["held", "physical"])), control="sampled",
        operator=draw(st.none() | reach.hand), hardware=draw(st.none() | wires),
        force=draw(pair(reach(evenly(-5.0, 5.0), evenly(-300.0, 300.0)))),
        stop_when_unstable=draw(maybe),
    )  # fmt: skip


def pulls_back(t, q, qd, fh, state, params):
    """A law for any number of joints."""
    return tuple(-3.0 * math.sin(x) - 0.1 * w for x, w in zip(q, qd, strict=True)), state


def made(scene, engine):
    """A run, or why there is none."""
    try:
        return hc.simulate(scene, engine=engine)
    except hc.ParameterError as error:
        return str(error)


def same_bits(scene):
    """Checks that both engines make the same of a scene."""
    a, b = made(scene, "python"), made(scene, "native")
    if isinstance(a, str):
        event("refused")
        assert a == b
    else:
        event(a.outcome.code)
        same(b, a, "scene")


@native
@pytest.mark.parametrize("far", [False, True], ids=["usual", "far"])
@pytest.mark.parametrize("law", LAWS)
@examples(8)
@given(st.data())
def test_both_engines_make_the_same_bits_of_any_scene(law, far, data):
    scene = data.draw(scenes(law, far))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(user_laws, "TABLE", [hardening_law] if law == "own" else [])
        same_bits(scene)


@native
@pytest.mark.parametrize("far", [False, True], ids=["usual", "far"])
@examples(8)
@given(st.data())
def test_both_engines_make_the_same_bits_of_any_arm_from_a_file(far, data):
    same_bits(data.draw(arm_scenes(far)))
