"""Verdicts on one wall: of its linear loop, and of a run."""

import pytest

import hapticclay as hc

DEVICE = dict(mass=0.1, damper=0.5)


@pytest.mark.parametrize("factor,stable", [(0.97, True), (1.03, False)])
def test_a_run_of_a_linear_wall_agrees_with_its_limit(factor, stable):
    wall = hc.VirtualWall(device=hc.Device(**DEVICE))
    wall = hc.VirtualWall(K=factor * hc.walls.stiffness_band(wall)[1], device=wall.device)
    assert hc.walls.stable_wall(wall) == hc.walls.settles(wall) == stable


@pytest.mark.parametrize("K,rests", [(30.0, True), (500.0, False)])
def test_an_encoder_keeps_a_wall_from_rest_that_its_linear_loop_calls_stable(K, rests):
    """Both lie below the linear limit, 1001 N/m.

    At 500 N/m without friction no K is passive (Abbott, Okamura 2005: K <= 2 fc/Delta). At 30 N/m
    2 fc/Delta is 4e3 N/m, and the wall is passive. Rest is 1 um, far below a count.
    """
    device = hc.Device(**DEVICE, quantum=5e-5, friction=0.1 if rests else 0.0)
    wall = hc.VirtualWall(K=K, device=device)
    assert hc.walls.stable_wall(wall)
    assert hc.walls.settles(wall, hc.walls.Press(still=1e-6)) == rests


def test_another_push_is_refused_by_name():
    with pytest.raises(hc.ParameterError):
        hc.walls.settles(hc.Scenario())


def test_the_largest_K_of_a_region_says_between_which_B_it_lies():
    """Five given B: the exact limit of the linear loop rises and falls among them."""
    wall = hc.VirtualWall(device=hc.Device(**DEVICE))
    found = hc.walls.zwidth(wall, B=(0.0, 30.0, 60.0, 120.0))
    (region,) = found.regions
    i = region.K.index(max(region.K))
    low, high = region.top_between
    assert low == region.B[i - 1] and high == region.B[i + 1] and region.top_B == region.B[i]
    more = [
        hc.walls.stiffness_band(hc.VirtualWall(B=B, device=wall.device))[1] for B in (70.0, 80.0)
    ]
    assert max(more) > region.largest_K
    assert f"between B = {low:.4g} and {high:.4g}, of 4 tried" in found.text()
