"""Limits of joint loops: against another map, other theory, and the engine's own runs."""

import functools
import itertools
import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import hapticclay as hc
from benchmarks import arm_integrators
from hapticclay.arms.mechanism import Linear
from hapticclay.theory import joint_crossings
from hapticclay.theory.joint_delays import delay_left
from hapticclay.theory.joint_families import Circle, Family
from hapticclay.theory.joint_gains import Study, joint_loop
from hapticclay.theory.wall_limits import stiffness_band
from tests.hunt import examples, some
from tests.oracles import joints

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
LEADER_KP = (240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0)
LEADER_KD = (3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2)
LEADER_LAW = hc.JointPD(LEADER_KP, LEADER_KD, velocity="filter", cutoff=90.0)


def leader(**kw):
    return hc.MjcfArm(CARDS / "leader_7.xml", **kw)


@functools.cache
def limits_at(Ts=2e-3, delay=2e-3, **numbers):
    return hc.theory.joint_limits(leader(**numbers), LEADER_LAW, Ts, delay)


def drawn(seed):
    """A loop of one to three joints, with all that may stand in it."""
    random = np.random.default_rng(seed)
    n, Ts = int(random.integers(1, 4)), 10.0 ** random.uniform(-3.5, -2.0)
    root = random.normal(size=(n, n))
    M = root @ root.T + 0.1 * np.eye(n)
    D = np.diag(random.choice([0.0, 0.3, 2.0], n))
    S = np.diag(random.choice([0.0, 5.0, -2.0], n))
    kind = str(random.choice(["exact", "difference", "filter"]))
    law = hc.JointPD(
        tuple(random.uniform(0.0, 0.4, n) / Ts),
        tuple(random.uniform(0.05, 1.0, n)),
        velocity=kind,
        cutoff=10.0 ** random.uniform(1.0, 3.0) if kind == "filter" else None,
        friction=[(0.1, 2.0, 0.05)] * n if random.random() < 0.3 else None,
    )
    delay = Ts * float(random.choice([0.0, 0.4, 1.0, 2.7]))
    zero = np.zeros((n, n))
    return Linear(M, D, S, zero, zero, np.zeros((3, n))), law, Ts, delay


def other_radius(linear, law, Ts, delay, Kp=None, Kd=None):
    Kp, Kd = (law.Kp if Kp is None else Kp), (law.Kd if Kd is None else Kd)
    gains = np.diag(Kp), np.diag(Kd) - np.diag(law.slopes)
    arm = linear.inertia, linear.damping, linear.stiffness
    return joints.radius(arm, gains, Ts, delay, law.velocity, law.cutoff)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_the_map_is_that_of_pieces_of_motion(seed):
    linear, law, Ts, delay = drawn(seed)
    loop = joint_loop(linear, law, Ts, delay, False)
    found = np.abs(np.linalg.eigvals(loop.map())).max()
    # eigenvalues of matrices of some 20 states with defective zeros: 1e-9 is far above rounding
    assert found == pytest.approx(other_radius(linear, law, Ts, delay), rel=1e-9)


