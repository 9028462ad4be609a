"""What the studies ask of a wall, and the kinds that answer: a bare device, an arm in clay."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real
from ..model.constants import AXES
from ..model.operator import Operator
from ..model.shapes import Constant
from ..model.signals import Multisine
from ..scene.scenario import Scenario
from ..scene.virtual_wall import VirtualWall
from ..simulation.record import Record
from ..theory import gain_crossings, gain_limits, wall_limits
from ..theory.impedance import Impedance, loop_response, wall_response
from ..theory.loops import Loop
from . import boundary, growth
from .boundary import PushedLoop
from .published_walls import Limit, published_limits

Subject = PushedLoop | VirtualWall

FEWEST_SAMPLES, MOST_SAMPLES = 300, 6000  # samples of a run whose growth is read
READ_SWINGS = 4.0  # periods of device and wall in such a run, at least
READ = 400  # samples of it that are read, about
SLOWEST = 1e-3  # modes slower than this share of sqrt(K/m) do not count as oscillation
GROWTH_STEPS, REST_STEPS = 16, 4  # least number of engine steps per sample
STEP_DECAY = 0.1  # largest share of its speed that the damper takes in a step
DEEPEST = 5e-3  # [m] depth to which the force presses into the wall, so that the arm moves straight
REST_SAMPLES = 1000  # of the first run that is judged by its rest
REST_SWINGS = 10.0  # its periods, at least
REST_MOST = 20_000  # samples of that first run, at most
STILL = 1e-6  # [m] of motion that counts as rest where no coarser encoder hides more
TRIAL_PUSH = 1e-6  # [m/s] so small that the arm stays linear to 1e-6
SAMPLE_PUSH = 1e-7  # [m] per sample, for a device: above rounding, and far below the arm's length

Varied = Mapping[str, tuple[str, str, float]]  # field, unit, factor of the unit in labels
TS_VARIED, DELAY_VARIED = ("Ts", "ms", 1e3), ("delay", "ms", 1e3)


@part("press.")
class Press:
    """The push that tests a wall with a nonlinear loop, and the criterion of rest.

    Attributes:
        force: force that presses into the wall from the start [N], 0 to 1e3: to at most 5 mm, and
            to the middle between two forces that the encoder can resolve, where rest is least
            likely.
        speed: impact speed of the device [m/s], 0 to 1.
        still: largest peak-to-peak motion that counts as rest [m], 1e-9 to 1e-2; None for 1 um, or
            a count of the encoder where that is larger. A gripping hand feels less than 1 um at 150
            to 200 Hz (Brisben, Hsiao, Johnson 1999), but a loop cannot stop what its encoder does
            not see.
    """

    force: Annotated[Real, Bound(0.0, 1e3, "N")] = 1.0
    speed: Annotated[Real, Bound(0.0, 1.0, "m/s")] = boundary.LARGE_PUSH
    still: Annotated[Real | None, Bound(1e-9, 1e-2, "m")] = None

    def rest(self, quantum: float) -> float:
        """Largest motion that counts as rest [m].

        Args:
            quantum: distance per count of the encoder [m]; 0 for no encoder.
        """
        return max(STILL, quantum) if self.still is None else self.still


class GrowthRun(NamedTuple):
    """A run whose growth rate is read, and how: `growth.growth_of_run`."""

    scenario: Scenario
    every: int
    sample: float
    slowest: float


class Port(NamedTuple):
    """Velocity and forces at the hand in a run; whether the motor force is held over a sample."""

    v: np.ndarray
    fh: np.ndarray
    fe: np.ndarray
    held: bool


@dataclass(frozen=True)
class Wall(ABC):
    """A wall that a device renders, as the studies see it.

    Attributes:
        subject: what the user describes it by.
        plane: fields of the subject for stiffness and damping.
        varied: parameters of a family of walls.
        read_by_samples: whether growth is read on the scale of the wall's samples, else on that of
            the arm.
        costly: whether its exact limit takes a scan.
        exact_note: how that limit is computed.
    """

    subject: Any
    plane: ClassVar[tuple[str, str]]
    varied: ClassVar[Varied]
    read_by_samples: ClassVar[bool]
    costly: ClassVar[bool]
    exact_note: ClassVar[str]

    @property
    @abstractmethod
    def axis(self) -> str:
        """Axis of the motion."""

    @property
    def Ts(self) -> float | None:
        """Control sample [s]; None in continuous time."""
        return self.subject.Ts

    @property
    def delay(self) -> float:
        """Delay of the force [s]."""
        return self.subject.delay

    @property
    def hand(self) -> Operator:
        """The hand, of zeros for none."""
        return self.subject.hand

    @property
    def damping(self) -> float:
        """Virtual damping [N.s/m]."""
        return getattr(self.subject, self.plane[1])

    def changed(self, **fields: Any) -> Self:
        """The wall with other fields of its subject."""
        return type(self)(replace(self.subject, **fields))

    def at(self, K: float, B: float) -> Self:
        """The wall with another stiffness and damping."""
        return self.changed(**dict(zip(self.plane, (K, B), strict=True)))

    @property
    @abstractmethod
    def mass(self) -> float:
        """Mass of device and hand [kg]."""

    @property
    def damper(self) -> float:
        """Physical damping of device and hand [N.s/m]."""
        return self.hand.damper

    @property
    def quantum(self) -> float:
        """Quantum of the measured position [m]."""
        return 0.0

    @property
    def left_out(self) -> tuple[str, ...]:
        """What theory neglects: friction, encoder, surface."""
        return ()

    @property
    def linear(self) -> bool:
        """Whether its loop is linear, so that eigenvalues predict its runs."""
        return not self.left_out

    # ---- theory ----

    @abstractmethod
    def stable(self) -> bool:
        """Whether the linear loop is stable."""

    @abstractmethod
    def limit(self) -> float:
        """Largest stable stiffness of the linear loop [N/m]."""

    def trial_limit(self) -> float:
        """Largest stable value of the parameter "K" of random trials, in the linear loop."""
        return self.limit()

    def published(self, B: Sequence[float]) -> list[Limit]:  # noqa: ARG002
        """Published lines over B."""
        return []

    @abstractmethod
    def response(self, omega: np.ndarray) -> Impedance:
        """The computed impedance at the hand."""

    def rendered(self, part: str) -> float:
        """Rendered stiffness, damping or mass; 0 for none."""
        names = dict(zip(("stiffness", "damping"), self.plane, strict=True))
        return getattr(self.subject, names[part]) if part in names else 0.0

    # ---- runs ----

    @abstractmethod
    def growth_run(self) -> GrowthRun:
        """A run of a small push, for the growth rate of the oscillation."""

    def growth_reading(self, span: float = 1.0) -> tuple[int, float, float]:
        """Samples of a run for a growth rate, time between those read [s], slowest mode [rad/s].

        Only walls that are read by samples have it.
        """
        raise NotImplementedError

    def rest_run(self, press: Press, span: float, steps: int) -> Scenario:
        """A run of a push into a wall that is not linear, to see whether it comes to rest."""
        raise NotImplementedError

    def engine_steps(self, least: int) -> int:
        """Engine steps per sample: at least a given number, more where dampers are strong."""
        raise NotImplementedError

    @abstractmethod
    def trial(self, t_max: float, push: float | None) -> Scenario:
        """A run of a random trial; the push [m/s] is a small one for None."""

    @abstractmethod
    def check_trial(self, made: Scenario) -> None:
        """Refuses trials of a wall that is not linear, in a scenario made from it."""

    @abstractmethod
    def check_steady(self) -> None:
        """Refuses a wall without a steady response."""

    @abstractmethod
    def driven(self, wave: Multisine, t_max: float, dt: float) -> Scenario:
        """A run at the nominal pose, driven by a multisine."""

    @abstractmethod
    def port(self, record: Record, part: slice, steps: int) -> Port:
        """The hand's port over a part of such a run, of some engine steps per sample."""

    # ---- words ----

    @abstractmethod
    def phrases(self) -> dict[str, str]:
        """The device in a title: phrases by the parameter that they show."""

    @abstractmethod
    def felt_phrases(self, hand: str) -> list[str]:
        """Wall, device and hand in the title of an impedance."""


