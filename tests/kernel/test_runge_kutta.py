"""The accurate integrator: fourth order, by the laws of the loop."""

import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import arm, controller
from hapticclay.kernel import arm as arms
from hapticclay.kernel import instant
from hapticclay.model.operator import NO_HAND, Operator
from hapticclay.simulation.run import Run
from tests.oracles import laws, nonlinear, piecewise_linear, store
from tests.oracles.links import Links

EDGES = (0.05, 0.15, 0.20)
CASES = {
    "plain": dict(),
    "shaped": dict(inertia_shaping=True),
    "hand": dict(operator=hc.Operator(), force=(2.0, 0.0)),
    "off axis": dict(force=(1.0, 0.3)),
}


@pytest.mark.parametrize("name", CASES)
def test_fourth_order_and_1e_9_s_at_2_ms(name):
    s = hc.constant_cut(integrator="accurate", **CASES[name])
    th = (0.25, 2.0, 6.0) if s.operator else None
    grid = np.arange(1, 15_000) * 4e-3  # in every dt below
    exact = store.solution(
        f"fourth-order-{name}", nonlinear, (0, 90, 0), EDGES, s.gain, s.force, th,
        s.inertia_shaping, 60.0, grid, 1e-13, 1e-15,
    )  # fmt: skip
    steps, border, place = np.array([4e-3, 2e-3, 1e-3]), [], []
    for dt in steps:
        r = hc.simulate(dataclasses.replace(s, dt=float(dt)))
        border.append(np.max(np.abs(np.array([c.time for c in r.crossings]) - exact.crossings)))
        i = np.rint(exact.t / dt).astype(int)
        place.append(np.max(np.abs(r.p[i] - exact.p)))
    assert border[1] < 1e-9 and place[1] < 1e-8
    for error in (border, place):
        assert 3.6 < np.polyfit(np.log(steps), np.log(error), 1)[0] < 4.6, error


def test_agrees_with_the_fast_integrator_in_everything_recorded():
    kw = dict(operator=hc.Operator(), force=(2.0, 0.2), t_max=1.0)
    a, b = (
        hc.simulate(hc.constant_cut(**kw)),
        hc.simulate(hc.constant_cut(integrator="accurate", **kw)),
    )
    away = np.min(np.abs(a.t[:, None] - [c.time for c in a.crossings]), axis=1) > 1e-3
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.b, b.b)
    for name, scale in dict(
        p=1e-7, v=1e-4, fh=1e-2, fe=1e-2, q=1e-6, qd=1e-3, tau=1e-2, delta=1e-7
    ).items():
        np.testing.assert_allclose(
            getattr(a, name)[away], getattr(b, name)[away], atol=scale, err_msg=name
        )
    for name in a.energy:
        assert a.energy[name] == pytest.approx(b.energy[name], abs=1e-5), name
    assert a.crossings[0].speed == pytest.approx(b.crossings[0].speed, rel=1e-5)


def test_residual_of_the_energy_converges_at_fourth_order():
    steps, rest = np.array([2e-3, 1e-3, 5e-4]), []
    for dt in steps:
        e = hc.simulate(
            hc.constant_cut(
                integrator="accurate", dt=float(dt), operator=hc.Operator(), force=(2.0, 0.0)
            )
        ).energy
        rest.append(abs(e["residual"]) / e["throughput"])
    assert rest[-1] < 1e-8 and 3.5 < np.polyfit(np.log(steps), np.log(rest), 1)[0] < 4.5, rest


def test_free_path_and_a_last_step_that_is_shorter():
    exact, position = piecewise_linear((0.20,), (0.0,), 1.0, 1.0)
    r = hc.simulate(hc.free(inertia_shaping=True, integrator="accurate", dt=2e-3))
    assert r.crossings[0].time == pytest.approx(exact[0], abs=1e-10)
    r = hc.simulate(hc.free(inertia_shaping=True, integrator="accurate", dt=2e-3, t_max=0.1234567))
    assert r.t[-1] == 0.1234567 and r.p[-1, 0] == pytest.approx(position(r.t[-1:])[0], abs=1e-10)


