"""The closed-form arm against first principles; tolerances are multiples of rounding."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import arm
from hapticclay.model.arm import PAPER, jacobians
from tests.oracles import Arm
from tests.oracles.links import Links

EPS = np.finfo(float).eps
angle = st.floats(-3.1, 3.1)
elbow = st.floats(-3.1, -0.02)
length, inertia = st.floats(0.05, 2.0), st.floats(1e-3, 10.0)
arms = st.just(hc.Arm()) | st.builds(hc.Arm, length, length, inertia, inertia)


def oracle(a):
    return Links(a.l1, a.l2, a.I1, a.I2)


def size(a):
    """What the roundings of a length are measured in: 1 for the paper's arm."""
    return max(1.0, a.l1 + a.l2)


def columns(u):
    return np.array([[u[0], u[2]], [u[1], u[3]]])


@given(angle, elbow)
def test_the_oracle_of_any_arm_is_that_of_the_papers(q1, q2):
    own, q = oracle(hc.Arm()), (q1, q2)
    np.testing.assert_allclose(own.forward(q), Arm.forward(q), atol=4 * EPS)
    np.testing.assert_allclose(own.jacobian(q), Arm.jacobian(q), atol=4 * EPS)
    np.testing.assert_array_equal(own.M, Arm.M)


@given(arms, angle, elbow)
def test_columns_are_the_jacobian_in_absolute_angles(a, q1, q2):
    relative = np.array([[1, 0], [1, 1]])  # absolute rates from relative ones
    u = arm.jacobian(q1, q2, a.links)
    found, exact = columns(u) @ relative, oracle(a).jacobian((q1, q2))
    np.testing.assert_allclose(found, exact, atol=4 * EPS * size(a))
    several = jacobians(np.full(3, q1), np.full(3, q2), a.links)
    # NumPy's sines may differ from those of math in the last bit
    np.testing.assert_allclose(several, np.repeat(u, 3).reshape(4, 3), atol=EPS * size(a))


@given(arms, angle, elbow)
def test_jacobian_is_the_derivative_of_the_position(a, q1, q2):
    h = 1e-6  # central difference: truncation h^2 l/6, rounding eps l/h, both below 1e-9
    q, own = np.array((q1, q2)), oracle(a)
    numeric = np.array([(own.forward(q + e) - own.forward(q - e)) / (2 * h)
                        for e in (np.array([h, 0]), np.array([0, h]))]).T  # fmt: skip
    np.testing.assert_allclose(own.jacobian(q), numeric, atol=1e-9 * size(a))


@given(arms, angle, elbow)
def test_mobility_is_J_Minv_Jt(a, q1, q2):
    own = oracle(a)
    wxx, wxy, wyy = arm.mobility(arm.jacobian(q1, q2, a.links), a.links)
    # the oracle solves with M; 40 roundings for the paper's arm
    tolerance = 1.5 * EPS * np.linalg.cond(own.M) * a.links[4]
    W = own.mobility((q1, q2))
    np.testing.assert_allclose([[wxx, wxy], [wxy, wyy]], W, atol=tolerance)


@given(arms, angle, elbow)
def test_trace_of_mobility_is_the_same_at_every_pose(a, q1, q2):
    x, y = a.nominal_mobility
    assert a.links == (a.l1, a.l2, a.I1, a.I2, x + y)
    W = oracle(a).mobility((q1, q2))
    assert np.trace(W) == pytest.approx(x + y, rel=4 * EPS * np.linalg.cond(oracle(a).M))


def test_trace_of_mobility_is_the_sum_of_the_printed_gains():
    assert PAPER.links[4] == pytest.approx(0.7919 + 0.131, rel=4 * EPS)


@given(arms, angle, elbow, st.floats(-5, 5), st.floats(-5, 5))
def test_rates_invert_the_jacobian(a, q1, q2, vx, vy):
    u = arm.jacobian(q1, q2, a.links)
    r = arm.joint_velocity(vx, vy, u, 2.0)
    # the columns are as long as the links: their ratio conditions the solution
    ratio = max(a.l1 / a.l2, a.l2 / a.l1, 1.5) / 1.5
    scale = EPS * 40 * ratio * (abs(vx) + abs(vy)) / abs(math.sin(q2))
    np.testing.assert_allclose(2.0 * columns(u) @ r, (vx, vy), atol=scale)


