"""The loop report: the wall a client rendered, and the limit for this hand, rate and delay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import compensated
from ..display import text_table
from ..errors import ParameterError
from ..results import Result, Tables
from ..scene.scenario import Scenario
from ..theory.client_loop import (
    AnyHandle,
    Handle,
    JointHandle,
    rendered_stiffness_limit,
    rendered_stiffness_limits,
    slowest_period,
)
from .exchanges import Exchanges

LATEST = 40  # oldest answer, counted back, that a force may have been computed from
LOOKBACK = 4  # share of the messages, one in so many, to which the search goes back
ALIKE = 6.0  # log-likelihood times 2: delays that explain the forces so nearly as well are alike
ROUNDING = 1e-9  # of the force: smaller misfits are alike
FIRST = 3  # answers back at least, also in a short session
FEWEST = 8  # fewest messages in contact for a fit
FORCE_LEAST = 1e-9  # [N] smaller forces count as zero
EXPLAINED = 0.9  # least share of the squared force that a wall must explain
KEPT_UP = 0.95  # of the time is simulated where the computer is not late
DOUBT = 0.2  # largest relative standard error of K
UNDETERMINED = (  # without a wall
    "delay",
    "longest_delay",
    "K",
    "B",
    "K_error",
    "explained",
    "limit",
    "rate_needed",
)
LINE = 25  # number of values of B on the theoretical limit line


class WallFit(NamedTuple):
    """A wall that explains a client's forces."""

    K: float  # [N/m]
    B: float  # [N.s/m]
    K_error: float  # [N/m] standard error
    explained: float  # share of the squared force that the wall explains
    back: int  # age, in answers, of the state that a force was computed from: 1 for the newest
    oldest: int  # the largest age that explains the forces as well
    tried: int  # the largest age that was tried
    normal: tuple[float, ...]  # direction of the force
    place: tuple[float, ...]  # [m] mean position in contact
    contact: int  # number of messages used in the fit


