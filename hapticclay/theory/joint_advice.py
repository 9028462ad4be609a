"""What to change first at an arm's joints: a value for each change, tried by the exact map."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..arms.joint_law import JointPD
from ..arms.joint_units import of_joint
from ..arms.mechanism import Linear
from ..arms.mjcf_arm import MjcfArm
from ..display import time_words
from .joint_delays import LATEST
from .joint_families import Family, Limit
from .joint_loop import JointLoop

UNITS = {"Kp": "N.m/rad", "Kd": "N.m.s/rad"}
ROOM = 0.7  # of a limit: a value that is recommended
FROM_NONE = 100.0  # factor that a gain is said to change by where it is 0 now
OF_ALL = 3.0  # weight of a change of all joints' gains, beside one joint's
SHORTER = 1e-3  # [s] of delay, of an arm that is stable
SHARES = (0.9, 0.75, 0.5, 0.25, 0.1, 0.01, 0.0)  # of a delay, of friction, that are tried
FASTER = (1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0, 1000.0)  # rates that are tried, as factors
FACTORS = (0.5, 0.25, 0.1, 0.03, 0.01, 2.0, 4.0, 10.0, 30.0)  # of all Kp, each with its own Kd
SPEEDS = np.geomspace(0.5, 1e-4, 24)  # of gains from inertias: rad in the time that torque is late
DAMPED = 0.7  # their share of critical damping
LEAST_TS = 1e-6  # [s]
SAMPLED = 1e3  # [Hz] of drives whose rate is not known, at least


class Study(Protocol):
    """An arm under study, as advice asks it."""

    arm: MjcfArm
    law: JointPD
    linear: Linear
    loop: JointLoop
    Ts: float
    delay: float

    def at(self, **changes: Any) -> Study:
        """The same arm under another law, at another Ts or delay."""
        ...

    def remade(self, **changes: Any) -> JointLoop:
        """The loop with another linear arm, law, gains, Ts or delay."""
        ...

    def family(self, kind: str, joint: int | None = None) -> Family:
        """Loops of other gains of a joint; of a common factor of all joints for None."""
        ...


class Advice(NamedTuple):
    """A change.

    Attributes:
        words: the change in words.
        change: fields of the law, Ts or delay with it; empty for no change.
    """

    words: str
    change: dict[str, Any]


class Room(NamedTuple):
    """What an arm carries under its law.

    Attributes:
        Kp: stable interval of each joint's Kp [N.m/rad].
        Kd: likewise of Kd [N.m.s/rad].
        all_Kp: of the common factor of all Kp.
        all_Kd: of the common factor of all Kd.
        slopes: largest slope of a friction fed forward at each joint [N.m.s/rad].
        left: delay left [s].
        slowest: lowest rate [Hz].
    """

    Kp: Sequence[Limit]
    Kd: Sequence[Limit]
    all_Kp: Limit
    all_Kd: Limit
    slopes: np.ndarray
    left: float
    slowest: float


def factor_words(kind: str, low: float, high: float) -> str:
    """The common factors of a gain that would be stable; factor 1 is not."""
    low, high = _rounded(low, up=True), _rounded(high, up=False)
    if low >= 1.0:
        return f"all {kind} times {low:.4g} {_end(high)} would be stable"
    least = f" ({low:.4g} or more)" if low > 0.0 else ""
    return f"all {kind} times {high:.4g} or less{least} would be stable"


def _end(high: float) -> str:
    return "or more" if math.isinf(high) else f"to {high:.4g}"


def advise(study: Study, room: Room) -> Advice:
    """The change that gains most, or that brings an unstable loop back."""
    if study.loop.stable():
        return _of_stable(study, room)
    return next(_ways_back(study, room), None) or _none(study)


# ---- a stable arm --------------------------------------------------------------------------------


def _of_stable(study: Study, room: Room) -> Advice:
    scale = room.all_Kp.high
    if not any(study.law.Kp):
        return Advice(f"nothing: without Kp there is none to buzz{_room_of_Kd(study, room)}", {})
    if math.isinf(scale):
        return Advice(f"nothing: {_unlimited(study)}", {})
    if study.delay:
        shorter = min(study.delay, SHORTER)
        where = f"delay ({time_words(room.left, LATEST)} left)"
        what, change = f"{1e3 * shorter:.3g} ms less", {"delay": study.delay - shorter}
    else:
        where = f"rate ({1.0 / study.Ts:.4g} Hz, at least {room.slowest:.4g} Hz needed)"
        what, change = f"{2.0 / study.Ts:.4g} Hz", {"Ts": 0.5 * study.Ts}
    after = study.at(**change).family("Kp").limit().high
    if not after > scale:
        return Advice(f"nothing: neither less delay nor a higher rate raises {scale:.4g}", {})
    to = "any" if math.isinf(after) else f"{after:.4g}"
    return Advice(f"{where}: {what} raises the factor of all Kp from {scale:.4g} to {to}", change)


def _unlimited(study: Study) -> str:
    """Why no factor of Kp buzzes, and what would limit it."""
    if study.law.runs == "host" or study.law.drive_rate is not None:
        return "no factor of Kp buzzes"
    rate = math.ceil(SAMPLED * study.Ts) / study.Ts  # a whole multiple of the host's
    sampled = study.at(law=replace(study.law, drive_rate=rate)).family("Kp").limit().high
    carried = "any Kp" if math.isinf(sampled) else f"all Kp times {sampled:.4g}"
    carried = "no Kp, with these Kd" if math.isnan(sampled) else carried
    at_rate = f"sampled at {rate:g} Hz they carry {carried}"
    return f"drives without a rate count as continuous and carry any Kp; {at_rate}: give drive_rate"


def _room_of_Kd(study: Study, room: Room) -> str:
    high = room.all_Kd.high
    if not any(study.law.Kd) or not math.isfinite(high):
        return ""
    return f"; all Kd may rise to {_rounded(high, up=False):.4g} times what they are"


# ---- an unstable one -----------------------------------------------------------------------------


def _ways_back(study: Study, room: Room) -> Iterator[Advice]:
    """Changes after which the arm is stable, tried, the likeliest cause first."""
    yield from _friction(study, room.slopes)
    of_all = {
        "Kp": _AllGains(study, "Kp", None, room.all_Kp),
        "Kd": _AllGains(study, "Kd", None, room.all_Kd),
    }
    own = [
        _OneGain(study, kind, j, x)
        for kind, limits in (("Kp", room.Kp), ("Kd", room.Kd))
        for j, x in enumerate(limits)
    ]
    for way in sorted([*own, *of_all.values()], key=lambda x: x.cost):
        for advice in way.advice():
            other = of_all[way.kind]
            also = other is not way and len(study.law) > 1 and any(other.advice())
            more = f", or {other.words}" if also else ""
            yield advice._replace(words=advice.words + more)
    yield from _all_friction(study)
    yield from _both_gains(study)
    yield from _new_gains(study)
    yield from _timing(study)
    yield from _drives(study)


def _none(study: Study) -> Advice:
    growth = study.loop.growth / study.Ts
    words = f"no gains, delay or rate that were tried: the arm grows by {growth:.3g} 1/s"
    return Advice(words, {})


def _tried(study: Study, **change: Any) -> bool:
    """Whether the arm is stable with other fields of the law, another Ts or delay."""
    timing = {name: change.pop(name) for name in ("Ts", "delay") if name in change}
    law = replace(study.law, **change) if change else study.law
    return study.remade(law=law, **timing).stable()


class _OneGain:
    """A gain that is moved into its stable interval."""

    where = "{kind} of {joint}"

    def __init__(self, study: Study, kind: str, joint: int | None, limit: Limit):
        self.study, self.kind, self.joint = study, kind, joint
        self.low, self.high = _rounded(limit.low, up=True), _rounded(limit.high, up=False)
        self.present = self._present()
        self.unit = self._unit()

    def _present(self) -> float:
        return getattr(self.study.law, self.kind)[self.joint]

    def _unit(self) -> str:
        return f" {of_joint(UNITS[self.kind], self.study.arm.mechanism.turning[self.joint or 0])}"

    @property
    def _name(self) -> str:
        return f"{self.kind} of {self.study.arm.names[self.joint or 0]}"

    def _with(self, value: float) -> tuple[float, ...]:
        values = list(getattr(self.study.law, self.kind))
        values[self.joint or 0] = value
        return tuple(values)

    @property
    def _lowered(self) -> bool:
        return self.high <= self.present

    @property
    def cost(self) -> float:
        """By how much the gain has to move: a logarithm; inf for a gain that does not help."""
        if not self.low <= self.high or self.low < self.present < self.high:
            return math.inf
        end = self.high if self._lowered else self.low
        if not self.present:
            return math.log(FROM_NONE)
        return abs(math.log(max(end, self.present / FROM_NONE**2) / self.present))

    def advice(self) -> Iterator[Advice]:
        """The change, if it was tried and is stable at the limit that is printed."""
        if math.isinf(self.cost):
            return
        aim = self._aim()
        ends = [x for x in (self.low, self.high) if 0.0 < x < math.inf]
        if all(_tried(self.study, **{self.kind: self._with(x)}) for x in (aim, *ends)):
            words = f"{self.words}, such as {aim:.4g} (now {self.present:.4g})"
            yield Advice(words, {self.kind: self._with(aim)})

    def _aim(self) -> float:
        """A value with room to the limit."""
        low, high = self.low, self.high
        aim = ROOM * high if self._lowered else low / ROOM
        if not low < aim < high or not aim:
            aim = math.sqrt(low * high) if 0.0 < low and high < math.inf else 0.5 * (low + high)
        return float(f"{aim:.2g}") if low <= float(f"{aim:.2g}") <= high else aim

    @property
    def words(self) -> str:
        """The change in words, without a value."""
        verb = "lower" if self._lowered else "raise"
        low, high = f"{self.low:.4g}", f"{self.high:.4g}"
        if not self.low:
            to = f"below {high}"
        elif math.isinf(self.high):
            to = f"above {low}"
        else:
            to = f"to between {low} and {high}"
        return f"{verb} {self._name} {to}{self.unit}"


class _AllGains(_OneGain):
    """A common factor of a gain of all joints."""

    def _present(self) -> float:
        return 1.0

    def _unit(self) -> str:
        return " times what they are"

    @property
    def _name(self) -> str:
        return f"all {self.kind}"

    def _with(self, value: float) -> tuple[float, ...]:
        return tuple(value * x for x in getattr(self.study.law, self.kind))

    @property
    def cost(self) -> float:
        """More than that of one joint's gain; inf where all are 0."""
        return OF_ALL * super().cost if any(getattr(self.study.law, self.kind)) else math.inf


