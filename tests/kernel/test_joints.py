"""Runs of arms from files beside the closed form, SciPy, a QP solver, dense matrices, their law."""

import math
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import hapticclay as hc
from hapticclay.formulas import arm as arm_law
from hapticclay.kernel import engine, joint_friction, joints, records
from tests.oracles import joint_motion, store

HAND = hc.Operator(0.3, 2.0, 6.0)
WALL = hc.Profile((0.006,), (0.0, 5.0), springs=(hc.Spring(), hc.Spring(k=800.0)))


def plain(card, **kw):
    """An arm of the package without Coulomb friction."""
    return hc.MjcfArm(card, friction=[0.0] * len(hc.MjcfArm(card).names), **kw)


def scene(arm, law, Ts=1e-3, ratio=1, **kw):
    """A run of an arm without forces."""
    common = dict(t_max=0.2, force=(0.0, 0.0), stop_when_unstable=False)
    return hc.Scenario(arm=arm, controller=law, Ts=Ts, dt=Ts / ratio, **(common | kw))


# ---- the arm in closed form ----------------------------------------------------------------------

BASE = hc.Scenario()
POSE = arm_law.inverse_kinematics(*BASE.origin, hc.Arm().links)
AIM = POSE[0] - 0.12, POSE[1] + 0.1


def to_aim(t, q, qd, fh, state, params):
    pulls = zip(q, params, qd, fh, strict=True)
    return tuple(-8.0 * (x - y) - 0.3 * w + 0.2 * f for x, y, w, f in pulls), state


PD, OWN = hc.JointPD((8.0, 5.0), (0.3, 0.2), reference=AIM), hc.Controller(to_aim, params=AIM)
VISCOUS = hc.Clay(
    hc.Profile((0.005, 0.02), (0.0, 40.0, 90.0)), hc.Profile((), (20.0,))
)  # fmt: skip
STIFF = hc.Clay(WALL, hc.Profile((), (0.0,)))
MEASURED = dict(encoder=4096, velocity="difference", velocity_window=3, velocity_filter=80.0)
BESIDE = {
    "PD": dict(controller=PD),
    "difference, hand": dict(controller=replace(PD, velocity="difference"), operator=HAND),
    "own law of the hand's force": dict(controller=OWN, operator=HAND, force=(0.5, 0.2)),
    "physical clay": dict(controller=PD, clay=VISCOUS, render="physical"),
    "own law, hand, physical clay": dict(
        controller=OWN, operator=HAND, clay=VISCOUS, render="physical"
    ),
    "filter, held clay": dict(
        controller=replace(PD, velocity="filter", cutoff=200.0), clay=VISCOUS
    ),
    "held wall, hand": dict(controller=PD, clay=STIFF, operator=HAND),
    "physical wall, own law": dict(controller=OWN, clay=STIFF, render="physical", operator=HAND),
    "encoder, late": dict(controller=OWN, hardware=hc.Hardware(encoder=4096, delay=1.4e-3)),
    "rates from an encoder, late": dict(
        controller=OWN, operator=HAND, hardware=hc.Hardware(delay=0.6e-3, **MEASURED)
    ),
    "converter, jitter, losses, limits": dict(
        controller=OWN, torque_limit=(1.5, 0.8),
        hardware=hc.Hardware(jitter=1e-4, dropout_probability=0.1, dac_bits=12),
    ),
    "joint friction": dict(
        controller=PD, operator=HAND, hardware=hc.Hardware(friction=(0.05, 0.02))
    ),
    "muscle": dict(
        controller=PD, operator=HAND, clay=VISCOUS, muscle=hc.Step((2.0, 1.0), 0.03)
    ),
}  # fmt: skip