@given(seed=st.integers(0, 10**6))
@examples(20)
def test_the_other_map_turns_unstable_at_each_limit(seed):
    """The upper end of each interval: the radius passes 1 within 1e-5 of the gain."""
    linear, law, Ts, delay = drawn(seed)
    loop = joint_loop(linear, law, Ts, delay, False)
    e = np.eye(len(law))
    for kind, gains in (("Kp", law.Kp), ("Kd", law.Kd)):
        for j in range(len(law)):

            def changed(u, kind=kind, j=j):
                now = {"Kp": np.array(law.Kp), "Kd": np.array(law.Kd)}
                now[kind] = now[kind] + u * e[j]
                return joint_loop(linear, law, Ts, delay, False, (now["Kp"], now["Kd"]))

            of = "position" if kind == "Kp" else "rate"
            column = e[:, j : j + 1]
            limit = Family(Circle(loop), of, column, column, gains[j], changed).limit()
            if not math.isfinite(limit.high) or limit.high <= 1e-6:
                continue
            for share, stable in ((1.0 - 1e-5, True), (1.0 + 1e-5, False)):
                now = np.array(gains)
                now[j] = limit.high * share
                size = other_radius(linear, law, Ts, delay, **{kind: now})
                assert bool(size < 1.0 + 1e-11) is stable, (kind, j, limit, size)


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 2e-3])
@pytest.mark.parametrize("B", [0.0, 3.0])
def test_one_joint_is_the_wall_on_a_bare_device(B, delay):
    """A slide of a mass with a damper: the theory of walls has its band of stiffness."""
    wall = hc.VirtualWall(
        device=hc.Device(0.3, 1.5), Ts=1e-3, B=B, delay=delay, velocity="difference"
    )
    one = np.ones((1, 1))
    linear = Linear(0.3 * one, 1.5 * one, 0 * one, 0 * one, 0 * one, np.zeros((3, 1)))
    law = hc.JointPD([100.0], [B], velocity="difference")

    def changed(u):
        return joint_loop(linear, law, 1e-3, delay, False, (np.array([100.0 + u]), np.array([B])))

    circle = Circle(joint_loop(linear, law, 1e-3, delay, False))
    limit = Family(circle, "position", one, one, 100.0, changed).limit()
    low, high = stiffness_band(wall)
    assert limit.high == pytest.approx(high, rel=1e-9)
    assert limit.low == pytest.approx(low, abs=1e-6)


@pytest.mark.parametrize("joint", [0, 2, 4, 6])
def test_the_engine_flips_at_the_limit(joint):
    """Half a percent on each side of the largest Kp of a joint, seven joints coupled."""
    arm, Ts = leader(), arm_integrators.TS
    high = limits_at(Ts, Ts).Kp[joint, 1]
    verdicts = []
    for share in (0.995, 1.005):
        Kp = np.array(LEADER_KP)
        Kp[joint] = share * high
        verdicts.append(arm_integrators.grows(arm, Kp, "mjINT_RK4", 2, True, 3.0))
    assert verdicts == [False, True]


@pytest.mark.parametrize("method", ["EULER", "IMPLICIT", "IMPLICITFAST", "DISCRETE"])
def test_steps_that_move_by_the_rates_at_their_end_are_off_alike(method):
    """One step a sample: 37 % too high, whatever a step takes implicitly."""
    arm, Ts = leader(), arm_integrators.TS
    scale = hc.theory.joint_limits(arm, LEADER_LAW, Ts, Ts).scale
    verdicts = [
        arm_integrators.grows(arm, share * scale * np.array(LEADER_KP), f"mjINT_{method}", 1, True)
        for share in (1.36, 1.39)
    ]
    assert verdicts == [False, True]


def test_published_gains_of_a_leader():
    """Limits to the digits to which an independent program found them."""
    found = limits_at()
    for j, (high, buzz) in enumerate(
        [
            (1334, 12.0),
            (1057, 12.1),
            (776, 11.8),
            (869, 12.1),
            (313, 26.1),
            (314, 24.2),
            (34.4, 12.1),
        ]
    ):
        digits = 0.5 if high > 100 else 0.05  # of the last printed digit
        assert found.Kp[j, 1] == pytest.approx(high, abs=1.1 * digits)
        assert found.Kp_buzz[j] == pytest.approx(buzz, abs=0.055)
    assert found.scale == pytest.approx(1.361, abs=5.5e-4)
    assert found.delay_left == pytest.approx(1.35e-3, abs=5.5e-6)
    assert found.Kd_scale == pytest.approx((0.530, 9.40), rel=6e-4)
    assert found.Kd[6] == pytest.approx((0.096, 2.00), rel=3e-3)
    assert found.joint == "joint7" and found.stable


LIMITS = {  # of joint 7 and of the whole arm, and the attribute with their slopes
    "Kp": (lambda x: x.Kp[6, 1], lambda x: x.Kp_change[6]),
    "Kd": (lambda x: x.Kd[6, 1], lambda x: x.Kd_change[6]),
    "least Kd": (lambda x: x.Kd[6, 0], lambda x: -x.friction_slope_change[6]),
    "slope": (lambda x: x.friction_slope[6], lambda x: x.friction_slope_change[6]),
    "scale": (lambda x: x.scale, lambda x: [*x.scale_change[6], x.scale_per_delay]),
    "Kd_scale": (
        lambda x: x.Kd_scale[1],
        lambda x: [*x.Kd_scale_change[1, 6], x.Kd_scale_per_delay[1]],
    ),
    "least Kd_scale": (
        lambda x: x.Kd_scale[0],
        lambda x: [*x.Kd_scale_change[0, 6], x.Kd_scale_per_delay[0]],
    ),
    "delay": (lambda x: x.delay_left, lambda x: [*x.delay_change[6], -1.0]),
    "rate": (lambda x: x.slowest_rate, lambda x: [*x.rate_change[6], x.rate_per_delay]),
}