def _friction(study: Study, most: np.ndarray) -> Iterator[Advice]:
    """Less friction fed forward at one joint."""
    present = study.law.slopes
    for j in sorted(range(len(present)), key=lambda j: most[j] - present[j]):
        high = _rounded(float(most[j]), up=False)
        if 0.0 < high < present[j]:
            low, rows = float(f"{ROOM * high:.2g}"), list(study.law.friction or ())
            change = {"friction": _shared(rows, low / present[j], j)}
            limit = {"friction": _shared(rows, high / present[j], j)}
            if _tried(study, **change) and _tried(study, **limit):
                what = f"slope of the friction fed forward at {study.arm.names[j]}"
                unit = of_joint(UNITS["Kd"], study.arm.mechanism.turning[j])
                now = f"{high:.4g} {unit}, such as {low:.4g} (Fc k + Fv, now {present[j]:.4g})"
                yield Advice(f"lower the {what} below {now}", change)


def _all_friction(study: Study) -> Iterator[Advice]:
    """Less friction fed forward at all joints."""
    rows = list(study.law.friction or ())
    for share in SHARES if any(study.law.slopes) else ():
        change = {"friction": _shared(rows, share)}
        if _tried(study, **change):
            what = (
                f"feed {share:.0%} of the friction forward" if share else "feed no friction forward"
            )
            yield Advice(what, change)


