"""Renderable masses, dampers and springs against closed forms, roots and other searches."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.theory import gain_crossings, gain_limits, mbk

WALL = hc.VirtualWall(device=hc.Device(0.1, 0.5))


@given(B=st.floats(0.0, 150.0), M=st.floats(-0.05, 0.1), delay=st.floats(0.0, 2e-3))
@settings(max_examples=20, deadline=None)
def test_the_band_of_springs_is_that_of_the_exact_crossings(B, M, delay):
    """`stiffness_band` has the crossings of the unit circle, `stable_band` eigenvalues."""
    wall = replace(WALL, B=B, M=M, delay=delay)
    low, high = hc.walls.stiffness_band(wall)
    found = mbk.stable_band(wall, "K")
    if high == 0.0 or high < 1e-6 / wall.Ts**2 or low > 0.5 * high:
        return  # nothing, or less than a step of the grid
    assert found[1] == pytest.approx(high, rel=1e-6)
    assert found[0] == pytest.approx(low, rel=1e-6, abs=1e-6 * high)


@pytest.mark.parametrize("part", ["B", "M"])
@pytest.mark.parametrize("K", [0.0, 800.0])
def test_the_ends_of_a_band_are_where_stability_ends(part, K):
    wall = replace(WALL, K=K, operator=hc.Operator(0.2, 1.0, 0.0))
    low, high = mbk.stable_band(wall, part)
    span = high - low
    for at, expected in ((low, False), (high, True)):
        below, above = (
            hc.walls.stable_wall(replace(wall, **{part: at + x * span})) for x in (-1e-6, 1e-6)
        )
        assert (below, above) == (expected, not expected)


def test_the_largest_damper_of_a_bare_mass_is_in_closed_form():
    """With D the difference over Ts and x = B Ts/m: v+ = v - x D, D+ = v - x/2 D; so x < 2."""
    for m, Ts in ((0.1, 1e-3), (0.4, 5e-3)):
        low, high = mbk.stable_band(hc.VirtualWall(device=hc.Device(m), Ts=Ts), "B")
        assert high == pytest.approx(2.0 * m / Ts, rel=1e-8)
        assert low == pytest.approx(0.0, abs=1e-6 * high)
    assert mbk.stable_band(WALL, "B")[0] == pytest.approx(-0.5, rel=1e-6)  # that of the device


def test_a_region_is_stable_inside_and_unstable_outside():
    for plane, (across, up) in mbk.PLANES.items():
        wall = replace(WALL, K=500.0, B=2.0)
        region = mbk.renderable(wall, plane, 9)
        for x, low, high in zip(region.x[1:-1], region.low[1:-1], region.high[1:-1], strict=True):
            at = replace(wall, **{across: float(x)})
            assert hc.walls.stable_wall(replace(at, **{up: 0.5 * (low + high)}))
            assert not hc.walls.stable_wall(replace(at, **{up: high + 1e-6 * (high - low)}))
        for beyond in (-0.02, 1.02):
            x = region.x[0] + beyond * (region.x[-1] - region.x[0])
            low, high = mbk.stable_band(replace(wall, **{across: float(x)}), up)
            assert math.isnan(high) or high <= 0.02 * np.nanmax(region.high)


def test_a_virtual_mass_stiffens_the_wall_from_half_the_mass_of_the_device_on():
    """Late by 3/2 Ts, M a damps where M/(m + M) > 1/3: it pays for the hold of K."""
    limits = [mbk.stable_band(replace(WALL, B=2.0, M=M), "K")[1] for M in (0.0, 0.04, 0.06)]
    assert limits[0] < limits[1] < limits[2] and limits[2] > 10.0 * limits[0]


def test_negative_mass_takes_away_that_of_the_device_and_no_more():
    low, high = mbk.stable_band(WALL, "M")
    assert low == pytest.approx(-0.1, rel=0.01)
    assert high == pytest.approx(0.2, rel=0.01)


def rendering(loop, M, B):
    """The loop whose compensator is the admittance 1/(M s^2 + B s)."""
    return replace(loop, compensator=hc.Compensator((1.0,), (1.0, B / M, 0.0)), K=1.0 / M)


@pytest.mark.parametrize("Ts", [None, 1e-3])
def test_least_mass_of_the_arm_is_the_border(Ts):
    loop = hc.theory.Loop("y", 40.0, hc.Operator(), Ts=Ts)
    for decay in (2.0, 10.0, 60.0):
        M, B = mbk.least_mass(loop, decay)
        assert B == pytest.approx(decay * M)
        assert gain_crossings.is_stable(rendering(loop, 1.001 * M, 1.001 * B))
        assert not gain_crossings.is_stable(rendering(loop, 0.999 * M, 0.999 * B))
    printed = mbk.least_mass(loop, 10.0)[0]
    assert printed == pytest.approx(1.0 / gain_limits.gain_limit(loop), rel=1e-12)


def test_least_mass_over_a_box_is_that_of_its_worst_hand():
    loop = hc.theory.Loop("x", 0.0, hc.Operator())
    box = hc.theory.Box((0.1, 1.0), (1.0, 10.0), (0.0, 300.0))
    M, B = mbk.least_mass(loop, 10.0, box)
    members = [*box.corners(), *box.sample(60)]
    each = [mbk.least_mass(replace(loop, operator=th), 10.0)[0] for th in members]
    assert M >= max(each) * (1.0 - 1e-9)
    assert M == pytest.approx(max(each), rel=0.05)  # a corner here


def test_dynamic_range_is_between_free_motion_and_the_stiffest_wall():
    omega = 2.0 * np.pi * np.array([0.5, 5.0, 30.0])
    r = mbk.dynamic_range(WALL, omega)
    s = 1j * omega
    np.testing.assert_allclose(r.free, np.abs(0.1 * s + 0.5), rtol=1e-9)
    np.testing.assert_allclose(
        r.most, np.abs(hc.walls.wall_impedance(r.stiffest, omega)), rtol=1e-9
    )
    assert hc.walls.stable_wall(r.stiffest)
    # no other B has a stiffer wall: a search by the exact crossings
    most = max(hc.walls.stiffness_band(replace(WALL, B=B))[1] for B in np.linspace(40.0, 130.0, 31))
    assert r.stiffest.K / r.share == pytest.approx(most, rel=1e-3)
    assert r.stiffest.K / r.share >= most * (1.0 - 1e-6)
    assert np.all(r.least <= r.free) and 0.0 < r.mean < r.decibels[0]


def test_what_is_refused():
    with pytest.raises(ParameterError, match="part"):
        mbk.stable_band(WALL, "b")
    with pytest.raises(ParameterError, match="plane"):
        mbk.renderable(WALL, "mass-dampr")
    with pytest.raises(ParameterError, match="must be stable somewhere"):
        mbk.renderable(replace(WALL, B=1e6), "mass-stiffness")
    with pytest.raises(ParameterError, match="share"):
        mbk.dynamic_range(WALL, [1.0], 1.0)
    with pytest.raises(ParameterError, match="decay"):
        mbk.least_mass(hc.theory.Loop("x"), -1.0)