@given(st.floats(0.12, 0.58), st.floats(-3.1, 3.1))
def test_inverse_reaches_the_point_with_the_elbow_bent_right(r, phi):
    x, y = r * math.cos(phi), r * math.sin(phi)
    q1, q2 = arm.inverse_kinematics(x, y, PAPER.links)
    # acos loses half the digits near the stretched arm; 0.58 m keeps sin(q2) above 0.15
    np.testing.assert_allclose(Arm.forward((q1, q2)), (x, y), atol=100 * EPS)
    assert q2 < 0.0


@given(st.floats(0.12, 0.58), st.floats(-math.pi, math.pi) | st.sampled_from([math.pi, -math.pi]))
def test_inverse_takes_the_remainder_by_a_turn_exactly(r, phi):
    """Bit for bit the IEEE remainder, for which compiled code has no function."""
    x, y = r * math.cos(phi), r * math.sin(phi)
    q1, q2 = arm.inverse_kinematics(x, y, PAPER.links)
    l1, l2 = PAPER.l1, PAPER.l2
    turned = math.atan2(y, x) - math.atan2(l2 * math.sin(q2), l1 + l2 * math.cos(q2))
    assert q1 == math.remainder(turned, 2.0 * math.pi)


@given(arms, st.floats(-3.1, 3.1), st.floats(0.15, 2.99))
def test_inverse_finds_the_joint_angles_of_any_arm(a, q1, bend):
    x, y = oracle(a).forward((q1, -bend))
    found = arm.inverse_kinematics(x, y, a.links)
    assert -math.pi < found[0] <= math.pi and found[1] < 0.0
    # sin(q2) above 0.15; roundings of r^2 against 2 l1 l2, which is small where one link is
    ratio = max(a.l1 / a.l2, a.l2 / a.l1)
    np.testing.assert_allclose(oracle(a).forward(found), (x, y), atol=100 * EPS * size(a) * ratio)


@given(arms, st.tuples(*[st.floats(-3, 3)] * 6), angle, elbow)
def test_torques_rates_and_accelerations_of_the_links(a, x, q1, q2):
    """In joint space, M q'' = tau + J' f at rest; power is the same in both."""
    own, u = oracle(a), arm.jacobian(q1, q2, a.links)
    t1, t2, fx, fy, w1, w2 = x
    tau, f, J = np.array([t1, t2]), np.array([fx, fy]), own.jacobian((q1, q2))
    np.testing.assert_allclose(arm.joint_torques(fx, fy, u), J.T @ f, atol=40 * EPS * size(a))
    v = arm.handle_velocity(w1, w1 + w2, u)
    np.testing.assert_allclose(v, J @ (w1, w2), atol=40 * EPS * size(a))
    exact = J @ np.linalg.solve(own.M, tau + J.T @ f)
    Wxx, Wxy, Wyy = arm.mobility(u, a.links)
    found = arm.handle_velocity((t1 - t2) / a.I1, t2 / a.I2, u) + np.array(
        [Wxx * fx + Wxy * fy, Wxy * fx + Wyy * fy]
    )
    bound = 40 * EPS * np.linalg.cond(own.M) * (size(a) / min(a.I1, a.I2)) * size(a)
    np.testing.assert_allclose(found, exact, atol=bound)


def test_nominal_pose_is_decoupled_with_the_printed_inertias():
    u = arm.jacobian(math.pi / 2, -math.pi / 2, PAPER.links)
    wxx, wxy, wyy = arm.mobility(u, PAPER.links)
    assert (wxx, wyy) == pytest.approx((0.7919, 0.131), rel=8 * EPS)
    assert abs(wxy) < 4 * EPS
    assert (u[1] + u[3], -u[0] - u[2]) == pytest.approx((0.35, 0.24), abs=4 * EPS)


@given(arms)
def test_nominal_mobility_and_reach_of_any_arm(a):
    W = oracle(a).mobility((math.pi / 2, -math.pi / 2))
    bound = 4 * EPS * np.linalg.cond(oracle(a).M) * a.links[4]
    np.testing.assert_allclose(np.diag(a.nominal_mobility), W, atol=bound)
    folded, stretched = a.reach
    for q2, r in ((0.0, stretched), (math.pi, folded)):
        assert math.hypot(*oracle(a).forward((0.3, q2))) == pytest.approx(r, abs=4 * EPS * size(a))


@pytest.mark.parametrize(
    "kw", [dict(l1=0.0), dict(l2=-0.35), dict(I1=0.0), dict(I2=float("nan")), dict(l1="long")]
)
def test_bad_arms_are_refused(kw):
    with pytest.raises(ParameterError) as e:
        hc.Arm(**kw)
    assert e.value.field == f"arm.{next(iter(kw))}"