def test_stiffness_takes_more_steps_and_then_is_refused():
    s = hc.constant_cut(integrator="accurate", b=1e4, dt=1e-3, t_max=1.0)
    r, f = hc.simulate(s), hc.simulate(dataclasses.replace(s, integrator="fast", dt=1e-4))
    assert r.steps > 15_000
    assert r.p[-1, 0] == pytest.approx(f.p[-1, 0], abs=1e-7)
    for stiff in (
        dict(clay=hc.constant_cut(b=1e9).clay),
        dict(operator=Operator(0.0, 0.0, 1e9), dt=0.02),
    ):
        with pytest.raises(ParameterError, match="explicit.*choose 'fast'"):
            hc.simulate(dataclasses.replace(s, **stiff))


def test_the_control_callback_of_a_stranger_is_respected():
    def mine(model, data):
        return None

    mujoco.set_mjcb_control(mine)
    try:
        for integrator in ("fast", "accurate"):
            with pytest.raises(ParameterError, match="mjcb_control"):
                hc.simulate(hc.free(integrator=integrator))
        assert mujoco.get_mjcb_control() is mine
    finally:
        mujoco.set_mjcb_control(None)


def test_instability_is_a_result_here_too():
    r = hc.simulate(hc.constant_cut(gain=(1.0, 1.0), integrator="accurate", dt=1e-3))
    assert (r.outcome.code, r.outcome.axis) == ("diverged", "y")
    assert np.all(np.isfinite(r.p))


def test_both_integrators_step_one_model():
    fast, accurate = (hc.build(hc.constant_cut(integrator=x)) for x in ("fast", "accurate"))
    assert fast.na == accurate.na == 0 and fast.nu == accurate.nu == 4


unit = st.floats(-1.0, 1.0)
OTHER = dict(  # parts that have nothing in common with the paper's
    arm=hc.Arm(0.3, 0.25, 0.05, 0.4),
    servo=(
        hc.Servo(hc.SecondOrder(500.0, 30.0, 800.0), hc.SecondOrder(1.3, 25.0, 300.0)),
        hc.Servo(hc.SecondOrder(900.0, 55.0, 600.0), hc.SecondOrder(0.2, 40.0, 700.0)),
    ),
)
HANDS = Operator(0.4, 3.0, 5.0), Operator(0.1, 7.0, 20.0)
ZEROS = (
    hc.Compensator((0.3, 2.0), (1.0, 12.0, 0.0)),
    hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)),
)
STAGES = CASES | {
    "weak": dict(torque_limit=(0.2, 0.1)),
    "other": OTHER,
    "two hands": dict(operator=HANDS, **OTHER),
    "hand on y": dict(operator=(None, HANDS[1]), inertia_shaping=True, **OTHER),
    "formed": dict(compensator=ZEROS),
    "all": dict(compensator=ZEROS, operator=HANDS, **OTHER),
}


