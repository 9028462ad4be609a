"""Boxes of hands.

The worst case against dense sampling and against the loop at the hand it names.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from hapticclay.theory import hand_boxes, linear_loop, loops
from tests.hunt import HUNTS, examples


def spans(high):
    side = st.just(0.0) | st.floats(1e-3 * high, high)
    return st.tuples(side, side).map(lambda x: (min(x), max(x)))


@examples(10)
@given(
    axis=st.sampled_from("xy"), b=st.floats(5.0, 300.0), m=spans(2.0), d=spans(40.0), k=spans(400.0)
)
def test_the_worst_case_is_no_better_than_any_sample_and_is_reached(axis, b, m, d, k):
    box = hc.theory.Box(m, d, k)
    worst = hc.theory.worst_case(axis, 1.0, b, box)
    samples = box.corners() + box.sample(60 if HUNTS else 20, seed=3)
    limits = [hc.theory.gain_limit(axis, b, th) for th in samples]
    assert worst.limit <= min(limits) * (1 + 1e-9)  # rounding of roots
    assert worst.hand is not None
    if worst.limit == float("inf"):
        return
    assert hc.theory.gain_limit(axis, b, worst.hand) == pytest.approx(
        worst.limit, rel=1e-6
    )  # the hand it names does it
    for value, (low, high) in zip(
        (worst.hand.mass, worst.hand.damper, worst.hand.spring),
        (box.mass, box.damper, box.spring),
        strict=True,
    ):
        assert low <= value <= high
    assert worst.verdict.verdict == (worst.limit > 1.0) and "exact" in worst.verdict.method


@pytest.mark.parametrize("axis", ["x", "y"])
def test_box_against_a_dense_grid(axis):
    box = hc.theory.Box((0.05, 1.0), (0.0, 20.0), (0.0, 100.0))
    grid = [
        Operator(m, d, k)
        for m in np.linspace(0.05, 1, 6)
        for d in np.linspace(0, 20, 9)
        for k in np.linspace(0, 100, 6)
    ]
    dense = min(hc.theory.gain_limit(axis, 60.0, th) for th in grid)
    found = hc.theory.worst_case(axis, 1.0, 60.0, box).limit
    assert (
        dense * 0.99 < found <= dense * (1 + 1e-9)
    )  # steps of a fifth of the box about a smooth minimum


def test_a_worst_case_inside_an_edge():
    """Without mass and spring the limit in x is least near b + damper = 94 N.s/m.

    No corner of this box.
    """
    box = hc.theory.Box((0.0, 0.0), (0.0, 40.0), (0.0, 0.0))
    worst = hc.theory.worst_case("x", 1.0, 70.0, box)
    dense = min((hc.theory.gain_limit("x", 70.0 + d, None), d) for d in np.linspace(0.0, 40.0, 401))
    assert worst.limit == pytest.approx(
        dense[0], rel=2e-6
    )  # 0.1 N.s/m about a minimum: second order
    assert worst.hand.damper == pytest.approx(dense[1], abs=0.5) and 5.0 < worst.hand.damper < 35.0
    assert worst.limit < min(hc.theory.gain_limit("x", 70.0, th) for th in box.corners())


def test_a_point_is_the_gain_limit_of_that_hand():
    for axis in "xy":
        assert hc.theory.worst_case(axis, 1.0, 90.0, hc.theory.Box()).limit == pytest.approx(
            hc.theory.gain_limit(axis, 90.0, Operator()), rel=1e-9
        )


def test_sampled_and_late_boxes_say_that_they_are_samples():
    box = hc.theory.Box((0.1, 0.5), (1.0, 4.0), (0.0, 20.0))
    for kw in (dict(Ts=1e-3), dict(delay=1e-3)):
        worst = hc.theory.worst_case("y", 0.5, 90.0, box, samples=6, **kw)
        assert worst.verdict.method.startswith("sampled: the corners and 6")
        assert worst.limit == pytest.approx(
            hc.theory.gain_limit("y", 90.0, operator=worst.hand, **kw), rel=1e-12
        )
        assert worst.limit < hc.theory.worst_case("y", 0.5, 90.0, box).limit


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_rigid_arm_is_the_limit_of_rigid_arms(axis):
    """Closed-loop poles tend to the zeros of G C + Sh, left of the axis at every K.

    Th may be as large as it likes.
    """
    limit, _ = hand_boxes.rigid_limit(hc.theory.Loop(axis))
    assert limit == float("inf")
    for K in (0.1, 1.0, 10.0, 1000.0):
        zeros = np.sort_complex(linear_loop.device_admittance(hc.theory.Loop(axis, K=K))[0].roots())
        poles = loops.closed_loop_poles(axis, K, 90.0, Operator(1e3, 1e8, 1e9))
        near = [np.min(np.abs(poles - z)) / abs(z) for z in zeros]
        assert max(near) < 1e-3 and zeros.real.max() < 0.0
        assert linear_loop.stable(hc.theory.Loop(axis, 90.0, Operator(1e3, 1e8, 1e9), K=K))
    box = hc.theory.Box((0.1, 0.5), rigid=True)
    assert (
        hc.theory.worst_case(axis, 0.5, 90.0, box).limit
        == hc.theory.worst_case(axis, 0.5, 90.0, hc.theory.Box((0.1, 0.5))).limit
    )


def test_a_rigid_arm_limits_a_slower_compensator():
    """C = K/(s (s + 1)) in y.

    The zeros of G C + Sh cross, and an arm of 1e9 N/m, 1e8 N.s/m and 1 t confirms it.
    """
    c, arm = hc.Compensator((1.0,), (1.0, 1.0, 0.0)), Operator(1e3, 1e8, 1e9)
    limit, omega = hand_boxes.rigid_limit(hc.theory.Loop("y", compensator=c))
    assert 50.0 < omega < 200.0
    assert hc.theory.gain_limit("y", 90.0, arm, compensator=c) == pytest.approx(
        limit, rel=1e-3
    )  # as near to rigid as 1e8 is to infinity
    for b in (0.0, 90.0):
        worst = hc.theory.worst_case(
            "y",
            0.1,
            b,
            hc.theory.Box((0.25, 0.25), (2.0, 2.0), (0.0, 0.0), rigid=True),
            compensator=c,
        )
        alone = hc.theory.gain_limit("y", b, Operator(0.25, 2.0, 0.0), compensator=c)
        assert worst.limit == pytest.approx(min(alone, limit), rel=1e-9) and (
            worst.hand is None
        ) == (limit < alone)


@pytest.mark.parametrize(
    "call,field",
    [
        (lambda: hc.theory.Box((1.0, 0.5)), "box.mass"),
        (lambda: hc.theory.Box(damper=(-1.0, 0.5)), "box.damper[low]"),
        (lambda: hc.theory.Box(spring=3.0), "box.spring"),
        (lambda: hc.theory.Box(rigid=1), "box.rigid"),
        (lambda: hc.theory.worst_case("x", 1.0, 90.0, (1, 2)), "box"),
        (lambda: hc.theory.worst_case("x", 0.0, 90.0, hc.theory.Box()), "K"),
    ],
)
def test_bad_input_is_refused(call, field):
    with pytest.raises(ParameterError) as e:
        call()
    assert e.value.field == field