def around(kind, share):
    """Values of a number of joint 7 or of the delay, and weights of a derivative."""
    if kind == "delay":
        h = share * 2e-3
        late = [{}, {"delay": 2e-3 + h}, {"delay": 2e-3 + 2.0 * h}]
        return late, np.array([-1.5, 2.0, -0.5]) / h
    values = np.array(getattr(leader(), kind))
    h = share * values[6]
    return [{kind: tuple(values + s * h * np.eye(7)[6])} for s in (1, -1)], np.array(
        [0.5, -0.5]
    ) / h


COLUMNS = [(0, "armature"), (1, "damping"), (2, "delay")]


@pytest.mark.parametrize("column, kind", some(COLUMNS, 2))  # of walls, all
def test_sensitivities_are_slopes_of_limits(column, kind):
    """Differences of whole limits, of second order: a tenth of the step, a hundredth of the error.

    Half of that is asked for, down to 1e-5, where the lowest rate, found to 1e-9, ends.
    """
    found, errors = limits_at(), []
    for share in (1e-2, 1e-3):
        values, weights = around(kind, share)
        limits = [limits_at(**x) for x in values]
        errors.append(
            {
                name: sum(w * of(x) for w, x in zip(weights, limits, strict=True))
                / slopes(found)[column]
                - 1.0
                for name, (of, slopes) in LIMITS.items()
            }
        )
    for name, error in errors[1].items():
        assert abs(error) < max(0.02 * abs(errors[0][name]), 1e-5), name


@functools.cache
def wall_at(delay=2e-3, **numbers):
    hand = hc.Operator(0.25, 2.0, 6.0)
    return hc.theory.wall_limit(leader(**numbers), "x", 5.0, hand, 2e-3, delay)


@pytest.mark.parametrize("column, kind", COLUMNS)
def test_sensitivities_of_a_wall(column, kind):
    """As above, to 1e-4 at a step of 1e-3."""
    found, (values, weights) = wall_at(), around(kind, 1e-3)
    slope = sum(w * wall_at(**x).K for w, x in zip(weights, values, strict=True))
    assert [*found.K_change[6], found.K_per_delay][column] == pytest.approx(slope, rel=1e-4)
    assert any(x.startswith("gravity: fed forward") for x in found.assumed)


def test_a_crossing_on_the_grid_is_not_missed():
    """An eigenvalue on the circle is an angle of the grid: its size there is 1 to the bit."""
    damping = np.array(leader().damping) + 1e-3 * np.eye(7)[1]
    study = Study(leader(damping=tuple(damping)), LEADER_LAW, 2e-3, 2e-3)
    left = delay_left(study.loop).change
    assert study.remade(delay=2e-3 + left * (1.0 - 1e-6)).stable()
    assert not study.remade(delay=2e-3 + left * (1.0 + 1e-6)).stable()
    assert left == pytest.approx(1.3479e-3, rel=1e-4)


def test_delay_and_rate_left_are_where_stability_ends():
    study = Study(leader(), LEADER_LAW, 2e-3, 2e-3)
    found = limits_at()
    left = delay_left(study.loop).change
    assert left == found.delay_left
    for share, stable in ((1 - 1e-6, True), (1 + 1e-6, False)):
        assert study.remade(delay=2e-3 + share * left).stable() is stable
        assert study.remade(Ts=share / found.slowest_rate).stable() is stable


