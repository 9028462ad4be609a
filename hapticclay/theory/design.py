"""Design of the compensator: the largest gain for a margin, and shapes of C at equal margin."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import named
from ..errors import Bound, ParameterError, Real, pair
from ..model.compensator import Compensator
from ..results import Result
from . import gain_limits, margin_gains, stability_margins
from .loops import TIMING, Loop, of_loop

K_MAX = 1e6  # bound of Scenario.gain: a margin that holds up to here counts as holding for any gain
SPARE = 1e-10  # a gain is lower by this share, so that rounding does not cost it its margin
DESIGN_BAND = (0.3, 30.0)  # [rad/s]: voluntary motion of a hand, up to about 5 Hz


@of_loop("b", "operator", timing=True)
def design_gain(
    loop: Loop,
    *,
    gain_margin: Annotated[float, Bound(1.0)] = 1.0,
    phase_margin: Annotated[Real, Bound(0.0, math.pi, "rad")] = 0.0,
    disk_margin: Annotated[float, Bound(0.0, 2.0)] = 0.0,
    delay_margin: Annotated[Real, Bound(0.0, unit="s")] = 0.0,
    at: stability_margins.Break = "compensator",
) -> float:
    """Largest K for which it and every lower K keep all requested margins.

    Args:
        loop: the loop, its K ignored; or axis, b, operator, and other parts by name. With sampling
            or delay only gain_margin may be requested.
        gain_margin: least factor to which the gain may rise, >= 1.
        phase_margin: least phase margin [rad], 0 to pi.
        disk_margin: least alpha, 0 to 2 (see `Margins`).
        delay_margin: least delay margin [s]. Without this margin a lead compensator may have no
            largest K, because nothing else in the continuous loop is delayed.
        at: where the loop is opened for the margins (see `open_loop`).

    Returns:
        K; inf if every gain up to 1e6, the largest of a scenario, keeps the margins and the loop is
        stable above; 0 if no small gain does. In continuous time K is the least over all
        frequencies of the gains that use up a margin there.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    top = gain_limits.gain_limit(loop)
    beside = phase_margin, disk_margin, delay_margin
    if loop.Ts is not None or loop.delay:
        if any(beside) or at != "compensator":
            bound = "must stay as they are with sampling or delay, where only gain_margin is known"
            field = "phase_margin, disk_margin, delay_margin, at"
            raise ParameterError(field, (*beside, at), bound)
        return top / gain_margin

    if at == "compensator":
        top /= gain_margin
    K = (1.0 - SPARE) * min(top, margin_gains.first_gain(loop, at, gain_margin, *beside))
    return math.inf if top == math.inf and K > K_MAX else K


@named
@dataclass(frozen=True, repr=False)
class Design(Result):
    """A compensator tuned to a margin; shape and gain are `Scenario.compensator` and `gain`.

    Attributes:
        compensator: shape of C.
        K: gain of the compensator.
        error: rms of |1 - fe/fh| over the band, in log frequency; 0 if the hand feels only the
            clay.
        margins: stability margins of the loop.
    """

    drawn_by = "hapticclay.views.theory_plots:design_plot"

    compensator: Compensator
    K: float
    error: float
    margins: stability_margins.Margins

    def headline(self) -> str:
        """Gain, transparency error and margins, in one line."""
        m = self.margins
        return (
            f"K = {self.K:.5g}, transparency error {self.error:.4g}, gain margin {m.gain[1]:.4g}, "
            f"phase margin {math.degrees(m.phase):.4g} degrees, disk margin {m.disk:.4g}"
        )

    def tables(self) -> dict[str, dict[str, list[float]]]:
        """Gain, error and margins."""
        m = self.margins
        return {
            "design": {
                "K": [self.K], "transparency error": [self.error],
                "gain margin, less": [m.gain[0]], "gain margin, more": [m.gain[1]],
                "phase margin [rad]": [m.phase], "delay margin [s]": [m.delay],
                "disk margin": [m.disk],
            }
        }  # fmt: skip


@of_loop("K", "b")
def transparency_error(loop: Loop, *, band: tuple[float, float] = DESIGN_BAND) -> float:
    """Rms of |1 - fe/fh| (Eq. 7) over a band, in log frequency (Simpson's rule, 401 points).

    Args:
        loop: the loop with its K, its hand ignored; or axis, K, b, and other parts by name.
        band: lowest and highest frequency [rad/s].
    """
    from scipy.integrate import simpson

    low, high = _design_band(band)
    x = np.linspace(math.log(low), math.log(high), 401)
    error = np.abs(1.0 - stability_margins.transparency(loop, np.exp(x))) ** 2
    return math.sqrt(float(simpson(error, x=x)) / (x[-1] - x[0]))


@of_loop("b", "compensators", "operator", timing=True)
def compare(
    loop: Loop,
    compensators: Iterable[Any],
    *,
    band: tuple[float, float] = DESIGN_BAND,
    at: stability_margins.Break = "compensator",
    **margin: float,
) -> list[Design]:
    """Compensators at equal margin, the most transparent first.

    The error is computed in continuous time. With sampling or delay only gain_margin can be
    requested.

    Args:
        loop: the loop, its compensator and K ignored; or axis, b, compensators, operator, and other
            parts by name.
        compensators: shapes to compare, anything that `Compensator.of` accepts.
        band: band of the error [rad/s].
        at: where the loop is opened for the margins (see `open_loop`).
        **margin: margins, as in `design_gain`.

    Raises:
        ParameterError: a value is out of its bounds, or a shape has no largest K.
    """
    out, band = [], _design_band(band)
    for c in map(Compensator.of, compensators):
        tried = replace(loop, compensator=c)
        K = design_gain(tried, at=at, **margin)
        if not 0.0 < K < math.inf:
            bound = f"must have a largest K at this margin, it is {K:g}"
            raise ParameterError("compensators", c, bound)
        tried = replace(tried, K=K)
        error = transparency_error(replace(tried, **TIMING), band=band)
        out.append(Design(c, K, error, stability_margins.margins(tried, at=at)))
    return sorted(out, key=lambda d: d.error)


def _design_band(band: Any) -> tuple[float, float]:
    low, high = pair("band", band, 0.0, above=True, unit="rad/s")
    if high <= low:
        raise ParameterError("band", band, "must end beyond where it begins")
    return low, high
