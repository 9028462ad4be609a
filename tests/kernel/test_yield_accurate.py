"""Clay that yields in the accurate method: closed forms, SciPy with events, exact rest."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import modes, pace
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.simulation.run import Run
from tests.hunt import HUNTS, examples
from tests.oracles import store
from tests.oracles.yielding import yielding_case

MASS = 1.25  # [kg]
SPEED = 0.2  # [m/s]


def slider(flow, dt, t_max):
    """A mass with clay alone: motors that feign it without a loop worth the name."""
    base = hc.free()
    # poles at nearly 0: what is left of the servo counts some 1e-10
    servo = tuple(hc.Servo(x.G, hc.SecondOrder(1.0 / MASS, 1e-9, 1e-9)) for x in base.servo)
    return dataclasses.replace(
        base, clay=hc.slab(flow), gain=(0.0, 0.0), inertia_shaping=True, servo=servo,
        velocity=(SPEED, 0.0),
        start=(0.02, 0.0), force=(0.0, 0.0), compensator=hc.Compensator((1,), (1, 0, 0)), dt=dt,
        t_max=t_max, length=None, torque_limit=(1e5, 1e5), integrator="accurate",
        stop_when_unstable=False,
    )  # fmt: skip


def stop_of(flow):
    """Time and way to the stop: in closed form where there is one."""
    Fy, K, n, b = flow.Fy, flow.K, flow.n, flow.b
    if not K and b:
        r = math.log1p(b * SPEED / Fy)
        return MASS / b * r, MASS * SPEED / b - MASS * Fy / b**2 * r
    if not K:
        return MASS * SPEED / Fy, MASS * SPEED**2 / (2.0 * Fy)
    if not Fy and not b:
        return (
            MASS * SPEED ** (1.0 - n) / (K * (1.0 - n)),
            MASS * SPEED ** (2.0 - n) / (K * (2.0 - n)),
        )
    force = lambda u: Fy + b * u + K * u**n  # noqa: E731
    t = quad(lambda u: MASS / force(u), 0.0, SPEED, epsabs=1e-14, epsrel=1e-13)[0]
    return t, quad(lambda u: MASS * u / force(u), 0.0, SPEED, epsabs=1e-14, epsrel=1e-13)[0]


@pytest.mark.parametrize(
    "flow",
    [
        hc.Flow(Fy=2.0, b=5.0),
        hc.Flow(Fy=2.0),
        hc.Flow(K=3.0, n=0.5),
        hc.Flow(K=1.5, n=0.23),
        hc.Flow(Fy=1.0, K=1.0, n=0.5, b=2.0),
        hc.Flow(Fy=0.5, K=4.0, n=2.0),
        hc.Flow(Fy=0.5, K=4.0, n=1.5, b=1.0),
    ],
    ids=lambda f: f"{f.kind} {f.n:g}",
)
def test_a_slider_stops_when_and_where_it_should(flow):
    t, x = stop_of(flow)
    # 1e-9 but where nothing but K v^n stops it, n < 1: there what is left of the servo, 2.5e-10
    # m/s^2, outlasts the clay, and the steps beside rest are shares of the speed (modes.GRADE)
    thins = flow.n < 1.0 and not flow.Fy
    most = [(1e-2, 2e-7), (1e-3, 2e-9)]
    if HUNTS or flow.b == 5.0:
        most += [(3.6e-4, 1e-9), (1e-4, 1e-9)]
    for dt, within in most:
        within *= 10.0 if thins and dt < 1e-2 else 1.0
        r = hc.simulate(slider(flow, dt, 1.1 * t + 2.0 * dt))
        (stop,) = r.stops
        assert stop.axis == "xy" and stop.end is None
        assert abs(stop.start / t - 1.0) < within and abs((r.p[-1, 0] - 0.02) / x - 1.0) < within
        still = r.t > stop.start
        assert still.any() and np.all(r.v[still] == 0.0) and np.all(r.p[still] == r.p[-1])
        assert np.all(r.qd[still] == 0.0)
        assert abs(r.energy["residual"]) < 1e-7 * MASS


HAND = (0.25, 2.0, 6.0)
RAMP = (((4.0, 1.5), 0.05, 0.55), ((-5.0, -2.0), 0.6, 0.6))
BINGHAM = (((0.5, 0.0, 1.0, 5.0), (0.3, 0.0, 1.0, 9.0)),)
ALIKE = (((0.5, 0.0, 1.0, 5.0),) * 2,)
NONE = ((0.0, 0.0, 1.0, 0.0),) * 2
LAYERS = (
    NONE,
    ((0.6, 0.0, 1.0, 9.0), (0.4, 0.0, 1.0, 9.0)),
    ((0.0, 0.0, 1.0, 20.0),) * 2,
    ((2.0, 0.0, 1.0, 9.0), (1.0, 0.0, 1.0, 9.0)),
)
MOVING = dict(uh=(0.1, 0.05), v0=(0.1, -0.05), t_end=0.5)
PUSHED = dict(uh=(0.0, 0.0), pushes=RAMP, t_end=1.2)
SLOW = dict(method="Radau", rtol=1e-11, isotropic=True)  # its direction is stiff beside rest
THINNING = ((0.3, 3.0, 0.5, 2.0), (0.2, 2.0, 0.7, 2.0))
CASES = {
    "coulomb": dict(laws=(((0.5, 0.0, 1.0, 0.0), (0.3, 0.0, 1.0, 0.0)),), **MOVING),
    "bingham": dict(laws=BINGHAM, **PUSHED),
    "shaped": dict(laws=BINGHAM, inertia_shaping=True, hand=HAND, **PUSHED),
    "hand": dict(laws=(((0.8, 0.0, 1.0, 0.0), (0.6, 0.0, 1.0, 0.0)),), hand=HAND, **PUSHED),
    "pose": dict(laws=BINGHAM, p0=(0.1, -0.08), **PUSHED),
    "turned": dict(laws=BINGHAM, angle=0.5, **PUSHED),
    "borders": dict(laws=LAYERS, edges=(0.01, 0.02, 0.03), uh=(1.5, 0.3), t_end=1.0),
    "thinning": dict(laws=(THINNING,), **PUSHED),
    "thickening": dict(
        laws=(((0.3, 30.0, 1.5, 2.0), (0.2, 20.0, 2.0, 2.0)),), uh=(0.1, 0.3), v0=(0.1, -0.05),
        t_end=0.5,
    ),
    "along, coulomb": dict(laws=(((0.5, 0.0, 1.0, 0.0),) * 2,), **SLOW, **MOVING),
    "along, bingham": dict(laws=ALIKE, **SLOW, **PUSHED),
    "along, hand": dict(laws=(((0.5, 3.0, 0.5, 0.0),) * 2,), hand=HAND, **SLOW, **PUSHED),
    "along, borders": dict(
        laws=(NONE, ((0.6, 0.0, 1.0, 9.0),) * 2, ((0.0, 0.0, 1.0, 20.0),) * 2), edges=(0.01, 0.02),
        uh=(1.5, 0.3), **SLOW,
    ),
}  # fmt: skip
SMOOTH = ["coulomb", "bingham", "shaped", "hand", "pose", "turned", "borders"]


def scene(case, dt, **more):
    """The same case as a scenario."""
    laws, edges = case["laws"], case.get("edges", ())
    axes = [
        Profile(edges, tuple(x[i][3] for x in laws), "x", Fy=tuple(x[i][0] for x in laws),
                K=tuple(x[i][1] for x in laws), n=tuple(x[i][2] for x in laws))
        for i in (0, 1)
    ]  # fmt: skip
    clay = Clay(*axes, angle=case.get("angle", 0.0), isotropic=case.get("isotropic", False))
    parts = [
        hc.Ramp(value, begin, end) if end > begin else hc.Step(value, begin)
        for value, begin, end in case.get("pushes", ())
    ]
    hand = case.get("hand")
    settings = dict(
        clay=clay, force=case.get("uh", (1.0, 0.0)),
        muscle=sum(parts[1:], parts[0]) if parts else None,
        operator=hc.Operator(*hand) if hand else None,
        inertia_shaping=case.get("inertia_shaping", False),
        start=case.get("p0", (0.0, 0.0)), velocity=case.get("v0", (0.0, 0.0)), length=None,
        t_max=case.get("t_end", 1.0), gain=(1.0, 0.5), dt=dt, integrator="accurate",
        stop_when_unstable=False,
    )  # fmt: skip
    return dataclasses.replace(hc.free(), **(settings | more))


@functools.cache
def exact(name):
    """The stored solution."""
    return store.solution(f"yield-{name.replace(', ', '-')}", yielding_case, CASES[name])


@functools.cache
def run_of(name, dt):
    """The case's run by the accurate method."""
    return hc.simulate(scene(CASES[name], dt))


