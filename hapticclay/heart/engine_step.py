"""The engine's step: it gets torques, dampers and the rest of the hand force, and moves the arm."""

from __future__ import annotations

from ..model import arm
from . import viscous


def put(array, i, x):
    """Writes a number into an array; compiled, `array` is its address."""
    array[i] = x


def get(array, i):
    """Reads a number from an array; compiled, `array` is its address."""
    return array[i]


def with_dampers(clay, e, dampers):
    """Gives the clay's dampers to the engine, which has some where there is clay."""
    if clay is None:
        return
    put(e.ctrl, 2, dampers[0])
    put(e.ctrl, 3, dampers[1])


def step_engine(e, clay, tau, push, dampers, h):
    """Lets the engine step; returns joint angles and rates."""
    put(e.ctrl, 0, tau[0])
    put(e.ctrl, 1, tau[1])
    with_dampers(clay, e, dampers)
    put(e.push, 0, push[0])
    put(e.push, 1, push[1])
    put(e.timestep, 0, h)
    e.step(e.model, e.data)
    return (get(e.q, 0), get(e.q, 1)), (get(e.w, 0), get(e.w, 1))


def moved_arm(parts, e, grain, before, w, k, h):
    """Steps the engine to the rates of a kick; joint angles and rates there."""
    if before == h:  # beside its dampers the engine gets all of the force
        b, u, f = k.viscous.b1, k.motion.u, k.motion.f
        x, y = viscous.force(grain, b, u)
        push = arm.joint_torques(f[0] + x, f[1] + y, k.at.u)
        return step_engine(e, parts.clay, k.tau, push, b, h)
    # its step is longer or shorter than the kick
    links, n, tau = parts.arm.links, k.w, k.tau
    a1, a2 = (n[0] - w[0]) / h, (n[0] + n[1] - w[0] - w[1]) / h
    push = links[2] * a1 + links[3] * a2 - tau[0], links[3] * a2 - tau[1]
    return step_engine(e, parts.clay, tau, push, (0.0, 0.0), h)
