"""Clay that yields, in sampled control: physical and held, with all of the hardware."""

import dataclasses
import functools
import inspect

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import hapticclay as hc
from hapticclay.formulas import hardware
from hapticclay.kernel import records, sampled
from hapticclay.model.constants import TS
from hapticclay.simulation.run import Run
from tests.hunt import examples
from tests.kernel.test_engines import ALL, PHYSICAL
from tests.oracles import paper_law, store
from tests.oracles.sampled_yield import yielding

Ts = 2.88e-3  # of the runs beside the oracle [s]
SPAN = 0.1152  # their length [s]
GAIN = (1.0, 0.6)


def everywhere(along, *law):
    """Clay all around; law as of hc.Flow."""
    clay = hc.slab(hc.Flow(*law))
    return clay if along else dataclasses.replace(clay, isotropic=False)


def scene(flow, along=True, parts=None, **kw):
    """A cut into clay that yields, from 1 cm on."""
    apart = {"operator", "gain", "velocity", "stop_when_unstable", "muscle"} & kw.keys()
    own = {x: kw.pop(x) for x in apart}
    kw = dict(t_max=0.3, force=(4.0, 0.4), control="sampled") | kw
    clay = dataclasses.replace(hc.slab(flow, 0.01, 0.1), isotropic=along)
    own = dict(stop_when_unstable=False, operator=None) | own
    return dataclasses.replace(hc.constant_cut(**kw), clay=clay, hardware=parts, **own)


# ---- beside SciPy
# ------------------------------------------------------------------------------------------

CASES = {
    "slides": dict(law=(1.0, 0.0, 1.0, 10.0), uh=(8.0, 4.0), v0=(0.1, 0.05)),
    "power law": dict(law=(1.0, 3.0, 0.5, 20.0), uh=(5.0, 2.0), v0=(0.1, 0.05), along=True),
    "y rests": dict(law=(4.0, 0.0, 1.0, 10.0), uh=(8.0, 1.0), v0=(0.1, 0.0)),
    "both rest and go on": dict(
        law=(9.0, 0.0, 1.0, 10.0), uh=(1.0, 0.5), v0=(0.1, 0.02), along=True
    ),
    "held": dict(law=(1.0, 0.0, 1.0, 10.0), uh=(8.0, 2.0), v0=(0.1, 0.02), render="held"),
}


CASE = inspect.signature(yielding)


@functools.cache
def solved(name):
    case = CASE.bind(Ts=Ts, K=GAIN, t_end=SPAN, **CASES[name])
    case.apply_defaults()
    return store.solution(f"yields-{name}", yielding, *case.arguments.values())


def beside(name, ratio):
    """A run with so many steps in a control sample, at the samples."""
    c = dict(along=False, render="physical") | CASES[name]
    s = hc.Scenario(
        clay=everywhere(c["along"], *c["law"]),
        gain=GAIN,
        force=c["uh"],
        dt=Ts / ratio,
        Ts=Ts,
        t_max=SPAN,
        length=None,
        velocity=c["v0"],
        control="sampled",
        render=c["render"],
        stop_when_unstable=False,
        torque_limit=(1e3, 1e3),
    )
    r = hc.simulate(s)
    return r, {x: getattr(r, x)[::ratio] for x in ("p", "v", "fe", "tau")}


@pytest.mark.parametrize("name", CASES)
def test_the_loop_is_that_of_an_event_solver_and_second_order_in_the_step(name):
    x = solved(name)
    P, V, F, T = x.p, x.v, x.fe, x.tau
    errors = []
    for ratio in (4, 16):
        r, at = beside(name, ratio)
        errors.append([np.abs(at["p"] - P).max(), np.abs(at["v"] - V).max()])
        errors[-1].append(np.abs(at["tau"] - T)[:-1].max())
    # at Ts/16 = 0.18 ms; of a motion of 1 to 3 cm at 0.2 m/s under torques of 1 N.m
    assert errors[1][0] < 1e-7 and errors[1][1] < 2e-6 and errors[1][2] < 2e-4
    # a stop falls anywhere in a step, so that not every halving divides its error by four
    assert errors[1][0] < errors[0][0] / 6.0
    # where the handle rests, fe is the mean of that before and after the torques change
    moves = (np.abs(V) > 1e-4).all(axis=1) & (np.arange(len(V)) > 0)
    moves[-1] = False
    assert moves.sum() > 4 and np.abs(at["fe"] - F)[moves].max() < 1e-4 * np.abs(F).max()
    rests = (np.abs(V) < 1e-9) & (np.arange(len(V)) > 1)[:, None]
    if name in ("y rests", "both rest and go on"):
        assert rests.sum() >= 1 and not at["v"][rests].any() and r.stops


