"""What window and page write beside a picture of a session or a replay."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..model.constants import AXES
from ..scene.scenario import Scenario
from .replay import Replay
from .session import Session


def held_words(held: Sequence[bool]) -> str:
    """Text if yielding clay holds the handle: "held", "held along x", or nothing."""
    names = [f" along {a}" for a, still in zip(AXES, held, strict=True) if still]
    return f"held{names[0] if len(names) == 1 else ''}" if names else ""


def clay_here(scenario: Scenario, p: tuple[float, float], b: tuple[float, float]) -> str:
    """Text of the clay's resistance at a place."""
    phrases = scenario.clay.here(p, b) if scenario.clay else ()
    return f"{', '.join(x.text() for x in phrases) or 'none'} here"


def status(play: Session | Replay) -> dict[str, str]:
    """Lines of text by name: time, state, gain, clay and force of the hand."""
    frame, clock = play.frames[-1], play.clock
    state = "paused" if play.paused else "ended" if play.ended else "replaying"
    if isinstance(play, Session) and not (play.paused or play.ended):
        state = "recording" if play.recording else "not recording"
    slow = ", machine too slow" if clock.slow else ""
    return {
        "time": f"{frame.t:.1f} s, {clock.factor:.2f} x real time{slow}",
        "state": ", ".join(x for x in (state, held_words(frame.held)) if x),
        "K": ", ".join(f"{k:.3g}" for k in play.gain),
        "clay": clay_here(play.scenario, frame.p, play.b),
        "fh": f"{math.hypot(*frame.fh):.2f} N",
    }


def banner(play: Session | Replay, restart: str) -> tuple[str, bool]:
    """The verdict on the loop, or why the run ended; and whether the arm is unstable."""
    verdict = play.verdict()
    text = f"{play.ended}: {restart}" if play.ended else verdict.text
    return text, verdict.unstable
