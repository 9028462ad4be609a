"""The paper's experiments as scenarios."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from .clay import slab
from .errors import ParameterError, flag, number, numbers_of, pair
from .params import (
    B_CONSTANT,
    B_MAX,
    CLAY_X,
    GAIN,
    ORIGIN,
    PATH_LENGTH,
    TORQUE_LIMIT,
    TS,
    Operator,
    Scenario,
)


def constant_cut(
    b: float = B_CONSTANT,
    gain: tuple[float, float] = GAIN,
    force: tuple[float, float] = (1.0, 0.0),
    impedance: bool = False,
    shaping: bool = False,
    dt: float = TS,
    t_max: float = 60.0,
    *,
    clay: tuple[float, float] = CLAY_X,
    length: float = PATH_LENGTH,
    start: tuple[float, float] = (0.0, 0.0),
    origin: tuple[float, float] = ORIGIN,
    torque_limit: tuple[float, float] = TORQUE_LIMIT,
    integrator: Literal["fast", "accurate"] = "fast",
    control: Literal["continuous", "sampled"] = "continuous",
    Ts: float | None = None,
    render: Literal["held", "implicit"] = "held",
) -> Scenario:
    """Cutting with constant volume (Sec. 4.1, Figs. 7, 8): along +x through a slab of clay.

    Args:
        b: damping of the clay on both axes [N.s/m], 0 to 1e9 (Eq. 21).
        gain: K of the compensator on each axis, > 0 (Eq. 20).
        force: muscle force uh of the operator [N].
        impedance: True puts the operator's arm Th (Eq. 19) in the loop.
        shaping: True lets the servo shape the inertia, so that Sh (Eqs. 17, 18) holds at every pose.
        dt: physics and control step [s], 1e-6 to 0.02.
        t_max: longest simulated time [s].
        clay: where the slab begins and ends [m].
        length: the run ends when the handle reaches this x [m].
        start: handle position at t = 0 [m], at rest.
        origin: world position of p = 0 [m].
        torque_limit: of the shoulder and elbow motor [N.m].
        integrator: "fast" (second order, any stiffness) or "accurate" (fourth order, slower).
        control: "continuous", part of the differential equation, or "sampled": measured and held every Ts.
        Ts: control sample [s], a whole multiple of dt; None for dt.
        render: the clay of a sampled loop: its force "held" by the motors, or "implicit" (physical).

    Raises:
        ParameterError: a value is out of its bounds, or the path leaves the reach of the arm.
    """
    begin, end = numbers_of("clay", clay, ("begin", "end"), unit="m")
    if end <= begin:
        raise ParameterError("clay", clay, "must end beyond where it begins")
    return Scenario(
        name="constant",
        clay=slab(number("b", b, 0.0, B_MAX, unit="N.s/m"), begin, end),
        gain=pair("gain", gain, 0.0, 1e6, above=True),
        force=force,
        operator=Operator() if flag("impedance", impedance) else None,
        shaping=shaping,
        dt=dt,
        t_max=t_max,
        length=number("length", length, unit="m"),
        start=start,
        origin=origin,
        torque_limit=torque_limit,
        integrator=integrator,
        control=control,
        Ts=Ts,
        render=render,
    )


def free(
    gain: tuple[float, float] = GAIN,
    force: tuple[float, float] = (1.0, 0.0),
    impedance: bool = False,
    shaping: bool = False,
    dt: float = TS,
    t_max: float = 60.0,
    *,
    length: float = PATH_LENGTH,
    start: tuple[float, float] = (0.0, 0.0),
    origin: tuple[float, float] = ORIGIN,
    torque_limit: tuple[float, float] = TORQUE_LIMIT,
    integrator: Literal["fast", "accurate"] = "fast",
    control: Literal["continuous", "sampled"] = "continuous",
    Ts: float | None = None,
    render: Literal["held", "implicit"] = "held",
) -> Scenario:
    """The same path without clay: the steady speed is K f/10.

    Args:
        gain: K of the compensator on each axis, > 0 (Eq. 20).
        force: muscle force uh of the operator [N].
        impedance: True puts the operator's arm Th (Eq. 19) in the loop.
        shaping: True lets the servo shape the inertia, so that Sh (Eqs. 17, 18) holds at every pose.
        dt: physics and control step [s], 1e-6 to 0.02.
        t_max: longest simulated time [s].
        length: the run ends when the handle reaches this x [m].
        start: handle position at t = 0 [m], at rest.
        origin: world position of p = 0 [m].
        torque_limit: of the shoulder and elbow motor [N.m].
        integrator: "fast" (second order, any stiffness) or "accurate" (fourth order, slower).
        control: "continuous", part of the differential equation, or "sampled": measured and held every Ts.
        Ts: control sample [s], a whole multiple of dt; None for dt.
        render: the clay of a sampled loop: its force "held" by the motors, or "implicit" (physical).

    Raises:
        ParameterError: a value is out of its bounds, or the path leaves the reach of the arm.
    """
    return Scenario(
        name="free",
        gain=pair("gain", gain, 0.0, 1e6, above=True),
        force=force,
        operator=Operator() if flag("impedance", impedance) else None,
        shaping=shaping,
        dt=dt,
        t_max=t_max,
        length=number("length", length, unit="m"),
        start=start,
        origin=origin,
        torque_limit=torque_limit,
        integrator=integrator,
        control=control,
        Ts=Ts,
        render=render,
    )


SCENARIOS: dict[str, Callable[..., Scenario]] = {"constant": constant_cut, "free": free}
