"""The kick: what it works out, and what the engine makes of it."""

import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.formulas import arm, damping
from hapticclay.kernel import arm as arms
from hapticclay.kernel import kick, path
from hapticclay.model.operator import NO_HAND, Operator
from hapticclay.simulation import run as runs
from hapticclay.simulation.run import Run
from tests.oracles import Arm, laws
from tests.oracles.links import Links

OTHER = dict(  # parts that have nothing in common with the paper's
    arm=hc.Arm(0.3, 0.25, 0.05, 0.4),
    servo=(
        hc.Servo(hc.SecondOrder(500.0, 30.0, 800.0), hc.SecondOrder(1.3, 25.0, 300.0)),
        hc.Servo(hc.SecondOrder(900.0, 55.0, 600.0), hc.SecondOrder(0.2, 40.0, 700.0)),
    ),
)
HANDS = Operator(0.4, 3.0, 5.0), Operator(0.1, 7.0, 20.0)
ZEROS = (  # with a zero, an output at once, complex poles; with an integrator on x alone
    hc.Compensator((0.3, 2.0), (1.0, 12.0, 0.0)),
    hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)),
)


def cut(**parts):
    return dataclasses.replace(hc.constant_cut(t_max=1.0), **parts)


CASES = {
    "plain": hc.constant_cut(t_max=1.0),
    "shaped": hc.constant_cut(t_max=1.0, inertia_shaping=True, force=(1.0, 0.3)),
    "hand": hc.constant_cut(t_max=1.0, operator=hc.Operator(), force=(2.0, 0.0)),
    "stiff": hc.constant_cut(t_max=1.0, b=1e6),
    "heavy hand": dataclasses.replace(
        hc.constant_cut(t_max=1.0), operator=Operator(100.0, 10.0, 1e5)
    ),
    "weak motors": hc.constant_cut(t_max=1.0, torque_limit=(0.2, 0.1)),
    "free": hc.free(t_max=1.0),
    "other": cut(force=(1.0, 0.3), **OTHER),
    "two hands": cut(operator=HANDS, force=(2.0, 0.3), **OTHER),
    "hand on y": cut(operator=(None, HANDS[1]), inertia_shaping=True, **OTHER),
    "formed": cut(compensator=ZEROS, force=(1.0, 0.3)),
    "all": cut(compensator=ZEROS, operator=HANDS, **OTHER),
}
NEAR = {  # the same, short of the border but for the heavy hand, which would tear itself away
    name: dataclasses.replace(s, t_max=0.3, start=(0.0 if name == "heavy hand" else 0.045, 0.0))
    for name, s in CASES.items()
}
unit = st.floats(-1.0, 1.0)


def held(compensator, h, z, f):
    """State of a compensator after a time in which the force is held, by the matrix exponential."""
    A, B, _, _ = compensator.state_space()
    n = len(B)
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A, B
    return (expm(h * M) @ (*z, f))[:n]


