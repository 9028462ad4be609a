"""Why a run of a pair shows another verdict than theory, and the run that shows theory's."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..display import time_words
from ..model.signals import Signal
from ..scene.pair import TOUCH, Pair, joint_names, joint_unit
from ..simulation.simulate import simulate

if TYPE_CHECKING:
    from ..simulation.pair_record import PairRecord
    from ..theory.pair_verdict import PairLimits

PUSHES = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # [N] along x, tried from the smallest on
SHOWN = 3.0  # growth in a run, as a power of e, that its last quarter shows
LONG = 10.0  # the same in a run that is offered


def push(newtons: float) -> Signal:
    """A push of the leader's hand along x, as long as the usual one."""
    return replace(TOUCH, value=(newtons, 0.0))


def disagreement(pair: Pair, limits: PairLimits, record: PairRecord) -> str:
    """Why a run and theory differ, and what shows it; "" where they do not.

    Args:
        pair: what ran, for its time.
        limits: what theory says of it.
        record: the run.
    """
    if limits.stable is not record.grows:
        return ""
    if limits.stable:
        return f"theory says stable, the run grows: theory leaves out {_left_out(pair)}"
    rate = math.log(limits.radius) / limits.Ts
    begin = "theory says unstable, the run does not grow: "
    if pair.muscle is None and not record.motion.any():
        return f"{begin}nothing pushes the leader; give --push"
    if rate * pair.t_max < SHOWN:
        span = f"it would grow by {math.exp(rate * pair.t_max):.3g} times in {pair.t_max:g} s"
        return f"{begin}{span}; give --run {math.ceil(LONG / rate)}"
    return begin + _held(pair)


def _held(pair: Pair) -> str:
    """What holds a pair that theory calls unstable, and the push that overcomes it."""
    slides = _without_friction(pair)
    rubs = slides is not None and _grows(slides)
    holder = _friction_words(pair) if rubs else f"what theory leaves out, {_left_out(pair)},"
    for newtons in PUSHES:
        if _grows(replace(pair, muscle=push(newtons))):
            grows = f"one of {newtons:g} N makes it grow: give --push {newtons:g}"
            return f"{holder} holds this push; {grows}"
    return f"{holder} holds it, and so does every push up to {PUSHES[-1]:g} N along x"


def _grows(pair: Pair) -> bool:
    """Whether a run grows by itself: a joint that leaves its range may have been pushed there."""
    record: Any = simulate(pair)
    return bool(record.grows) and "out of reach" not in record.ended


def _frictions(pair: Pair, i: int) -> list[float]:
    """Coulomb friction of the joints of an arm [N.m]."""
    arm, hardware, n = pair.arms[i], pair.hardware[i], pair.n
    of_arm = np.broadcast_to(getattr(arm, "friction", 0.0), n)
    rubs = hardware is not None and any(hardware.friction)  # of the two-link arm alone
    of_hardware = hardware.friction if hardware is not None and rubs else (0.0,) * n
    return [max(x) for x in zip(of_arm.tolist(), of_hardware, strict=True)]


def _without_friction(pair: Pair) -> Pair | None:
    """The pair without Coulomb friction in its joints; None if it has none."""
    if not any(max(_frictions(pair, i)) for i in range(2)):
        return None
    leader, follower = map(_frictionless, pair.arms)
    of_leader, of_follower = (x and replace(x, friction=(0.0, 0.0)) for x in pair.hardware)
    hardware = {"leader_hardware": of_leader, "follower_hardware": of_follower}
    return replace(pair, leader=leader, follower=follower, **hardware)


def _frictionless(arm: Any) -> Any:
    if not hasattr(arm, "friction"):
        return arm
    none = [0.0] * len(arm.friction) if isinstance(arm.friction, tuple) else 0.0
    return replace(arm, friction=none)


def _friction_words(pair: Pair) -> str:
    """The largest friction of a joint of either arm."""
    rows = [
        row
        for i, arm in enumerate(pair.arms)
        for row in zip(_frictions(pair, i), joint_names(arm), strict=True)
    ]
    friction, name = max(rows)
    unit = "N" if joint_unit((name,)) == "m" else "N.m"
    return f"friction (up to {friction:.3g} {unit}, at {name})"


def _left_out(pair: Pair) -> str:
    """What a run of the pair has and theory has not."""
    words = []
    if any(max(_frictions(pair, i)) for i in range(2)):
        words.append("friction")
    if any(math.isfinite(x) for arm in pair.arms for x in getattr(arm, "torque_limit", ())):
        words.append("torque limits")
    if any(pair.hardware):
        words.append("hardware")
    if pair.link.jitter or pair.link.loss:
        words.append(f"jitter of {time_words(pair.link.jitter)} and loss of the link")
    return ", ".join([*words, "large motion"])
