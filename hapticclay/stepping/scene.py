"""Composes the engine's model from the parts in mjcf/, adding only what a scenario needs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..model.scenario import L1, L2, Scenario
from .engine import mujoco


def folder() -> Path:
    """The folder of MJCF files: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent / "mjcf"
    return checkout if (checkout / "arm.xml").is_file() else package / "mjcf"


@contextlib.contextmanager
def warnings_caught() -> Iterator[list[str]]:
    """Collects the engine's warnings instead of letting it write MUJOCO_LOG.TXT."""
    caught: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(caught.append)
    try:
        yield caught
    finally:
        mujoco.set_mju_user_warning(before)


def build(scenario: Scenario) -> mujoco.MjModel:
    """The model that simulate(scenario) steps: joints, inertias, motors; the clay's dampers
    and the states of an accurate run if there are any.

    It holds no geom, sensor, contact, mesh, material, light or camera.

    Args:
        scenario: what to build for.

    Raises:
        RuntimeError: the engine warned while compiling; the parts in mjcf/ do not fit together.
    """
    accurate = scenario.integrator == "accurate"
    parts = ["arm.xml"] + ["clay.xml"] * (scenario.clay is not None) + ["states.xml"] * accurate
    with warnings_caught() as caught:
        spec = _compose(parts)
        spec.option.timestep = scenario.dt
        if accurate:
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        for name, limit in zip(("shoulder", "elbow"), scenario.torque_limit, strict=True):
            spec.actuator(name).ctrlrange = (-limit, limit)
        model = spec.compile()
    return _sound(model, caught)


@dataclass(frozen=True)
class Block:
    """The block of clay in a picture.

    Attributes:
        low, high: corners [m], in world coordinates. rows, columns: of its map of heights. thickness: [m].
        colors: image over the block, shape (n, m, 3) of bytes, row 0 at the +y edge.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    rows: int
    columns: int
    thickness: float
    colors: np.ndarray


def picture(clay: Block | None, tool: tuple[float, float]) -> mujoco.MjModel:
    """A model to look at, not to step: the same arm with skin on, the room, the block of clay as a heightfield.

    Its joints are those of `build`; whoever draws copies the angles. The target of the hand is the mocap body
    "target", the tool's tip the body "tool".

    Args:
        clay: the block; None for none. tool: width of the tool, and depth of its tip under the surface [m].
    """
    with warnings_caught() as caught:
        spec = _compose(["arm.xml", "room.xml"])
        for body, *skin in SKIN:
            _skin(spec.body(body) if body else spec.worldbody, *skin)
        surface = GROUND + (clay.thickness if clay else THICKNESS)
        body = spec.body("link2").add_body(name="tool", pos=(L2, 0.0, 0.0))
        _skin(body, "cylinder", (0.0, 0.0, surface - tool[1]), (0.0, 0.0, 0.0), 0.5 * tool[0], "steel")
        _skin(body, "cylinder", (0.0, 0.0, 0.0), (0.0, 0.0, 0.045), 0.008, "dark")
        _skin(body, "sphere", (0.0, 0.0, 0.052), (0.0, 0.0, 0.052), 0.016, "orange")
        target = spec.worldbody.add_body(name="target", mocap=True)
        _skin(target, "sphere", (0.0, 0.0, 0.052), (0.0, 0.0, 0.052), 0.012, "", (0.9, 0.42, 0.05, 0.45))
        if clay:
            _block(spec, clay)
        model = spec.compile()
    return _sound(model, caught)


GROUND = -0.06  # height of the table under the plane of the arm [m], as in room.xml
THICKNESS = 0.03  # of a block of clay [m]
SKIN: Any = (  # body ("" for the world), shape, from, to [m], radius [m], material
    ("", "cylinder", (0.0, 0.0, GROUND), (0.0, 0.0, -0.03), 0.060, "dark"),
    ("", "cylinder", (0.0, 0.0, -0.03), (0.0, 0.0, 0.022), 0.042, "steel"),
    ("link1", "cylinder", (0.0, 0.0, 0.022), (0.0, 0.0, 0.034), 0.034, "dark"),
    ("link1", "capsule", (0.0, 0.0, 0.0), (L1, 0.0, 0.0), 0.017, "dark"),
    ("link1", "cylinder", (L1, 0.0, -0.024), (L1, 0.0, 0.024), 0.026, "steel"),
    ("link2", "cylinder", (0.0, 0.0, 0.024), (0.0, 0.0, 0.034), 0.021, "blue"),
    ("link2", "capsule", (0.0, 0.0, 0.0), (L2, 0.0, 0.0), 0.012, "blue"),
)


def _compose(parts: list[str]) -> mujoco.MjSpec:
    text = "".join(f'<include file="{part}"/>' for part in parts)
    files = {part: (folder() / part).read_bytes() for part in parts}
    return mujoco.MjSpec.from_string(f'<mujoco model="hapticclay">{text}</mujoco>', include=files)


def _sound(model: mujoco.MjModel, caught: list[str]) -> mujoco.MjModel:
    if caught:
        raise RuntimeError(f"mjcf: {'; '.join(caught)}")
    return model


def _skin(body, shape: str, begin, end, radius: float, material: str, rgba=(0.5, 0.5, 0.5, 1.0)) -> None:
    """Adds a geom that is only seen: it weighs nothing and touches nothing."""
    kind = getattr(mujoco.mjtGeom, f"mjGEOM_{shape.upper()}")
    place = {"pos": begin, "size": (radius, 0.0, 0.0)} if begin == end else {"fromto": (*begin, *end)}
    geom = body.add_geom(type=kind, material=material, mass=0.0, contype=0, conaffinity=0, **place)
    geom.size[0] = radius
    if not material:
        geom.rgba = rgba


def _block(spec: mujoco.MjSpec, clay: Block) -> None:
    size = [0.5 * (high - low) for low, high in zip(clay.low, clay.high, strict=True)]
    middle = [0.5 * (high + low) for low, high in zip(clay.low, clay.high, strict=True)]
    height, width = clay.colors.shape[:2]
    spec.add_texture(
        name="block", type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3,
        data=clay.colors.astype(np.uint8).ravel().tolist(),
    )  # fmt: skip
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "block"
    spec.add_material(name="block", textures=textures, specular=0.12, shininess=0.15)
    spec.add_hfield(
        name="clay", nrow=clay.rows, ncol=clay.columns, size=(*size, clay.thickness, 1e-3),
        userdata=np.ones(clay.rows * clay.columns),
    )  # fmt: skip
    spec.worldbody.add_geom(
        name="clay", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="clay", material="block",
        pos=(*middle, GROUND), contype=0, conaffinity=0,
    )  # fmt: skip
