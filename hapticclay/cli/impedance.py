"""`hapticclay impedance`: the impedance a hand feels, measured by a run beside the computed one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ..errors import ParameterError, choice
from ..files import writable
from ..model.constants import AXES
from . import console

if TYPE_CHECKING:
    from ..model.virtual_wall import VirtualWall
    from ..studies.impedance import MeasuredImpedance, Subject

DEVICE_WORDS = {  # short names of what a wall has below its first level
    "mass": "device.mass",
    "damper": "device.damper",
    "friction": "device.friction",
    "quantum": "device.quantum",
}


@dataclass(frozen=True)
class ImpedanceCommand:
    """Measure the impedance that a hand feels, and transparency, beside the computed ones.

    A multisine of the muscles drives the arm of an experiment, or a virtual wall on a bare device,
    so gently that it stays linear. Any Ze of both is drawn as a thin line.

    Attributes:
        source: Experiment, as in hapticclay run, or a scenario file; its clay is all around the
            handle, which is at the nominal pose. By default the constant cut.
        wall: A virtual wall instead, as in --wall K=300 B=2 M=0.05 mass=0.1 damper=0.5 Ts=1ms
            delay=0.5ms window=2 velocity_filter=100; operator.mass=0.25 adds a hand.
        axis: Axis of the arm, x unless given.
        b: Clay [N.s/m]; by default that of the experiment with the least gain limit.
        k: Stiffness of the clay [N/m].
        hand: Put the operator's arm Th (Eq. 19) at the handle.
        band: Lowest and highest frequency [Hz].
        lines: Number of frequencies.
        amplitude: Size of the motion, rms [m].
        seed: Seed of the multisine's phases.
        out: Folder for impedance.json, impedance.png and transparency.png.
        figures: Format and style of the figures.
    """

    source: Annotated[str | None, tyro.conf.Positional] = None
    wall: tuple[str, ...] = ()
    axis: Literal["x", "y"] | None = None
    b: float | None = None
    k: float | None = None
    hand: bool = False
    band: tuple[float, float] = (0.5, 30.0)
    lines: int = 24
    amplitude: float = 1e-5
    seed: int = 0
    out: Path = Path("out/impedance")
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.impedance import measure_impedance
        from ..views import impedance_plots
        from ..views.figure import Figure

        writable(self.out)
        subject = self._wall() if self.wall else self._loop()
        found = measure_impedance(
            subject, band=self.band, lines=self.lines, amplitude=self.amplitude, seed=self.seed
        )
        try:
            console.save_json(found.summary(), self.out / "impedance.json")
            figures = {
                "impedance": Figure(lambda: impedance_plots.impedance_plot(found), found.tables),
                "transparency": Figure(
                    lambda: impedance_plots.transparency_bode_plot(found), found.tables
                ),
            }
            console.save_figures(figures, self.out, self.figures)
        finally:  # a full disk must not hide the result
            print(impedance_table(found))
        print(f"written to {self.out}")
        return 0

    def _wall(self) -> VirtualWall:
        for name in ("source", "axis", "b", "k"):
            if getattr(self, name) is not None:
                bound = "is for the arm: leave it out with --wall"
                raise ParameterError(name, getattr(self, name), bound)
        wall = wall_of(self.wall)
        if self.hand and wall.operator is None:
            from dataclasses import replace

            from ..model.operator import Operator

            wall = replace(wall, operator=Operator())
        return wall

    def _loop(self) -> Subject:
        from dataclasses import replace

        from ..model.experiments import EXPERIMENTS, SCENARIOS
        from ..model.operator import Operator
        from ..model.scenario_file import is_scenario_file, load_scenario
        from ..studies.impedance import subject_of

        name = self.source or "constant"
        if is_scenario_file(name):
            scenario = load_scenario(name)
        else:
            scenario = SCENARIOS[choice("experiment", name, tuple(EXPERIMENTS))]()
        axis = self.axis or AXES[0]
        loop = subject_of(scenario, axis, self.b)
        if self.k is not None:
            loop = replace(loop, k=self.k)
        return replace(loop, operator=Operator()) if self.hand else loop


def wall_of(words: Sequence[str]) -> VirtualWall:
    """A virtual wall from words such as K=300 B=2 mass=0.1 Ts=1ms.

    Args:
        words: NAME=VALUE each, one text or several; names are those of the fields of `VirtualWall`,
            or mass, damper, friction and quantum of its device.

    Raises:
        ParameterError: a word has another form, a name is unknown, or a value is out of its bounds.
    """
    from ..model.fields import named_values, with_fields
    from ..model.virtual_wall import VirtualWall

    given = named_values("--wall", " ".join(words).split())
    return with_fields(VirtualWall(), {DEVICE_WORDS.get(k, k): v for k, v in given.items()})


def impedance_table(found: MeasuredImpedance) -> str:
    """Effective stiffness, damping and mass at each line, for a terminal.

    Args:
        found: from `measure_impedance`.
    """
    m, c = found.measured, found.computed
    off = abs(m.Z / c.Z - 1.0)
    columns = zip(m.frequency, m.stiffness, m.damping, m.mass, off, abs(m.felt), strict=True)
    rows = [
        [
            f"{f:.4g}",
            *(console.significant(float(x)) for x in (stiffness, damping, mass)),
            f"{100.0 * gap:.4f} %",
            console.significant(float(felt)),
        ]
        for f, stiffness, damping, mass, gap, felt in columns
    ]
    head = ["Hz", "stiffness [N/m]", "damping [N.s/m]", "mass [kg]", "off theory", "|fe/fh|"]
    lines = [
        console.text_table(rows, head, "rrrrrr"),
        f"measured against computed: Z within {100.0 * found.gap:.2g} %"
        + ("" if math.isnan(found.felt_gap) else f", fe/fh within {100.0 * found.felt_gap:.2g} %"),
        *found.notes,
    ]
    return "\n".join(lines)
