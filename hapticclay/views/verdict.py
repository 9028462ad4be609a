"""What to say of the stability of the loop while it runs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..model.scenario import AXES, Operator
from ..simulation.record import Outcome
from ..theory import linear_loop


@dataclass(frozen=True)
class Verdict:
    """What to say of the loop now.

    Attributes:
        text: in a line. unstable: whether the arm swings out of hand.
    """

    text: str
    unstable: bool


def verdict(
    gain: tuple[float, float], limit: tuple[float, float] | None, onset: Outcome | None, swings: bool
) -> Verdict:
    """Says what the stability monitor has found, or else how far the gain is from its limit.

    Args:
        gain: K. limit: of it, in the clay at the handle; None if unknown. onset: the instability that the monitor has
            found. swings: whether the arm still swings.
    """
    far = limit or (math.inf, math.inf)
    above = [f"K{a} {k:.3g} > {most:.3g}" for a, k, most in zip(AXES, gain, far, strict=True) if k > most]
    text = "stable"
    if onset is not None and swings:
        text = f"UNSTABLE since {onset.time:.1f} s: {onset.cause}" + (f" of {onset.axis}" if onset.axis else "")
    elif above:
        text = "beyond the limit of K"
    elif onset is not None:
        text = f"calm again, was unstable at {onset.time:.1f} s"
    if above:
        text += f"; here {', '.join(above)}"
    elif limit:
        each = ("none" if most == math.inf else f"{most:.3g}" for most in limit)
        text += f"; limit of K here: {'none' if limit == (math.inf, math.inf) else ', '.join(each)}"
    return Verdict(text, bool(onset and swings))


def limits(b: tuple[float, float], operator: Operator | None) -> tuple[float, float]:
    """The gain limit of the linear loop on each axis, with this clay at the handle [N.s/m]; inf for none."""
    x, y = (linear_loop.gain_limit(axis, damping, operator) for axis, damping in zip(AXES, b, strict=True))
    return x, y