class DeviceWall(Wall):
    """A `VirtualWall` on a bare device."""

    subject: VirtualWall
    plane = "K", "B"
    read_by_samples, costly = True, False
    varied: ClassVar[Varied] = {
        "Ts": TS_VARIED,
        "delay": DELAY_VARIED,
        "quantum": ("device.quantum", "um", 1e6),
        "damper": ("device.damper", "N.s/m", 1.0),
        "friction": ("device.friction", "N", 1.0),
        "mass": ("device.mass", "kg", 1.0),
        "filter": ("velocity_filter", "Hz", 1.0),
        "velocity_window": ("velocity_window", "samples", 1.0),
    }
    exact_note = "eigenvalues"

    @property
    def axis(self) -> str:
        return "x"

    @property
    def mass(self) -> float:
        return self.subject.device.mass + self.hand.mass

    @property
    def damper(self) -> float:
        return self.hand.damper + self.subject.device.damper

    @property
    def quantum(self) -> float:
        return self.subject.device.quantum

    @property
    def left_out(self) -> tuple[str, ...]:
        d = self.subject.device
        found = {"friction": d.friction, "encoder": d.quantum, "surface": self.subject.unilateral}
        return tuple(name for name, there in found.items() if there)

    def stable(self) -> bool:
        return wall_limits.stable_wall(self.subject)

    def limit(self) -> float:
        return wall_limits.stiffness_band(self.subject)[1]

    def published(self, B: Sequence[float]) -> list[Limit]:
        return published_limits(self.subject, B)

    def response(self, omega: np.ndarray) -> Impedance:
        return wall_response(self.subject, omega)

    def rendered(self, part: str) -> float:
        return self.subject.M if part == "mass" else super().rendered(part)

    @property
    def _omega(self) -> float:
        """Frequency of device and hand on wall and hand [rad/s]."""
        return math.sqrt((self.subject.K + self.hand.spring) / self.mass)

    def growth_reading(self, span: float = 1.0) -> tuple[int, float, float]:
        w, omega = self.subject, self._omega
        order = w.velocity_window + w.delay / w.Ts
        n = max(
            FEWEST_SAMPLES + 12.0 * order,
            READ_SWINGS * math.tau / max(omega * w.Ts, 1e-9) if omega else 0.0,
        )
        n = math.ceil(span * min(n, MOST_SAMPLES + 12.0 * order))
        return n, w.Ts * max(1.0, n / max(READ, 6.0 * order)), SLOWEST * omega

    def growth_run(self) -> GrowthRun:
        (n, *reading), every = self.growth_reading(), self.engine_steps(GROWTH_STEPS)
        w = self.subject
        return GrowthRun(
            w.scenario(n * w.Ts, push=boundary.SMALL_PUSH, steps=every), every, *reading
        )

    def engine_steps(self, least: int) -> int:
        Ts = self.subject.Ts
        decay = self.damper / self.mass * Ts
        most = max(1, math.floor(Ts / 1e-6))  # dt is 1 us at least
        return min(max(least, math.ceil(decay / STEP_DECAY), math.ceil(Ts / 0.02)), most)

    def rest_run(self, press: Press, span: float, steps: int) -> Scenario:
        w, quantum = self.subject, self.quantum
        force = min(press.force, DEEPEST * (w.K + self.hand.spring))
        if quantum and w.K:
            force = (max(0, round(force / (w.K * quantum) - 0.5)) + 0.5) * w.K * quantum
        omega = self._omega
        n = max(REST_SAMPLES, REST_SWINGS * math.tau / (omega * w.Ts)) if omega else REST_SAMPLES
        n = math.ceil(span * min(n + w.delay / w.Ts, REST_MOST))
        muscle = Constant((force, 0.0)) if force else None
        return w.scenario(n * w.Ts, push=press.speed, muscle=muscle, steps=steps)

    def trial(self, t_max: float, push: float | None) -> Scenario:
        speed = push or min(SAMPLE_PUSH / self.subject.Ts, 1.0)
        return self.subject.scenario(t_max, push=speed, steps=self.engine_steps(GROWTH_STEPS))

    def check_trial(self, made: Scenario) -> None:
        hardware = made.hardware
        rough = hardware and (hardware.encoder or any(hardware.friction))
        if self.subject.unilateral or rough:
            bound = "must be a wall without surface, friction and encoder; see hc.walls.zwidth"
            raise ParameterError("base", self.subject, bound)

    def check_steady(self) -> None:
        w = self.subject
        if w.unilateral:
            bound = "must be False: a unilateral wall is not linear"
            raise ParameterError("wall.unilateral", True, bound)
        if self.linear and not self.stable():
            low, high = wall_limits.stiffness_band(w)
            bound = (
                f"must leave the wall stable with this hand: between {low:.4g} and {high:.4g} N/m "
                f"at B = {w.B:g} N.s/m, M = {w.M:g} kg"
            )
            raise ParameterError("wall.K", w.K, bound)

    def driven(self, wave: Multisine, t_max: float, dt: float) -> Scenario:
        return self.subject.scenario(t_max, muscle=wave, steps=round(self.subject.Ts / dt))

    def port(self, record: Record, part: slice, steps: int) -> Port:  # noqa: ARG002
        v = record.v[part, 0]
        # the run has the damper of the device in the arm of the operator
        fh = record.fh[part, 0] + self.subject.device.damper * v
        return Port(v, fh, record.tau[part, 0] / record.scenario.arm.l1, True)

    def phrases(self) -> dict[str, str]:
        w, d = self.subject, self.subject.device
        phrases = {"mass": f"m = {d.mass:g} kg", "damper": f"b = {d.damper:g} N.s/m"}
        phrases |= timing_phrases(self)
        if d.friction:
            phrases["friction"] = f"fc = {d.friction:g} N"
        if d.quantum:
            phrases["quantum"] = f"Delta = {1e6 * d.quantum:g} um"
        if w.velocity_window > 1:
            phrases["velocity_window"] = f"window = {w.velocity_window} samples"
        if w.velocity_filter:
            phrases["filter"] = f"filter = {w.velocity_filter:g} Hz"
        if w.unilateral:
            phrases["surface"] = "surface"
        return phrases

    def felt_phrases(self, hand: str) -> list[str]:
        w = self.subject
        parts = (("K", w.K, "N/m"), ("B", w.B, "N.s/m"), ("M", w.M, "kg"))
        wall = [f"{name} = {x:g} {unit}" for name, x, unit in parts if x]
        return [*(wall or ["no wall"]), f"device {w.device.mass:g} kg", hand, *sampling(self)]