def test_a_long_delay_is_found_on_the_circle():
    """A slow, well damped joint: some hundred samples, as the other map has it."""
    one = np.ones((1, 1))
    linear = Linear(one, 8.0 * one, 0 * one, 0 * one, 0 * one, np.zeros((3, 1)))
    loop = joint_loop(linear, hc.JointPD([9.0], [0.0]), 5e-3, 0.0, False)
    left = delay_left(loop).change
    # continuous: P e^{-s T}/(s (s + 8)) with a phase of -pi at |.| = 1; the hold adds Ts/2
    w = math.sqrt((-64.0 + math.sqrt(64.0**2 + 4.0 * 81.0)) / 2.0)
    assert left + 2.5e-3 == pytest.approx((math.pi / 2 - math.atan(w / 8.0)) / w, rel=1e-5)
    arm = one, 8.0 * one, 0 * one
    gains = 9.0 * one, 0 * one
    assert joints.radius(arm, gains, 5e-3, left * (1 - 1e-4)) < 1.0
    assert joints.radius(arm, gains, 5e-3, left * (1 + 1e-4)) > 1.0


def test_a_drive_hardly_limits_its_gains():
    law = replace(LEADER_LAW, runs="drive")
    found = hc.theory.joint_limits(leader(), law, 2e-3, 2e-3)
    host = limits_at()
    assert found.stable and (found.Kp[:, 1] > 5.0 * host.Kp[:, 1]).all()


@pytest.mark.parametrize("Kd", [0.0, 0.1, 1e4, 1e8, 1e9])
def test_a_drive_of_an_arm_without_weight_holds_nothing_and_is_stable(Kd):
    """No torque of the host, so no delay matters; a slow drive decays by exp(-Kp Ts/Kd)."""
    law = hc.JointPD((5.0, 5.0), (Kd, Kd), runs="drive")
    found = hc.theory.joint_limits(hc.MjcfArm("planar_2r"), law, 1e-3, 1e-3)
    assert found.stable and found.delay_left == found.scale == math.inf
    assert "any factor" in found.headline() and "unstable" not in found.text()
    if Kd > 1e3:  # a double holds a radius to 1e-16
        assert 1.0 - found.radius == pytest.approx(-math.expm1(-5e-3 / Kd), rel=1e-3, abs=2e-16)


def test_friction_fed_forward_has_a_largest_slope():
    """A slope above the limit makes the loop unstable, one below does not."""
    plain = limits_at(1e-3, 1e-3)
    for share, stable in ((0.999, True), (1.001, False)):
        rows = [(0.0, 1.0, 0.0)] * 6 + [(share * plain.friction_slope[6], 1.0, 0.0)]
        law = replace(LEADER_LAW, friction=tuple(rows))
        assert Study(leader(), law, 1e-3, 1e-3).loop.stable() is stable


@pytest.mark.parametrize("axis", "xyz")
def test_a_wall_at_the_handle_is_stable_below_its_limit(axis):
    """The other map, with the hand and the wall written out along the Jacobian."""
    arm, hand, B, Ts = leader(), hc.Operator(0.25, 2.0, 6.0), 5.0, 1e-3
    found = hc.theory.wall_limit(arm, axis, B, hand, Ts, Ts, "difference")
    J, n = arm.jacobian(), 7
    along, square = J["xyz".index(axis)], J.T @ J
    weight = np.zeros((n, n))
    for j in range(n):
        h = 1e-5 * np.eye(n)[j]
        weight[:, j] = 9.81 * (arm.jacobian(arm.q + h)[2] - arm.jacobian(arm.q - h)[2]) / 2e-5
    gravity = arm.gravity_stiffness() + hand.mass * 0.5 * (weight + weight.T)
    M = arm.mass_matrix() + hand.mass * square
    D = np.diag(arm.damping) + hand.damper * square
    S = hand.spring * square + gravity
    for share, stable in ((0.9999, True), (1.0001, False)):
        P = share * found.K * np.outer(along, along) - gravity
        z = np.linalg.eigvals(
            joints.sample_map((M, D, S), (P, B * np.outer(along, along)), Ts, Ts, "difference")
        )
        size = np.abs(z[np.abs(z - 1.0) > 1e-6]).max()
        assert bool(size < 1.0) is stable