@given(
    st.sampled_from([*STAGES]),
    st.tuples(*[unit] * 18),
    st.floats(0.0, 100.0),
    st.integers(0, 1),
)
def test_a_stage_is_what_its_laws_say(name, x, b, held):
    """Put together from the laws, a stage is the same to rounding."""
    s = dataclasses.replace(hc.constant_cut(integrator="accurate"), **STAGES[name])
    s = dataclasses.replace(s, operator=s.operator or (hc.Operator() if held else None))
    row, links = Run(s, 1).row, s.arm.links
    m, z, now = row.m, row.s.a.z, row.s.a.now
    row.s.x.b = row.s.y.b = b
    (q1, q2), (w1, w2) = (row.s.q[0], row.s.q[1]), x[:2]
    z.q1, z.q2, z.w1, z.w2 = q1, q2, w1, w2
    dx, dy, ex, ey, yx, yy, ydx, ydy = (0.1 * each for each in x[2:10])
    z.x.delta, z.x.rate, z.x.y, z.x.yrate = dx, ex, yx, ydx
    z.y.delta, z.y.rate, z.y.y, z.y.yrate = dy, ey, yy, ydy
    if m.formed:
        states = [0.1 * each for each in x[10:18]]
        states[s.compensators[0].order : 4] = [0.0] * (4 - s.compensators[0].order)
        states[7] = 0.0
        z.x.z[:], z.y.z[:] = states[:4], states[4:]
    instant.evaluate(m, row.s, z, 0.0, -1, now)
    hands = [th or NO_HAND for th in s.operators]
    u = arm.jacobian(q1, q2, links)
    p = (Links(*links[:4]).forward((q1, q2)) - s.origin).tolist()
    v, c = arm.handle_velocity(w1, w1 + w2, u), arm.centripetal(w1, w1 + w2, u)
    W = (
        [s.servo[0].S.gain, 0.0, s.servo[1].S.gain]
        if s.inertia_shaping
        else [*arm.mobility(u, links)]
    )
    fe = b * v[0], b * v[1]
    a, hand, shown, feed = [], [], [dx, dy], [0.0, 0.0]
    for i, (y, yd) in enumerate(((yx, ydx), (yy, ydy))):
        th, servo = hands[i], s.servo[i]
        if m.formed:
            _, _, C, D = s.compensators[i].state_space()
            shown[i] += C @ z.axis[i].z[: len(C)]
            feed[i] = s.gain[i] * D
            W[2 * i] += servo.G.gain * feed[i]  # a force moves delta, and delta the reference
        ydd = servo.G.gain * shown[i] - servo.G.stiffness * y - servo.G.damping * yd
        k, d = servo.S.stiffness, servo.S.damping
        a.append(laws.servo_acceleration(1.0, -d, k, (yd, ydd), v[i], y, p[i], c[i]))
        law = controller.feedback_law(servo.numbers, shown[i], y, yd, p[i], v[i], c[i])
        np.testing.assert_allclose(law, (a[i], ydd), rtol=1e-12, atol=1e-11)
        resists = th.spring * p[i] - th.mass * c[i] + th.damper * v[i]
        hand.append(s.force[i] - resists)
    net = hand[0] - fe[0], hand[1] - fe[1]
    mass = hands[0].mass, hands[1].mass
    out = laws.servo_kick(
        1.0, (0.0, 0.0), u, links, ((1.0, 1.0), a, W), (net, mass), s.torque_limit
    )
    fh = out[4] + fe[0], out[5] + fe[1]
    delta = shown[0] + feed[0] * out[4], shown[1] + feed[1] * out[5]
    expected = (*p, *v, *fh, *out[6:8], *delta)
    k, of_x, of_y = row.s.k, now.x, now.y
    sample = k.x.p, k.y.p, k.x.v, k.y.v, of_x.fh, of_y.fh, now.tau1, now.tau2
    sample = *sample, of_x.shown, of_y.shown
    np.testing.assert_allclose(sample, expected, rtol=1e-11, atol=1e-11)


@given(
    st.sampled_from([*STAGES]), st.tuples(*[unit] * 4), st.floats(0.0, 100.0), st.floats(0.0, 100.0)
)
def test_the_joints_accelerate_as_in_mj_forward(name, x, bx, by):
    """Its dampers and motors act there; the method applies their torques itself."""
    s = dataclasses.replace(hc.constant_cut(integrator="accurate"), **STAGES[name])
    row = Run(s, 1).row
    q = 1.2 + x[0], -1.5 + x[1]
    z, now = row.s.a.z, row.s.a.now
    (z.q1, z.q2), (z.w1, z.w2) = q, x[2:]
    for axis, start in zip(z.axis, row.s.axis, strict=True):
        axis.z[:] = start.z
    row.s.x.b, row.s.y.b = bx, by
    instant.evaluate(row.m, row.s, z, 0.0, -1, now)
    found, tau, fh = arms.accelerations(row.m, z, now), (now.tau1, now.tau2), (now.x.fh, now.y.fh)
    model = hc.build(s)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, x[2:], (*tau, bx, by)
    u = arm.jacobian(*q, s.arm.links)  # type: ignore[call-arg]
    data.qfrc_applied[:] = arm.joint_torques(*fh, u)
    mujoco.mj_forward(model, data)
    scale = np.abs(data.qacc).max() + np.abs(fh).max() * 10.0
    # rounding, 1e-16, times the condition of the inertia, up to 1e2, and the forces that cancel
    np.testing.assert_allclose(found, data.qacc, rtol=0.0, atol=1e-12 * (1.0 + scale))


def test_the_choice_is_checked():
    with pytest.raises(ParameterError, match="did you mean 'accurate'"):
        hc.constant_cut(integrator="acurate")  # type: ignore[arg-type]