def kick_by_laws(run, before, after):
    """One kick put together from the laws, as docs/equations.md has it; motors without limits.

    Returns velocity, net force, torques, rates of the reference model, delta, and states of the
    compensator after it.
    """
    s, state = run.scenario, run.row.s
    H, L, R = (0.5 * (before + after), before / (before + after), after / (before + after))
    formed = run.row.m.formed
    hands, links = [th or NO_HAND for th in s.operators], s.arm.links
    q, w1, w2, g1, g2 = state.q[:2], *state.w[:2], *state.g[:2]
    u = arm.jacobian(*q, links)
    p = Links(*links[:4]).forward(q) - s.origin
    v = arm.handle_velocity(w1, w1 + w2, u)
    c = arm.centripetal(w1 + 0.5 * before * g1, w1 + w2 + 0.5 * before * g2, u)
    W = (
        [s.servo[0].S.gain, 0.0, s.servo[1].S.gain]
        if s.inertia_shaping
        else [*arm.mobility(u, links)]
    )
    b = run.b()
    trace = s.arm.l1**2 / s.arm.I1 + s.arm.l2**2 / s.arm.I2
    Wmost = trace / (1.0 + min(th.mass for th in hands) * trace)
    dampers = [th.damper for th in hands]
    b0x, b1x, b0y, b1y, stiff, *_ = damping.split_damping(b, b, H, L, R, Wmost, *dampers)
    assert not stiff
    f, d, n, a, feed, rate = [], [], [], [], [], []
    for i in (0, 1):
        th, compensator, K = hands[i], s.compensators[i], s.gain[i]
        axis = state.axis[i]
        delta, yi, ydi = axis.delta, axis.y, axis.yrate
        ratio = s.servo[i].G.gain / s.servo[i].G.stiffness
        keep, take, ni, mi, spring = laws.servo_weights(s.servo[i], H, L, R)
        feed.append((0.0, 0.0))
        if formed:  # what it shows at the sample without the force of the kick, and per N
            _, B, C, D = compensator.state_space()
            z = axis.z[: compensator.order]
            delta += C @ held(compensator, 0.5 * before, z, 0.0)
            # held between equal steps; between others, one impulse at the sample
            moved = held(compensator, 0.5 * before, 0.0 * np.array(z), 1.0)
            moved = moved if before == after else 0.5 * after * B
            feed[i] = K * (C @ moved + D), take
            W[2 * i] += ni * take * ratio * feed[i][0]
        vr = keep * ydi + take * (ratio * delta - yi)
        a.append(laws.servo_acceleration(ni, mi, spring, (ydi, vr), v[i], yi, p[i], c[i]))
        n.append(ni)
        rate.append([vr, delta, ratio])
        mass = th.mass + 0.25 * th.spring * H * H
        th0, th1 = th.damper * L - mass / H, th.damper * R + mass / H
        f.append(s.force[i] - (b0x, b0y)[i] * v[i] - (th.spring * p[i] - mass * c[i] + th0 * v[i]))
        d.append((b1x, b1y)[i] + th1)
    ux, uy, _, _, *ff, t1, t2 = laws.servo_kick(H, v, u, links, (n, a, W), (f, d))
    each = list(zip(rate, feed, ff, strict=True))
    rates = [vr + take * ratio * e * x for (vr, _, ratio), (e, take), x in each]
    shown = [delta + e * x for (_, delta, _), (e, _), x in each]
    states = []
    for i, compensator in enumerate(s.compensators):
        if formed:
            z = state.axis[i].z[: compensator.order]
            drive, B = s.gain[i] * ff[i], compensator.state_space()[1]
            if before == after:
                states += [*held(compensator, H, z, drive)]
            else:
                kicked = held(compensator, 0.5 * before, z, 0.0) + H * B * drive
                states += [*held(compensator, 0.5 * after, kicked, 0.0)]
        else:
            keep, take = laws.trapezoid(compensator.den[1], H, L, R)
            states.append(keep * state.axis[i].rate + take * s.gain[i] * ff[i])
    return (ux, uy), ff, (t1, t2), rates, shown, states


@given(
    st.sampled_from(
        ["plain", "shaped", "hand", "free", "other", "two hands", "hand on y", "formed", "all"]
    ),
    st.tuples(*[unit] * 18),
    st.floats(0.1, 1.0),
    st.none() | st.floats(0.1, 1.0),
)
def test_the_kick_is_what_its_laws_say(name, x, before, after):
    """A kick put together from the laws of the model one by one is the same to rounding."""
    after = before if after is None else after
    s = dataclasses.replace(CASES[name], torque_limit=(1e6, 1e6))
    run = Run(s, 1)
    m, state = run.row.m, run.row.s
    orders = [c.order for c in s.compensators]
    assert m.formed == (name in ("formed", "all"))
    for i, axis in enumerate(state.axis):
        axis.delta, axis.rate, axis.y, axis.yrate = (0.1 * a for a in x[2 + 4 * i : 6 + 4 * i])
        if m.formed:
            axis.rate = 0.0
            axis.z[: orders[i]] = [0.1 * a for a in x[10 + 4 * i :][: orders[i]]]
    before, after = before * s.dt, after * s.dt
    state.before, state.w[:2] = before, x[:2]
    u, f, tau, rates, shown, states = kick_by_laws(run, before, after)
    k = state.k
    kick.by_servo(m, state, k, after)
    if m.formed:
        own = [k.axis[i].z[j] for i in (0, 1) for j in range(orders[i])]
    else:
        own = [k.x.next_rate, k.y.next_rate]
    delta = kick.shown_delta(k, 0), kick.shown_delta(k, 1)
    found = (k.x.u, k.y.u), (k.x.net, k.y.net), (k.tau[0], k.tau[1])
    found = *found, (k.x.next_yrate, k.y.next_yrate), delta, own
    for a, b, what in zip(found, (u, f, tau, rates, shown, states), "uftrds", strict=True):
        # 1/dt = 2800 multiplies roundings of the velocity
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11, err_msg=what)