def test_over_poses():
    arm = leader()
    found = hc.theory.over_poses(arm, LEADER_LAW, 2e-3, 2e-3, poses=6, seed=3)
    ranges = arm.ranges
    assert ((ranges[:, 0] <= found.q) & (found.q <= ranges[:, 1])).all()
    at = hc.theory.joint_limits(replace(arm, pose=found.worst_pose), LEADER_LAW, 2e-3, 2e-3)
    assert at.scale == pytest.approx(found.scale.min(), rel=1e-9)
    assert at.joint == found.names[found.first[found.worst]]
    np.testing.assert_allclose(found.p[4], arm.handle(found.q[4]), atol=1e-12)
    again = hc.theory.over_poses(arm, LEADER_LAW, 2e-3, 2e-3, poses=6, seed=3)
    assert (again.scale == found.scale).all()


def test_over_poses_of_a_slide():
    """A slide is in metres, and has no turn to be drawn from: without a range it stays."""
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body><joint name='lift' type='slide' axis='0 0 1'/>"
        "<geom size='0.1' mass='2'/><body pos='0.2 0 0'><joint name='turn' axis='0 0 1'/>"
        "<geom size='0.05' pos='0.2 0 0' mass='1'/>"
        "<body pos='0.3 0 0'><joint name='reach' type='slide' axis='1 0 0' range='-0.1 0.2'/>"
        "<geom size='0.03' mass='0.3'/><site name='hand'/></body></body></body>"
        "</worldbody></mujoco>"
    )
    arm = hc.MjcfArm(spec, site="hand", pose={"lift": 0.25})
    law = hc.JointPD([400.0, 20.0, 50.0], [20.0, 1.0, 2.0])
    found = hc.theory.over_poses(arm, law, 1e-3, poses=40)
    lift, turn, reach = found.q.T
    assert (lift == 0.25).all()
    assert np.ptp(turn) > 0.8 * 2.0 * np.pi
    assert reach.min() >= -0.1 and reach.max() <= 0.2 and np.ptp(reach) > 0.2
    assert {"lift [m]", "turn [rad]", "reach [m]"} < set(found.tables()["poses"])


GAINS = {
    "openarm.yaml": (
        "LeaderArmParam:\n  Kp: [1,2,3,4,5,6,7,8]\n  Kd: [1,1,1,1,1,1,1,1]\n"
        "  Fc: [1,1,1,1,1,1,1,1]\n"
        "  k: [2,2,2,2,2,2,2,2]\n  Fv: [0.5,0,0,0,0,0,0,0]\n  Fo: [0,0,0,0,0,0,0,0]\n"
    ),
    "plain.toml": "Kp = [1, 2]\nKd = [0.1, 0.2]\nvelocity = 'filter'\ncutoff = 90\n",
    "lerobot.json": '{"follower": {"position_kp": [1, 2], "position_kd": [0.1, 0.2]}}',
    "franka.yaml": "imp: {ros__parameters: {k_gains: [240, 100], d_gains: [20, 10]}}\n",
    "servo.json": '{"position_p_coefficient": [16], "position_d_coefficient": [32]}',
}


ROS = """controller_manager: {ros__parameters: {update_rate: 500}}
arm:
  ros__parameters:
    gains:
      a: {p: 600.0, i: 0.0, d: 30.0}
      b: {p: 400.0, i: 0.0, d: 20.0}
"""


def test_gains_under_the_names_of_projects(tmp_path):
    for name, text in GAINS.items():
        (tmp_path / name).write_text(text)
    open_arm = hc.JointPD.load(tmp_path / "openarm.yaml", velocity="filter", cutoff=90.0)
    assert open_arm.Kp == (1, 2, 3, 4, 5, 6, 7)
    assert open_arm.slopes == pytest.approx((0.7, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2))  # Fc 0.1 k + Fv
    assert hc.JointPD.load(tmp_path / "plain.toml").cutoff == 90.0
    assert hc.JointPD.load(tmp_path / "lerobot.json").Kd == (0.1, 0.2)
    assert hc.JointPD.load(tmp_path / "servo.json").Kp == (16.0,)
    assert hc.JointPD.load(tmp_path / "franka.yaml").Kd == (20.0, 10.0)


