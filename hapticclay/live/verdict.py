"""Stability of the loop of a session, and the resistance of its clay."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..model.constants import AXES
from ..simulation.monitor import Outcome
from ..theory.pose_limits import PoseLimits

CALM_TIME = 1.0  # [s] without growing oscillation after which an unstable arm counts as calm


class LiveVerdict(NamedTuple):
    """The current verdict on the loop, in one line, and whether its oscillation grows."""

    text: str
    unstable: bool


def live_verdict(
    gain: tuple[float, float],
    limit: tuple[float, float] | None,
    onset: Outcome | None,
    swings: bool,
) -> LiveVerdict:
    """Combines the finding of the stability monitor with the gain's distance to its limit."""
    far = limit or (math.inf, math.inf)
    above = [
        f"K{a} {k:.3g} > {most:.3g}" for a, k, most in zip(AXES, gain, far, strict=True) if k > most
    ]
    text = "stable"
    if onset is not None and swings:
        text = f"UNSTABLE since {onset.time:.1f} s: {onset.cause}" + (
            f" of {onset.axis}" if onset.axis else ""
        )
    elif above:
        text = "beyond the limit of K"
    elif onset is not None:
        text = f"calm again, was unstable at {onset.time:.1f} s"
    if above:
        text += f"; here {', '.join(above)}"
    elif limit:
        text += _limit_words(limit, text == "stable")
    return LiveVerdict(text, bool(onset and swings))


def _limit_words(limit: tuple[float, float], stable: bool) -> str:
    """The limits of K that there are, for the end of a verdict."""
    known = {axis: most for axis, most in zip(AXES, limit, strict=True) if most < math.inf}
    if not known:  # beside an oscillation it would be no comfort
        return "; no limit of K here" if stable else ""
    axis = "" if len(known) == len(AXES) else next(iter(known))
    return f"; limit of K{axis} here: {', '.join(f'{most:.3g}' for most in known.values())}"


def live_gain_limits(
    limits: PoseLimits, p: tuple[float, float], b: tuple[float, float]
) -> tuple[float, float] | None:
    """Gain limit of the linear loop on each axis with the handle where it is [1/kg], inf for none.

    None where it does not apply: under sampled control, and in clay that is not viscous.
    """
    s = limits.scenario
    if s.control != "continuous" or not (s.clay is None or s.clay.viscous_at(p)):
        return None
    return limits.at(0, p, b), limits.at(1, p, b)