@functools.cache
def errors(name, dt):
    """Largest errors of positions, velocities, times of stops, and times of crossings."""
    found, r = exact(name), run_of(name, dt)
    i = np.rint(found.t / dt).astype(int)
    stops = [
        (("x", "y", "xy").index(x.axis), on, t)
        for x in r.stops
        for on, t in ((1, x.start), (0, x.end))
        if t is not None
    ]
    # in one order, where one axis stops as the other goes on
    both = [
        np.array(sorted(map(list, x), key=lambda x: (round(x[2], 4), *x))).reshape(-1, 3)
        for x in (stops, found.stops)
    ]
    assert np.array_equal(both[0][:, :2], both[1][:, :2])
    times = np.abs(both[0][:, 2] - both[1][:, 2]).max(initial=0.0)
    crossings = np.abs(np.array([x.time for x in r.crossings]) - found.crossings).max(initial=0.0)
    p, v = np.abs(r.p[i] - found.p).max(), np.abs(r.v[i] - found.v).max()
    return p, v, times, crossings


@pytest.mark.parametrize("name", CASES)
def test_as_scipy_solves_it_with_events(name):
    p, v, stops, crossings = errors(name, 1e-3)
    assert p < 1e-9 and v < 2e-8 and crossings < 1e-9
    # where n < 1, the clay holds by K v^n more, v the slowest creep that is followed
    assert stops < (5e-6 if "thinning" in name or "hand" in name[5:] else 1e-7)


