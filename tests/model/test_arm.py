"""The closed-form arm against first principles; tolerances are multiples of rounding."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.model import arm
from tests.oracles import Arm

EPS = np.finfo(float).eps
angle = st.floats(-3.1, 3.1)
elbow = st.floats(-3.1, -0.02)


def at(q1, q2):
    return arm.jacobian(q1, q2)


def columns(q1, q2):
    u = at(q1, q2)
    return np.array([[u[0], u[2]], [u[1], u[3]]])


@given(angle, elbow)
def test_columns_are_the_jacobian_in_absolute_angles(q1, q2):
    relative = np.array([[1, 0], [1, 1]])  # absolute rates from relative ones
    np.testing.assert_allclose(columns(q1, q2) @ relative, Arm.jacobian((q1, q2)), atol=4 * EPS)


@given(angle, elbow)
def test_handle_position_from_columns(q1, q2):
    np.testing.assert_allclose(arm.handle_position(q1, q2), Arm.forward((q1, q2)), atol=4 * EPS)


@given(angle, elbow)
def test_jacobian_is_the_derivative_of_the_position(q1, q2):
    h = 1e-6  # central difference: truncation h^2 l/6, rounding eps l/h, both below 1e-9
    q = np.array((q1, q2))
    numeric = np.array([(Arm.forward(q + e) - Arm.forward(q - e)) / (2 * h)
                        for e in (np.array([h, 0]), np.array([0, h]))]).T  # fmt: skip
    np.testing.assert_allclose(Arm.jacobian((q1, q2)), numeric, atol=1e-9)


@given(angle, elbow)
def test_mobility_is_J_Minv_Jt(q1, q2):
    J = Arm.jacobian((q1, q2))
    W = J @ np.linalg.solve(Arm.M, J.T)
    wxx, wxy, wyy = arm.mobility(at(q1, q2))
    np.testing.assert_allclose([[wxx, wxy], [wxy, wyy]], W, atol=40 * EPS)


def test_trace_of_mobility_is_the_sum_of_the_printed_gains():
    assert arm.TRACE_W == pytest.approx(0.7919 + 0.131, rel=4 * EPS)


@given(angle, elbow, st.floats(-5, 5), st.floats(-5, 5))
def test_rates_invert_the_jacobian(q1, q2, vx, vy):
    u = at(q1, q2)
    r = arm.joint_velocity(vx, vy, u, 2.0)
    scale = EPS * 40 * (abs(vx) + abs(vy)) / abs(math.sin(q2))
    np.testing.assert_allclose(2.0 * columns(q1, q2) @ r, (vx, vy), atol=scale)


@given(st.floats(0.12, 0.58), st.floats(-3.1, 3.1))
def test_inverse_reaches_the_point_with_the_elbow_bent_right(r, phi):
    x, y = r * math.cos(phi), r * math.sin(phi)
    q1, q2 = arm.inverse_kinematics(x, y)
    # acos loses half the digits near the stretched arm; 0.58 m keeps sin(q2) above 0.15
    np.testing.assert_allclose(Arm.forward((q1, q2)), (x, y), atol=100 * EPS)
    assert q2 < 0.0


def test_nominal_pose_is_decoupled_with_the_printed_inertias():
    u = at(math.pi / 2, -math.pi / 2)
    wxx, wxy, wyy = arm.mobility(u)
    assert (wxx, wyy) == pytest.approx((0.7919, 0.131), rel=8 * EPS)
    assert abs(wxy) < 4 * EPS
    assert (u[1] + u[3], -u[0] - u[2]) == pytest.approx((0.35, 0.24), abs=4 * EPS)