@pytest.mark.parametrize("name", CASES)
def test_engine_does_what_the_kick_foretold(name, monkeypatch):
    """The rates after each engine step are those worked out."""
    worst = 0.0
    plain = arms.step_engine

    def stepped(m, s, k, h, even):
        nonlocal worst
        plain(m, s, k, h, even)
        worst = max(worst, abs(s.w[0] - k.w[0]), abs(s.w[1] - k.w[1]))

    monkeypatch.setattr(arms, "step_engine", stepped)
    hc.simulate(NEAR[name], engine="python")
    assert 0.0 < worst < 1e-11  # rounding of a 2x2 solve, conditioned by b dt/Lambda = 4e2 at most


@pytest.mark.parametrize("name", CASES)
def test_steps_that_glide_are_those_with_a_look_at_their_end(name, monkeypatch):
    s = dataclasses.replace(NEAR[name], dt=7.2e-4)
    gliding = hc.simulate(s, engine="python")
    monkeypatch.setattr(path, "whole_steps", lambda m, s, room: None)
    careful = hc.simulate(s, engine="python")
    for field in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"):
        np.testing.assert_array_equal(getattr(gliding, field), getattr(careful, field), field)
    assert gliding.energy == careful.energy and gliding.crossings == careful.crossings


@pytest.mark.parametrize("name", ["plain", "shaped", "weak motors"])
def test_recorded_clay_force_is_what_changed_the_engines_momentum(name, monkeypatch):
    """M dqd/dt - tau - J' fh, from the engine's own state, is -J' fe."""
    states = []
    step = mujoco.mj_implicit  # the last piece of a step

    def spy(model, data):
        before = (data.qpos.copy(), data.qvel.copy(), data.ctrl[:2].copy())
        step(model, data)
        states.append((*before, data.qvel.copy(), model.opt.timestep))

    monkeypatch.setattr(mujoco, "mj_implicit", spy)
    monkeypatch.setattr(runs, "_idle", [])  # engines that call the plain one
    s = dataclasses.replace(CASES[name], t_max=0.7)
    r = hc.simulate(s, engine="python")
    whole = [x for x in states if x[4] == s.dt]
    assert len(whole) > 1800
    rows = {tuple(q): i for i, q in enumerate(r.q)}
    checked = 0
    for q, w, tau, w1, h in whole:
        i = rows.get(tuple(q))
        if i is None or i == 0 or np.any(r.b[i - 1] != r.b[i]) or np.any(r.b[i - 2] != r.b[i]):
            continue  # the start and the two samples beside a border have kicks of another length
        fe = r.fh[i] - np.linalg.solve(Arm.jacobian(q).T, Arm.M @ (w1 - w) / h - tau)
        np.testing.assert_allclose(fe, r.fe[i], atol=2e-9)  # eps * q / h^2
        checked += 1
    assert checked > 1800
    assert np.max(np.abs(r.fe)) > 1.0


def test_engine_never_sees_more_than_the_motors_can_give():
    r = hc.simulate(CASES["weak motors"])
    limit = np.array([0.2, 0.1])
    assert np.all(np.abs(r.tau) <= limit)
    assert np.any(np.abs(r.tau) == limit)


@pytest.mark.parametrize("name", CASES)
def test_a_run_in_python_holds_no_numpy_numbers(name):
    """They are several times slower in CPython, and divide by zero without an error."""
    run = Run(NEAR[name], 1)
    run.go(None)
    assert {type(x) for x in numbers_in(run.row.s)} == {int, float}
    assert {type(x) for x in numbers_in(run.row.m)} == {int, float}


def numbers_in(record):
    """All numbers in a record."""
    for name, kind in type(record).kinds.items():
        x = getattr(record, name)
        for each in x if kind.n else [x]:
            if kind.is_record:
                yield from numbers_in(each)
            elif not kind.is_place:
                yield each


def test_a_kick_counts_half_of_the_clay_on_either_side_and_all_of_the_muscle():
    row = Run(dataclasses.replace(CASES["hand"], operator=None), 1).row
    m, s, k = row.m, row.s, row.s.k
    s.x.b, s.y.b = s.x.old, s.y.old = 8.0, 6.0
    kick.begin(k, 1e-3, 1e-3)
    kick.take_over(m, s, k)
    arms.handle_at(m, k, s.q[0], s.q[1], 0.0, 0.0)
    kick.load(m, s, k)
    assert (k.x.b0, k.y.b0, k.x.b1, k.y.b1) == (4.0, 3.0, 4.0, 3.0)
    assert (k.L, k.x.uh, k.y.uh) == (0.5, 2.0, 0.0)
    assert k.splits == 0.0 and (k.x.d, k.y.d, k.dxy) == (4.0, 3.0, 0.0)