@pytest.mark.parametrize("name", SMOOTH)
def test_fourth_order_across_stops(name):
    steps = np.array([4e-3, 2e-3, 1e-3])
    found = np.array([errors(name, dt)[:2] for dt in steps])
    for error in found.T:
        assert 3.5 < np.polyfit(np.log(steps), np.log(error), 1)[0] < 4.6, found


@pytest.mark.parametrize("name", SMOOTH)
def test_the_fast_method_is_of_second_order_beside_scipy(name):
    steps = np.array([4e-3, 2e-3, 1e-3])
    found, exactly = [], exact(name)
    for dt in steps:
        r = hc.simulate(scene(CASES[name], float(dt), integrator="fast"))
        found.append(np.abs(r.p[np.rint(exactly.t / dt).astype(int)] - exactly.p).max())
    # from step to step, where a stop falls in a step changes
    assert found[2] < 5e-7 and 1.6 < np.polyfit(np.log(steps), np.log(found), 1)[0] < 2.6, found


def test_one_axis_rests_exactly_while_the_other_slides():
    """Its velocity is 0.0, and it stays where it is but for a rounding or two of the angles."""
    for name, angle in (("coulomb", 0.0), ("turned", 0.5)):
        r = run_of(name, 1e-3)
        c, d = math.cos(angle), math.sin(angle)
        axes = dict(x=(c, d), y=(-d, c))
        seen = 0
        for stop in r.stops:
            end = stop.end or r.scenario.t_max
            held = (r.t > stop.start) & (r.t < end)
            if held.sum() < 3:
                continue
            way = np.array(axes[stop.axis])
            seen += np.any(np.abs(r.v[held]).max(axis=1) > 1e-3)  # the other axis
            assert np.ptp(r.p[held] @ way) < 3e-16
            # turned back into x and y, 0.0 is a rounding
            assert np.abs(r.v[held] @ way).max() <= (1e-17 if angle else 0.0)
        assert seen


@pytest.mark.parametrize("along", [False, True])
def test_below_the_yield_force_nothing_moves(along):
    clay = Clay(*[Profile((), (5.0,), Fy=(0.5,))] * 2, isotropic=along)
    wave = hc.Multisine(rms=(0.05, 0.05), high=3.0)
    s = dataclasses.replace(
        hc.free(), clay=clay, force=(0.2, 0.1), muscle=wave, integrator="accurate", dt=1e-3,
        t_max=0.5, start=(0.05, 0.02),
    )  # fmt: skip
    run = Run(s, 1)
    data = run.row.mover.data
    q = data.qpos.copy()
    run.go(None)
    r = run.arrays()
    assert np.array_equal(data.qpos, q) and np.all(data.qvel == 0.0)
    assert np.all(r["v"] == 0.0) and np.all(r["qd"] == 0.0) and np.ptp(r["p"], axis=0).max() == 0.0
    assert [x.axis for x in run.stops] == (["xy"] if along else ["x", "y"])
    assert all(x.start == 0.0 and x.end is None for x in run.stops)
    # the clay bears what hand and servo push
    assert np.abs(r["fe"]).max() > 0.1 and np.linalg.norm(r["fe"], axis=1).max() < 0.5 * 2**0.5


def test_energy_converges_at_fourth_order_and_none_is_made():
    for name in ("bingham", "turned", "along, bingham"):
        steps, rest = np.array([4e-3, 2e-3, 1e-3]), []
        for dt in steps:
            r = run_of(name, dt)
            rest.append(abs(r.energy["residual"]) / r.energy["throughput"])
            assert np.all(np.sum(r.fe * r.v, axis=1) >= 0.0) and r.energy["clay"] > 0.0
        order = np.polyfit(np.log(steps), np.log(rest), 1)[0]
        assert rest[-1] < 1e-7 and (order > 3.5 or rest[0] < 1e-7), (name, rest)


