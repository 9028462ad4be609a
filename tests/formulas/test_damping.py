"""Damping of clay in a kick: split, slow, on rotated axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.formulas import damping


@given(st.floats(0, 1e9), st.floats(1e-6, 1e-1))
def test_interior_kick_conserves_the_damping_and_never_overshoots(b, H):
    w = 0.92
    before, after, *_ = damping.split_damping((b, b), (b, b), H, 0.5, 0.5, w, 0.0, 0.0)
    assert before + after == pytest.approx(b, rel=1e-15)
    z = b * H * w
    amplification = (1 - H * w * before) / (1 + H * w * after)
    assert -1e-9 <= amplification <= 1.0
    if z < 2:
        assert before == after == b / 2  # second order


@given(st.floats(0, 1e3), st.floats(0, 1e3), st.floats(0.01, 0.99))
def test_soft_border_kick_gives_each_side_its_share(b0, b1, L):
    before, after, *_, stiff, sharex, sharey, softx, softy = damping.split_damping(
        (b0, b0), (b1, b1), 1e-4, L, 1 - L, 0.92, 0.0, 0.0
    )
    assert (before, after) == (L * b0, (1 - L) * b1)
    assert stiff == sharex == sharey == softx == softy == 0.0


@given(*[st.floats(0, 9).map(lambda e: 10.0**e)] * 2, *[st.floats(1e-6, 1e-2)] * 3)
def test_impulse_of_a_step_is_b_times_its_distance_in_any_clay(bx, by, h0, h, h1):
    """The shares of two kicks in the step between them sum to b h, for steps of any length."""
    b, free = (bx, by), (0.0, 0.0)
    H0, H1 = 0.5 * (h0 + h), 0.5 * (h + h1)
    first = damping.split_damping(free, b, H0, h0 / (2 * H0), h / (2 * H0), 0.92, 0.0, 0.0)
    then = damping.split_damping(b, free, H1, h / (2 * H1), h1 / (2 * H1), 0.92, 0.0, 0.0)
    for i in (0, 1):
        assert H0 * first[2 * i + 1] + H1 * then[2 * i] == pytest.approx(b[i] * h, rel=1e-12)
        assert H1 * then[2 * i] * 0.92 <= 1.0 + 1e-12  # the part before never overshoots


@given(*[st.floats(0.0, 1e6)] * 2)
def test_each_axis_has_the_damper_of_its_hand(dx, dy):
    """Beside stiff clay each axis is split as under a hand that is the same on both."""
    given_numbers = (1e7, 1e6), (1e6, 1e7), 1e-3, 0.5, 0.5, 0.92
    own = damping.split_damping(*given_numbers, dx, dy)
    x, y = (damping.split_damping(*given_numbers, d, d) for d in (dx, dy))
    assert own[4] == 1.0 and own[5] > 0.0 < own[6]
    for i, axis in ((0, x), (1, y)):
        assert [own[2 * i], own[2 * i + 1], own[5 + i]] == [
            axis[2 * i],
            axis[2 * i + 1],
            axis[5 + i],
        ]


def test_slow_force_balances_whatever_pushes():
    """Under the slow force the handle does not accelerate along any stiff axis."""
    W, g, soft = np.array([[0.8, 0.2], [0.2, 0.15]]), np.array([1.0, -2.0]), np.array([0.3, -0.4])
    for stiff in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        slow = damping.slow_force(g, (W[0, 0], W[0, 1], W[1, 1]), stiff, soft)
        f = np.where(np.array(stiff) > 0.0, slow, soft)
        rest = (g - W @ f)[np.array(stiff) > 0.0]
        assert np.abs(rest).max() < 1e-15 * 10  # a few roundings


@given(*[st.floats(0.0, 1e9)] * 2, st.floats(-np.pi, np.pi), *[st.floats(-1.0, 1.0)] * 2)
def test_the_force_of_rotated_axes_is_that_of_its_tensor(bx, by, angle, vx, vy):
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    B = R @ np.diag([bx, by]) @ R.T
    close = dict(rtol=0.0, atol=1e-15 * 16 * max(bx, by, 1e-200))  # some roundings
    xx, yy, xy = damping.rotated_damping(c, s, bx, by)
    np.testing.assert_allclose([[xx, xy], [xy, yy]], B, **close)
    fe = damping.rotated_force(c, s, bx, by, vx, vy)
    np.testing.assert_allclose(fe, B @ [vx, vy], **close)
    assert fe[0] * vx + fe[1] * vy >= -1e-15 * 16 * max(bx, by, 1e-200)  # it takes energy
