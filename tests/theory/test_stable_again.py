"""A box of hands whose loop is stable at small and at huge gains, and not between."""

from dataclasses import replace

import numpy as np

import hapticclay as hc
from hapticclay.theory import linear_loop
from hapticclay.theory.loops import Loop

C = hc.Compensator((1.0, 0.6648866174921014, 280.92193517084104), (1.0, 0.886304300269653, 0.0))
BOX = hc.theory.Box((0.0153, 3.015), (0.0629, 0.857), (350.0, 5853.0))
LOOP = Loop("y", b=14.748, compensator=C, K=1e-5)


def growth(K, hand):
    """Largest real part of the poles, by numpy's roots of the characteristic polynomial."""
    found = linear_loop.characteristic(replace(LOOP, K=K, operator=hand))
    return np.roots(np.trim_zeros(found.coef)[::-1]).real.max()


def test_a_box_stable_at_a_huge_gain_has_the_limit_of_its_first_failure():
    """Every corner is stable at every K, and every hand at K = 1e6; hands within are not."""
    found = hc.theory.worst_case(LOOP, box=BOX)
    assert found.limit < 1e-3
    assert growth(1.01 * found.limit, found.hand) > 0.0
    rng = np.random.default_rng(0)
    ends = (BOX.mass, BOX.damper, BOX.spring)
    hands = [hc.Operator(*(float(rng.uniform(*x)) for x in ends)) for _ in range(300)]
    assert all(growth(1e6, th) < 0.0 for th in [*hands, *BOX.corners()])
    assert all(growth(0.99 * found.limit, th) < 0.0 for th in [*hands, *BOX.corners()])
    assert any(growth(10.0 * found.limit, th) > 0.0 for th in hands)
