"""Arms in other packages: their mechanics and motion are those of the engine's model."""

import importlib

import numpy as np
import pytest

import hapticclay as hc
from benchmarks import arm_integrators, arms

FILE, TS = arm_integrators.FILE, arm_integrators.TS


@pytest.mark.parametrize(
    "package, name", [("pydrake", "arm_drake"), ("pinocchio", "arm_pinocchio")]
)
def test_an_arm_of_another_package_is_the_same_arm(package, name):
    """M and weight to rounding; 50 samples of their methods of order 3 and 4 within 1e-6."""
    pytest.importorskip(package)
    peer = importlib.import_module(f"benchmarks.peers.{name}")
    arm, rng = hc.MjcfArm(FILE), np.random.default_rng(0)
    q = arm.q + 0.02 * rng.uniform(-1.0, 1.0, 7)
    method = next(x for x, _ in peer.CASES if x in arms.SECOND)
    theirs, own = peer.make(FILE, method, TS, 1), arms.mujoco_arm(FILE, "RK4", TS, 8)
    for x in (theirs, own):
        x.start(q)
        np.testing.assert_allclose(x.mass_matrix(), arm.mass_matrix(q), atol=1e-13)
    np.testing.assert_allclose(theirs.weight(), own.weight(), atol=1e-13)
    torque = own.weight() + 0.3 * rng.normal(size=7)
    for x in (theirs, own):
        x.hold(torque, 50)
    assert np.abs(own.q - q).max() > 0.02
    np.testing.assert_allclose(theirs.q, own.q, atol=1e-6)
