"""Composes the engine's model from the parts in mjcf/, adding only what a scenario needs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import mujoco

from .params import Scenario


def folder() -> Path:
    """The folder of MJCF files: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).resolve().parent
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
    text = "".join(f'<include file="{part}"/>' for part in parts)
    files = {part: (folder() / part).read_bytes() for part in parts}
    with warnings_caught() as caught:
        spec = mujoco.MjSpec.from_string(f'<mujoco model="hapticclay">{text}</mujoco>', include=files)
        spec.option.timestep = scenario.dt
        if accurate:
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        for name, limit in zip(("shoulder", "elbow"), scenario.torque_limit, strict=True):
            spec.actuator(name).ctrlrange = (-limit, limit)
        model = spec.compile()
    if caught:
        raise RuntimeError(f"mjcf: {'; '.join(caught)}")
    return model