def test_physical_clay_tends_to_the_continuous_loop_as_the_samples_get_shorter():
    # the controller is given the force that clay exerts, at rest too; what remains is the hold
    flow = hc.Flow(Fy=3.0, b=20.0)
    error = []
    for dt in (4e-4, 1e-4):
        s = scene(flow, render="physical", dt=dt, t_max=0.15, force=(4.0, 0.0), velocity=(0.1, 0.0))
        a = hc.simulate(s)
        b = hc.simulate(dataclasses.replace(s, control="continuous", render="held"))
        error.append(np.abs(a.p - b.p).max())
    assert error[0] < 2e-4 and error[1] < error[0] / 3.0  # of first order


# ---- held clay
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("flow", [hc.Flow(Fy=2.0, b=30.0), hc.Flow(1.0, 3.0, 0.5, 30.0)])
def test_held_clay_is_the_law_typed_out_bit_for_bit(flow):
    s = dataclasses.replace(scene(flow, along=False), length=None)
    law = [0.01, 0.1, flow.b, flow.Fy, flow.K, flow.n]
    params = [*law, *paper_law.memory(s.gain, s.dt)]
    own = hc.Controller(paper_law.paper_that_yields, [0.0] * 8, params)
    a = hc.simulate(s, engine="python")
    b = hc.simulate(dataclasses.replace(s, controller=own), engine="python")
    for name in ("t", "p", "v", "fh", "tau"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert a.crossings == b.crossings and not a.stops
    inside = np.abs(a.v).min(axis=1) > 0.0
    np.testing.assert_allclose(a.fe[inside][:-1], b.fe[inside][:-1], rtol=1e-11)


def test_held_clay_chatters_where_it_should_hold_and_physical_clay_holds():
    flow = hc.Flow(Fy=3.0, b=5.0)
    kw = dict(force=(1.0, 0.3), start=(0.02, 0.0), gain=(0.0, 0.0))
    held, physical = (hc.simulate(scene(flow, render=x, **kw)) for x in ("held", "physical"))
    late = held.t > 0.2
    assert (np.abs(np.diff(np.sign(held.v[late, 0]))) > 1.0).mean() > 0.3
    assert np.hypot(*held.fe[late].T).min() >= 3.0  # never less: no rest at all
    assert physical.stops and physical.stops[0].axis == "xy" and not held.stops
    guarded = hc.simulate(scene(flow, render="held", parts=hc.Hardware(passivity=True), **kw))
    assert guarded.v[late].min() > 0.0  # it creeps, without chatter


finite = st.floats(-100.0, 100.0)
LAW = st.tuples(
    st.floats(0.0, 1e4), st.one_of(st.just(0.0), st.floats(1e-3, 1e3)), st.floats(0.05, 4.0)
)


@given(
    tool=st.tuples(finite, finite),
    p=st.tuples(finite, finite),
    v=st.tuples(finite, finite),
    b=st.floats(0.0, 1e5),
    law=LAW,
    along=st.booleans(),
    spring=st.floats(1.0, 1e6),
    damper=st.floats(0.1, 1e4),
)
def test_the_tool_of_a_coupling_obeys_the_law_and_takes_energy(  # noqa: PLR0913  # of the law
    tool, p, v, b, law, along, spring, damper
):
    Fy, K, n = law
    u1, u2, f1, f2 = hardware.tool_that_yields(
        tool, p, v, (b, b), law + law, along, (spring, damper), 1e-3
    )
    u, f = np.array([u1, u2]), np.array([f1, f2])
    asked = spring * np.subtract(p, tool) + damper * np.array(v)
    # the coupling pushes the tool as the clay resists it
    big = np.abs(asked).max() + 1e-300
    np.testing.assert_allclose(asked - (damper + 1e-3 * spring) * u, f, atol=1e-9 * big)
    assert u @ f >= 0.0
    size = np.hypot(*u) if along else np.abs(u)
    with np.errstate(over="ignore"):
        most = Fy + K * size**n + b * size
    got = np.hypot(*f) if along else np.abs(f)
    assert np.all(got <= most * (1.0 + 1e-9) + 1e-300)  # at rest up to Fy, else the law


def test_a_tool_at_rest_is_held_by_the_clay_and_the_handle_by_the_coupling():
    coupling = hc.Coupling(3000.0, 60.0)
    kw = dict(force=(2.0, 0.0), start=(0.02, 0.0), gain=(0.0, 0.0), t_max=1.5, dt=1e-3)
    for along in (True, False):
        r = hc.simulate(
            scene(hc.Flow(Fy=3.0), along, hc.Hardware(coupling=coupling), **kw),
        )
        # the servo's spring bears its part; the coupling's deflection, what is left over
        np.testing.assert_allclose(r.fe[-1, 0], 3000.0 * (r.p[-1, 0] - 0.02), rtol=1e-6)
        assert 0.5 < r.fe[-1, 0] < 2.0 and np.abs(r.v[-1]).max() < 1e-6


# ---- rest
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("along", [True, False])
@pytest.mark.parametrize("dt", [3.6e-4, 1e-2, 1e-5])
@pytest.mark.parametrize("parts", [None, hc.Hardware(friction=(0.05, 0.02))])
def test_clay_that_holds_the_handle_leaves_no_motion_at_all(along, dt, parts):
    kw = dict(force=(1.0, 0.5), velocity=(0.02, 0.008), start=(0.02, 0.0), gain=(0.0, 0.0))
    s = scene(hc.Flow(Fy=9.0, b=5.0), along, parts, render="physical", dt=dt, **kw)
    r = hc.simulate(dataclasses.replace(s, t_max=max(60.0 * dt, 0.005), operator=hc.Operator()))
    held = r.t > max(x.start for x in r.stops) + dt
    assert held.sum() > 5 and not r.v[held].any() and not r.qd[held].any()
    assert np.ptp(r.p[held], axis=0).max() == 0.0
    assert all(x.end is None for x in r.stops)
    assert np.abs(r.fe[held]).max() <= 9.0 * (1.0 + 1e-12)


def test_the_sensor_shows_the_whole_push_of_a_hand_at_rest():
    shown = []

    def law(t, q, qd, fh, state, params):
        shown.append(fh)
        return (0.0, 0.0), state

    hand = hc.Operator(2.0, 10.0, 50.0)
    s = scene(hc.Flow(Fy=9.0), render="physical", start=(0.02, 0.0), force=(3.0, 1.0), t_max=0.01)
    s = dataclasses.replace(s, controller=hc.Controller(law), operator=hand)
    r = hc.simulate(s, engine="python")
    assert not r.v.any()
    np.testing.assert_allclose(shown, np.tile([3.0 - 50.0 * 0.02, 1.0], (len(shown), 1)), rtol=1e-9)
    np.testing.assert_allclose(r.fe[1:], shown[: len(r.fe) - 1], rtol=1e-9)


# ---- friction of the joints
# ------------------------------------------------------------------------------------------


def started(**kw):
    """A run in clay that yields, before its first step."""
    s = scene(hc.Flow(Fy=2.0), False, hc.Hardware(friction=(0.3, 0.2)), render="physical", **kw)
    return Run(dataclasses.replace(s, start=(0.02, 0.0)), 1)


def first_kick(run, friction, Fy, tau, w):
    """Its first kick, with joint rates w before it, under torques."""
    m, s, k = run.row.m, run.row.s, records.Kick()
    m.friction, m.slip[:] = int(friction is not None), friction or (0.0, 0.0)
    for z in s.axis:
        z.Fy, z.Kn, z.n = z.old_Fy, z.old_Kn, z.old_n = Fy, 0.0, 1.0
    s.w[0], s.w[1] = w
    s.now.tau[:2] = tau
    sampled.across(m, s, k, m.dt)
    return k


@given(
    t=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    w=st.sampled_from([(0.0, 0.0), (0.3, -0.2), (-0.001, 0.002)]),
    Fy=st.floats(0.0, 6.0),
)
def test_friction_and_clay_are_the_least_kinetic_energy_within_both(t, w, Fy):
    run = started()

    def kick(t):
        k = first_kick(run, None, 0.0, t, w)
        return np.array([k.w[0], k.w[1]])

    free = kick(t)
    A = np.column_stack([kick((t[0] + 1.0, t[1])) - free, kick((t[0], t[1] + 1.0)) - free])
    u = np.reshape(first_kick(run, None, 0.0, t, w).u, (2, 2))  # of both links
    J = np.array([[u[0, 0] + u[1, 0], u[1, 0]], [u[0, 1] + u[1, 1], u[1, 1]]])
    k = first_kick(run, (0.3, 0.2), Fy, t, w)
    after = np.array([k.w[0], k.w[1]])
    # rates after the kick: free + A (friction - J' clay), of least energy w' A^-1 w
    half = np.linalg.cholesky(np.linalg.inv(A)).T
    G, most = np.column_stack((A, -A @ J.T)), np.array([0.3, 0.2, Fy + 1e-12, Fy + 1e-12])
    best = lsq_linear(half @ G, -half @ free, (-most, most), tol=1e-14, method="bvls")
    expected = free + G @ best.x
    if any(w):  # a kick that stops on the way, and turns, is no single implicit step
        v0, v1 = J @ w, J @ expected
        turned = any(np.any(v0 * x < 0) for x in (v1, J @ free, J @ after))
        if turned:
            return
    np.testing.assert_allclose(after, expected, atol=1e-9 * (1.0 + np.abs(free).max()))
    if np.abs(expected).max() < 1e-13 and Fy > 1e-3 and best.optimality < 1e-12:
        assert np.abs(k.slip[0]) <= 0.3 and np.abs(k.slip[1]) <= 0.2


def test_friction_beside_clay_elsewhere_is_that_without_it():
    # the same motion by the two ways to friction: in a scene that yields, and in one that does not
    kw = dict(render="physical", t_max=0.2, start=(0.02, 0.0), velocity=(0.1, 0.05))
    parts = hc.Hardware(friction=(0.05, 0.02))
    a = scene(hc.Flow(b=20.0), False, parts, **kw)
    edges = a.clay.x.edges
    flows = tuple([0.0] * len(edges) + [0.0, 9.0])
    b = hc.Profile((*edges, 5.0), (*a.clay.x.values, 0.0), Fy=flows)
    b = dataclasses.replace(a, clay=hc.Clay(b, b))
    assert b.clay.yields
    a, b = hc.simulate(a), hc.simulate(b)
    np.testing.assert_allclose(a.p, b.p, atol=1e-13)
    np.testing.assert_allclose(a.energy["friction"], b.energy["friction"], rtol=1e-9)


# ---- energy
# ------------------------------------------------------------------------------------------


@settings(examples(15), suppress_health_check=[HealthCheck.too_slow])
@given(
    Fy=st.floats(0.0, 30.0),
    K=st.sampled_from([0.0, 0.5, 20.0]),
    n=st.sampled_from([0.23, 0.5, 1.0, 2.0]),
    b=st.sampled_from([0.0, 10.0, 300.0, 1e5]),
    along=st.booleans(),
    force=st.tuples(st.integers(-20, 20), st.integers(-20, 20)),
    velocity=st.tuples(st.integers(-30, 30), st.integers(-30, 30)),
    ratio=st.sampled_from([1, 3]),
    friction=st.sampled_from([None, (0.05, 0.02)]),
)
def test_physical_clay_takes_energy_and_the_ledger_closes(  # noqa: PLR0913  # a random scene
    Fy, K, n, b, along, force, velocity, ratio, friction
):
    s = hc.Scenario(
        clay=everywhere(along, Fy, K, n, b),
        force=force,
        velocity=(0.01 * velocity[0], 0.01 * velocity[1]),
        dt=TS,
        Ts=ratio * TS,
        control="sampled",
        render="physical",
        t_max=0.025,
        length=None,
        stop_when_unstable=False,
        torque_limit=(50.0, 50.0),
        hardware=hc.Hardware(friction=friction) if friction else None,
    )
    r = hc.simulate(s)
    e = r.energy
    # to rounding of the sums; what is below 1e-20 J is none
    assert abs(e["residual"]) <= 1e-11 * (e["throughput"] + abs(e["kinetic"])) + 1e-20
    # the ledger multiplies the mean force of a kick by its mean velocity: where the handle stops or
    # turns within one, at a speed of at most W F dt, that is off by up to W (F dt)^2
    F = np.abs(r.fe).max() + np.hypot(*force)
    turns = 2 * len(r.stops) + 2 + (np.diff(np.sign(r.v), axis=0) != 0).sum()
    assert e["clay"] >= -turns * (F * TS) ** 2 - 1e-12 * e["throughput"]
    if not r.stops and not (np.diff(np.sign(r.v), axis=0) != 0).any():
        assert e["clay"] >= -1e-12 * e["throughput"]


# ---- engines
# ------------------------------------------------------------------------------------------

WEAK, PASTE = hc.Flow(Fy=1.5, b=20.0), hc.Flow(0.5, 2.0, 0.4, 10.0)
SCENES = {
    "held": (WEAK, True, None, {}),
    "held by axis": (PASTE, False, None, dict(operator=hc.Operator())),
    "physical": (WEAK, True, None, dict(render="physical", operator=hc.Operator())),
    "physical by axis": (PASTE, False, None, dict(render="physical", Ts=3 * TS)),
    "at rest": (hc.Flow(Fy=6.0), False, None, dict(render="physical", velocity=(0.1, 0.05))),
    "stiff": (hc.Flow(Fy=2.0, b=1e5), True, None, dict(render="physical")),
    "all": (WEAK, False, hc.Hardware(**ALL), dict(operator=hc.Operator())),
    "all, along": (PASTE, True, hc.Hardware(**ALL), {}),
    "all, physical": (WEAK, False, hc.Hardware(**PHYSICAL), dict(render="physical")),
    "all, stiff": (hc.Flow(1.0, 2.0, 0.5, 1e5), True, hc.Hardware(**PHYSICAL),
                   dict(render="physical", operator=hc.Operator())),
}  # fmt: skip


def named(name):
    flow, along, parts, kw = SCENES[name]
    return scene(flow, along, parts, **kw)


@pytest.mark.parametrize("name", ["physical by axis", "at rest", "all", "all, physical"])
def test_step_by_step_and_in_a_batch_it_is_the_run(name):
    s = dataclasses.replace(named(name), start=(0.0095, 0.0), t_max=0.04)
    whole = hc.simulate(s, engine="python")
    assert whole.crossings and np.ptp(whole.p, axis=0).min() > 1e-5
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            _ = sim.state  # a look ahead changes nothing
            sim.step()
    r = sim.record()
    for x in ("p", "v", "fe", "tau"):
        np.testing.assert_array_equal(getattr(r, x), getattr(whole, x), err_msg=x)
    assert r.stops == whole.stops
    (batch,) = hc.simulate_batch([s])
    np.testing.assert_array_equal(batch.p, whole.p)
    assert batch.stops == whole.stops


def test_rotated_axes_by_its_own_axes_is_that_along_x_and_y_seen_from_elsewhere():
    # along the motion, the angle of the axes makes no difference
    s = scene(hc.Flow(Fy=2.0, b=30.0), render="physical", velocity=(0.1, 0.03), t_max=0.15)
    turned = dataclasses.replace(s, clay=dataclasses.replace(s.clay, angle=0.7))
    a, b = hc.simulate(s), hc.simulate(turned)
    np.testing.assert_allclose(a.p, b.p, atol=1e-12)
    np.testing.assert_allclose(a.fe[1:-1], b.fe[1:-1], atol=1e-8)
    held, other = (hc.simulate(dataclasses.replace(x, render="held")) for x in (s, turned))
    np.testing.assert_allclose(held.p, other.p, atol=1e-10)
