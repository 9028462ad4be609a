"""The hardware between computer and arm (Fig. 3), as frozen records; the laws are in `interface`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError, choice, flag, integer, number, numbers_of

VELOCITIES = ("exact", "difference")
STIFF = 1e12  # [N/m, N.s/m] no coupling is stiffer


@dataclass(frozen=True)
class Coupling:
    """A virtual coupling: spring and damper between the handle and a massless virtual tool that is in the clay.

    Colgate, Stanley, Brown, Issues in the haptic display of tool use, IROS 1995.

    Attributes:
        spring: N/m. damper: N.s/m.
    """

    spring: float
    damper: float

    def __post_init__(self):
        for field, unit in (("spring", "N/m"), ("damper", "N.s/m")):
            value = number(f"coupling.{field}", getattr(self, field), 0.0, STIFF, above=True, unit=unit)
            object.__setattr__(self, field, value)


@dataclass(frozen=True)
class Interface:
    """What lies between computer and arm, part by part; with nothing given it is ideal.

    Attributes:
        jitter: how far a sampling instant is off its time, uniform, rms [s]; 0.28 Ts at most: samples keep their order.
        lost: probability that a sample is lost; the torque is then held for one more.
        encoder: counts per turn of each joint; None measures angles exactly.
        velocity: of the joints: "exact" (a tachometer) or "difference" of measured angles.
        window: samples that the difference spans. velocity_filter: first-order low-pass behind it [Hz]; None for none.
        adc_bits, adc_range: converter of the hand's force on each axis, from -range to range [N]; None for none.
        force_noise: white, on each axis, rms [N]; ahead of the filter.
        force_filter: Butterworth low-pass ahead of the converter [Hz]; None for none. filter_order: 1 or 2.
        dac_bits, dac_range: converter of the torques, from -range to range [N.m]; None for none, and for the
            torque limit.
        delay: from a sampling instant to the torque computed from it [s], any multiple or fraction of Ts.
        friction: Coulomb friction of shoulder and elbow, in the joints [N.m].
        passivity: observer and controller of the energy that the rendered clay takes (Hannaford, Ryu 2002).
        coupling: between the handle and a virtual tool in the clay; None puts the handle into the clay.
        seed: of jitter, losses and noise.
    """

    jitter: float = 0.0
    lost: float = 0.0
    encoder: int | None = None
    velocity: str = "exact"
    window: int = 1
    velocity_filter: float | None = None
    adc_bits: int | None = None
    adc_range: float = 50.0
    force_noise: float = 0.0
    force_filter: float | None = None
    filter_order: int = 2
    dac_bits: int | None = None
    dac_range: tuple[float, float] | None = None
    delay: float = 0.0
    friction: tuple[float, float] = (0.0, 0.0)
    passivity: bool = False
    coupling: Coupling | None = None
    seed: int = 0

    def __post_init__(self):
        def put(field: str, check: Callable[..., Any], *bounds: Any, **kw: Any) -> None:
            value = check(f"interface.{field}", getattr(self, field), *bounds, **kw)
            object.__setattr__(self, field, value)

        def optional(field: str, check: Callable[..., Any], *bounds: Any, **kw: Any) -> None:
            if getattr(self, field) is not None:
                put(field, check, *bounds, **kw)

        joints = ("shoulder", "elbow")
        put("jitter", number, 0.0, 1.0, unit="s")
        put("lost", number, 0.0, 0.99)
        optional("encoder", integer, 4, 2**40)
        put("velocity", choice, VELOCITIES)
        put("window", integer, 1, 10_000)
        optional("velocity_filter", number, 0.0, 1e6, above=True, unit="Hz")
        optional("adc_bits", integer, 2, 32)
        put("adc_range", number, 0.0, 1e6, above=True, unit="N")
        put("force_noise", number, 0.0, 1e3, unit="N")
        optional("force_filter", number, 0.0, 1e6, above=True, unit="Hz")
        put("filter_order", integer, 1, 2)
        optional("dac_bits", integer, 2, 32)
        optional("dac_range", numbers_of, joints, 0.0, 1e6, above=True, unit="N.m")
        put("delay", number, 0.0, 1.0, unit="s")
        put("friction", numbers_of, joints, 0.0, 1e6, unit="N.m")
        put("passivity", flag)
        put("seed", integer, 0, 2**32 - 1)
        if not isinstance(self.coupling, Coupling | None):
            raise ParameterError("interface.coupling", self.coupling, "must be a Coupling or None")
        if self.velocity == "exact" and (self.velocity_filter is not None or self.window != 1):
            raise ParameterError("interface.velocity", self.velocity, "must be 'difference' for a window or a filter")
