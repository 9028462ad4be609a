"""Clay that changes smoothly with the place, against solutions that are not ours."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from tests.oracles import kept_cells, store
from tests.oracles.hybrid import hybrid
from tests.oracles.spline import even_spline

METHODS = {
    "default": {},
    "accurate": dict(integrator="accurate", dt=1e-3),
    "held": dict(control="sampled"),
    "physical": dict(control="sampled", render="physical"),
    "late": dict(control="sampled", render="physical", hardware=hc.Hardware(delay=2e-4)),
    "hand": dict(operator=hc.Operator(), inertia_shaping=True),
    "muscle": dict(muscle=hc.Multisine(rms=(1.0, 0.5), high=3.0)),
}
RANDOM = np.random.default_rng(3)
SPANS = ((0.02, 0.16), (-0.01, 0.05)), ((0.0, 0.2), (0.0, 0.04))
VALUES = tuple(np.round(RANDOM.uniform(0.0, 120.0, shape), 1) for shape in ((7, 6), (5, 4)))
LAWS = tuple(hc.Smooth(*spans, values) for spans, values in zip(SPANS, VALUES, strict=True))
SPLINES = tuple(even_spline(*spans, values) for spans, values in zip(SPANS, VALUES, strict=True))


def path_through(clay, **more):
    """A slanted path through the clay."""
    free = hc.free(force=(1.0, 0.7), gain=(1.0, 0.2), inertia_shaping=True, t_max=2.0)
    return dataclasses.replace(free, **{"clay": clay, "length": None, **more})


def exact(t_max, hand=None, shaping=True, angle=0.0):
    """The path through LAWS at half time and at the end."""
    s = path_through(None)
    th = dataclasses.astuple(hand) if hand else (0.0,) * 3
    case = SPANS, VALUES, (s.gain, s.force), [0.5 * t_max, t_max], th, shaping, angle
    name = f"smooth-{t_max}-{'hand' if hand else ''}-{angle}"
    return store.solution(name, kept_cells.of_splines, *case)


@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize("hand,shaping", [(None, True), (hc.Operator(0.25, 2.0, 6.0), False)])
@pytest.mark.parametrize("kind,order,limit", [("fast", 2, 1e-7), ("accurate", 4, 1e-11)])
def test_the_order_is_kept(kind, order, limit, hand, shaping, angle):
    s = path_through(
        hc.Clay(*LAWS, angle), integrator=kind, operator=hand, inertia_shaping=shaping, t_max=0.8
    )
    truth, errors = exact(0.8, hand, shaping, angle), []
    steps = np.array([4e-3, 2e-3, 1e-3])
    for dt in steps:
        r = hc.simulate(dataclasses.replace(s, dt=float(dt)))
        middle = len(r.t) // 2
        errors.append(np.abs(r.p[[middle, -1]] - truth.p).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order - 0.3 < slope < order + 0.7, errors
    assert errors[-1] < limit


@pytest.mark.parametrize("render", ["held", "physical"])
def test_sampled_control_is_that_of_the_oracle(render):
    """Second order in the step of the physics, Ts kept."""
    values, Ts = [[10.0], [100.0], [30.0], [120.0], [60.0]], 4e-3
    law, b = hc.Smooth((0.0, 0.12), (0.0, 1.0), values), even_spline((0, 0.12), (0, 1), values)
    s = hc.constant_cut(
        gain=(1.0, 0.5), force=(2.0, 0.0), t_max=0.4, control="sampled", render=render, dt=Ts, Ts=Ts
    )
    s = dataclasses.replace(s, clay=hc.Clay(law, law))
    P, V, _ = hybrid(lambda x: b((x, 0.0)), Ts, s.gain, s.force, render=render, t_end=0.4, edges=())
    errors = []
    for n in (1, 2, 4):
        r = hc.simulate(dataclasses.replace(s, dt=Ts / n))
        errors.append(np.abs(r.p[::n][: len(P)] - P).max())
    order = np.polyfit(np.log([1, 2, 4]), -np.log(errors), 1)[0]
    assert 1.7 < order < 2.6, errors


@pytest.mark.parametrize("render", ["held", "physical"])
def test_sampled_control_tends_to_the_continuous(render):
    """Of first order in Ts."""
    s = path_through(hc.Clay(*LAWS), control="sampled", render=render, t_max=0.4)
    truth, errors = exact(0.8), []
    for dt in (4e-4, 2e-4):
        r = hc.simulate(dataclasses.replace(s, dt=dt))
        errors.append(np.abs(r.p[-1] - truth.p[0]).max())
    assert errors[0] < 1e-5 and errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("name", METHODS)
def test_the_record_holds_the_clay_of_the_place(name):
    """b by SciPy at the recorded places, to the rounding of values near 100; fe = b v."""
    r = hc.simulate(path_through(hc.Clay(*LAWS), **METHODS[name], velocity=(0.3, 0.1), t_max=0.3))
    want = np.array([[b(p) for b in SPLINES] for p in r.p[::7]])
    np.testing.assert_allclose(r.b[::7], want, rtol=0.0, atol=1e-11)
    if name != "late":  # there the motors' force, or the handle's, is beside the sample
        np.testing.assert_allclose(r.fe, r.b * r.v, rtol=1e-14, atol=1e-16)
    assert np.ptp(r.b[:, 0]) > 20.0
    assert not r.crossings


@pytest.mark.parametrize("name", METHODS)
def test_the_energy_closes(name):
    for clay in (hc.Clay(*LAWS), hc.Clay(*LAWS, 0.5)):
        s = path_through(clay, **METHODS[name], torque_limit=(0.3, 0.15), t_max=0.25)
        r = hc.simulate(s)
        e = r.energy
        assert (np.abs(r.tau) == s.torque_limit).any()
        # the accurate method integrates the works, to fourth order; a hand is no part of the
        # balance of a kick but for its order
        assert abs(e["residual"]) < (1e-6 if name in ("accurate", "hand") else 1e-13)
        assert e["clay"] > 0.0 or name == "held"  # the work of held clay is the motors'


@pytest.mark.parametrize("name", METHODS)
def test_smooth_clay_that_is_constant_is_the_layer(name):
    """One control point, or many alike; but for the rounding of b."""
    layer, more = hc.Profile((), (90.0,)), dict(METHODS[name], t_max=0.08)
    first = hc.simulate(path_through(hc.Clay(layer, layer), **more))
    assert first.p[-1].min() > 1e-4
    for values in ([[90.0]], np.full((4, 5), 90.0)):
        law = hc.Smooth((0.0, 0.1), (0.0, 0.1), values)
        for clay in (hc.Clay(law, law), hc.Clay(law, layer), hc.Clay(layer, law)):
            r = hc.simulate(path_through(clay, **more))
            np.testing.assert_allclose(r.p, first.p, rtol=0.0, atol=1e-12)
            np.testing.assert_allclose(r.b, first.b, rtol=1e-15)
            assert r.outcome == first.outcome


def test_beside_clay_of_layers_that_grow_or_are_stiff():
    """Each axis has its own law; x is crossed by borders of the other."""
    for other in (
        hc.Profile((0.01, 0.03), (10.0, 50.0, 20.0), growth=(0.0, 30.0, 10.0)),
        hc.Profile((0.01, 0.03), (10.0, 1e6, 20.0)),
    ):
        r = hc.simulate(path_through(hc.Clay(LAWS[0], other), dt=1e-3))
        assert [c.border for c in r.crossings] == [0.01, 0.03]
        want = [SPLINES[0](p) for p in r.p[::7]]
        np.testing.assert_allclose(r.b[::7, 0], want, rtol=0.0, atol=1e-11)
        assert abs(r.energy["residual"]) < 1e-13


def test_steady_motion_feels_the_clay_of_the_place():
    """fe/v is b(p), and the speed K f/(10 + K b) where b has long been constant."""
    law = hc.Smooth.of_function(
        lambda x, y: 20.0 + 2e3 * min(x, 0.02), (0.0, 0.04), (0.0, 1.0), (21, 1)
    )
    s = dataclasses.replace(hc.constant_cut(inertia_shaping=True), clay=hc.Clay(law, law))
    r = hc.simulate(s)
    assert r.v[-1, 0] == pytest.approx(s.gain[0] * s.force[0] / (10.0 + s.gain[0] * 60.0), rel=1e-6)
    b = even_spline((0.0, 0.04), (0.0, 1.0), law.values)
    moving = np.flatnonzero(r.v[:, 0] > 1e-4)[::50]
    want = [b(p) for p in r.p[moving]]
    assert min(want) < 25.0 and want[-1] == pytest.approx(60.0, rel=1e-9)
    np.testing.assert_allclose(r.fe[moving, 0] / r.v[moving, 0], want, rtol=1e-10)


def test_stiff_smooth_clay_is_refused_and_the_step_named():
    soft, stiff = (hc.Smooth((0.0, 0.1), (0.0, 0.1), [[0.0, b]]) for b in (6000.0, 7000.0))
    s = path_through(hc.Clay(soft, LAWS[0]))
    with pytest.raises(ParameterError, match="dt = 0.00036: must be at most 0.00031 s in smooth"):
        path_through(hc.Clay(LAWS[0], stiff))
    for more in (
        dict(dt=3e-4),
        dict(integrator="accurate"),
        dict(control="sampled"),
        dict(operator=hc.Operator(mass=1.0)),
    ):
        assert path_through(hc.Clay(soft, stiff), **more).clay != s.clay
    with pytest.raises(ParameterError, match="must be at most"):
        path_through(hc.Clay(soft, stiff), control="sampled", render="physical")


def test_a_run_goes_on_step_by_step_as_in_one():
    s = path_through(hc.Clay(*LAWS), t_max=0.3)
    whole, steps = hc.simulate(s), hc.Simulation(s)
    while steps.outcome is None:
        steps.step()
    np.testing.assert_array_equal(steps.record().p, whole.p)


def test_the_loop_of_a_scenario_has_the_control_point_of_the_least_limit():
    s = path_through(hc.Clay(*LAWS))
    for i, axis in enumerate("xy"):
        least = min(VALUES[i].ravel(), key=lambda b: hc.theory.gain_limit(axis, b))
        assert hc.theory.Loop.of(s, axis).b == least


def test_the_monitor_names_the_limit_of_the_clay():
    law = hc.Smooth((0.05, 0.15), (-0.1, 0.1), np.full((6, 6), 90.0))
    layer = hc.Profile((), (90.0,))
    cut = hc.constant_cut(gain=(1.0, 1.0))
    a, b = (hc.simulate(dataclasses.replace(cut, clay=hc.Clay(x, x))).outcome for x in (law, layer))
    assert a.code == b.code == "diverged" and a.step == b.step and a.advice == b.advice
