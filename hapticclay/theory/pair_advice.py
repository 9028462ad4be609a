"""What brings an unstable leader and follower back: each value is tried by the exact map."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..display import time_words
from ..scene.pair import Pair
from . import roots

STEP, STEPS = math.sqrt(0.5), 14  # factors of gains that are tried: down to 1/128
RAISED = (1.5, 2.0, 3.0, 5.0, 10.0)  # factors of Kd above 1, and of the rate
EXACT = 1e-3  # relative width within which the largest factor is sought
NOTHING = (
    "nothing that was tried brings it back: all Kp or Kd times 1/128 to 1, Kd and rate up to ten "
    "times, no delay of the link"
)


class Study(Protocol):
    """A pair under study, as advice asks it."""

    pair: Pair
    build: Any

    def __init__(self, pair: Pair) -> None: ...

    def holds(self, gain: float, friction: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
        """Whether it is stable with a factor of all Kp, and other friction fed forward."""
        ...

    def at(self, late: float) -> bool:
        """Whether it is stable with another delay of the link."""
        ...

    def delay(self) -> float:
        """The largest delay of the link [s]."""
        ...


def remedy(study: Study, friction: float) -> str:
    """Changes of an unstable pair, each of which alone makes it stable, in words.

    Args:
        study: the pair.
        friction: largest share of the laws' friction.
    """
    first = _less_friction(study, friction)
    found = [first] if first else [x for x in (_factor(study, "Kp"), _link(study)) if x]
    return ", or ".join(found) or next(_others(study), NOTHING)


def _less_friction(study: Study, share: float) -> str:
    """Less feed-forward of friction, where that is what makes the pair unstable."""
    slopes = [np.array(law.slopes) for law in study.pair.laws]
    if not any(map(np.any, slopes)):
        return ""
    value = _down(share) if math.isfinite(share) else 0.0
    if not study.holds(1.0, (value * slopes[0], value * slopes[1])):
        return ""
    over = study.build.names[int(np.concatenate(slopes).argmax())]
    how = f"to {100.0 * value:.2g}% of it or less" if value else "to none"
    why = "an undamped common motion, which Kp and Kd cannot touch"
    return f"friction feed-forward ({over} most), {how}: {why}"


def _factor(study: Study, *gains: str) -> str:
    """The largest factor of gains below 1 that is stable, and whether all below it are."""
    words = f"all {' and '.join(gains)} times"

    def holds(x: float) -> bool:
        return _changed(study, dict.fromkeys(gains, x)).holds(1.0)

    held = [holds(STEP**k) for k in range(1, STEPS + 1)]
    if True not in held:
        return ""
    i = held.index(True)
    edge = roots.bisect(holds, STEP ** (i + 1), STEP**i, EXACT)[0]
    value = next((x for x in (_down(edge), _down(STEP ** (i + 1))) if holds(x)), 0.0)
    if not value:
        return ""
    return f"{words} {value:.2g}{' or less' if all(held[i:]) else ''}"


def _link(study: Study) -> str:
    """A link that is fast enough."""
    late = _down(study.delay())
    if not 0.0 < late < math.inf or not study.at(late):
        return ""
    link = study.pair.link
    more = ", jitter and losses in it" if link.jitter or link.loss else ""
    return f"a link of {time_words(late)} at most each way{more}"


def _others(study: Study) -> Iterator[str]:
    """What else may do, the least intrusive first."""
    tries: tuple[Callable[[], str], ...] = (
        lambda: _factor(study, "Kd"),
        lambda: _raised(study),
        lambda: _factor(study, "Kp", "Kd"),
        lambda: _faster(study),
    )
    yield from filter(None, (attempt() for attempt in tries))


def _raised(study: Study) -> str:
    factors = (x for x in RAISED if _changed(study, {"Kd": x}).holds(1.0))
    return next((f"all Kd times {x:g}" for x in factors), "")


def _faster(study: Study) -> str:
    for x in RAISED:
        if _again(study, Ts=study.pair.Ts / x).holds(1.0):
            return f"a control rate of {x / study.pair.Ts:.4g} Hz"
    return ""


def _changed(study: Study, factors: dict[str, float]) -> Study:
    """The pair with factors of gains of both laws."""
    laws = [
        replace(law, **{k: tuple(f * x for x in getattr(law, k)) for k, f in factors.items()})
        for law in study.pair.laws
    ]
    return _again(study, law=laws[0], follower_law=laws[1])


def _again(study: Study, **changes: object) -> Study:
    return type(study)(replace(study.pair, **changes))  # type: ignore[arg-type]


def _down(x: float) -> float:
    """The number with two digits, rounded towards 0; 0 and inf remain."""
    if not 0.0 < x < math.inf:
        return x
    unit = 10.0 ** (math.floor(math.log10(x)) - 1)
    return float(f"{math.floor(x / unit * (1.0 + 1e-12)) * unit:.2g}")
