"""M and J of arms against Pinocchio's reading of the same files, where it is installed."""

from pathlib import Path

import pytest

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
pytest.importorskip("pinocchio")


@pytest.mark.parametrize("name", ["planar_2r", "five_bar", "haptic_3", "leader_7"])
def test_inertia_and_jacobian(name):
    """Closed chains within 1e-10 rad; all else is rounding."""
    from benchmarks.peers.arm_mechanics import largest_gaps

    M, J = largest_gaps(CARDS / f"{name}.xml")
    assert M < 1e-10 and J < 1e-10
