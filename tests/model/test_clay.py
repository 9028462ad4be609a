import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.errors import ParameterError
from hapticclay.model import clay
from hapticclay.model.clay import Clay, Profile


@given(st.floats(0, 1e9), st.floats(1e-6, 1e-1))
def test_interior_kick_conserves_the_damping_and_never_overshoots(b, H):
    w = 0.92
    before, after, *_ = clay.split_damping((b, b), (b, b), H, 0.5, 0.5, w, 0.0)
    assert before + after == pytest.approx(b, rel=1e-15)
    z = b * H * w
    amplification = (1 - H * w * before) / (1 + H * w * after)
    assert -1e-9 <= amplification <= 1.0
    if z < 2:
        assert before == after == b / 2  # second order


@given(st.floats(0, 1e3), st.floats(0, 1e3), st.floats(0.01, 0.99))
def test_soft_border_kick_gives_each_side_its_share(b0, b1, L):
    before, after, *_, stiff, sharex, sharey, softx, softy = clay.split_damping(
        (b0, b0), (b1, b1), 1e-4, L, 1 - L, 0.92, 0.0
    )
    assert (before, after) == (L * b0, (1 - L) * b1)
    assert stiff == sharex == sharey == softx == softy == 0.0


@given(*[st.floats(0, 9).map(lambda e: 10.0**e)] * 2, *[st.floats(1e-6, 1e-2)] * 3)
def test_impulse_of_a_step_is_b_times_its_distance_in_any_clay(bx, by, h0, h, h1):
    """The shares of two kicks in the step between them sum to b h, for steps of any length."""
    b, free = (bx, by), (0.0, 0.0)
    H0, H1 = 0.5 * (h0 + h), 0.5 * (h + h1)
    first = clay.split_damping(free, b, H0, h0 / (2 * H0), h / (2 * H0), 0.92, 0.0)
    then = clay.split_damping(b, free, H1, h / (2 * H1), h1 / (2 * H1), 0.92, 0.0)
    for i in (0, 1):
        assert H0 * first[2 * i + 1] + H1 * then[2 * i] == pytest.approx(b[i] * h, rel=1e-12)
        assert H1 * then[2 * i] * 0.92 <= 1.0 + 1e-12  # the part before never overshoots


def test_slow_force_balances_whatever_pushes():
    """Under the slow force the handle does not accelerate along any stiff axis."""
    W, g, soft = np.array([[0.8, 0.2], [0.2, 0.15]]), np.array([1.0, -2.0]), np.array([0.3, -0.4])
    for stiff in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        slow = clay.slow_force(*g, W[0, 0], W[0, 1], W[1, 1], *stiff, *soft)
        f = np.where(np.array(stiff) > 0.0, slow, soft)
        rest = (g - W @ f)[np.array(stiff) > 0.0]
        assert np.abs(rest).max() < 1e-15 * 10  # a few roundings


def regions(damping, length, x=0.0, y=0.0):
    """The region around a place: the table, its indices, and a function that enters a region."""
    table = clay.region_table(damping, length)
    at = [
        int(np.searchsorted(table[clay.EDGE_ROW + i][1:], (x, y)[i], side="right")) for i in (0, 1)
    ]
    return table, at, lambda ix, iy, t=0.0: clay.enter_region(table, ix, iy, t)


def test_regions_of_the_slab():
    table, at, enter = regions(clay.slab(90.0, 0.05, 0.15), 0.20)
    assert at == [0, 0] and table[clay.AXIS_ROWS, 2] == 0.20
    ways = [(low[0], high[0], b) for low, high, b, _ in (enter(i, 0) for i in range(3))]
    assert ways == [
        (-np.inf, 0.05, (0.0, 0.0)),
        (0.05, 0.15, (90.0, 90.0)),
        (0.15, 0.20, (0.0, 0.0)),
    ]


@pytest.mark.parametrize(
    "p,b", [((0.05, 0.0), 90.0), ((0.049, 0.0), 0.0), ((0.1, 0.3), 90.0), ((0.15, 0.0), 0.0)]
)
def test_regions_from_any_start(p, b):
    _, at, enter = regions(clay.slab(90.0, 0.05, 0.15), 0.2, *p)
    assert enter(*at)[2] == (b, b)


def test_each_axis_follows_its_own_coordinate():
    both = Clay(Profile((0.05,), (50.0, 100.0), "x"), Profile((0.05,), (50.0, 200.0), "y"))
    _, at, enter = regions(both, None)
    assert at == [0, 0]
    assert [enter(*i)[2] for i in ((0, 0), (0, 1), (1, 1))] == [
        (50.0, 50.0),
        (50.0, 200.0),
        (100.0, 200.0),
    ]


def test_clay_grows_from_its_first_entry():
    both = Profile((0.05,), (10.0, 20.0), "x", growth=(1.0, 3.0))
    _, _, enter = regions(Clay(both, both), None)
    for t in (2.0, 5.0):  # the second time, it has grown since the first
        _, _, base, rate = enter(1, 0, t)
        assert clay.damping_at(base, rate, 6.0) == (20.0 + 3.0 * 4.0,) * 2


@pytest.mark.parametrize(
    "edges,values,along",
    [
        ((0.1, 0.05), (0, 1, 0), "x"),
        ((0.1,), (1.0,), "x"),
        ((0.1,), (0.0, -1.0), "x"),
        ((0.1,), (0.0, 1.0), "z"),
        ((float("nan"),), (0.0, 1.0), "x"),
        (None, (0.0,), "x"),
        ((0.1,), (0.0, 1e12), "x"),
    ],
)
def test_bad_profiles_are_refused(edges, values, along):
    with pytest.raises(ParameterError, match="clay"):
        Profile(edges, values, along)
