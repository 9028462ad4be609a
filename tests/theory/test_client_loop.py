"""The sampled loop of arm, hand and client: against other solutions of the same loop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.constants import NOMINAL
from hapticclay.theory.client_loop import (
    Handle,
    client_map,
    holds,
    rendered_stiffness_limit,
    slowest_period,
)

SCENE = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), origin=NOMINAL, length=None)


@settings(max_examples=15, deadline=None)
@given(
    st.floats(1e-3, 2e-2),
    st.floats(0.0, 2.5),
    st.floats(0.0, 20.0),
    st.floats(0.1, 2.0),
    st.floats(0.5, 20.0),
)
def test_the_limit_is_that_of_a_bare_device_where_the_axes_do_not_couple(Ts, late, B, mass, damper):
    """At the nominal pose x moves as a mass alone: theory.wall_limits has its own matrix for it."""
    hand = hc.Operator(mass, damper, 60.0)
    scene = hc.Scenario(operator=hand, origin=NOMINAL, length=None)
    device = hc.Device(mass=1.0 / scene.arm.nominal_mobility[0])
    wall = hc.VirtualWall(
        K=1.0, B=B, Ts=Ts, delay=late * Ts, device=device, operator=hand, velocity="exact"
    )
    low, high = hc.walls.stiffness_band(wall)
    found = rendered_stiffness_limit(Handle.of(scene), B, Ts, late * Ts)
    if low > 0.0 or high == 0.0:
        assert found == 0.0
    else:
        assert found == pytest.approx(high, rel=1e-6)


def test_the_map_is_the_motion_between_samples():
    """A coupled pose, a fraction of a sample of delay: against an integrated motion."""
    scene = hc.Scenario(operator=hc.Operator(0.4, 3.0, 80.0), length=None)
    handle, Ts, delay = Handle.of(scene, (0.02, 0.01), (1.0, 0.7)), 0.004, 0.0055
    K, B = 300.0, 4.0
    inverse = np.linalg.inv(handle.inertia)
    forces = [0.3, -0.2, 0.5]  # computed one, two and three samples ago

    def motion(t, x):
        f = forces[1] if t < delay - Ts else forces[0]
        rest = -handle.stiffness * x[:2] - handle.damping * x[2:]
        return [*x[2:], *(inverse @ (rest + handle.normal * f))]

    start = np.array([1e-3, -2e-3, 0.01, 0.02])
    x, t = start, 0.0
    for end in (delay - Ts, Ts):
        x = solve_ivp(motion, (t, end - 1e-15), x, rtol=1e-11, atol=1e-14).y[:, -1]
        t = end
    A = client_map(handle, K, B, Ts, delay)
    found = A @ [*start, *(forces[0] * handle.normal), *(forces[1] * handle.normal)]
    assert found[:4] == pytest.approx(x, rel=1e-8, abs=1e-12)
    law = -K * handle.normal @ start[:2] - B * handle.normal @ start[2:]
    assert found[4:6] == pytest.approx(law * handle.normal, rel=1e-14)
    assert found[6:] == pytest.approx(forces[0] * handle.normal, rel=1e-14)


def test_the_slowest_period_is_where_the_limit_is_reached():
    handle = Handle.of(SCENE)
    limit = rendered_stiffness_limit(handle, 0.0, 0.005, 0.005)
    assert holds(handle, 0.99 * limit, 0.0, 0.005, 0.005)
    assert not holds(handle, 1.01 * limit, 0.0, 0.005, 0.005)
    period = slowest_period(handle, 2.0 * limit, 0.0, 1.0, 0.005)
    assert 0.0 < period < 0.005
    assert rendered_stiffness_limit(handle, 0.0, period, period) == pytest.approx(
        2.0 * limit, rel=1e-5
    )
    slow = slowest_period(handle, 0.5 * limit, 0.0, 1.0, 0.005)  # slower than the one it has
    assert slow > 0.005
    assert rendered_stiffness_limit(handle, 0.0, slow, slow) == pytest.approx(0.5 * limit, rel=1e-5)


@pytest.mark.parametrize("Ts", [1e-3, 1e-2, 0.4])
@pytest.mark.parametrize(("K", "B"), [(1000.0, 3.0), (50.0, 3.0), (1e4, 3.0), (10.0, 8.0)])
def test_the_slowest_period_of_a_free_mass_is_that_of_jury(K, B, Ts):
    """A mass m under K and B, held: z^2 - (2 - B T/m - K T^2/2m) z + 1 - B T/m + K T^2/2m.

    Jury: T < 2 B/K and T < 2 m/B, whatever period the program has. Within the bisection's 1e-9
    and the rounding that counts as stable, 1e-12 of an eigenvalue, whose slope here is above 1e-3.
    """
    m = 0.3
    handle = Handle(np.diag([m, m]), np.zeros(2), np.zeros(2), np.array([1.0, 0.0]))
    found = slowest_period(handle, K, B, 0.0, Ts)
    assert found == pytest.approx(min(2.0 * B / K, 2.0 * m / B), rel=1e-7)


def test_a_wall_softer_than_the_hand_is_stable_at_any_rate():
    """Both hold the handle by springs; that of the wall, which comes late, is the weaker one."""
    assert slowest_period(Handle.of(SCENE), 10.0, 0.0, 1.2, 0.005) == math.inf
    free = Handle.of(hc.Scenario(origin=NOMINAL, length=None))
    assert slowest_period(free, 640.0, 0.0, 1.0, 0.005) == 0.0  # nothing damps it


def test_without_hand_and_damping_every_delayed_wall_buzzes():
    scene = hc.Scenario(origin=NOMINAL, length=None)
    assert rendered_stiffness_limit(Handle.of(scene), 0.0, 0.005, 0.005) == 0.0


@pytest.mark.parametrize(("place", "normal"), [((9.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (0.0, 0.0))])
def test_bad_poses_are_refused(place, normal):
    with pytest.raises(ParameterError):
        Handle.of(SCENE, place, normal)
    with pytest.raises(ParameterError):
        rendered_stiffness_limit(Handle.of(SCENE), math.nan, 0.005)