class ClayWall(Wall):
    """A `PushedLoop`: the wall is clay of b and k on an arm with servo and compensator."""

    subject: PushedLoop
    plane = "k", "b"
    read_by_samples, costly = False, True
    varied: ClassVar[Varied] = {
        "Ts": TS_VARIED,
        "delay": DELAY_VARIED,
        "gain": ("K", "1/kg", 1.0),
    }
    exact_note = "sampled loop at the nominal pose"

    @property
    def axis(self) -> str:
        return self.subject.axis

    @property
    def mass(self) -> float:
        return 1.0 / self.subject.servo.S.gain + self.hand.mass

    @property
    def _loop(self) -> Loop:
        return self.subject.linear

    def stable(self) -> bool:
        return gain_crossings.is_stable(self._loop)

    def limit(self) -> float:
        return gain_limits.stiffness_limit(self._loop)

    def trial_limit(self) -> float:
        placed = self.subject.pose != (0.0, 0.0) and not self.subject.inertia_shaping
        return (boundary.pose_limit if placed else boundary.nominal_limit)(self.subject)

    def response(self, omega: np.ndarray) -> Impedance:
        return loop_response(self._loop, omega)

    def growth_run(self) -> GrowthRun:
        return GrowthRun(self.subject.scenario(), 1, growth.GROWTH_SAMPLE, growth.SLOWEST_MODE)

    def trial(self, t_max: float, push: float | None) -> Scenario:
        pushed = replace(self.subject, push=push or TRIAL_PUSH)
        return pushed.scenario(t_max, stop_when_unstable=False)

    def check_trial(self, made: Scenario) -> None:
        """Refuses nothing: a larger push shows the effect of hardware and torque limits."""

    def check_steady(self) -> None:
        if not self.stable():
            limit = gain_limits.gain_limit(self._loop)
            bound = f"must be stable with this hand: at most {limit:.4g}"
            raise ParameterError("K", self.subject.K, bound)

    def driven(self, wave: Multisine, t_max: float, dt: float) -> Scenario:
        still = dict(force=(0.0, 0.0), velocity=(0.0, 0.0), stop_when_unstable=True)
        base = replace(self.subject, pose=(0.0, 0.0)).scenario(t_max)
        return replace(base, name="impedance", muscle=wave, dt=dt, Ts=self.Ts, **still)

    def port(self, record: Record, part: slice, steps: int) -> Port:
        i = AXES.index(self.axis)
        v, fh, fe = (x[part, i] for x in (record.v, record.fh, record.fe))
        held = bool(self.Ts) and self.subject.render == "held"
        if held and not self.delay:  # the record then has b v between the samples, too
            fe = np.repeat(fe[::steps], steps)
        return Port(v, fh, fe, held)

    def phrases(self) -> dict[str, str]:
        w = self.subject
        return {"axis": f"arm, {w.axis} axis", "gain": f"Kc = {w.K:g} 1/kg"} | timing_phrases(self)

    def felt_phrases(self, hand: str) -> list[str]:
        w = self.subject
        clay = f"b = {w.b:g} N.s/m" + (f", k = {w.k:g} N/m" if w.k else "")
        words = [f"{w.axis} axis", clay, f"gain {w.K:g}", hand, *sampling(self)]
        return words + [f"{w.render} clay"] * bool(w.Ts)


KINDS: dict[type, type[Wall]] = {VirtualWall: DeviceWall, PushedLoop: ClayWall}


def as_wall(subject: Any, axis: str = "x") -> Wall:
    """The wall of a subject, or of a scenario's axis; a wall itself is unchanged."""
    subject = boundary.of_scenario(subject, axis)
    kind = next((KINDS[c] for c in type(subject).__mro__ if c in KINDS), None)
    return subject if kind is None else kind(subject)


def timing_phrases(wall: Wall) -> dict[str, str]:
    """Sample and delay in a title."""
    phrases = {"Ts": f"Ts = {1e3 * (wall.Ts or 0.0):g} ms"}
    return phrases | ({"delay": f"delay = {1e3 * wall.delay:g} ms"} if wall.delay else {})


def sampling(wall: Wall) -> list[str]:
    """Sample and delay in words."""
    how = "continuous time" if wall.Ts is None else f"sampled every {1e3 * wall.Ts:g} ms"
    return [how, *([f"{1e3 * wall.delay:g} ms late"] if wall.delay else [])]
