"""The engine's step: it gets torques, dampers and the rest of the hand force, and moves the arm."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..model import arm

THREE = 0.0, 0.0, 0.0


class Dynamics(NamedTuple):
    """Functions of the engine that give inertia and bias: what of mj_forward this arm needs.

    Attributes:
        kinematics: mj_kinematics.
        com_pos: mj_comPos.
        inertia: mj_makeM.
        com_vel: mj_comVel.
        bias: mj_rne.
    """

    kinematics: Any
    com_pos: Any
    inertia: Any
    com_vel: Any
    bias: Any


class Probe(NamedTuple):
    """The engine as the accurate method uses it.

    Attributes:
        dynamics: its functions.
        model: the model.
        data: its data.
        q: joint angles [rad].
        w: joint rates [rad/s].
        M: inertia in joint space, M11, M21, M22 [kg.m^2].
        bias: Coriolis and centripetal torques of the joints [N.m].
    """

    dynamics: Dynamics
    model: Any
    data: Any
    q: Any
    w: Any
    M: Any
    bias: Any


class Engine(NamedTuple):
    """The engine, and the arrays that a run fills: memoryviews, or addresses for compiled steps.

    Attributes:
        step: mj_step.
        model: the model, or its address.
        data: the data, or its address.
        q: joint angles [rad].
        w: joint rates [rad/s].
        ctrl: controls.
        push: applied joint torques [N.m].
        timestep: length of a step [s].
        rows: of the record, rows.ROW numbers each.
        crossings: coordinate, border [m], time [s], speed along it [m/s] of each.
        stops: where yielding clay stops the handle or releases it: coordinate, or 2.0 for both; 1.0
            for a stop, 0.0 for the end of one; time [s].
        rendered: force of the clay [N] where b v does not give it, and volume removed [m^3], one
            line per row.
        most_crossings: number of crossings at which their array is full.
        most_stops: number of stops at which their array is full.
        probe: for the accurate method.
    """

    step: Any
    model: Any
    data: Any
    q: Any
    w: Any
    ctrl: Any
    push: Any
    timestep: Any
    rows: Any
    crossings: Any
    stops: Any
    rendered: Any
    most_crossings: int
    most_stops: int
    probe: Any


def put(array, i, values):
    """Writes numbers into an array from i on; in compiled code, `array` is its address.

    Args:
        array: of floats.
        values: the numbers, a tuple.
    """
    for x in values:
        array[i] = x
        i += 1


def numbers_at(like, array, i):
    """As many numbers as a tuple has, of an array from i on; compiled, `array` is its address.

    Args:
        like: the tuple.
        array: of floats.
    """
    return tuple(array[i : i + len(like)])


def pair(array):
    """The first two numbers of an array; compiled, `array` is its address.

    Args:
        array: of floats.
    """
    return array[0], array[1]


def with_dampers(clay, e, b):
    """Gives the clay's damping to the engine, which has dampers where there is clay."""
    if clay is None:
        return
    put(e.ctrl, 2, b)


def step_engine(e, clay, tau, push, b, h):
    """Makes the engine step; returns joint angles and rates."""
    put(e.ctrl, 0, tau)
    with_dampers(clay, e, b)
    put(e.push, 0, push)
    put(e.timestep, 0, (h,))
    e.step(e.model, e.data)
    return pair(e.q), pair(e.w)


def moved_arm(parts, e, before, w, k, h):
    """Steps the engine to the rates of a kick; joint angles and rates there."""
    if before == h:  # beside its dampers the engine gets all of the force
        (x, y), f = k.damped, k.motion.f
        push = arm.joint_torques(f[0] + x, f[1] + y, k.at.u)
        return step_engine(e, parts.clay, k.tau, push, k.viscous.b1, h)
    # its step is longer or shorter than the kick
    links, n, tau = parts.arm.links, k.w, k.tau
    a1, a2 = (n[0] - w[0]) / h, (n[0] + n[1] - w[0] - w[1]) / h
    push = links[2] * a1 + links[3] * a2 - tau[0], links[3] * a2 - tau[1]
    return step_engine(e, parts.clay, tau, push, (0.0, 0.0), h)


def accelerations(probe, z, now):
    """Joint accelerations at a point of a step, by the engine's inertia and bias [rad/s^2]."""
    put(probe.q, 0, z.q)
    put(probe.w, 0, z.w)
    x, model, data = probe.dynamics, probe.model, probe.data
    x.kinematics(model, data)
    x.com_pos(model, data)
    x.inertia(model, data)
    x.com_vel(model, data)
    x.bias(model, data, 0, probe.bias)
    (c1, c2), (m11, m21, m22) = pair(probe.bias), numbers_at(THREE, probe.M, 0)
    n1, n2 = now.tau[0] + now.push[0] - c1, now.tau[1] + now.push[1] - c2
    share = m21 / m22
    a1 = (n1 - share * n2) / (m11 - share * m21)
    return a1, n2 / m22 - share * a1
