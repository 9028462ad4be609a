"""The hardware between computer and arm (Fig. 3): parts as frozen dataclasses, and their laws."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt, tau
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real
from ..fields import JOINTS, Seed
from .traits import LEFT_OUT, YES, Quantity, Refusal, Trait, present

STIFF = 1e12  # [N/m, N.s/m] upper bound of a coupling


@part("coupling.")
class Coupling:
    """A virtual coupling: spring and damper between the handle and a massless tool in the clay.

    Colgate, Stanley, Brown, Issues in the haptic display of tool use, IROS 1995. A bare handle of
    mass m is stable in clay of any stiffness if and only if spring Ts/2 < damper < 2 m/Ts.

    Attributes:
        spring: stiffness [N/m], > 0, at most 1e12.
        damper: damping [N.s/m], > 0, at most 1e12.
    """

    spring: Annotated[Real, Bound(0.0, STIFF, "N/m", above=True)]
    damper: Annotated[Real, Bound(0.0, STIFF, "N.s/m", above=True)]


@part("hardware.")
class Hardware:
    """The hardware between computer and arm, part by part; ideal by default.

    Attributes:
        jitter: how far a sampling instant is off its time, uniform, rms [s], at most 0.28 Ts, so
            that samples keep their order.
        dropout_probability: probability that a sample is lost, 0 to 0.99; the torque is then held
            for one more.
        encoder: counts per turn of the joints that turn, 4 to 2^40, one number or one for each;
            None measures angles exactly.
        velocity: of the joints: "exact" (a tachometer) or "difference" of measured angles.
        velocity_window: samples that the difference spans, 1 to 10000.
        velocity_filter: first-order low-pass behind the difference [Hz]; None for none.
        adc_bits: bits of the converter of the hand's force, 2 to 32; None for none.
        adc_range: that converter spans -range to range on each axis [N].
        force_noise: white noise ahead of the filter, on each axis, rms [N], 0 to 1e3.
        force_filter: Butterworth low-pass ahead of the converter [Hz]; None for none.
        filter_order: order of that low-pass, 1 or 2.
        dac_bits: bits of the converter of the torques, 2 to 32; None for none.
        dac_range: that converter spans -range to range at shoulder and elbow [N.m]; None for the
            torque limit.
        delay: from a sampling instant to the torque computed from it [s], any multiple or
            fraction of Ts.
        friction: Coulomb friction in the shoulder and elbow joint [N.m].
        passivity: whether an observer and controller keep the rendered clay passive (Hannaford,
            Ryu 2002).
        coupling: between the handle and a virtual tool in the clay; None puts the handle into it.
        seed: seed of jitter, losses and noise, 0 to 2^32 - 1.
        linear_encoder: counts per length of the joints of a file that slide [1/m], as "1000 1/mm",
            up to 1e12, one number or one for each; 0 or None measures their positions exactly.
    """

    jitter: Annotated[Real, Bound(0.0, 1.0, "s")] = 0.0
    dropout_probability: Annotated[float, Bound(0.0, 0.99)] = 0.0
    encoder: Annotated[int | tuple[int, ...] | None, Bound(4, 2**40)] = None
    velocity: Literal["exact", "difference"] = "exact"
    velocity_window: Annotated[int, Bound(1, 10_000)] = 1
    velocity_filter: Annotated[Real | None, Bound(0.0, 1e6, "Hz", above=True)] = None
    adc_bits: Annotated[int | None, Bound(2, 32)] = None
    adc_range: Annotated[Real, Bound(0.0, 1e6, "N", above=True)] = 50.0
    force_noise: Annotated[Real, Bound(0.0, 1e3, "N")] = 0.0
    force_filter: Annotated[Real | None, Bound(0.0, 1e6, "Hz", above=True)] = None
    filter_order: Annotated[int, Bound(1, 2)] = 2
    dac_bits: Annotated[int | None, Bound(2, 32)] = None
    dac_range: Annotated[
        tuple[Real, Real] | None, Bound(0.0, 1e6, "N.m", above=True, names=JOINTS)
    ] = None
    delay: Annotated[Real, Bound(0.0, 1.0, "s")] = 0.0
    friction: Annotated[tuple[Real, Real], Bound(0.0, 1e6, "N.m", names=JOINTS)] = (0.0, 0.0)
    passivity: bool = False
    coupling: Coupling | None = None
    seed: Seed = 0
    linear_encoder: Annotated[Real | tuple[Real, ...] | None, Bound(0.0, 1e12, "1/m")] = None

    def __post_init__(self):
        if isinstance(self.encoder, tuple):
            if not self.encoder or any(x != int(x) for x in self.encoder):
                bound = "must be whole numbers, one for each joint"
                raise ParameterError("hardware.encoder", self.encoder, bound)
            object.__setattr__(self, "encoder", tuple(map(int, self.encoder)))
        if self.linear_encoder == ():
            bound = "must be one number, or one for each joint that slides"
            raise ParameterError("hardware.linear_encoder", (), bound)
        if self.velocity == "exact" and (
            self.velocity_filter is not None or self.velocity_window != 1
        ):
            raise ParameterError(
                "hardware.velocity", self.velocity, "must be 'difference' for a window or a filter"
            )

    def count_sizes(self, turning: Sequence[bool]) -> list[float]:
        """Size of a count of each joint, 0 of one that is measured exactly [rad, m of slides].

        Args:
            turning: whether each joint turns; others slide.
        """
        turns, slides = sum(turning), len(turning) - sum(turning)
        per_turn = [tau / n if n else 0.0 for n in _each(self.encoder, turns)]
        per_metre = [1.0 / n if n else 0.0 for n in _each(self.linear_encoder, slides)]
        sizes = {True: iter(per_turn), False: iter(per_metre)}
        return [next(sizes[bool(turns)]) for turns in turning]

    def check_encoders(self, turning: Sequence[bool], names: Sequence[str], path: str) -> None:
        """Refuses counts that do not fit the joints.

        Args:
            turning: whether each joint turns; others slide.
            names: joints.
            path: what errors put before the name of a field.

        Raises:
            ParameterError: counts a turn of a joint that slides, or the other way round; more or
                fewer numbers than joints.
        """
        slides = [name for name, turns in zip(names, turning, strict=True) if not turns]
        if self.encoder is not None and slides and self.linear_encoder is None:
            bound = (
                f"is a number of counts a turn, and {', '.join(slides)} slides: give counts a "
                "metre as hardware.linear_encoder, such as '1000 1/mm', or 0 for exact positions"
            )
            raise ParameterError(f"{path}encoder", self.encoder, bound)
        for name, many, kind in (
            ("encoder", len(names) - len(slides), "turn"), ("linear_encoder", len(slides), "slide")
        ):  # fmt: skip
            value = getattr(self, name)
            if value is not None and not many:
                raise ParameterError(f"{path}{name}", value, f"must be None: no joint {kind}s")
            if isinstance(value, tuple) and len(value) != many:
                bound = f"must be one number, or one for each of {many} joints that {kind}"
                raise ParameterError(f"{path}{name}", value, bound)


def _each(value: Any, n: int) -> Sequence[float]:
    """A value for each of n joints."""
    return value if isinstance(value, tuple) else (value or 0.0,) * n


NOISE_BLOCK = 1024  # samples drawn at once


def butterworth(cutoff: float, order: int, Ts: float) -> tuple[float, ...]:
    """Butterworth low-pass [Hz] of unit gain under a held input: x+ = A x + B u, y = x[0], exact.

    A row by row, then B; the poles lie on a circle of radius 2 pi cutoff (matrix exponential).
    """
    from scipy.linalg import expm

    w = tau * cutoff
    a = (
        [[-w, w], [0.0, 0.0]]
        if order == 1
        else [[0.0, 1.0, 0.0], [-w * w, -sqrt(2.0) * w, w * w], [0.0, 0.0, 0.0]]
    )
    e = expm(Ts * np.array(a))
    A, B = np.zeros((2, 2)), np.zeros(2)
    A[:order, :order], B[:order] = e[:order, :order], e[:order, order]
    return (*A.ravel().tolist(), *B.tolist())


class SampleNoise:
    """Random effects on each sample, reproducible by seed and index; one stream per part."""

    def __init__(self, parts: Hardware):
        self.parts = parts
        self._streams = [np.random.default_rng([parts.seed, i]) for i in range(3)]
        self._first, self._rows = 0, np.zeros((0, 4))

    @property
    def first(self) -> int:
        """Index of the first sample that is kept."""
        return self._first

    def forget(self, first: int) -> None:
        """Drops the samples before a given one."""
        self._rows, self._first = self._rows[first - self._first :], first

    def table(self, first: int, n: int) -> np.ndarray:
        """Offset in time [s], whether lost (1 or 0), and force noise (x, y) [N] of n samples.

        The first sample of a run is on time and never lost.
        """
        blocks, at = [self._rows], first - self._first
        missing = at + n - len(self._rows)
        while missing > 0:
            blocks.append(self._draw())
            missing -= NOISE_BLOCK
        self._rows = np.concatenate(blocks)
        if self._first == 0:
            self._rows[0, :2] = 0.0
        return self._rows[at : at + n].copy()

    def _draw(self) -> np.ndarray:
        s, (time, loss, noise) = self.parts, self._streams
        width = s.jitter * sqrt(3.0)
        late = time.uniform(-width, width, NOISE_BLOCK)
        lost = loss.random(NOISE_BLOCK) < s.dropout_probability
        hiss = s.force_noise * noise.standard_normal((NOISE_BLOCK, 2))
        return np.column_stack((late, lost, hiss))


_IDEAL = Refusal("hardware", "must be None unless control is 'sampled'")
_UNSAMPLED = {"fast": _IDEAL, "accurate": _IDEAL}
_HELD = Refusal("render", "must be 'held' for a passivity controller or a coupling")


def _difference_words(x: Hardware) -> list[Quantity]:
    window = [Quantity("over {} samples", (float(x.velocity_window),))] * (x.velocity_window > 1)
    cutoff = x.velocity_filter
    low_pass = [] if cutoff is None else [Quantity("low-pass {}", (cutoff,), "Hz")]
    return [Quantity("velocity by difference"), *window, *low_pass]


def _encoder_words(x: Hardware) -> list[Quantity]:
    kinds = ("encoder", x.encoder, "turn"), ("linear encoder", x.linear_encoder, "metre")
    out = []
    for name, n, length in kinds:
        if n:
            values = n if isinstance(n, tuple) else (n,)
            out += Quantity.of_scene(f"{name} {{}}", values, f"counts per {length}")
    return out


def _converter_words(x: Hardware) -> list[Quantity]:
    bits = {"A/D": x.adc_bits, "D/A": x.dac_bits}
    return [Quantity(f"{name} {{}}", (float(n),), "bits") for name, n in bits.items() if n]


def _friction_words(x: Hardware) -> list[Quantity]:
    shoulder, elbow = x.friction
    return [Quantity(f"joint friction ({shoulder:.4g}, {elbow:.4g})", (), "N.m")]


def _coupling_words(x: Any) -> list[Quantity]:
    spring, damper = x.coupling.spring, x.coupling.damper
    return [
        Quantity("virtual coupling {}", (spring,), "N/m"),
        Quantity("{}", (damper,), "N.s/m"),
    ]


def _trait(name: str, has: Any, words: Any, theory: str = LEFT_OUT, **refuses: Refusal) -> Trait:
    """The trait of scenes whose hardware has a part."""
    return Trait(
        name,
        "part",
        lambda s: s.hardware is not None and has(s.hardware),
        theory,
        _UNSAMPLED | refuses,
        lambda s: words(s.hardware),
    )


def _field_trait(name: str, field: str, unit: str = "", theory: str = LEFT_OUT) -> Trait:
    """The trait of a part that is a number, or one for each joint, 0 or None without it."""
    form = f"{field.replace('_', ' ')} {{}}"

    def words(x: Any) -> Any:
        value = getattr(x, field)
        return Quantity.of_scene(form, value if isinstance(value, tuple) else (value,), unit)

    return _trait(name, lambda x: bool(getattr(x, field)), words, theory)


def hardware_words(scenario: Any) -> str:
    """The parts of the hardware of a scenario, with units; "ideal" if there are none."""
    found = [x.text() for part in present(scenario, TRAITS[1:]) for x in part.words(scenario)]
    return ", ".join(found) or "ideal"


TRAITS = (
    Trait("hardware", "part", lambda s: s.hardware is not None, YES, _UNSAMPLED),
    _field_trait("jitter", "jitter", "s rms"),
    _field_trait("dropouts", "dropout_probability"),
    _trait("encoder", lambda x: bool(x.encoder or x.linear_encoder), _encoder_words),
    _trait("velocity by difference", lambda x: x.velocity == "difference", _difference_words),
    _trait("converters", lambda x: bool(x.adc_bits or x.dac_bits), _converter_words),
    _field_trait("force noise", "force_noise", "N rms"),
    _field_trait("force filter", "force_filter", "Hz"),
    _field_trait("delay", "delay", "s", YES),
    _trait("joint friction", lambda x: any(x.friction), _friction_words),
    _trait(
        "passivity controller",
        lambda x: x.passivity,
        lambda x: [Quantity("passivity controller")],
        physical=_HELD,
    ),
    _trait("virtual coupling", lambda x: x.coupling is not None, _coupling_words, physical=_HELD),
)