def from_file(fields):
    """The same scene with the arm as MJCF, which has its own friction and limits."""
    fields, of_arm = dict(fields), {}
    io, limit = fields.get("hardware"), fields.pop("torque_limit", None)
    if limit:
        of_arm["torque_limit"] = limit
    if io is not None and any(io.friction):
        of_arm["friction"] = io.friction
        fields["hardware"] = None
    spec = engine.compose_spec(["arm.xml"], hc.Arm())
    return hc.Scenario(arm=hc.MjcfArm(spec, site="handle", pose=POSE, **of_arm), **fields)


@pytest.mark.parametrize("name", BESIDE)
def test_the_arm_as_a_file_is_the_arm_in_closed_form(name):
    common = dict(Ts=1e-3, dt=5e-4, t_max=0.5, force=(0.0, 0.0), length=None, control="sampled")
    fields = common | BESIDE[name]
    one, other = hc.simulate(hc.Scenario(**fields)), hc.simulate(from_file(fields))
    assert len(one.t) == len(other.t) and np.abs(one.p).max() > 5e-3
    # 1000 steps of angles near 1, each rounded some ten times: 1e-12 m is 5000 eps
    assert np.abs(one.p - other.p).max() < 1e-12
    assert np.abs(one.q - other.q).max() < 3e-12
    for array in ("v", "qd", "fh", "fe", "tau"):
        a, b = getattr(one, array), getattr(other, array)
        assert np.abs(a - b).max() < 1e-10 * max(np.abs(a).max(), 1.0), array
    assert [x.axis for x in one.crossings] == [x.axis for x in other.crossings]
    for a, b in zip(one.crossings, other.crossings, strict=True):
        assert a.time == pytest.approx(b.time, abs=1e-11)
    assert one.outcome.code == other.outcome.code


# ---- order of the step ---------------------------------------------------------------------------

ARMS = {
    "planar_2r": dict(Kp=(3.0, 3.0)),
    "leader_7": dict(Kp=(40.0, 40.0, 40.0, 40.0, 4.0, 5.0, 4.0)),
    "leader_7, four joints": dict(
        Kp=(40.0, 40.0, 40.0, 40.0), joints=("joint1", "joint2", "joint3", "joint4")
    ),
    "haptic_3": dict(Kp=(0.9, 0.9, 0.9)),
    "five_bar": dict(Kp=(0.9, 0.9), away=0.1),
}


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("name", ARMS)
def test_a_step_is_of_second_order(name, delay):
    """Against SciPy at 1e-12, with a hand without mass."""
    given = dict(ARMS[name])
    Kp, away, Ts, samples = given.pop("Kp"), given.pop("away", 0.4), 4e-3, 15
    card, n = name.split(",")[0], len(Kp)
    arm = hc.MjcfArm(card, friction=[0.0] * n, **given)
    aim = arm.q + np.random.default_rng(1).uniform(-away, away, n)
    law = hc.JointPD(Kp, [0.02 * x for x in Kp], velocity="difference", reference=tuple(aim))
    force = (2.0, 1.0, 0.5)[: len(arm.axes)]
    of_motion = arm.names, arm.axes, arm.pose, (0.0, 2.0, 6.0), force
    of_run = (law.Kp, law.Kd, aim), Ts, samples, delay
    exact = store.solution(
        f"joints-{name}-{delay}", joint_motion.positions, card, of_motion, of_run,
        joint_motion.text_of(card),
    ).q  # fmt: skip
    errors = []
    for ratio in (2, 4, 8):
        s = scene(
            arm, law, Ts, ratio, t_max=Ts * samples, force=force,
            operator=hc.Operator(0.0, 2.0, 6.0),
            hardware=hc.Hardware(delay=delay * Ts) if delay else None,
        )  # fmt: skip
        r = hc.simulate(s)
        errors.append(np.abs(r.q[::ratio][:samples] - exact).max())
    assert np.abs(exact - exact[0]).max() > 0.02
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.2), (orders, errors)


# ---- friction ------------------------------------------------------------------------------------


