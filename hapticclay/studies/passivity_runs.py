"""Passivity by theory and by runs: over frequency, over time, and over K, Ts and delay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..display import brief
from ..errors import ParameterError, array_of, number
from ..model.hardware import Hardware
from ..results import Result, figure_of
from ..scene.scenario import Scenario
from ..scene.virtual_wall import VirtualWall
from ..simulation.record import Record, port_energy
from ..simulation.simulate import simulate
from ..theory import wall_limits
from ..theory.gain_crossings import is_stable
from ..theory.impedance import wall_impedance
from .boundary import PushedLoop, of_scenario
from .impedance import computed_impedance, measure_impedance
from .port_energy import passivity_limit, polygon, taken_energy
from .stability_map import Progress

INDEX_TURNS = ((1, 8), (1, 4), (3, 8), (1, 2), (2, 3), (4, 5), (1, 1))  # omega Ts over pi
INDEX_BAND = (0.02, 0.9)  # shares of pi/Ts: sines that measure the impedance
INDEX_LINES = 8
ARM_BAND = (0.5, 30.0)  # [Hz]
INDEX_POINTS = 2000  # of a computed line
REGION_SPAN = 10.0  # Ts ranges from that of the wall divided by this to that times this
REGION_POINTS = 61
WORST_AMPLITUDE = 1e-4  # [m] of the worst paths


@named
@dataclass(frozen=True, eq=False)
class IndexOverFrequency:
    """Excess damping of a wall, or of an arm in clay, at each frequency, with runs.

    Attributes:
        name: name of the subject.
        omega: frequencies of the lines [rad/s], (n,).
        damping: Re Z of the impedance fh/v [N.s/m], (n,).
        index: passivity index of Colgate and Schenkel for a sampled wall [N.s/m], (n,); None for an
            arm.
        measured_omega: frequencies of the runs by sines [rad/s], (m,).
        measured: Re Z in those runs [N.s/m], (m,).
        worst_omega: frequencies of the runs along the worst paths of a hand [rad/s], (k,).
        worst: energy taken over the integral of v^2 in those runs [N.s/m], (k,).
    """

    drawn_by = "hapticclay.views.passivity_plots:index_plot"

    def __repr__(self) -> str:
        return brief(self)

    name: str
    omega: np.ndarray
    damping: np.ndarray
    index: np.ndarray | None
    measured_omega: np.ndarray
    measured: np.ndarray
    worst_omega: np.ndarray
    worst: np.ndarray

    @property
    def margin(self) -> float:
        """Least excess damping of the strictest line [N.s/m]; passive if not negative."""
        return float(np.min(self.damping if self.index is None else self.index))

    def tables(self) -> dict[str, dict[str, Any]]:
        """Returns the numbers of the figure: the lines, and the points by runs."""
        lines: dict[str, Any] = {"omega [rad/s]": self.omega, "Re Z [N.s/m]": self.damping}
        if self.index is not None:
            lines["index [N.s/m]"] = self.index
        out = {
            "lines": lines,
            "sines": {"omega [rad/s]": self.measured_omega, "Re Z [N.s/m]": self.measured},
        }
        if len(self.worst):
            out["paths"] = {"omega [rad/s]": self.worst_omega, "index [N.s/m]": self.worst}
        return out


@named
@dataclass(frozen=True, eq=False)
class EnergyOverTime:
    """One run without and with the observer and controller of Hannaford and Ryu.

    Attributes:
        without: the run without them.
        controlled: the run with `Hardware(passivity=True)`.
    """

    drawn_by = "hapticclay.views.passivity_plots:port_energy_plot"

    without: Record
    controlled: Record

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Energy absorbed by the rendered clay, without and with the controller [J], (n,).

        It is the observer's sum over both axes: held force times displacement since the previous
        sample.
        """
        return rendered_energy(self.without), rendered_energy(self.controlled)

    def tables(self) -> dict[str, dict[str, Any]]:
        """Returns the numbers of the figure, one table per run."""
        out = {}
        for name, record, energy in zip(
            ("without", "controlled"),
            (self.without, self.controlled),
            self.observed,
            strict=True,
        ):
            out[name] = {
                "time [s]": record.t,
                "energy taken by the clay [J]": energy,
                "energy put in by the hand [J]": port_energy(record).sum(axis=1),
                "v_x [m/s]": record.v[:, 0],
                "v_y [m/s]": record.v[:, 1],
            }
        return out