size = st.floats(-1.0, 1.0)


@examples(10)
@given(
    st.sampled_from((0.0, 0.1, 3.0, 200.0, 1e4)),
    st.sampled_from((0.0, 2.0)),
    st.sampled_from((0.5, 1.0, 1.5)),
    st.booleans(),
    st.booleans(),
    st.tuples(size, size, size, size),
    st.sampled_from((1e-2, 1e-3)),
)
def test_the_clay_only_takes_energy(Fy, K, n, along, hand, x, dt):
    clay = Clay(
        *[Profile((), (9.0,), Fy=(Fy,), K=(K,), n=(n,))] * 2,
        angle=0.0 if along else 0.4, isotropic=along and Fy + K > 0.0,
    )  # fmt: skip
    wave = hc.Multisine(rms=(3.0 * abs(x[0]) + 0.1, 0.1), high=6.0)
    r = hc.simulate(
        dataclasses.replace(
            hc.free(), clay=clay, force=(4.0 * x[0], 4.0 * x[1]), velocity=(0.1 * x[2], 0.1 * x[3]),
            muscle=wave, operator=hc.Operator() if hand else None, integrator="accurate", dt=dt,
            t_max=0.1, stop_when_unstable=False,
        )
    )  # fmt: skip
    power = np.sum(r.fe * r.v, axis=1)
    assert power.min() >= -1e-15 * (1.0 + np.abs(r.fe).max()) and r.energy["clay"] >= 0.0
    # no chatter: stops are apart
    assert len(r.stops) < 40


def test_the_motors_limits_hold_in_clay_that_yields():
    """Beside the fast method at small steps: the torques are cut, the stops are the same."""
    kw = dict(torque_limit=(0.3, 0.2), t_max=0.8)
    a = hc.simulate(scene(CASES["bingham"], 1e-3, **kw))
    b = hc.simulate(scene(CASES["bingham"], 1.25e-4, integrator="fast", **kw))
    assert np.all(np.abs(a.tau) <= kw["torque_limit"]) and np.any(np.abs(a.tau) >= (0.3, 0.2))
    # both are of second order across the corners of the limits
    np.testing.assert_allclose(a.p, b.p[::8], atol=2e-6)
    first, second = ([(x.axis, x.start) for x in r.stops] for r in (a, b))
    for x, y in zip(first, second, strict=True):
        assert x[0] == y[0] and x[1] == pytest.approx(y[1], abs=1e-3)


def test_a_creep_too_slow_for_explicit_steps_counts_as_rest():
    """Of clay of n < 1; how slow is known, and too much of it is refused."""
    K, n, dt, span = 30.0, 0.5, 1e-3, 0.003
    s = slider(hc.Flow(K=K, n=n), dt, span)
    slowest = modes.creep_speed(pace.largest_lightness(s), dt, K, n)
    assert slowest < pace.CREEP_MOST
    for times, moves in ((0.5, False), (2.0, True)):
        speed = times * slowest
        push = dataclasses.replace(s, velocity=(0.0, 0.0), force=(K * speed**n, 0.0))
        r = hc.simulate(push)
        way = r.p[-1, 0] - r.p[0, 0]
        assert (way > 0.0) == moves
        assert abs(way - speed * span) <= (0.02 if moves else 1.0) * speed * span
    with pytest.raises(ParameterError, match="creep below .* choose 'fast'"):
        hc.simulate(slider(hc.Flow(K=300.0, n=0.23), 1e-2, 0.3))


def test_consistency_counts_among_the_rates_that_divide_a_step():
    thin, thick = (slider(hc.Flow(K=K), 1e-3, 0.1) for K in (5.0, 5e3))
    damper = dataclasses.replace(thick, clay=hc.slab(5e3))
    assert pace.fastest_rate(thick) == pace.fastest_rate(damper)
    assert hc.simulate(thin).steps < 150 < 700 < hc.simulate(thick).steps
    with pytest.raises(ParameterError, match="explicit.*choose 'fast'"):
        hc.simulate(slider(hc.Flow(K=1e6), 1e-3, 0.1))


def test_an_asked_error_is_kept_in_clay_that_yields():
    s = dataclasses.replace(
        hc.constant_cut(), clay=hc.slab(hc.Flow(Fy=0.5, b=60.0), 0.05, 0.15), force=(2.0, 0.0)
    )
    r = hc.simulate(s, error="1e-8 m")
    assert r.error is not None and r.error.reached and r.error.integrator == "accurate"