def test_gains_by_name_are_in_the_order_of_the_joints(tmp_path):
    (tmp_path / "g.yaml").write_text(ROS)
    file = tmp_path / "g.yaml"
    assert hc.JointPD.load(file).Kp == (600.0, 400.0)
    assert hc.JointPD.load(file, joints=["elbow", "shoulder"]).Kp == (600.0, 400.0)  # own names
    law = hc.JointPD.load(file, joints=["b", "a"])
    assert (law.Kp, law.Kd) == ((400.0, 600.0), (20.0, 30.0))
    with pytest.raises(hc.ParameterError, match="arm.*must have gains of c, too; has a, b"):
        hc.JointPD.load(file, joints=["a", "c"])
    file.write_text(ROS.replace("    gains:", "    joints: [b, a]\n    gains:"))
    assert hc.JointPD.load(file).Kp == (400.0, 600.0)


def test_one_of_several_tables_is_chosen(tmp_path):
    file = tmp_path / "g.yaml"
    file.write_text("teleop: {kp: [20], kd: [0.5]}\nold: {policy: {kp: [80], kd: [2]}}\n")
    assert hc.JointPD.load(f"{file}:teleop").Kp == (20.0,)
    assert hc.JointPD.load(f"{file}:policy").Kp == hc.JointPD.load(f"{file}:old.policy").Kp == (80,)
    with pytest.raises(hc.ParameterError, match="choose one, as g.yaml:old.policy"):
        hc.JointPD.load(file)
    with pytest.raises(
        hc.ParameterError, match="must name one of its tables of gains: teleop, old"
    ):
        hc.JointPD.load(f"{file}:polcy")


@pytest.mark.parametrize(
    "name, text, told",
    [
        ("g.txt", "", "must be a file"),
        ("g.toml", "Kp = [1]", "must hold gains: a table with Kp and Kd"),
        (
            "g.json",
            '{"a": {"Kp": [1], "Kd": [1]}, "b": {"Kp": [1], "Kd": [1]}}',
            r"as g.json:b \(a, b\)",
        ),
        ("g.toml", "[c.gains.a]\np = 1\nd = 1\ni = 3\n", "c.a.i = 3: must be 0: the law"),
        ("g.toml", "Kp = {a = 1, b = 2}\nKd = {a = 1}\n", "the same joints as Kp"),
        ("g.yaml", "a: [1", "cannot be read"),
        ("g.json", '{"Kp": [1, 2], "Kd": [1]}', "for each joint"),
        ("g.json", '{"Kp": ["x"], "Kd": [1]}', "finite number"),
        ("g.json", '{"Kp": [-1], "Kd": [1]}', ">= 0"),
        ("g.toml", "Kp = [nan]\nKd = [1]", "finite number"),
        ("g.toml", "Kp = [1]\nKd = [1]\ncutof = 90", "gains.cutof.*did you mean 'cutoff'"),
        ("g.toml", "Kp = [1]\nKd = [1]\nfrictoin = [[1, 1, 1]]", "did you mean 'friction'"),
    ],
)
def test_gains_that_are_refused(tmp_path, name, text, told):
    (tmp_path / name).write_text(text)
    with pytest.raises(hc.ParameterError, match=told) as error:
        hc.JointPD.load(tmp_path / name)
    assert "\n" not in str(error.value)


def test_a_law_of_another_arm_is_refused():
    with pytest.raises(hc.ParameterError, match="7 numbers, one for each joint .joint1"):
        hc.theory.joint_limits(leader(), hc.JointPD([1.0], [1.0]), 1e-3)
    with pytest.raises(hc.ParameterError, match="velocity 'filter'"):
        hc.JointPD([1.0], [1.0], velocity="filter")
    with pytest.raises(hc.ParameterError, match="left out without"):
        hc.JointPD([1.0], [1.0], cutoff=3.0)


@given(st.integers(2, 7), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_eigenvalues_of_two_angles_are_paired_at_the_least_sum_of_distances(k, m, seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, k, k)) + 1j * rng.normal(size=(2, k, k))
    values = np.linalg.eigvals(a + np.linspace(0.0, 3.0, m)[:, None, None] * b)
    paired = joint_crossings.branches(values)
    for one, other in itertools.pairwise(paired):
        gaps = np.abs(one[:, None] - other[None, :])
        assert gaps.trace() == pytest.approx(gaps[linear_sum_assignment(gaps)].sum(), rel=1e-12)
    np.testing.assert_array_equal(np.sort(paired, axis=1), np.sort(values, axis=1))