@named
@dataclass(frozen=True, repr=False)
class LoopReport(Result):
    """The wall a client's loop rendered, and the limit of that loop.

    Attributes:
        messages: number of messages read.
        rate: mean rate of the messages [Hz].
        intervals: median and 99th percentile of the time between two messages [s].
        period: median of the simulated time between two messages [s].
        delay: simulated time from a measurement to the force computed from it [s];
            NaN if the forces do not determine it.
        limited: share of the messages whose force was limited, or added to that of others.
        K: stiffness estimated from the forces [N/m]; NaN if they do not determine it.
        B: damping estimated from the forces [N.s/m]; NaN if they do not determine it.
        K_error: standard error of K [N/m].
        explained: share of the squared force that K and B explain.
        contact: number of messages used in the fit.
        normal: direction of the wall, along the axes of the handle.
        limit: largest stable stiffness at this period, delay, hand and B [N/m].
        rate_needed: lowest rate at which K and B are stable, as at all higher ones, with as many
            samples of delay [Hz]; inf for none up to a thousand times the present rate, 0 where
            even a thousandth of it is enough.
        line_B: damping along the theoretical limit line [N.s/m], from 0 on.
        line_K: largest stable stiffness there [N/m]: the Z-width at this period, delay and hand.
        note: why K and B could not be estimated; "" if they were.
        longest_delay: longest delay that explains the forces as well [s]; inf where older answers
            than those that were tried may; NaN without a wall.
        assumed: what the limit of an arm from a file rests on, and what it leaves out, a sentence
            each.
    """

    drawn_by = "hapticclay.views.loop_plots:loop_plot"
    written_as = "loop"

    messages: int
    rate: float
    intervals: tuple[float, float]
    period: float
    delay: float
    limited: float
    K: float
    B: float
    K_error: float
    explained: float
    contact: int
    normal: tuple[float, ...]
    limit: float
    rate_needed: float
    line_B: tuple[float, ...]
    line_K: tuple[float, ...]
    note: str = ""
    longest_delay: float = math.nan
    assumed: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """ "holds", "buzzes" or "not told"."""
        if math.isnan(self.K):
            return "not told"
        return "holds" if self.K <= self.limit else "buzzes"

    @property
    def age(self) -> float:
        """Age of the state that a force was computed from, when the force acts [samples]."""
        return self.delay / self.period if self.period > 0.0 else math.nan

    @property
    def z_width(self) -> tuple[float, float, float]:
        """Largest stable stiffness, the damping at which it is stable, and the largest damping.

        [N/m], [N.s/m], [N.s/m]; NaN without a wall.
        """
        if not self.line_K:
            return math.nan, math.nan, math.nan
        K, B = max(zip(self.line_K, self.line_B, strict=True))
        return K, B, max((b for b, k in zip(self.line_B, self.line_K, strict=True) if k), default=0)

    def headline(self) -> str:
        """The report in one line."""
        rate = f"{(1.0 / self.period if self.period > 0.0 else self.rate):.4g} Hz"
        if math.isnan(self.K):
            return f"{self.messages} messages at {rate}; {self.note}"
        damped = f" and {self.B:.3g} N.s/m" if abs(self.B) > 1e-3 else ""
        text = (
            f"rendered {self.K:.4g} N/m{damped} at {rate}, {self._lateness()}; "
            f"limit for this hand {self.limit:.4g} N/m: it {self.verdict}"
        )
        if self.verdict == "holds":
            return text + self._spare_rate()
        if math.isinf(self.rate_needed):
            return text + "; no rate carries it: damp the wall or soften it"
        return text + f"; {self.rate_needed:.4g} Hz would carry it"

    def _lateness(self) -> str:
        """How old the state is that a force was computed from."""
        if math.isinf(self.longest_delay):
            return f"{self.age:.2g} samples late or more"
        if self.longest_delay > self.delay:
            longest = self.longest_delay / self.period
            return f"{self.age:.2g} to {longest:.2g} samples late (the forces do not tell which)"
        return f"{self.age:.2g} samples late"

    def _spare_rate(self) -> str:
        """The lowest rate of a wall that holds, where it is lower than the present one."""
        if self.rate_needed == 0.0:
            return "; so it would at any rate"
        return f"; {self.rate_needed:.4g} Hz would do"

    def text(self, form: str = "") -> str:
        """The report, a quantity a line, and the headline."""
        report = self.tables()["report"]
        values = [value for (value,) in report.values()]
        table = text_table({"loop": list(report), "": values}, form=form)
        return "\n".join([table, self.headline(), *self.assumed])

    def figures(self) -> dict[str, Any]:
        """The limit line; without a wall there is nothing to show."""
        return super().figures() if self.line_K else {}

    def write(self, folder: Path, asked: Mapping[str, Any] | None = None) -> None:
        """Writes loop.json with exact values, as `save` does; `asked` is left out of it."""
        self.save(folder / "loop.json")

    def tables(self) -> Tables:
        """The report, and the theoretical limit line."""
        (p50, p99), (K, B, most) = self.intervals, self.z_width
        undamped = self.line_K[0] if self.line_K else math.nan
        rows: dict[str, Any] = {
            "messages": self.messages,
            "rate [Hz]": self.rate,
            "interval, median [s]": p50,
            "interval, 99th percentile [s]": p99,
            "simulated period [s]": self.period,
            "delay [s]": self.delay,
            "longest delay that explains the forces [s]": self.longest_delay,
            "age of the state [samples]": self.age,
            "forces limited [share]": self.limited,
            "K [N/m]": self.K,
            "standard error of K [N/m]": self.K_error,
            "B [N.s/m]": self.B,
            "explained [share]": self.explained,
            "limit of K [N/m]": self.limit,
            "limit of K without damping [N/m]": undamped,
            "Z-width: largest K [N/m]": K,
            "at B [N.s/m]": B,
            "Z-width: largest B [N.s/m]": most,
            "lowest stable rate [Hz]": self.rate_needed,
            "verdict": self.verdict,
        }
        line = {"B [N.s/m]": self.line_B, "K limit [N/m]": self.line_K}
        return {"report": {k: [v] for k, v in rows.items()}, "limit": line}