@named
@dataclass(frozen=True, eq=False)
class PassiveRegion:
    """Largest passive stiffness of a wall over the control sample, for several delays.

    Attributes:
        wall: the fixed parts: device, B, M, velocity, window and filter.
        delays: delays over Ts.
        Ts: control samples of the lines [s], (n,).
        limits: largest passive K by theory [N/m], one row per delay, (len(delays), n).
        run_Ts: control samples of the runs [s], (m,).
        found: largest K at which no path of a hand draws energy, by runs [N/m], (len(delays), m).
    """

    drawn_by = "hapticclay.views.passivity_plots:region_plot"

    def __repr__(self) -> str:
        return brief(self)

    wall: VirtualWall
    delays: tuple[float, ...]
    Ts: np.ndarray
    limits: np.ndarray
    run_Ts: np.ndarray
    found: np.ndarray

    def tables(self) -> dict[str, dict[str, Any]]:
        """Returns the numbers of the figure: the lines, and the limits found by runs."""
        out = {}
        for name, Ts, K in (("theory", self.Ts, self.limits), ("runs", self.run_Ts, self.found)):
            out[name] = {
                "delay [samples]": np.repeat(self.delays, len(Ts)),
                "Ts [s]": np.tile(Ts, len(self.delays)),
                "K [N/m]": K.ravel(),
            }
        return out


@named
@dataclass(frozen=True, eq=False, repr=False)
class Passivity(Result):
    """Passivity of a wall and of an arm over frequency, of rendered clay over time, and over K.

    Attributes:
        index: the wall.
        arms: the arm, by axis.
        energy: rendered clay, without and with the controller.
        region: the largest passive stiffness of the wall.
    """

    printed = {"to spare": (), "largest passive K": ()}

    index: IndexOverFrequency
    arms: dict[str, IndexOverFrequency]
    energy: EnergyOverTime
    region: PassiveRegion

    def headline(self) -> str:
        """What the wall has to spare."""
        return f"{self.index.name}: {self.index.margin:.4g} N.s/m to spare"

    def tables(self) -> dict[str, dict[str, Any]]:
        """Margins of wall and arm; limits by theory and by runs."""
        found, r = (self.index, *self.arms.values()), self.region
        walls = [replace(r.wall, Ts=Ts, delay=d * Ts) for d in r.delays for Ts in r.run_Ts.tolist()]
        return {
            "to spare": {
                "subject": [x.name for x in found],
                "to spare [N.s/m]": [x.margin for x in found],
                "passive": [x.margin >= 0.0 for x in found],
            },
            "largest passive K": {
                "delay [samples]": [w.delay / w.Ts for w in walls],
                "Ts [ms]": [1e3 * w.Ts for w in walls],
                "theory [N/m]": [wall_limits.colgate_schenkel_limit(w) for w in walls],
                "by runs [N/m]": r.found.ravel().tolist(),
            },
        }

    def remarks(self) -> list[str]:
        """Energy that the rendered clay takes."""
        return [
            f"rendered clay {name} controller: least energy taken {float(e.min()):.3g} J, "
            f"at the end {float(e[-1]):.3g} J"
            for name, e in zip(("without", "with"), self.energy.observed, strict=True)
        ]

    def _parts(self) -> dict[str, Any]:
        arms = {f"arm_{axis}": arm for axis, arm in self.arms.items()}
        return {"index": self.index, "energy": self.energy, "region": self.region, **arms}

    def figures(self) -> dict[str, Any]:
        """Wall and arm over frequency, energy over time, and the region of K."""
        return {name: figure_of(part) for name, part in self._parts().items()}

    def contents(self) -> dict[str, Any]:
        """The numbers of all figures but the energy over time."""
        return {name: x.tables() for name, x in self._parts().items() if name != "energy"}