def kick_of(random, n, axes=2):
    """A model, a kick and dense arrays of a kick with friction, all drawn."""
    root, J = random.normal(size=(n, n)), random.normal(size=(3, n))
    M = root @ root.T + 0.05 * np.eye(n)
    H, R, damper = 1e-3, 0.5, random.uniform(0.0, 2.0, n)
    d = random.uniform(0.0, 30.0, 3) * random.integers(0, 2)
    dxy, f = 0.3 * min(d[:2]), random.normal(size=3)
    slip = random.uniform(0.0, 5.0, n) * random.integers(0, 2, n)
    moment = H * random.normal(size=n) * 5.0
    A = M + H * R * np.diag(damper)
    D = np.diag(d)
    D[0, 1] = D[1, 0] = dxy
    D[axes:], D[:, axes:], f[axes:] = 0.0, 0.0, 0.0
    A += H * J.T @ D @ J
    e = SimpleNamespace(
        joint_M=M.ravel(), joint_J=J.ravel(), moment=moment, pivots=np.zeros(n, int),
        matrix=np.full(2 * n * n + 2 * n, np.nan),
    )  # fmt: skip
    m = SimpleNamespace(engine=e, joints=n, axes=axes, damper=damper, slip=slip, computed=0)
    k = records.Kick()
    k.H, k.R, k.dxy = H, R, float(dxy)
    for i, o in enumerate((k.x, k.y, k.z)):
        o.d, o.f = float(d[i]), float(f[i])
    k.o[:n] = random.normal(size=n).tolist()
    return m, k, A, moment + H * J.T @ f


@given(seed=st.integers(0, 10**6))
@settings(max_examples=150, deadline=None)
def test_friction_is_that_of_a_quadratic_program(seed):
    """The friction f of a kick minimises w' A w/2 with A w = b + H f, |f| <= F: SciPy's BVLS."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 13))
    m, k, A, b = kick_of(random, n, int(random.integers(2, 4)))
    joint_friction.find(m, k)
    L = np.linalg.cholesky(A)
    G, g = np.linalg.solve(L, k.H * np.eye(n)), np.linalg.solve(L, b)
    bound = np.maximum(m.slip, 1e-12)
    f = lsq_linear(G, -g, (-bound, bound), method="bvls", tol=1e-14).x
    # A is of condition 1e3 to 1e5, and a rate is the difference of impulses near 1e-2
    rates = np.linalg.solve(A, b + k.H * np.array(k.slip[:n]))
    np.testing.assert_allclose(rates, np.linalg.solve(A, b + k.H * f), atol=1e-9)
    np.testing.assert_allclose(k.slip[:n], f, atol=1e-6)
    assert (np.abs(k.slip[:n]) <= m.slip * (1.0 + 1e-12)).all()


def test_friction_holds_a_joint_up_to_its_torque():
    """At rest to the bit below, and beyond it moves as a body under the excess."""
    arm = hc.MjcfArm("planar_2r", friction=(0.5, 0.2), damping=(0.0, 0.0))

    def pushed(torque):
        law = hc.Controller(lambda t, q, qd, fh, state, params: (params, state), params=torque)
        return hc.simulate(scene(arm, law, t_max=0.02))

    still = pushed((0.499, -0.199))
    assert not still.qd.any() and (still.q == arm.q).all()
    r = pushed((0.6, 0.0))  # link 2 is held: a rigid body turns
    assert (r.qd[1:, 0] > 0.0).all()
    free = np.linalg.solve(arm.mass_matrix(), (0.1, 0.0))
    held = 0.1 / arm.mass_matrix()[0, 0]
    bends = arm.mass_matrix()[1, 0] * held > 0.2
    assert not bends and not r.qd[:, 1].any()
    assert r.q[-1, 0] - arm.q[0] == pytest.approx(0.5 * held * r.t[-1] ** 2, rel=2e-3)
    assert free[0] > 1.05 * held


def test_a_joint_that_slides_stops_where_its_energy_is_spent():
    """q stops after w^2 M/(2 F), then rests to the bit."""
    arm = hc.MjcfArm("planar_2r", friction=(0.05, 5.0), damping=(0.0, 0.0))
    M, Ts = arm.mass_matrix()[0, 0], 1e-3

    def kicked(t, q, qd, fh, state, params):
        return (1.0 if t < 0.0995 else 0.0, 0.0), state

    r = hc.simulate(scene(arm, hc.Controller(kicked), Ts, 2, t_max=3.0))
    fast = 0.95 * 0.1 / M
    went = 0.5 * 0.95 / M * 0.1**2 + 0.5 * M * fast**2 / 0.05
    assert r.q[-1, 0] - arm.q[0] == pytest.approx(went, rel=1e-4)  # a stop within a step of 0.5 ms
    assert not r.qd[-100:].any()


# ---- the third axis ------------------------------------------------------------------------------


@given(seed=st.integers(0, 10**6))
@settings(max_examples=100, deadline=None)
def test_the_third_axis_is_eliminated_from_a_dense_system(seed):
    """n u = a + W (f - d u) of three axes, solved whole."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(3, 3))
    W, a, f = root @ root.T + 0.01 * np.eye(3), random.normal(size=3), random.normal(size=3)
    n, d = 10.0 ** random.uniform(1, 4), 10.0 ** random.uniform(-2, 3, 3)
    exact = np.linalg.solve(n * np.eye(3) + W * d, a + W @ f)
    k = records.Kick()
    k.Wxx, k.Wxy, k.Wyy, k.Wxz, k.Wyz, k.Wzz = W[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]].tolist()
    k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy
    for i, o in enumerate((k.x, k.y, k.z)):
        o.n, o.a, o.f, o.d = n, float(a[i]), float(f[i]), float(d[i])
    joints.eliminate(k, k.z.d)
    S, plane = np.array([[k.Sxx, k.Sxy], [k.Sxy, k.Syy]]), np.array([k.x.a, k.y.a])
    u = np.linalg.solve(n * np.eye(2) + S * d[:2], plane + S @ f[:2])
    np.testing.assert_allclose(u, exact[:2], rtol=1e-9, atol=1e-12 * np.abs(exact).max())


