"""What a file's own servos do in its own simulation, beside a host or a drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from .. import matrices
from ..arms.servo_gains import without_gains
from ..display import time_words
from .joint_loop import is_stable

IMPLICIT = ("implicit", "implicitfast", "discrete")


def radius(arm: Any, Kp: Sequence[float], Kd: Sequence[float], dt: float, integrator: str) -> float:
    """Largest eigenvalue of a step of MuJoCo for small motions of an arm under its servos.

    Args:
        arm: an arm from a file, at its pose.
        Kp: stiffness of each servo [N.m/rad], shape (n,).
        Kd: damping of each servo [N.m.s/rad], shape (n,).
        dt: step [s].
        integrator: as MJCF calls it.
    """
    linear, stiff, damped = arm.linear(), np.diag(Kp), np.diag(Kd)
    n, eye = len(linear.inertia), np.eye(len(linear.inertia))
    springs = linear.stiffness + stiff
    S, D = springs + linear.gravity_stiffness, linear.damping + damped
    if integrator == "RK4":
        rates = np.zeros((2 * n, 2 * n))
        rates[:n, n:] = eye
        rates[n:] = -np.linalg.solve(linear.inertia, np.hstack([S, D]))
        step = term = np.eye(2 * n)
        for k in range(1, 5):
            term = term @ rates * (dt / k)
            step = step + term
        return float(np.abs(matrices.eigenvalues(step)).max())
    ahead = D if integrator in IMPLICIT else linear.damping  # at the end of the step
    late = np.zeros_like(S)
    if integrator == "discrete":
        late = springs
    whole = linear.inertia + dt * ahead + dt * dt * late
    push = -dt * np.linalg.solve(whole, np.hstack([S, D + dt * late]))
    w = np.hstack([np.zeros((n, n)), eye]) + push
    q = np.hstack([eye, np.zeros((n, n))]) + dt * w
    return float(np.abs(matrices.eigenvalues(np.vstack([q, w]))).max())


def words(arm: Any, law: Any, elsewhere: tuple[str, float]) -> Iterator[str]:
    """Sentences on gains that are the file's own, and what they do elsewhere.

    Args:
        arm: an arm from a file.
        law: that is judged.
        elsewhere: where else the law may run, and the radius of its loop there.
    """
    gains = arm.servo
    if not gains.taken or (law.Kp, law.Kd) != (gains.Kp, gains.Kd):
        return
    yield f"gains: of the file, {gains.taken}"
    yield from without_gains(gains, arm.names)
    yield from gains.notes
    size = radius(arm, gains.Kp, gains.Kd, gains.dt, gains.integrator)
    step = f"at each step of {time_words(gains.dt)} ({gains.integrator}), undelayed"
    yield f"in the file's own simulation they act {step}: {_verdict(size)}"
    where, size = elsewhere
    yield f"{where}: {_verdict(size)}"


def _verdict(size: float) -> str:
    return "stable" if is_stable(size) else f"unstable, radius {size:.4g}"
