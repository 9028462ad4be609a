"""The model of a scenario."""

import copy
import ctypes
import functools
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked
from ..model.arm import PAPER, Arm
from ..physics import mjcf_folder, mujoco, warnings_caught
from ..scene.scenario import Scenario

__all__ = ["mjcf_folder", "mujoco", "warnings_caught"]

LINK2_SHARE = 0.4  # of I1, at most, that the mass of link 2 at the elbow takes; 0.396 in arm.xml
OPTIONS = 32  # numbers before the gravity of a model, among which its timestep is


@checked
def build(scenario: Scenario) -> mujoco.MjModel:
    """The model that simulate(scenario) steps.

    It holds joints, inertias and motors, and dampers where there is clay. It holds no geom, sensor,
    contact, mesh, material, light or camera. For an arm from a file it is that of the file, in
    which nothing acts but inertia and weight: all else is the run's.

    Args:
        scenario: what to build for.

    Raises:
        RuntimeError: the engine warned while compiling; the parts in mjcf/ do not fit together.
    """
    if not scenario.is_closed_form:
        model = scenario.file_arm.mechanism.runnable()
        model.opt.timestep = scenario.dt
        return model
    parts = scenario.clay is not None, mjcf_folder(), scenario.arm
    model = copy.copy(_compiled_model(*parts))
    model.opt.timestep = scenario.dt
    for i, limit in enumerate(scenario.torque_limit):
        model.actuator_ctrlrange[i] = -limit, limit
    rotate_dampers(model, scenario)
    return model


def rotate_dampers(model: mujoco.MjModel, scenario: Scenario) -> None:
    """Rotates the engine's dampers, which act along the axes of a site, with the clay."""
    if scenario.clay is not None:
        half, site = 0.5 * scenario.clay.angle, model.site("clay").id
        model.site_quat[site] = math.cos(half), 0.0, 0.0, math.sin(half)
        model.site_sameframe[site] = 0  # its axes are not those of the world


@functools.lru_cache(maxsize=32)
def _compiled_model(dampers: bool, folder: Path, arm: Arm) -> mujoco.MjModel:
    """The model, to be copied; composing and compiling it takes as long as a thousand steps."""
    with warnings_caught() as caught:
        model = compose_spec(["arm.xml"] + ["clay.xml"] * dampers, arm).compile()
    return checked_model(model, caught)


def compose_spec(parts: list[str], arm: Arm) -> mujoco.MjSpec:
    """The specification of a model from files of mjcf/, with the lengths and inertias of an arm."""
    text = "".join(f'<include file="{part}"/>' for part in parts)
    files = {part: (mjcf_folder() / part).read_bytes() for part in parts}
    spec = mujoco.MjSpec.from_string(f'<mujoco model="hapticclay">{text}</mujoco>', include=files)
    upper, lower = spec.body("link1"), spec.body("link2")
    lower.pos[0], spec.site("handle").pos[0] = arm.l1, arm.l2
    # any mass that leaves link 1 an inertia of its own: I1 is all that moves
    lower.mass = min(lower.mass, LINK2_SHARE * arm.I1 / (arm.l1 * arm.l1))
    inertias = (upper, arm.I1 - lower.mass * arm.l1 * arm.l1), (lower, arm.I2)
    for body, inertia in inertias:
        # the other two do not matter in the plane, but no body has less than half of the third
        body.inertia = *(max(x, 0.5 * inertia) for x in body.inertia[:2]), inertia
    return spec


def checked_model(model: mujoco.MjModel, caught: list[str]) -> mujoco.MjModel:
    """The model; raises if the engine warned while compiling it."""
    if caught:
        raise RuntimeError(f"mjcf: {'; '.join(caught)}")
    return model


def arm_at(q: tuple[float, float], arm: Arm = PAPER) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kinematics and inertia of the arm by the engine, independent of `model.arm`."""
    with warnings_caught() as caught:
        model = checked_model(compose_spec(["arm.xml"], arm).compile(), caught)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    handle = model.site("handle").id
    J, M = np.zeros((3, 2)), np.zeros((2, 2))
    mujoco.mj_jacSite(model, data, J, None, handle)
    mujoco.mj_fullM(model, data, M)
    return data.site_xpos[handle][:2].copy(), J[:2], M


def timestep_view(model: mujoco.MjModel) -> np.ndarray:
    """A view of model.opt.timestep, shape (1,).

    The engine shows its gravity as an array, which lies in the same record of options, after the
    timestep. Two values written to the timestep find where that lies.
    """
    start = model.opt.gravity.ctypes.data - 8 * OPTIONS
    memory: Any = (ctypes.c_double * OPTIONS).from_address(start)
    head = np.frombuffer(memory, dtype=float)
    before = model.opt.timestep
    found = np.ones(OPTIONS, dtype=bool)
    for mark in (0.0123456789, 0.00987654321):
        model.opt.timestep = mark
        found &= head == mark
    model.opt.timestep = before
    (at,) = np.flatnonzero(found)
    return head[at : at + 1]