@checked
def wall_index(wall: VirtualWall, progress: Progress = iter) -> IndexOverFrequency:
    """The passivity of a wall over frequency: theory, sines, and the worst paths of a hand.

    Args:
        wall: the wall with its K; its hand is ignored. Friction and encoder, which theory neglects,
            are ignored too.
        progress: wraps the list of paths to run.

    Raises:
        ParameterError: a wall with a surface; or B or M on an exact velocity, where no K is
            passive.
    """
    wall = replace(wall, operator=None, device=replace(wall.device, friction=0.0, quantum=0.0))
    _check_linear(wall)
    edge = math.pi / wall.Ts
    omega = np.geomspace(1e-3 * edge, edge * (1.0 - 1e-9), INDEX_POINTS)
    worst = [_index_by_run(wall, turn) for turn in progress(INDEX_TURNS)]
    measured_omega = measured = np.zeros(0)
    if wall_limits.stable_wall(wall):
        low, high = (x * edge / (2.0 * math.pi) for x in INDEX_BAND)
        found = measure_impedance(wall, band=(low, high), lines=INDEX_LINES, period=4.0 / low)
        measured_omega, measured = found.measured.omega, found.measured.damping
    return IndexOverFrequency(
        f"wall of K = {wall.K:g} N/m, B = {wall.B:g} N.s/m",
        omega,
        wall_impedance(wall, omega).real,
        wall_limits.passivity_index(wall, omega),
        measured_omega,
        measured,
        np.array([edge * p / q for p, q in INDEX_TURNS]),
        np.array(worst),
    )


@checked
def arm_index(loop: PushedLoop | Scenario, axis: str = "x") -> IndexOverFrequency:
    """The passivity of the arm in clay over frequency: Re Z by theory and by a run of sines.

    Args:
        loop: one axis, its hand ignored, or a scenario. In continuous time it is passive if Re Z >=
            0 at all frequencies. For a sampled loop Re Z holds for motion at one frequency; a hand
            that moves at several may meet less damping.
        axis: axis of a scenario, "x" or "y".
    """
    loop = replace(of_scenario(loop, axis), operator=None)
    omega = 2.0 * math.pi * np.geomspace(ARM_BAND[0] / 5.0, 5.0 * ARM_BAND[1], INDEX_POINTS)
    measured_omega = measured = np.zeros(0)
    if is_stable(loop.linear):
        found = measure_impedance(loop, band=ARM_BAND, lines=2 * INDEX_LINES)
        measured_omega, measured = found.measured.omega, found.measured.damping
    return IndexOverFrequency(
        f"{loop.axis} axis, K = {loop.K:g}, b = {loop.b:g} N.s/m",
        omega,
        computed_impedance(loop, omega).damping,
        None,
        measured_omega,
        measured,
        np.zeros(0),
        np.zeros(0),
    )


@checked
def energy_over_time(scenario: Scenario) -> EnergyOverTime:
    """Runs a scenario without and with the passivity controller.

    Args:
        scenario: a run under sampled control whose clay the motors hold.

    Raises:
        ParameterError: its clay is not held, or its hardware cannot have a passivity controller.
    """
    if scenario.control != "sampled" or scenario.render != "held" or scenario.clay is None:
        bound = "must be 'held' under control = 'sampled', in clay: the controller acts on that"
        raise ParameterError("render", scenario.render, bound)
    parts = scenario.hardware or Hardware()
    without, controlled = (
        simulate(replace(scenario, hardware=replace(parts, passivity=x))) for x in (False, True)
    )
    return EnergyOverTime(without, controlled)


