"""The paper's experiments as scenarios."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians
from typing import Literal

from ..errors import ParameterError, choice, flag, number, numbers_of, pair
from .clay import Clay, Profile, slab
from .constants import (
    AXES,
    B_CONSTANT,
    B_MAX,
    B_STABILITY,
    B_VARIABLE,
    BORDER,
    CLAY_X,
    COUNTERWEIGHT,
    GAIN,
    GAINS_FIG11,
    GROWTH,
    GROWTH_EQ25,
    NOMINAL,
    ORIGIN,
    ORIGIN_VARIABLE,
    PATH_LENGTH,
    TORQUE_LIMIT,
    TS,
)
from .operator import Operator
from .scenario import Scenario
from .signals import Multisine

GROWTHS = {  # readings of the growth [N.s/m per s]
    "30/s": GROWTH,
    "0.15/s": GROWTH_EQ25,
    "0.15/sample": GROWTH_EQ25 / TS,
    "none": 0.0,
}
UNIT_FORCE = COUNTERWEIGHT[0] * cos(radians(COUNTERWEIGHT[1]))  # on each axis [N]


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


def variable_cut(
    growth: float | Literal["30/s", "0.15/s", "0.15/sample", "none"] = GROWTH,
    gain: tuple[float, float] = GAIN,
    force: tuple[float, float] = (UNIT_FORCE, UNIT_FORCE),
    impedance: bool = False,
    shaping: bool = False,
    as_printed: bool = False,
    dt: float = TS,
    t_max: float = 60.0,
    *,
    b: tuple[float, float] = B_VARIABLE,
    border: float = BORDER,
    length: float = 0.10,
    start: tuple[float, float] = (0.0, 0.0),
    origin: tuple[float, float] = ORIGIN_VARIABLE,
    torque_limit: tuple[float, float] = TORQUE_LIMIT,
    integrator: Literal["fast", "accurate"] = "fast",
    control: Literal["continuous", "sampled"] = "continuous",
    Ts: float | None = None,
    render: Literal["held", "implicit"] = "held",
) -> Scenario:
    """Cutting with variable volume (Sec. 4.2, Figs. 9, 10): along x and y at once, each axis by its own coordinate.

    Args:
        growth: rate at which the second clay grows in x from when it is entered [N.s/m per s]; or a reading of
            the paper by name: "30/s", "0.15/s", "0.15/sample" (of 0.36 ms), "none".
        gain: K of the compensator on each axis, > 0 (Eq. 22).
        force: muscle force uh of the operator [N]; 1 N at 45 degrees by default.
        impedance: True puts the operator's arm Th (Eq. 19) in the loop.
        shaping: True lets the servo shape the inertia, so that Sh (Eqs. 17, 18) holds at every pose.
        as_printed: True takes K = 1 on both axes, with which y is unstable.
        dt: physics and control step [s], 1e-6 to 0.02.
        t_max: longest simulated time [s].
        b: clay before and after the border, on both axes [N.s/m] (Eqs. 23-26).
        border: where the second clay begins, on each axis [m].
        length: the run ends when the handle reaches this x [m].
        start: handle position at t = 0 [m], at rest.
        origin: world position of p = 0 [m].
        torque_limit: of the shoulder and elbow motor [N.m].
        integrator: "fast" (second order, any stiffness) or "accurate" (fourth order, slower).
        control: "continuous", part of the differential equation, or "sampled": measured and held every Ts.
        Ts: control sample [s], a whole multiple of dt; None for dt.
        render: the clay of a sampled loop: its force "held" by the motors, or "implicit" (physical).

    Raises:
        ParameterError: a value is out of its bounds, the path leaves the reach of the arm, or both as_printed and
            a gain are given.
    """
    if isinstance(growth, str):
        growth = GROWTHS[choice("growth", growth, tuple(GROWTHS))]
    growth = number("growth", growth, 0.0, B_MAX, unit="N.s/m per s")
    if flag("as_printed", as_printed):
        if tuple(gain) != GAIN:
            raise ParameterError("as_printed", True, "sets gain to (1, 1): give one of the two")
        gain = (1.0, 1.0)
    b = pair("b", b, 0.0, B_MAX, unit="N.s/m")
    border = number("border", border, unit="m")
    return Scenario(
        name="variable",
        clay=Clay(
            x=Profile((border,), b, "x", (0.0, growth)),
            y=Profile((border,), b, "y"),
        ),
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


def stability_test(
    gain: float = GAINS_FIG11[1],
    b: float = B_STABILITY,
    axis: Literal["x", "y"] = "x",
    rms: float = 1.0,
    seed: int = 0,
    impedance: bool = True,
    shaping: bool = False,
    dt: float = TS,
    t_max: float = 20.0,
    *,
    origin: tuple[float, float] = NOMINAL,
    torque_limit: tuple[float, float] = TORQUE_LIMIT,
    control: Literal["continuous", "sampled"] = "continuous",
    Ts: float | None = None,
    render: Literal["held", "implicit"] = "held",
) -> Scenario:
    """The stability test (Sec. 4.3, Fig. 11): an arbitrary maneuver through clay, with a gain below or above the limit.

    The maneuver is a muscle force of 0.1 to 2 Hz with random phases; the clay is everywhere. An unstable
    run goes on to the end, bounded by the motors' torque alone.

    Args:
        gain: K of the compensator on the axis (Eq. 27 has 1; Fig. 11 has 2 or 3, and 25).
        b: damping of the clay [N.s/m] (Eq. 28).
        axis: along which the hand moves; the other keeps its default gain.
        rms: of the muscle force [N]. seed: of its phases.
        impedance: True has the operator's arm Th (Eq. 19) in the loop.
        shaping: True lets the servo shape the inertia, so that Sh (Eqs. 17, 18) holds at every pose.
        dt: physics and control step [s], 1e-6 to 0.02.
        t_max: simulated time [s].
        origin: world position of p = 0, where the hand starts [m]; the nominal pose by default.
        torque_limit: of the shoulder and elbow motor [N.m].
        control: "continuous", part of the differential equation, or "sampled": measured and held every Ts.
        Ts: control sample [s], a whole multiple of dt; None for dt.
        render: the clay of a sampled loop: its force "held" by the motors, or "implicit" (physical).

    Raises:
        ParameterError: a value is out of its bounds.
    """
    i = AXES.index(choice("axis", axis, AXES))
    b = number("b", b, 0.0, B_MAX, unit="N.s/m")
    gain = number("gain", gain, 0.0, 1e6, above=True)
    rms = number("rms", rms, 0.0, 1e6, unit="N")
    everywhere = Profile((), (b,))
    return Scenario(
        name="stability",
        clay=Clay(x=everywhere, y=everywhere),
        gain=(gain, GAIN[1]) if i == 0 else (GAIN[0], gain),
        force=(0.0, 0.0),
        muscle=Multisine(rms=(rms, 0.0) if i == 0 else (0.0, rms), seed=seed),
        operator=Operator() if flag("impedance", impedance) else None,
        shaping=shaping,
        dt=dt,
        t_max=t_max,
        length=None,
        origin=origin,
        torque_limit=torque_limit,
        control=control,
        Ts=Ts,
        render=render,
        stop=False,
    )


SCENARIOS: dict[str, Callable[..., Scenario]] = {
    "constant": constant_cut,
    "variable": variable_cut,
    "stability": stability_test,
    "free": free,
}