# ---- the law of the joints -----------------------------------------------------------------------


def replayed(law, q, Ts, count=None):
    """Torques of a law from recorded positions."""
    q = q if count is None else np.round(q * count / math.tau) * math.tau / count
    past, filtered, out = q[0], np.zeros(q.shape[1]), []
    for now in q:
        w = (now - past) / Ts
        if law.velocity == "filter":
            wc = law.cutoff
            w = filtered = (filtered + wc * (now - past)) / (1.0 + wc * Ts)
        past = now
        if law.velocity_bits:
            step = law.velocity_range / 2 ** (law.velocity_bits - 1)
            w = np.clip(np.round(w / step), -(2 ** (law.velocity_bits - 1)), None) * step
        torque = np.array(law.Kp) * (np.array(law.reference) - now) - np.array(law.Kd) * w
        for i, (Fc, slope, Fv) in enumerate(law.friction or ((0.0, 0.0, 0.0),) * len(law)):
            torque[i] += Fc * math.tanh(slope * w[i]) + Fv * w[i]
        out.append(torque)
    return np.array(out)


LAWS = {
    "difference": dict(velocity="difference"),
    "filter": dict(velocity="filter", cutoff=90.0),
    "bits": dict(velocity="filter", cutoff=90.0, velocity_bits=8, velocity_range=4.0),
    "friction": dict(velocity="difference", friction=[(0.02, 30.0, 0.004)] * 3),
}


@pytest.mark.parametrize("late", [0, 2])
@pytest.mark.parametrize("name", LAWS)
def test_torques_are_those_of_the_law(name, late):
    arm, Ts = plain("haptic_3", gravity="acts"), 1e-3
    law = hc.JointPD(
        (1.0, 1.5, 0.8), (0.02, 0.01, 0.03), reference=tuple(arm.q + (0.2, 0.1, 0.15)), **LAWS[name]
    )
    io = hc.Hardware(encoder=8192, delay=late * Ts)
    r = hc.simulate(scene(arm, law, Ts, hardware=io, operator=hc.Operator(0.1, 2.0, 6.0)))
    want = replayed(law, r.q, Ts, 8192)
    # sums of a few numbers near 1; a run ends before its last sample is answered
    np.testing.assert_allclose(r.tau[late:-1], want[: len(want) - late - 1], atol=1e-12)
    assert not r.tau[:late].any()


