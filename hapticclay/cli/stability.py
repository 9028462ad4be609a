"""`hapticclay stability`: verdicts on one loop, and a map of where it is stable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError, choice, number_in
from ..files import writable
from ..model.constants import AXES, B_CONSTANT, C_DEN, C_NUM, GAIN, TS, SecondOrder
from . import console
from .unused import FIGURE_WORDS, Unused

if TYPE_CHECKING:
    from ..model.controller import Servo
    from ..model.flow import Flow
    from ..studies.boundary import PushedLoop
    from ..studies.stability_map import StabilityMap
    from ..studies.yield_map import YieldMap

Damping = Annotated[float, Bound(unit="1/s")]
Stiffness = Annotated[float, Bound(unit="1/s^2")]
PositionLoop = tuple[Annotated[float, Bound(unit="1/s^2")], Damping, Stiffness]
ForceLoop = tuple[Annotated[float, Bound(unit="1/kg")], Damping, Stiffness]


@dataclass(frozen=True)
class StabilityCommand:
    """Judge the stability of one loop, and map where it is stable by analysis and by runs.

    Attributes:
        axis: Axis of the loop.
        b: Damping of the clay [N.s/m]; by default 90, or 0 with --clay Fy=5.
        gain: K of the compensator [1/kg]; by default 1 on x and 0.5 on y.
        Ts: Control sample [s]; None for runs in continuous time.
        delay: Latency from a measurement to the torque computed from it [s].
        num: Numerator of the compensator, descending powers of s.
        den: Denominator of the compensator, descending powers of s.
        G: Gain [1/s^2], damping [1/s] and stiffness [1/s^2] of the position loop G; by default as
            printed.
        S: Gain [1/kg], damping [1/s] and stiffness [1/s^2] of Sh; by default as printed. Without
            --inertia-shaping the gain is that of the arm.
        operator: Put the operator's arm Th (Eq. 19) in the loop.
        inertia_shaping: Let the servo of the runs shape the inertia, so that Sh is the same at
            every pose.
        clay: Clay that yields, as Fy=5 K=2 n=0.5 in addition to b, or a material, "stiff clay":
            predict sticking and limit cycles.
        map: Plane of the map: a boundary in K or b over clay, delay or pose; or how a push ends,
            over yield force and gain, in Bingham clay of this b.
        out: Folder for stability.json and the map.
        quick: Draw a coarse map.
        figures: Format and style of the map.
    """

    axis: Literal["x", "y"] = "x"
    b: Annotated[float | None, Bound(unit="N.s/m")] = None
    gain: Annotated[float | None, Bound(unit="1/kg")] = None
    Ts: Annotated[float | None, Bound(unit="s")] = TS
    delay: Annotated[float, Bound(unit="s")] = 0.0
    num: tuple[float, ...] = C_NUM
    den: tuple[float, ...] = C_DEN
    G: PositionLoop | None = None
    S: ForceLoop | None = None
    operator: bool = True
    inertia_shaping: bool = False
    clay: tuple[str, ...] | None = None
    map: Literal["none", "gain-damping", "delay-damping", "gain-pose", "gain-yield"] = "none"
    out: Path = Path("out/stability")
    quick: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("quick", *FIGURE_WORDS), "is for a map: give --map too", (), ("map",)),
        Unused(("quick", *FIGURE_WORDS), "is for a map: give another --map", ("map=none",)),
    )

    def __call__(self) -> int:
        from ..model.compensator import Compensator
        from ..model.operator import Operator
        from ..studies.boundary import PushedLoop
        from ..studies.loop_verdicts import loop_verdicts

        writable(self.out)
        i, b = AXES.index(self.axis), B_CONSTANT if self.b is None else self.b
        flow = None if self.clay is None else clay_of(self.clay, self.b)
        loop = PushedLoop(
            self.axis,
            b=flow.b if flow else b,
            K=GAIN[i] if self.gain is None else self.gain,
            operator=Operator() if self.operator else None,
            servo=self._servo(i),
            compensator=Compensator(self.num, self.den),
            Ts=self.Ts,
            delay=self.delay if self.Ts else 0.0,
            inertia_shaping=self.inertia_shaping,
        )
        found = loop_verdicts(loop, self.delay, flow)
        print(found.text())
        asked = {"axis": self.axis, "b": loop.b, "K": loop.K, "operator": loop.operator,
                 "Ts": self.Ts, "compensator": loop.compensator, "servo": loop.servo,
                 "delay": self.delay, "inertia_shaping": self.inertia_shaping, "map": self.map,
                 "quick": self.quick}  # fmt: skip
        chart = self._map(loop)
        found, text = replace(found, chart=chart), chart.text() if chart else ""
        console.deliver(found, self.out, self.figures, text=text, asked=asked)
        return 0

    def _servo(self, i: int) -> Servo:
        from ..model.controller import SERVO

        printed = SERVO[i]
        return replace(
            printed,
            G=SecondOrder(*self.G) if self.G else printed.G,
            S=SecondOrder(*self.S) if self.S else printed.S,
        )

    def _map(self, loop: PushedLoop) -> StabilityMap | YieldMap | None:
        if self.map == "none":
            return None
        if self.map == "gain-yield":
            from ..studies.yield_map import yield_map

            return yield_map(loop, self.quick, _bar)
        from ..studies.stability_map import stability_map

        if self.map == "delay-damping":
            loop = replace(loop, delay=0.0)
        return stability_map(self.map, loop, self.quick, _bar)


def _bar(items: Any) -> Any:
    return console.progress_bar(items, desc="map")


def clay_of(words: Sequence[str], b: float | None = None) -> Flow:
    """The law of clay that is given by its numbers, or by the name of a material."""
    from ..fields import field_unit
    from ..model.flow import Flow
    from ..model.materials import material

    text = " ".join(words)
    if not text.strip():
        bound = "must be numbers with their names, Fy=5 b=30, or a material"
        raise ParameterError("clay", text, bound)
    if "=" not in text:
        if b is not None:
            raise ParameterError("b", b, f"must not be given beside {text!r}, which has its own")
        try:
            return material(text)
        except ParameterError as error:
            bound = f"{error.bound} (or numbers with their names, as Fy=5 b=30)"
            raise ParameterError(error.field, error.value, bound) from None
    found = {} if b is None else {"b": b}
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals:
            raise ParameterError("clay", word, "must be numbers with their names: Fy=5 K=2 n=0.5")
        if choice("clay", name, ("Fy", "K", "n", "b")) in found:
            raise ParameterError(f"clay {name}", value, "must be given once, here or as --b")
        try:
            found[name] = number_in(f"clay {name}", value, field_unit(name, Flow))
        except ParameterError:  # of a unit
            raise
        except ValueError:
            raise ParameterError(f"clay {name}", value, "must be a number") from None
    if "n" in found and not found.get("K"):
        raise ParameterError("clay n", found["n"], "must be given beside K > 0, whose power it is")
    return Flow(**found)
