"""Design of the compensator: the largest gain for a margin, and shapes of C at equal margin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError, number, pair
from ..model.controller import PRINTED, Compensator
from ..model.operator import Operator
from . import gain_limit, margins
from .roots import first_failure

K_MAX = 1e6  # as in a Scenario: a margin that holds there holds for any gain
DESIGN_BAND = (0.3, 30.0)  # [rad/s]: where a hand moves on purpose, up to about 5 Hz


def design_gain(  # noqa: PLR0913  # four margins and one loop, each by its name
    axis: str,
    b: float,
    operator: Operator | None = None,
    *,
    gain_margin: float = 1.0,
    phase_margin: float = 0.0,
    disk_margin: float = 0.0,
    delay_margin: float = 0.0,
    at: str = "compensator",
    compensator: Compensator = PRINTED,
    Ts: float | None = None,
    delay: float = 0.0,
    render: str = "held",
) -> float:
    """Largest K that keeps every requested margin, as does every lower K.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: arm at the handle; None for no hand (Th = 0).
        gain_margin: least factor to which the gain may rise, >= 1.
        phase_margin: least phase margin [rad], 0 to pi.
        disk_margin: least alpha, 0 to 2 (see `Margins`).
        delay_margin: least delay margin [s]. A lead of C without it may have no largest K, because
            nothing else in the continuous loop is late.
        at: where the loop is broken for the margins (see `open_loop`).
        compensator: shape of C.
        Ts: control sample [s]; None for continuous time. With sampling or delay only gain_margin
            may be requested.
        delay: as in `gain_limit` [s].
        render: as in `gain_limit`.

    Returns:
        K; inf if every gain keeps them, 0 if none does.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    gain = number("gain_margin", gain_margin, 1.0)
    phase = number("phase_margin", phase_margin, 0.0, math.pi, unit="rad")
    disk = number("disk_margin", disk_margin, 0.0, 2.0)
    late = number("delay_margin", delay_margin, 0.0, unit="s")
    if Ts is not None or delay:
        if phase or disk or late or compensator != PRINTED or at != "compensator":
            bound = "must stay as they are with sampling or delay, where only gain_margin is known"
            field = "phase_margin, disk_margin, delay_margin, at, compensator"
            raise ParameterError(field, (phase, disk, late, at, compensator), bound)
        limit = gain_limit.gain_limit(axis, b, operator, Ts=Ts, delay=delay, render=render)
        return limit / gain

    def good(K: float) -> bool:
        m = margins.margins(axis, K, b, operator, at=at, compensator=compensator)
        kept = m.phase >= phase and m.disk >= disk and m.delay >= late
        return m.stable and m.gain[1] >= gain and kept

    top = gain_limit.gain_limit(axis, b, operator, compensator=compensator)
    if top == math.inf:
        top = K_MAX
        if good(top):
            return math.inf
    return first_failure(good, np.geomspace(1e-6 * top, top, 200).tolist(), below=0.0)[0]


@dataclass(frozen=True)
class Design:
    """A compensator tuned to a margin.

    Attributes:
        compensator: its shape.
        K: its gain.
        error: rms of |1 - fe/fh| over the band, in log frequency; 0 if the hand feels only the
            clay.
        margins: the margins that it has.
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
    """Rms of |1 - fe/fh| (Eq. 7) over a band, evenly in log frequency (Simpson's rule, 401 points).

    Args:
        axis: "x" or "y".
        K: compensator gain.
        b: clay [N.s/m].
        band: lowest and highest frequency [rad/s].
        compensator: shape of C.
    """
    from scipy.integrate import simpson

    low, high = pair("band", band, 0.0, above=True, unit="rad/s")
    if high <= low:
        raise ParameterError("band", band, "must end beyond where it begins")
    x = np.linspace(math.log(low), math.log(high), 401)
    error = np.abs(1.0 - margins.transparency(axis, K, b, np.exp(x), compensator=compensator)) ** 2
    return math.sqrt(float(simpson(error, x=x)) / (x[-1] - x[0]))


def compare(
    axis: str,
    b: float,
    compensators: list[Compensator],
    operator: Operator | None = None,
    *,
    band: tuple[float, float] = DESIGN_BAND,
    at: str = "compensator",
    **margin: Any,
) -> list[Design]:
    """Compensators at equal margin, the most transparent first.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        compensators: shapes to compare.
        operator: arm at the handle; None for no hand (Th = 0).
        band: of the error [rad/s].
        at: where the loop is broken for the margins (see `open_loop`).
        **margin: margins and timing, as in `design_gain`.

    Raises:
        ParameterError: a value is out of its bounds, or a shape has no largest K.
    """
    out = []
    for c in compensators:
        K = design_gain(axis, b, operator, at=at, compensator=c, **margin)
        if not 0.0 < K < math.inf:
            bound = f"must have a largest K at this margin, it is {K:g}"
            raise ParameterError("compensators", c, bound)
        found = margins.margins(axis, K, b, operator, at=at, compensator=c)
        out.append(Design(c, K, transparency_error(axis, K, b, band=band, compensator=c), found))
    return sorted(out, key=lambda d: d.error)
