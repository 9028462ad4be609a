"""Passivity of virtual walls by runs, beside Colgate and Schenkel, Abbott and Okamura."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies.port_energy import Path, imposed, passivity_limit, taken_energy, zigzag
from tests.hunt import HUNTS, some


def test_the_path_is_imposed_and_its_energy_is_that_of_the_derivation():
    # 2 samples: 4 b A^2/Ts each from the damper, -2 A^2 (K + 2 B/Ts) from the wall
    A, b, K, B, Ts = 1e-4, 2.0, 1500.0, 0.6, 1e-3
    wall = hc.VirtualWall(K=K, B=B, device=hc.Device(mass=0.1, damper=b), Ts=Ts)
    asked = 2.0 * (4.0 * b * A**2 / Ts - 2.0 * A**2 * (K + 2.0 * B / Ts))
    # the forces of the hand are summed over two reversals of 2 m v, 5e4 times the energy's share
    assert taken_energy(wall, zigzag(A)) == pytest.approx(asked, rel=1e-4)
    r = hc.simulate(imposed(wall, zigzag(A), 3, 16)[0])
    # link 1 moves on an arc: (A/lever)^2/2 = 9e-8
    assert np.abs(r.p[::16, 0]) == pytest.approx(A, rel=1e-4)
    assert taken_energy(replace(wall, device=hc.Device(1.0, b)), zigzag(A)) == pytest.approx(
        asked, rel=1e-3
    )  # whatever the mass


@pytest.mark.parametrize(
    "parts",
    [
        dict(device=hc.Device(0.1, 2.0)),
        dict(device=hc.Device(0.3, 5.0), B=3.0, Ts=5e-4),
        dict(device=hc.Device(0.3, 5.0), B=-3.0, Ts=2e-3),
        dict(device=hc.Device(0.1, 2.0), delay=1e-3),
        dict(device=hc.Device(0.1, 2.0), delay=5e-4),
        dict(device=hc.Device(0.1, 2.0), delay=1.25e-3, B=0.5),
        dict(device=hc.Device(0.1, 2.0), B=1.5, velocity_window=3),
        dict(device=hc.Device(0.1, 2.0), B=1.5, velocity_filter=50.0),
    ],
)
def test_runs_are_passive_up_to_the_line_of_colgate_and_schenkel(parts):
    wall = hc.VirtualWall(**parts)
    # the slowest path is at pi/48, where the limit of slow paths is short of by 0.4 % at most
    assert passivity_limit(wall) == pytest.approx(hc.walls.colgate_schenkel_limit(wall), rel=5e-3)


@pytest.mark.parametrize(
    ("friction", "quantum"), some([(0.03, 4e-5), (0.02, 1e-5), (0.05, 1e-5), (0.2, 1e-5)], 2)
)
def test_runs_are_passive_up_to_the_line_of_abbott_and_okamura(friction, quantum):
    wall = hc.VirtualWall(device=hc.Device(0.1, 5.0, friction, quantum))
    # friction along the large path and damping along the small one: fc Ts/(2 A b) and 2 A b/(Ts fc)
    assert passivity_limit(wall) == pytest.approx(hc.walls.abbott_okamura_limit(wall), rel=0.01)


@pytest.mark.parametrize("mass", [0.7, 2.0] if HUNTS else [2.0])
def test_a_heavy_device_with_a_small_damper_is_no_less_passive(mass):
    # its arc weighs most beside the damper; friction along the large path leaves 2 % to spare
    wall = hc.VirtualWall(device=hc.Device(mass, 0.05, 0.001, 8e-5), Ts=2e-3)
    asked = min(2.0 * 0.05 / 2e-3, 2.0 * 0.001 / 8e-5)
    assert passivity_limit(wall) >= (1.0 - 2e-3) * asked
    slow = replace(wall, device=hc.Device(mass, 0.05, 0.01, 8e-5))
    assert passivity_limit(slow) >= (1.0 - 2e-3) * 2.0 * 0.05 / 2e-3


def test_no_passive_motion_takes_energy_from_a_wall_below_the_lines():
    rng = np.random.default_rng(5)
    plain = hc.VirtualWall(B=1.0, device=hc.Device(0.1, 3.0))
    plain = replace(plain, K=0.98 * hc.walls.colgate_schenkel_limit(plain))
    rough = hc.VirtualWall(device=hc.Device(0.1, 3.0, 0.05, 2e-5))
    rough = replace(rough, K=0.98 * hc.walls.abbott_okamura_limit(rough))
    for i in range(12):
        n = int(rng.integers(2, 9))
        path = Path(tuple((10.0 ** rng.uniform(-5.0, -3.5) * rng.uniform(-1.0, 1.0, n)).tolist()))
        for wall in (plain, rough):
            assert taken_energy(wall, path, 1) > 0.0, (i, wall)


def test_a_device_that_takes_nothing_has_no_passive_wall():
    assert passivity_limit(hc.VirtualWall()) == 0.0
    assert passivity_limit(hc.VirtualWall(B=3.0, device=hc.Device(0.1, 2.0))) == 0.0


@pytest.mark.parametrize(
    ("wall", "field"),
    [
        (hc.VirtualWall(operator=hc.Operator()), "wall.operator"),
        (hc.VirtualWall(unilateral=True), "wall.unilateral"),
        (hc.VirtualWall(B=1.0, velocity="exact"), "wall.velocity"),
    ],
)
def test_walls_that_are_refused(wall, field):
    with pytest.raises(ParameterError, match=field):
        passivity_limit(replace(wall, device=hc.Device(0.1, 1.0)))


def test_paths_that_are_refused():
    for bad in (
        dict(places=(1.0, 0.0)),
        dict(places=(0.0,)),
        dict(places=(0.0, 0.01), middles=(0.0,)),
    ):
        with pytest.raises(ParameterError, match="path"):
            Path(**bad)