@checked
def loop_report(exchanges: Exchanges, scenario: Scenario) -> LoopReport:
    """Estimates a client's loop from its exchanges with a device.

    Stiffness and damping are a least-squares fit of the forces to position and velocity of the
    answers, along the main direction of the force. The same fit finds the answer from which each
    force was computed. The limit is that of the exact sampled loop.

    Args:
        exchanges: of one client.
        scenario: of the device: its arm and its hand.

    Returns:
        The report; if the forces do not determine a wall, K and B are NaN and `note` says why.

    Raises:
        ParameterError: there are fewer than two messages, or they are of an arm of other axes.
    """
    if len(exchanges) < 2:
        raise ParameterError("exchanges", len(exchanges), "must have two messages or more")
    if exchanges.axes != len(scenario.axes):
        bound = f"must be of a handle of {len(scenario.axes)} axes, as the scenario's"
        raise ParameterError("exchanges", exchanges.axes, bound)
    gaps = np.diff(exchanges.received)
    period = float(np.median(np.diff(exchanges.began)))
    asked = exchanges.asked[:, : exchanges.axes]
    shortened = np.abs(asked - exchanges.applied).max(axis=1) > 1e-9
    fit, note = fit_wall(exchanges)
    mean = float(np.mean(gaps))
    common: dict[str, Any] = {
        "messages": len(exchanges),
        "rate": 1.0 / mean if mean > 0.0 else math.inf,
        "intervals": (float(np.median(gaps)), float(np.quantile(gaps, 0.99))),
        "period": period,
        "limited": float(np.mean(shortened)),
    }
    if fit is None or period <= 0.0:
        note = why_no_period(exchanges) if period <= 0.0 else note
        absent: dict[str, Any] = dict.fromkeys(UNDETERMINED, math.nan)
        normal = (1.0, *(0.0,) * (exchanges.axes - 1))
        absent |= dict(contact=0, normal=normal, line_B=(), line_K=())
        return LoopReport(**common, **absent, note=note)
    delay = lag_behind(exchanges, fit.back)
    longest = math.inf if fit.oldest == fit.tried else lag_behind(exchanges, fit.oldest)
    handle = handle_of(scenario, fit)
    limit = rendered_stiffness_limit(handle, fit.B, period, delay)
    slow = slowest_period(handle, fit.K, fit.B, delay / period, period)
    line_B, line_K = limit_line(handle, fit.B, period, delay)
    return LoopReport(
        **common,
        delay=delay,
        longest_delay=longest,
        K=fit.K,
        B=fit.B,
        K_error=fit.K_error,
        explained=fit.explained,
        contact=fit.contact,
        normal=fit.normal,
        limit=limit,
        rate_needed=1.0 / slow if slow else math.inf,
        line_B=line_B,
        line_K=line_K,
        assumed=assumed_of(scenario),
    )


def handle_of(scenario: Scenario, fit: WallFit) -> AnyHandle:
    """The handle as the wall of a client meets it; that of an arm from a file at its pose."""
    if not scenario.is_closed_form:
        return JointHandle.of(scenario, fit.normal)
    (x, y), (nx, ny) = fit.place, fit.normal
    return Handle.of(scenario, (x, y), (nx, ny))


def assumed_of(scenario: Scenario) -> tuple[str, ...]:
    """What the limit of an arm from a file rests on."""
    if scenario.is_closed_form:
        return ()
    from ..theory.joint_gains import IGNORED  # imported only for such an arm

    held = "held all the time" if compensated(scenario.arm, None) else "acts"
    about = "limit of small motions about the arm's pose"
    return (about, *scenario.file_arm.notes, f"weight: {held}", IGNORED)


def lag_behind(exchanges: Exchanges, back: int) -> float:
    """Median time from a measurement to the force of a later message [s], 0 or more."""
    return max(0.0, float(np.median(exchanges.began[back:] - exchanges.sampled[:-back])))


def why_no_period(exchanges: Exchanges) -> str:
    """Why most messages found the arm where the one before had left it."""
    real = float(exchanges.received[-1] - exchanges.received[0])
    moved = float(exchanges.began[-1] - exchanges.began[0])
    if moved < KEPT_UP * real:
        return (
            "the arm stood still between most messages: the computer was late and skipped control "
            f"samples ({moved:.3g} s of {real:.3g} s were simulated); --clock tick moves the arm "
            "by one period at each message"
        )
    return (
        "most messages came within the same control sample: the program is faster than the device"
    )


