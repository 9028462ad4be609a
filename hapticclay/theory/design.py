"""Choosing the compensator: the largest gain for a margin, and other shapes of C at the same margin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError, number, pair
from ..model.controller import PRINTED, Compensator
from ..model.operator import Operator
from . import gain_limit, linear_loop, margins

K_MAX = 1e6  # as in a Scenario: a margin that holds there holds for any gain
DESIGN_BAND = (0.3, 30.0)  # [rad/s]: where a hand moves on purpose, up to about 5 Hz


def design_gain(
    axis: str,
    b: float,
    *,
    gain_margin: float = 1.0,
    phase_margin: float = 0.0,
    disk_margin: float = 0.0,
    delay_margin: float = 0.0,
    impedance: bool = True,
    operator: Operator | None = None,
    at: str = "compensator",
    compensator: Compensator = PRINTED,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> float:
    """Largest K that keeps every margin asked for, as does every lower K.

    Args:
        axis: "x" or "y". b: clay [N.s/m].
        gain_margin: least factor (>= 1) to which the gain may rise. phase_margin: least [rad].
        disk_margin: least alpha, < 2 (see `Margins`). delay_margin: least [s]; a lead of C without it may have no
            largest K, because nothing else in the continuous loop is late.
        impedance, operator: the hand, as in `gain_limit`.
        at: where the loop is broken for the margins (see `loop`). compensator: shape of C.
        Ts, delay, render: as in `gain_limit`; with sampling or delay only gain_margin may be asked for.

    Returns:
        K; inf if any will do, 0 if none.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    gain = number("gain_margin", gain_margin, 1.0)
    phase = number("phase_margin", phase_margin, 0.0, math.pi, unit="rad")
    disk = number("disk_margin", disk_margin, 0.0, 2.0)
    late = number("delay_margin", delay_margin, 0.0, unit="s")
    th = gain_limit.hand(impedance, operator)
    if Ts is not None or delay:
        if phase or disk or late or compensator != PRINTED or at != "compensator":
            bound = "must stay as they are with sampling or delay, where only gain_margin is known"
            field = "phase_margin, disk_margin, delay_margin, at, compensator"
            raise ParameterError(field, (phase, disk, late, at, compensator), bound)
        return gain_limit.critical_gain(axis, b, th, Ts, delay, render)[0] / gain
    top = linear_loop.continuous_gain_limit(axis, b, th, compensator)

    def good(K: float) -> bool:
        m = margins.margins(
            axis, K, b, impedance=th is not None, operator=th, at=at, compensator=compensator
        )
        return (
            m.stable
            and m.gain[1] >= gain
            and m.phase >= phase
            and m.disk >= disk
            and m.delay >= late
        )

    if top == math.inf:
        top = K_MAX
        if good(top):
            return math.inf
    low, high = 0.0, top
    for K in np.geomspace(1e-6 * top, top, 200).tolist():
        if not good(K):
            high = K
            break
        low = K
    while high - low > 1e-12 * high:
        K = 0.5 * (low + high)
        if K in (low, high):
            break
        low, high = (K, high) if good(K) else (low, K)
    return low


@dataclass(frozen=True)
class Design:
    """A compensator tuned to a margin.

    Attributes:
        compensator: its shape. K: its gain.
        error: rms of |1 - fe/fh| over the band, in log frequency: 0 if the hand feels the clay and nothing else.
        margins: what it has.
    """

    compensator: Compensator
    K: float
    error: float
    margins: margins.Margins


def transparency_error(
    axis: str,
    K: float,
    b: float,
    *,
    band: tuple[float, float] = DESIGN_BAND,
    compensator: Compensator = PRINTED,
) -> float:
    """Rms of |1 - fe/fh| (Eq. 7) over a band [rad/s], evenly in log frequency (Simpson's rule, 401 points)."""
    from scipy.integrate import simpson

    low, high = pair("band", band, 0.0, above=True, unit="rad/s")
    if high <= low:
        raise ParameterError("band", band, "must end beyond where it begins")
    x = np.linspace(math.log(low), math.log(high), 401)
    miss = np.abs(1.0 - margins.transparency(axis, K, b, np.exp(x), compensator=compensator)) ** 2
    return math.sqrt(float(simpson(miss, x=x)) / (x[-1] - x[0]))


def compare(
    axis: str,
    b: float,
    compensators: list[Compensator],
    *,
    band: tuple[float, float] = DESIGN_BAND,
    impedance: bool = True,
    operator: Operator | None = None,
    at: str = "compensator",
    **margin: Any,
) -> list[Design]:
    """Compensators at equal margin, the most transparent first.

    Args:
        axis: "x" or "y". b: clay [N.s/m]. compensators: shapes to compare. band: of the error [rad/s].
        impedance, operator, at: as in `design_gain`. margin: the margins, as there.

    Raises:
        ParameterError: a value is out of its bounds, or a shape has no largest K.
    """
    out = []
    for c in compensators:
        how: Any = dict(impedance=impedance, operator=operator, at=at, compensator=c)
        K = design_gain(axis, b, **how, **margin)
        if not 0.0 < K < math.inf:
            raise ParameterError(
                "compensators", c, f"must have a largest K at this margin, it is {K:g}"
            )
        found = margins.margins(axis, K, b, **how)
        out.append(Design(c, K, transparency_error(axis, K, b, band=band, compensator=c), found))
    return sorted(out, key=lambda d: d.error)