def _shared(rows: list, share: float, joint: int | None = None) -> tuple:
    """Friction of which a share is fed forward, at one joint or all."""
    return tuple(
        (share * Fc, k, share * Fv) if joint in (None, j) else (Fc, k, Fv)
        for j, (Fc, k, Fv) in enumerate(rows)
    )


def _both_gains(study: Study) -> Iterator[Advice]:
    """A common factor of all Kp and another of all Kd."""
    law = study.law
    for factor in FACTORS if any(law.Kp) and any(law.Kd) else ():
        Kp = tuple(factor * x for x in law.Kp)
        with_Kp = study.at(law=replace(law, Kp=Kp))
        for way in _AllGains(with_Kp, "Kd", None, with_Kp.family("Kd").limit()).advice():
            Kd = way.change["Kd"]
            share = Kd[int(np.argmax(law.Kd))] / max(law.Kd)
            yield Advice(
                f"all Kp times {factor:g} and all Kd times {share:.4g}", {"Kp": Kp, "Kd": Kd}
            )


def _new_gains(study: Study) -> Iterator[Advice]:
    """Gains of joints that are as fast as the lateness of their torques lets them be."""
    mass, late = np.diag(study.linear.inertia), study.delay + 0.5 * study.Ts
    for speed in (SPEEDS / late).tolist():
        Kp, Kd = _digits(mass * speed**2), _digits(2.0 * DAMPED * mass * speed)
        for stiff in (Kp, (0.0,) * len(Kp)):
            if _tried(study, Kp=stiff, Kd=Kd):
                words = f"set Kp to {_listed(stiff)} and Kd to {_listed(Kd)}, in SI units"
                yield Advice(words, {"Kp": stiff, "Kd": Kd})


def _digits(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{x:.3g}") for x in values.tolist())


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{x:.3g}" for x in values)


def _timing(study: Study) -> Iterator[Advice]:
    """Less delay, or a higher rate."""
    for share in SHARES if study.delay else ():
        delay = float(f"{share * study.delay:.3g}")
        if _tried(study, delay=delay):
            now = f"(now {time_words(study.delay)})"
            yield Advice(f"shorten the delay to {time_words(delay)} {now}", {"delay": delay})
    for factor in FASTER:
        rate = float(f"{factor / study.Ts:.4g}")
        if 1.0 / rate >= LEAST_TS and _tried(study, Ts=1.0 / rate):
            now = f"(now {1.0 / study.Ts:.4g} Hz)"
            yield Advice(f"raise the rate to {rate:.4g} Hz {now}", {"Ts": 1.0 / rate})


def _drives(study: Study) -> Iterator[Advice]:
    """Gains in the drives."""
    if study.law.runs == "host" and _tried(study, runs="drive"):
        yield Advice("let the drives run the gains, at a rate of their own", {"runs": "drive"})


def _rounded(x: float, up: bool) -> float:
    """Four digits, towards the inside of an interval."""
    if not math.isfinite(x) or not x > 0.0:
        return x
    unit = 10.0 ** (math.floor(math.log10(x)) - 3)
    turn: Callable[[float], int] = math.ceil if up else math.floor
    return float(f"{turn(x / unit) * unit:.4g}")
