"""`record.plot`: the figures of `run_plots` by name, and energy over time."""

from __future__ import annotations

import io
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from ..arguments import checked
from ..errors import ParameterError
from ..simulation.record import Record, in_plane, port_energy
from . import arm_plots, path_plots, run_axes, run_figures, run_plots
from .palette import BLUE, GREEN, ORANGE, PURPLE, VERMILION
from .panels import add_legend, set_title, single
from .run_axes import spread
from .style import figure_style, stroke

MOST_STORED = 2000  # samples at which the energy of an arm from a file is computed


class RecordPlots:
    """The figures of a record; each call draws one and returns it.

    A figure has `savefig`, and `axes` to change; notebooks show it. Lengths are in cm, as in the
    paper's figures.

    Args:
        record: the run.
    """

    def __init__(self, record: Record):
        self.record = record

    def __call__(self) -> Figure:
        """The main figure that `hapticclay run` draws: velocity, in a maneuver the force.

        Of an arm from a file: its joints.
        """
        if not self.record.scenario.is_closed_form:
            return self.joints()
        return self.velocity() if self.record.scenario.muscle is None else self.force()

    def __repr__(self) -> str:
        names = "velocity", "force", "path", "joints", "handle", "energy"
        return f"<plots of {self.record!r}: plot(), {', '.join(f'.{x}()' for x in names)}>"

    def all(self) -> dict[str, Figure]:
        """The figures that `hapticclay run` draws, by file name."""
        figures = run_figures.figures(self._sampled())
        return {name: _with_picture(figure) for name, figure in figures.items()}

    @checked
    def velocity(self, axis: Literal["x", "y", "xy"] | None = None) -> Figure:
        """Velocity over position, with the expected steady speeds (Fig. 8, top; Fig. 10)."""
        record = in_plane(self._sampled())
        axes = axis or run_figures.shown_axes(record.scenario)
        return _with_picture(run_plots.velocity_plot(record, axes))

    @checked
    def force(
        self,
        axis: Literal["x", "y"] | None = None,
        over: Literal["time", "position"] | None = None,
    ) -> Figure:
        """The forces of hand and clay: their ratio to the velocity over position (Fig. 8, bottom).

        In a maneuver, in clay that is not viscous, and if `over` is given, it shows the forces
        (Fig. 11).
        """
        record = in_plane(self._sampled())
        s = record.scenario
        along = axis or run_axes.main_axis(s)
        if over or s.muscle is not None or (s.clay and not s.clay.viscous):
            return _with_picture(run_plots.maneuver_plot([record], along, over or "time"))
        return _with_picture(run_plots.force_ratio_plot(record, along))

    def path(self) -> Figure:
        """The path of the handle over a map of the clay (Figs. 7, 9)."""
        record = self._sampled()
        if not record.scenario.is_closed_form:
            return _with_picture(arm_plots.arm_path_plot(record))
        return _with_picture(path_plots.path_plot(record))

    def joints(self) -> Figure:
        """Position, rate and torque of each joint over time, with reference and limits."""
        return _with_picture(arm_plots.joints_plot(self._sampled()))

    def handle(self) -> Figure:
        """Position, velocity and forces of the handle over time."""
        return _with_picture(arm_plots.handle_plot(self._sampled()))

    def energy(self) -> Figure:
        """Energy over time: supplied by hand and motors, absorbed by the clay, and kinetic.

        See `energy_plot`.
        """
        return _with_picture(energy_plot(self._sampled()))

    def _sampled(self) -> Record:
        if not len(self.record.t):
            raise ParameterError("record", self.record.scenario.name, "holds no samples")
        return self.record


def energies(record: Record) -> dict[str, np.ndarray]:
    """Energies over time, from the samples.

    Integrals are trapezoidal: they miss changes between samples that are far apart, and while a
    session did not record.
    """

    def work(power: np.ndarray) -> np.ndarray:
        steps = 0.5 * np.diff(record.t) * (power[1:] + power[:-1])
        return np.concatenate(([0.0], np.cumsum(steps)))

    out = {
        "hand": port_energy(record).sum(axis=1),
        "motors": work((record.tau * record.qd).sum(axis=1)),
        "clay": work((record.fe * record.v).sum(axis=1)),
    }
    if not record.scenario.is_closed_form:
        return out | {"joints": work(_lost(record)), "stored": _stored(record)}
    I1, I2 = record.scenario.arm.links[2:4]
    rates = record.qd[:, 0], record.qd.sum(axis=1)  # of the links
    return out | {"kinetic": 0.5 * (I1 * rates[0] ** 2 + I2 * rates[1] ** 2)}


def _lost(record: Record) -> np.ndarray:
    """Power that dampers, friction and a fluid take in the joints of an arm from a file [W]."""
    arm = record.scenario.file_arm
    rubbed = (np.array(arm.friction) * np.abs(record.qd)).sum(axis=1)
    if not arm.mechanism.is_computed:
        return rubbed + (np.array(arm.damping) * record.qd**2).sum(axis=1)
    shown = spread(np.arange(len(record.t)), MOST_STORED)
    found = [arm.mechanism.taken(record.q[k], record.qd[k]) for k in shown]
    return rubbed + np.interp(record.t, record.t[shown], found)


def _stored(record: Record) -> np.ndarray:
    """Energy of motion, weight and springs that an arm from a file has gained [J]."""
    mechanism = record.scenario.file_arm.mechanism
    shown = spread(np.arange(len(record.t)), MOST_STORED)
    found = np.array([mechanism.energy(record.q[k], record.qd[k]) for k in shown])
    return np.interp(record.t, record.t[shown], found - found[0])


@figure_style()
def energy_plot(record: Record) -> Figure:
    """Plots `energies` over time, and as dots the run's own energy balance.

    Energy is conserved: without friction, hand + motors = clay + kinetic energy gained; of an arm
    from a file, hand + motors = clay + joints + stored.
    """
    looks = {
        "hand": (GREEN, "-", "put in by the hand"),
        "motors": (ORANGE, "-", "put in by the motors"),
        "clay": (BLUE, "-", "taken by the clay"),
        "kinetic": (VERMILION, "--", "kinetic, of the arm"),
        "joints": (PURPLE, "-", "taken by the joints' dampers and friction"),
        "stored": (VERMILION, "--", "of the arm: motion, weight, springs"),
    }
    figure, ax = single(3.6)
    for name, values in energies(record).items():
        color, dash, label = looks[name]
        ax.plot(record.t, values, color=color, ls=dash, label=label)
    for name, value in _added_up(record).items():
        look: Any = dict(color=looks[name][0], ms=stroke(5.0), label="added up by the run")
        ax.plot(record.t[-1], value, "o", **look)
    ax.set(xlabel="time [s]", ylabel="energy [J]")
    add_legend(figure, 3)
    set_title(ax, record.scenario.name, record.status)
    return figure


def _added_up(record: Record) -> dict[str, float]:
    """The run's own balance at the end, in the terms of `energies`; empty if it has none."""
    e = record.energy
    if not {"muscle", "hand_damper", "hand_stored", "motors", "clay"} <= set(e):
        return {}
    hand = e["muscle"] - e["hand_damper"] - e["hand_stored"]
    return {"hand": hand, "motors": e["motors"], "clay": e.get("rendered_clay", e["clay"])}


def _with_picture(figure: Figure) -> Figure:
    """The figure, displayed by a notebook without pyplot."""

    @figure_style()
    def picture() -> bytes:
        file = io.BytesIO()
        figure.savefig(file, format="png")
        return file.getvalue()

    figure._repr_png_ = picture  # type: ignore[attr-defined]
    return figure
