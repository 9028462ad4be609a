"""Pairs side by side: over gain and delay, and by architecture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..errors import Bound, ParameterError, Real
from ..results import Result, Tables
from ..scene.link import KINDS, Link
from ..scene.pair import Pair
from .held_words import pair_words
from .pair_build import Build
from .pair_delays import Delays
from .pair_onset import LATEST, onset
from .pair_verdict import PairLimits, pair_limits

SPAN = 8.0  # factor of all Kp of a map, up and down
LONGEST = 0.2  # [s] largest delay of a map of a pair without limit


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairMap(Result):
    """Where a pair is stable over a common factor of all Kp and the one-way delay of the link.

    Attributes:
        kind: kind of the link.
        gains: factors of all Kp, shape (m,).
        delays: one-way delays, both ways alike [s], shape (k,).
        unstable: number of unstable eigenvalues, shape (m, k).
        limits: largest one-way delay at each factor, from none on [s], shape (m,); 0 if none is
            stable, inf for more than 2 s.
        frequencies: of the motion that turns unstable there [Hz], shape (m,); NaN for none.
        present: delay of the pair [s].
        assumed: what the map rests on, a sentence each.
    """

    drawn_by = "hapticclay.views.pair_plots:map_plot"
    written_as = "delay_gain"
    printed = {"limits": ()}

    kind: str
    gains: np.ndarray
    delays: np.ndarray
    unstable: np.ndarray
    limits: np.ndarray
    frequencies: np.ndarray
    present: float
    assumed: tuple[str, ...] = ()

    def headline(self) -> str:
        """The map in one line."""
        share = float(np.mean(self.unstable == 0))
        return f"{self.kind}: stable at {share:.0%} of {self.unstable.size} gains and delays"

    def remarks(self) -> Sequence[str]:
        """What the map rests on."""
        return [self.headline(), *self.assumed]

    def tables(self) -> Tables:
        """The limit at each factor, and every cell."""
        limits: dict[str, Any] = {
            "factor of all Kp": self.gains,
            "largest delay [s]": self.limits,
            "buzz [Hz]": self.frequencies,
        }
        gain, delay = np.meshgrid(self.gains, self.delays, indexing="ij")
        cells: dict[str, Any] = {
            "factor of all Kp": gain.ravel(),
            "delay [s]": delay.ravel(),
            "unstable eigenvalues": self.unstable.ravel(),
        }
        return {"limits": limits, "cells": cells}


@checked
def pair_map(
    pair: Pair,
    gains: Annotated[int, Bound(2, 200)] = 20,
    delays: Annotated[int, Bound(2, 200)] = 20,
    longest: Annotated[Real | None, Bound(0.0, LATEST, "s", above=True)] = None,
) -> PairMap:
    """Where a pair is stable over gain and delay: eigenvalues counted on the unit circle.

    Factors of all Kp span 1/8 to 8; Kd remain. Delays are in whole samples there and back, and in
    between as if a message could arrive at any share of a sample.

    Args:
        pair: two arms, their laws and the link between them.
        gains: number of factors.
        delays: number of delays, from none on.
        longest: largest one-way delay [s], at most 2; None for twice the median of the limits.

    Raises:
        ParameterError: as `pair_limits`.
    """
    build = Build(pair)
    factors = np.geomspace(1.0 / SPAN, SPAN, gains)
    found = [Delays(build.loop((0.0, 0.0), gain)) for gain in factors.tolist()]
    onsets = [onset(build, gain) for gain in factors.tolist()]
    limits = np.array([math.inf if x is None else x.delay for x in onsets])
    late = np.linspace(0.0, longest or _longest(pair, limits), delays)
    samples = np.maximum(2.0 * late / pair.Ts, found[0].least)
    buzz = [math.nan if x is None else x.frequency for x in onsets]
    return PairMap(
        pair.link.kind,
        factors,
        late,
        np.array([[x.count(n) for n in samples.tolist()] for x in found]),
        limits,
        np.array(buzz),
        0.5 * sum(build.delays),
        (pair_words(pair), *build.assumed()),
    )


def _longest(pair: Pair, limits: np.ndarray) -> float:
    """Largest delay of a map: twice the median limit, or the pair's own delay."""
    finite = limits[np.isfinite(limits) & (limits > 0.0)]
    typical = 2.0 * float(np.median(finite)) if len(finite) else LONGEST
    return min(LATEST, max(typical, 1.5 * sum(pair.link.delays)))


# ---- architectures -------------------------------------------------------------------------------


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairComparison(Result):
    """One pair under each architecture.

    Attributes:
        kinds: kinds of the link, shape (m,).
        limits: what the pair carries with each; None where it is refused.
        refused: why, by kind.
        assumed: what the verdicts rest on, a sentence each.
    """

    drawn_by = "hapticclay.views.pair_plots:comparison_plot"
    written_as = "architectures"
    formats = {"radius": ".6g"}

    kinds: tuple[str, ...]
    limits: tuple[PairLimits | None, ...]
    refused: dict[str, str]
    assumed: tuple[str, ...] = ()

    def headline(self) -> str:
        """The comparison in one line."""
        held = [k for k, x in zip(self.kinds, self.limits, strict=True) if x and x.stable]
        return f"stable as it is: {', '.join(held) or 'none'}"

    def remarks(self) -> Sequence[str]:
        """What was refused, and what the verdicts rest on."""
        why = [f"{kind}: {why}" for kind, why in self.refused.items()]
        return [self.headline(), *why, *self.assumed]

    def tables(self) -> Tables:
        """Verdict, delay and motion of each architecture."""
        rows = [
            ("refused", math.nan, math.nan, "", math.nan)
            if x is None
            else (
                "yes" if x.stable else "no",
                x.radius,
                1e3 * x.delay,
                x.mode * x.has_onset,
                x.gain,
            )
            for x in self.limits
        ]
        verdict, radius, delay, mode, gain = zip(*rows, strict=True)
        return {
            "architectures": {
                "link": self.kinds,
                "stable": verdict,
                "radius": radius,
                "largest delay [ms]": delay,
                "first": mode,
                "largest factor of Kp": gain,
            }
        }


@checked
def compare_links(pair: Pair) -> PairComparison:
    """What a pair carries with each architecture, all else alike.

    A scale of forces, or wave impedances, that an architecture has no use for are left out.

    Args:
        pair: two arms, their laws and the link between them.

    Raises:
        ParameterError: as `pair_limits`.
    """
    limits: list[PairLimits | None] = []
    refused = {}
    for kind in KINDS:
        try:
            limits.append(pair_limits(replace(pair, link=_link(pair.link, kind))))
        except ParameterError as error:
            if kind == pair.link.kind:
                raise
            limits.append(None)
            refused[kind] = str(error)
    felt = pair_words(replace(pair, link=_link(pair.link, "position-force")))
    late = f"largest delay: looked for up to {LATEST:g} s, both ways alike"
    return PairComparison(KINDS, tuple(limits), refused, (felt, late, *Build(pair).assumed()))


def _link(link: Link, kind: Any) -> Link:
    """The link of another kind."""
    if kind == link.kind:
        return link
    scale = (link.scale[0], 1.0) if kind == "position-position" else link.scale
    rates = link.rates or kind == "waves"
    local = link.local_force if kind in ("position-force", "four-channel") else (0.0, 0.0)
    changes = {"scale": scale, "rates": rates, "impedance": None, "local_force": local}
    return replace(link, kind=kind, **changes)