def test_a_delay_of_any_fraction_lies_between_its_neighbours():
    """Over one step of a sample in four: 1.25 Ts late is exact as a whole number of steps."""
    arm, Ts = plain("planar_2r"), 4e-3
    law = hc.JointPD((3.0, 2.0), (0.1, 0.1), velocity="difference", reference=tuple(arm.q + 0.3))
    late = hc.simulate(scene(arm, law, Ts, 4, hardware=hc.Hardware(delay=5e-3)))
    want = replayed(law, late.q[::4], Ts)
    for i in range(4, 40):
        now = late.tau[4 * i : 4 * i + 4]
        np.testing.assert_allclose(now[0], want[i - 2], atol=1e-12)
        np.testing.assert_allclose(now[1:], np.tile(want[i - 1], (3, 1)), atol=1e-12)


def test_a_drive_is_the_limit_of_fast_hosts():
    arm = plain("leader_7", torque_limit=[math.inf] * 7, gravity="acts")
    law = hc.JointPD((40.0,) * 4 + (4.0,) * 3, (2.0,) * 4 + (0.2,) * 3, reference=arm.q + 0.2)
    at = {}
    for runs, Ts in (("drive", 1e-3), ("host", 2e-4), ("host", 1e-4), ("host", 5e-5)):
        s = scene(arm, replace(law, runs=runs), Ts, max(1, round(Ts / 1e-4)), t_max=0.1)
        at[runs, Ts] = hc.simulate(s).q[-1]
    drive = at["drive", 1e-3]
    errors = [np.abs(at["host", Ts] - drive).max() for Ts in (2e-4, 1e-4, 5e-5)]
    # a hold is a delay of Ts/2: first order in Ts
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.2)


def test_a_law_of_ones_own_has_all_joints_and_axes():
    arm, seen = plain("haptic_3", gravity="acts"), []
    pd = hc.JointPD((1.0, 1.0, 1.0), (0.02, 0.02, 0.02), reference=tuple(arm.q + 0.1))

    def law(t, q, qd, fh, state, params):
        seen.append((len(q), len(qd), fh))
        pulls = zip(q, qd, params, strict=True)
        return tuple((y - x) - 0.02 * w for x, w, y in pulls), state

    common = dict(operator=hc.Operator(0.0, 3.0, 8.0), force=(0.3, 0.1, 0.2))
    mine = hc.simulate(scene(arm, hc.Controller(law, params=pd.reference), **common))
    theirs = hc.simulate(scene(arm, pd, **common))
    np.testing.assert_allclose(mine.q, theirs.q, atol=1e-13)
    assert {x[:2] for x in seen} == {(3, 3)}
    forces = np.array([x[2] for x in seen])
    assert forces.shape[1] == 3 and np.abs(forces[:, 2]).max() > 1e-3
    # a hand without mass pushes by place and velocity; recorded rates are means over a sample
    np.testing.assert_allclose(
        forces[:, 2], (0.2 - 8.0 * mine.p[:, 2] - 3.0 * handle_rates(arm, mine)[:, 2])[:-1],
        atol=2e-2 * np.abs(forces[:, 2]).max(),
    )  # fmt: skip


def handle_rates(arm, r):
    """Velocity of the handle from joint rates, along the axes of a run."""
    rows = ["xyz".index(c) for c in arm.axes]
    return np.array([arm.jacobian(q)[rows] @ w for q, w in zip(r.q, r.qd, strict=True)])


# ---- energy --------------------------------------------------------------------------------------