@checked
def passive_region(
    wall: VirtualWall,
    delays: Sequence[float] = (0.0, 0.5, 1.0, 2.0),
    run_Ts: Sequence[float] | None = None,
    progress: Progress = iter,
) -> PassiveRegion:
    """Largest passive K of a wall over Ts for some delays, by theory and by runs.

    Args:
        wall: all but K, Ts and delay.
        delays: over Ts, each 0 to 100.
        run_Ts: control samples of the runs [s]; None for three around that of the wall.
        progress: wraps the list of limits to find by runs.

    Raises:
        ParameterError: as `wall_index`, or a delay out of its bounds.
    """
    wall = replace(wall, operator=None, device=replace(wall.device, friction=0.0, quantum=0.0))
    _check_linear(wall)
    for i, delay in enumerate(delays):
        number(f"delays.{i}", delay, 0.0, 100.0)
    Ts = wall.Ts * np.geomspace(1.0 / REGION_SPAN, REGION_SPAN, REGION_POINTS)
    Ts = Ts[Ts <= 1.0]
    some = wall.Ts * np.array((0.25, 1.0, 4.0)) if run_Ts is None else array_of("run_Ts", run_Ts)

    def at(T: float, delay: float) -> VirtualWall:
        return replace(wall, Ts=float(T), delay=delay * float(T))

    limits = [[wall_limits.colgate_schenkel_limit(at(T, d)) for T in Ts] for d in delays]
    jobs = [at(T, d) for d in delays for T in some]
    found = [passivity_limit(x) for x in progress(jobs)]
    shape = len(delays), len(some)
    return PassiveRegion(
        wall, tuple(delays), Ts, np.array(limits), some, np.array(found).reshape(shape)
    )


def rendered_energy(record: Record) -> np.ndarray:
    """Energy absorbed by rendered clay up to each sample, over both axes."""
    taken = (record.fe[:-1] * np.diff(record.p, axis=0)).sum(axis=1)
    return np.concatenate(((0.0,), np.cumsum(taken)))


def _check_linear(wall: VirtualWall) -> None:
    if wall.unilateral:
        bound = "must be False: the index is that of a wall that acts everywhere"
        raise ParameterError("wall.unilateral", True, bound)
    if wall.velocity == "exact" and (wall.B or wall.M):
        bound = "must be 'difference' for a wall with B or M: a hand can fake an exact velocity"
        raise ParameterError("wall.velocity", wall.velocity, bound)


def _index_by_run(wall: VirtualWall, turn: tuple[int, int]) -> float:
    """Excess damping along the worst path at omega Ts = pi p/q.

    If the delay has no fraction of a sample, that path is the same for every damper, and the
    absorbed energy is the excess damping times the integral of v^2. With a fraction, the damper is
    lowered until its worst path absorbs no energy.
    """
    path = polygon(wall, turn, WORST_AMPLITUDE)
    if not path.middles:
        ways = np.diff(path.places, append=path.places[0])
        return taken_energy(wall, path) * wall.Ts / float((ways * ways).sum())
    from scipy.optimize import brentq

    b, omega = wall.device.damper, np.array([math.pi * turn[0] / (turn[1] * wall.Ts)])
    needed = max(b - float(wall_limits.passivity_index(wall, omega * (1.0 - 1e-12))[0]), 1e-9)

    def energy(damper: float) -> float:
        other = replace(wall, device=replace(wall.device, damper=damper))
        return taken_energy(other, polygon(other, turn, WORST_AMPLITUDE))

    low, high = 0.5 * needed, 2.0 * needed
    if energy(low) > 0.0 or energy(high) < 0.0:
        return math.nan
    return b - float(brentq(energy, low, high, rtol=1e-5))  # type: ignore[arg-type]