def limit_line(
    handle: AnyHandle, B: float, Ts: float, delay: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Largest stable stiffness over damping, from zero damping to where none is stable."""
    top = max(2.5 * handle.mass / (Ts + delay), 1.2 * B)
    rising = np.geomspace(1e-3 * top, 0.8 * top, LINE)
    grid = [0.0, *rising.tolist(), *np.linspace(0.82 * top, top, LINE // 2).tolist()]
    return tuple(grid), rendered_stiffness_limits(handle, grid, Ts, delay)


def fit_wall(exchanges: Exchanges) -> tuple[WallFit | None, str]:
    """The wall that explains a client's forces, or why there is none."""
    force = exchanges.asked[:, : exchanges.axes]
    size = np.hypot(*force.T) if exchanges.axes == 2 else np.linalg.norm(force, axis=1)
    tried = max(FIRST, min(LATEST, len(force) // LOOKBACK))
    contact = np.isfinite(size) & (size > FORCE_LEAST)
    contact[: FIRST + 1] = False  # its state may have come with the inventory
    if contact.sum() < FEWEST:
        return None, f"{int(contact.sum())} messages had a force: a fit needs {FEWEST}"
    normal = np.linalg.svd(force[contact], full_matrices=False)[2][0]
    normal = normal if normal[np.argmax(np.abs(normal))] > 0.0 else -normal
    least, oldest, tried = _ages(exchanges, force @ normal, normal, contact, tried)
    best = _fitted(exchanges, force @ normal, normal, contact, least)
    best = best._replace(oldest=oldest, tried=tried)
    if best.explained < EXPLAINED:
        return None, f"a spring and damper explain {best.explained:.0%} of the force"
    if best.K <= 0.0 or best.K_error > DOUBT * best.K:
        return (
            None,
            f"stiffness {best.K:.3g} +- {best.K_error:.2g} N/m: the forces do not determine it",
        )
    return best, ""


def _ages(
    exchanges: Exchanges, force: np.ndarray, normal: np.ndarray, contact: np.ndarray, tried: int
) -> tuple[int, int, int]:
    """Least and largest age of the state that explain the forces best, or as well; ages tried.

    All are compared on the same messages. Motion of one frequency does not tell ages apart: any
    stiffness and damping at one of them are others at the next.
    """
    later = contact.copy()
    later[: tried + 1] = False
    if later.sum() < FEWEST:
        later, tried = contact, FIRST
    fits = [_fitted(exchanges, force, normal, later, back) for back in range(1, tried + 1)]
    unexplained = np.array([1.0 - fit.explained for fit in fits])
    threshold = max(unexplained.min(), ROUNDING**2) * math.exp(min(ALIKE / later.sum(), 1.0))
    good = np.flatnonzero(unexplained <= threshold) + 1
    return int(good[0]), int(good[-1]), tried


def _fitted(
    exchanges: Exchanges, force: np.ndarray, normal: np.ndarray, contact: np.ndarray, back: int
) -> WallFit:
    """Least-squares fit of the force to the position and velocity a number of answers earlier."""
    at = np.flatnonzero(contact)
    at = at[at >= back]
    place, rate = exchanges.position[at - back], exchanges.velocity[at - back]
    regressors = np.column_stack([place @ normal, rate @ normal, np.ones(len(at))])
    scale = np.maximum(np.abs(regressors).max(axis=0), 1e-300)
    y = force[at]
    solution, _, rank, _ = np.linalg.lstsq(regressors / scale, y)
    residual = y - regressors @ (solution / scale)
    variance = float(residual @ residual) / max(1, len(at) - 3)
    covariance = np.linalg.pinv((regressors / scale).T @ (regressors / scale))
    error = math.sqrt(variance * covariance[0, 0]) / scale[0] if rank == 3 else math.inf
    K, B, _ = 0.0 - solution / scale
    total = float(((y - y.mean()) ** 2).sum())
    is_constant = total < 1e-12 * float(y @ y)  # a constant force does not show a wall
    explained = 0.0 if is_constant else 1.0 - float(residual @ residual) / total
    direction, centre = tuple(normal.tolist()), tuple(place.mean(axis=0).tolist())
    return WallFit(
        float(K), float(B), error, explained, back, back, back, direction, centre, len(at)
    )