@pytest.mark.parametrize("card", ["planar_2r", "haptic_3", "five_bar", "leader_7"])
def test_energy_is_balanced_to_second_order(card):
    """Muscle and motors give what hand, dampers and friction take and what arm and hand store."""
    arm = hc.MjcfArm(card)
    n, large = len(arm.names), card == "leader_7"
    away = 0.05 if card == "five_bar" else 0.3
    law = hc.JointPD(
        (40.0 if large else 1.0,) * n, (1.0 if large else 0.02,) * n, velocity="difference",
        reference=tuple(arm.q + away * np.cos(np.arange(n))),
    )  # fmt: skip
    left = []
    for ratio in (1, 2, 4):
        s = scene(
            arm, law, 2e-3, ratio, operator=hc.Operator(0.0, 2.0, 6.0), t_max=0.1,
            force=(1.0, 0.5, -0.8)[: len(arm.axes)],
        )  # fmt: skip
        e = hc.simulate(s).energy
        left.append(abs(e["residual"]) / e["throughput"])
        assert e["joint_dampers"] >= 0.0 and e.get("friction", 0.0) >= 0.0
    assert left[2] < 2e-3 and left[2] < 0.4 * left[0] + 1e-7, left


def test_a_late_law_holds_the_weight_from_the_start():
    """Until its first torque arrives the motors hold those of the pose: nothing moves."""
    arm = hc.MjcfArm("leader_7")
    law = hc.JointPD((5.0,) * 7, (0.1,) * 7)
    late = hc.Hardware(delay=3.3e-3)
    r = hc.simulate(hc.Scenario(arm=arm, controller=law, Ts=2e-3, t_max=0.05, hardware=late))
    # rounding of torques of 2.6 N.m over an inertia of 0.02 kg.m^2, in 0.05 s: 1e-16
    assert np.abs(r.q - arm.q).max() < 1e-14 and np.abs(r.tau - r.tau[0]).max() < 1e-12


@pytest.mark.parametrize("runs", ["host", "drive"])
@pytest.mark.parametrize("card", ["planar_2r", "leader_7"])
def test_each_entry_of_the_energy_balance_is_an_integral_of_the_record(card, runs):
    """Trapezoids over the samples: held torques jump at some, so their error falls as the step."""
    arm = hc.MjcfArm(card, gravity="acts", torque_limit=[math.inf] * len(hc.MjcfArm(card).names))
    n, off = len(arm.names), []
    law = hc.JointPD((40.0,) * n, (1.0,) * n, runs=runs, reference=tuple(arm.q + 0.2))
    for ratio in (2, 4):
        r = hc.simulate(scene(arm, law, 1e-3, ratio, operator=hc.Operator(0.0, 0.0, 0.0)))
        taken = r.qd**2 @ np.array(arm.damping)
        motors, dampers = (
            np.trapezoid(x, r.t) for x in ((r.tau * r.qd).sum(axis=1), taken)
        )  # fmt: skip
        motion = 0.5 * r.qd[-1] @ arm.mass_matrix(r.q[-1]) @ r.qd[-1]
        lifted = lifted_by(arm, r.q[-1]) - lifted_by(arm, r.q[0])
        size, e = r.energy["throughput"], r.energy
        entries = (e["motors"] - motors, e["joint_dampers"] - dampers)
        off.append(max(abs(x) / size for x in (*entries, e["kinetic"] - motion - lifted)))
        assert abs(e["residual"]) < 2e-3 * size
        rubs = e.get("friction", 0.0)
        left = e["motors"] - e["joint_dampers"] - e["kinetic"] - rubs - e["residual"]
        assert abs(left) < 1e-12 * size
    assert off[1] < 1e-2 and off[1] < 0.6 * off[0] + 1e-6, off


def lifted_by(arm, q):
    """Energy of weight, by the places of the bodies."""
    model = mujoco.MjModel.from_xml_path(str(joint_motion.CARDS / f"{arm.file}.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_fwdPosition(model, data)
    return -float(model.body_mass @ (data.xipos @ model.opt.gravity))
