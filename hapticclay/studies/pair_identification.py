"""What a log of a leader and its follower says: gains, delays, friction, stiffness it felt.

Each side's law is fitted to the logged torques; the follower's inertia and friction come from a
simulation of the follower behind the measured leader (output error in closed loop: M. Gautier,
A. Janot, P.-O. Vandanjon, IEEE Trans. Control Syst. Technol. 21, 2013, 428-444). Docs: pair_log.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..display import fields_of, table_of
from ..errors import Bound, ParameterError, Real
from ..results import Result
from .block_fit import BlockFit, Unknown, block_fit
from .coulomb_axis import Axis, follow
from .pair_laws import (
    Motion,
    PairLaw,
    delayed,
    fit_following,
    fit_law,
    fit_reflection,
    fitted_rows,
    low_passed,
)
from .pair_log import PairLog

BAND = 80.0  # [Hz] of the fits of laws
OF_RATE = 0.2  # most of the sampling rate that a band takes
MECHANICS = 20.0  # [Hz] of the first guess of inertia and friction
SETTLED = 0.2  # [s] after which errors count
FREE = 0.3  # of the follower's torque: a force that varies less is no contact
EXPLAINS = 0.5  # of the leader's torque that a law must explain
ELASTIC = 0.9  # square of the correlation from which on a contact is a spring
MOST_STEPS = 40_000  # of a simulation that is repeated: the first of a longer log
AXIS_STEP = 1e-3  # of differences, where friction stops and starts the axis
ROUNDS = 12  # of that fit
INERTIAL = 0.25  # of the torque: below it, friction's errors are read as inertia
PUSHED = 0.5  # of the error that a free follower may leave unexplained
PUSHED_TOLD = (
    "the follower moves otherwise than its motor pushes it: a hand or a load may act there; "
    "inertia and friction are not identified"
)
ALIKE_TOLD = (
    "P, D and lag of the {} are not told apart: the error moves at one frequency, where many laws "
    "make the same torque; move at several"
)
UNTOLD = (
    "no torque of the follower was logged: gains, friction, inertia and contact are left out; name "
    "its column follower_torque=NAME"
)
MISFIT = 0.02  # of a torque that a law leaves, above which a warning is given


@named
@dataclass(frozen=True)
class PairNumber:
    """A number that a pair's log gives.

    Attributes:
        name: what it is.
        unit: its unit.
        value: its value.
        low: lower end of its confidence interval; nan if the log does not fix it.
        high: upper end of its confidence interval; nan if the log does not fix it.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float


@named
@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedPair(Result):
    """A pair as its log shows it, and the follower simulated behind the measured leader.

    Attributes:
        name: name of the log.
        architecture: "position-position", "position-force", or "unknown".
        numbers: what was identified, with intervals.
        level: confidence level of the intervals.
        t: time [s], (n,).
        error: leader less follower [rad], (n,).
        simulated: leader less simulated follower [rad], (n,); empty for a follower in contact.
        rms: deviation of the error from its mean, after the first 0.2 s [rad].
        simulated_rms: the same of the simulated follower [rad]; nan for one in contact.
        axis: the follower's inertia [kg.m^2], viscous friction [N.m.s/rad], Coulomb friction
            offset [N.m]; None for one in contact.
        warnings: limits of the result, one sentence each.
    """

    drawn_by = "hapticclay.views.pair_log_plots:pair_plot"
    written_as = "pair_log"
    formats = {"value": ".5g", "low": ".5g", "high": ".5g"}
    summary_units = {"rms": "rad", "simulated_rms": "rad", "axis": "kg.m^2, N.m.s/rad, N.m, N.m"}

    name: str
    architecture: str
    numbers: tuple[PairNumber, ...]
    level: float
    t: np.ndarray
    error: np.ndarray
    simulated: np.ndarray
    rms: float
    simulated_rms: float
    axis: tuple[float, ...] | None
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> PairNumber:
        """A number by its name."""
        for x in self.numbers:
            if x.name == name:
                return x
        known = ", ".join(x.name for x in self.numbers)
        raise ParameterError("name", name, f"must be one of {known}")

    @property
    def torque_known(self) -> bool:
        """Whether the torque of the follower was logged."""
        return any(x.name == "P" for x in self.numbers)

    def headline(self) -> str:
        """The architecture, the gains and the error in one line."""
        if self.torque_known:
            P, D = self["P"], self["D"]
            told = f"{self.architecture}: P {P.value:.4g} N.m/rad, D {D.value:.3g} N.m.s/rad"
        else:
            late, lag, share = self["delay"], self["lag"], self["explained"]
            told = f"the follower is {late.value:.3f} s late and lags by {lag.value:.3f} s, which "
            told += f"explains {100.0 * share.value:.3g} % of its error"
        told += f"; leader less follower {1e3 * self.rms:.3f} mrad rms"
        if math.isnan(self.simulated_rms):
            return told
        return told + f", simulated {1e3 * self.simulated_rms:.3f} mrad"

    def remarks(self) -> list[str]:
        """The headline and the warnings."""
        return [self.headline(), *(f"warning: {x}" for x in self.warnings)]

    def tables(self) -> dict[str, dict[str, Any]]:
        """The numbers, and the errors over time."""
        errors = {"time [s]": self.t, "leader less follower [rad]": self.error}
        if len(self.simulated):
            errors["leader less simulated follower [rad]"] = self.simulated
        rows = [(f"{x.name} [{x.unit}]", x.value, x.low, x.high) for x in self.numbers]
        return {"numbers": table_of(("number", "value", "low", "high"), rows), "errors": errors}

    def contents(self) -> dict[str, Any]:
        """All but the columns over time."""
        return fields_of(self, "t", "error", "simulated")


@checked
def identify_pair(
    log: PairLog,
    *,
    band: Annotated[Real, Bound(0.1, 1e5, "Hz")] = BAND,
    level: Annotated[float, Bound(0.5, 0.999)] = 0.95,
) -> IdentifiedPair:
    """Finds gains, delays, friction and inertia of a pair from its log, each with an interval.

    The follower's law is u = P x + D dx/dt, x the error behind a first-order filter or a delay,
    whichever fits better. The leader has the same law (position-position), or is pushed by the
    follower's force (position-force). A follower that touches nothing gives inertia and friction,
    one that pushes a spring the stiffness. Without the follower's torque it is taken as a delayed
    and lagged leader: delay, lag, scale, and the share of the error that they explain.

    Args:
        log: the log.
        band: highest frequency of the fits of laws [Hz], at most 0.2 of the sampling rate.
        level: confidence level of the intervals, 0.5 to 0.999.

    Raises:
        ParameterError: an argument is wrong, or the log is too short for the band.
    """
    if log.follower_torque is None:
        return _followed(log, level)
    band = min(band, OF_RATE / log.Ts)
    if len(log.t) * log.Ts * band < 40.0:
        bound = f"must last {40.0 / band:.3g} s or more for fits up to {band:.3g} Hz"
        raise ParameterError("log", f"{len(log.t) * log.Ts:.3g} s", bound)
    torque = log.torque
    law, fit = fit_law(Motion(log.t, log.follower, log.leader, torque), band, level)
    numbers, warnings = _law_numbers("", law, fit), list(log.notes)
    if math.isnan(numbers[0].low):
        warnings.append(ALIKE_TOLD.format("follower"))
    if fit.rms > MISFIT * float(np.std(torque)):
        share = fit.rms / float(np.std(torque))
        warnings.append(f"the law leaves {100.0 * share:.2g} % of the follower's torque")
    architecture, more = _leader(log, band, level)
    numbers += more
    if architecture == "position-position" and math.isnan(more[0].low):
        warnings.append(ALIKE_TOLD.format("leader"))
    simulated, axis = np.zeros(0), None
    if _is_free(log):
        axis, found, simulated = _mechanics(log, law, fit, level)
        left = float(np.std(simulated - (log.leader - log.follower)))
        if left > PUSHED * float(np.std(log.leader - log.follower)):
            axis, simulated = None, np.zeros(0)
            warnings.append(PUSHED_TOLD)
        else:
            numbers += _axis_numbers(found)
            warnings += _weak_inertia(log, axis)
    else:
        numbers += _contact(log, law, band, level)
        numbers += _felt(architecture, numbers)
        warnings.append("the follower touches something: inertia and friction are not identified")
    if log.force is None:
        warnings.append("no force on the follower was logged: it is taken as free")
    error, after = log.leader - log.follower, log.t >= log.t[0] + SETTLED
    return IdentifiedPair(
        log.name, architecture, tuple(numbers), level, log.t, error, simulated,
        float(np.std(error[after])),
        float(np.std(simulated[after])) if len(simulated) else math.nan,
        tuple(axis) if axis else None, tuple(warnings),
    )  # fmt: skip


def _followed(log: PairLog, level: float) -> IdentifiedPair:
    """Delay and lag of a follower behind its leader, where no torque was logged."""
    model, fit = fit_following(log.t, log.leader, log.follower, level)
    names = (("delay", "s"), ("lag", "s"), ("scale", "1"), ("offset", "rad"))
    numbers = [_number(name, unit, fit, i) for i, (name, unit) in enumerate(names)]
    error, simulated = log.leader - log.follower, log.leader - model
    after = log.t >= log.t[0] + SETTLED
    rms, off = float(np.std(error[after])), float(np.std((error - simulated)[after]))
    share = 1.0 - (off / rms) ** 2 if rms > 0.0 else math.nan
    numbers.append(PairNumber("explained", "1", share, math.nan, math.nan))
    warnings = [*log.notes, UNTOLD]
    if share < EXPLAINS:
        warnings.append("delay and lag explain less than half of the error: is it this leader's?")
    return IdentifiedPair(
        log.name, "unknown", tuple(numbers), level, log.t, error, simulated, rms,
        float(np.std(simulated[after])), None, tuple(warnings),
    )  # fmt: skip


def _number(name: str, unit: str, fit: BlockFit, i: int) -> PairNumber:
    value, half = float(fit.values[i]), float(fit.half[i])
    return PairNumber(name, unit, value, value - half, value + half)


def _law_numbers(side: str, law: PairLaw, fit: BlockFit) -> list[PairNumber]:
    """The numbers of a law, by the side's name."""
    lag = "filter lag" if law.filters else "delay"
    names = (("P", "N.m/rad"), ("D", "N.m.s/rad"), (lag, "s"), ("link delay", "s"))
    return [_number(f"{side}{name}", unit, fit, i) for i, (name, unit) in enumerate(names)]


# ---- the leader ----------------------------------------------------------------------------------


def _leader(log: PairLog, band: float, level: float) -> tuple[str, list[PairNumber]]:
    """The architecture: which law explains the leader's torque, and its numbers."""
    if log.leader_torque is None:
        return "unknown", []
    u = low_passed(log.leader_torque, log.Ts, band)[fitted_rows(len(log.t), log.Ts, band)]
    motion = Motion(log.t, log.leader, log.follower, log.leader_torque)
    law, fit = fit_law(motion, band, level)
    tries = [(fit.rms, "position-position", _law_numbers("leader ", law, fit))]
    if log.force is not None and np.ptp(log.force) > 0.0:
        reflected = fit_reflection(log.t, log.force, log.leader_torque, band, level)
        names = (("force scale", "1"), ("force delay", "s"))
        found = [_number(name, unit, reflected, i) for i, (name, unit) in enumerate(names)]
        tries.append((reflected.rms, "position-force", found))
    left, architecture, numbers = min(tries, key=lambda x: x[0])
    if left > EXPLAINS * float(np.std(u)):
        return "unknown", []
    return architecture, numbers


# ---- the follower --------------------------------------------------------------------------------


def _is_free(log: PairLog) -> bool:
    """Whether the follower touches nothing, as far as its force shows."""
    return log.force is None or float(np.std(log.force)) < FREE * float(np.std(log.torque))


def _mechanics(
    log: PairLog, law: PairLaw, of_law: BlockFit, level: float
) -> tuple[Axis, BlockFit, np.ndarray]:
    """Inertia and friction of a free follower; the error of the one that they make."""
    first = max(3, round(0.03 / log.Ts))
    speed = float(np.polyfit(log.t[:first] - log.t[0], log.follower[:first], 1)[0])
    begin = float(log.follower[0]), speed
    after = (log.t >= log.t[0] + SETTLED)[:MOST_STEPS]

    def moved(axis: Axis, law: PairLaw, count: int | None = MOST_STEPS) -> np.ndarray:
        target = delayed(log.t, log.leader, law.link)[:count].tolist()
        starts = lambda: law.start(log.Ts, target[0] - begin[0])  # noqa: E731
        return follow(axis, target, starts, begin, log.Ts, law.late)

    def rest(x: np.ndarray, law: PairLaw = law) -> np.ndarray:
        return (moved(Axis(*x.tolist()), law) - log.follower[:MOST_STEPS])[after]

    found = block_fit(rest, _axis_guess(log), level, AXIS_STEP, ROUNDS)
    axis, covariance = Axis(*found.values.tolist()), of_law.covariance[:4, :4]
    if np.isfinite(covariance).all():
        steps = np.sqrt(np.diag(covariance))
        pairs = zip(law._fields[:4], steps.tolist(), strict=True)
        laws = [law._replace(**{name: getattr(law, name) + h}) for name, h in pairs]
        slopes = [rest(found.values, x) - found.rest for x in laws]
        scaled = covariance / np.outer(steps, steps)
        found = found.given(np.column_stack(slopes), scaled)
    return axis, found, log.leader - moved(axis, law, None)


def _weak_inertia(log: PairLog, axis: Axis) -> list[str]:
    """A warning where inertia makes too little of the torque to be told from friction."""
    T, band = log.Ts, min(0.5 * MECHANICS, OF_RATE / log.Ts)
    a = np.gradient(np.gradient(low_passed(log.follower, T, band), T), T)
    rows = fitted_rows(len(a), T, band)
    share = axis.J * float(np.std(a[rows]) / np.std(log.torque))
    if share >= INERTIAL:
        return []
    return [
        f"inertia makes {100.0 * share:.0f} % of the torque: friction that is not Coulomb's may "
        "bias it beyond its interval; move faster"
    ]


def _axis_guess(log: PairLog) -> list[Unknown]:
    """Inertia, friction and offset by linear least squares on smooth columns."""
    T, band = log.Ts, min(MECHANICS, OF_RATE / log.Ts)
    q, u = (low_passed(x, T, band) for x in (log.follower, log.torque))
    v = np.gradient(q, T)
    rows, fast = fitted_rows(len(q), T, band), 0.1 * float(np.std(v)) or 1.0
    columns = (np.gradient(v, T), v, np.tanh(v / fast), np.ones_like(v))
    A = np.column_stack([x[rows] for x in columns])
    J, b, friction, offset = matrices.least_squares(A, u[rows]).tolist()
    torque = float(np.std(u)) or 1.0
    J = J if J > 0.0 else torque / (float(np.std(columns[0])) or 1.0)
    b_size = max(abs(b), 0.1 * torque / (float(np.std(v)) or 1.0))
    return [
        Unknown(J, 0.05 * J, 20.0 * J, J),
        Unknown(max(b, 0.1 * b_size), 0.0, 100.0 * b_size, b_size),
        Unknown(max(friction, 0.02 * torque), 0.0, 10.0 * torque, torque),
        Unknown(offset, -10.0 * torque, 10.0 * torque, torque),
    ]


def _axis_numbers(fit: BlockFit) -> list[PairNumber]:
    names = (
        ("inertia", "kg.m^2"),
        ("viscous friction", "N.m.s/rad"),
        ("Coulomb friction", "N.m"),
        ("torque offset", "N.m"),
    )
    return [_number(name, unit, fit, i) for i, (name, unit) in enumerate(names)]


def _contact(log: PairLog, law: PairLaw, band: float, level: float) -> list[PairNumber]:
    """Stiffness of what the follower pushes, by sensor and motor, and what the leader shows."""
    assert log.force is not None
    pairs = (
        ("contact stiffness", log.follower, log.force),
        ("contact stiffness, motor", log.follower, log.torque),
        ("felt, measured", log.leader, log.leader_torque),
    )
    fits = {
        name: _slope(log, x, -y if x is log.leader else y, band, level)
        for name, x, y in pairs
        if y is not None
    }
    found = {n: _number(n, "N.m/rad", fit, 0) for n, fit in fits.items() if fit is not None}
    return list(found.values()) if "contact stiffness" in found else []


def _felt(architecture: str, numbers: list[PairNumber]) -> list[PairNumber]:
    """The stiffness that the leader's motor should show: of what pushes it, over its motion.

    With k by the sensor and K by the motor, the follower is behind by K q/P. So F/q_l is
    k P/(K + P), and u/q_l is K P/(K + P).
    """
    by_name = {x.name: x for x in numbers}
    k, K = by_name.get("contact stiffness"), by_name.get("contact stiffness, motor")
    if k is None or K is None or architecture == "unknown":
        return []
    P, pushed = by_name["P"].value, K if architecture == "position-position" else k
    name = "felt, K P/(K + P)" if pushed is K else "felt, k P/(K + P)"
    value, low, high = (
        by_name["force scale"].value * x if pushed is k else x
        for x in (
            pushed.value * P / (K.value + P),
            pushed.low * P / ((K.low if pushed is K else K.high) + P),
            pushed.high * P / ((K.high if pushed is K else K.low) + P),
        )
    )
    return [PairNumber(name, "N.m/rad", value, low, high)]


def _slope(
    log: PairLog, x: np.ndarray, y: np.ndarray, band: float, level: float
) -> BlockFit | None:
    """The line through torques over positions; None if they are not on one."""
    rows = fitted_rows(len(x), log.Ts, band)
    x, y = (low_passed(z, log.Ts, band)[rows] for z in (x, y))
    if np.ptp(x) == 0.0 or np.ptp(y) == 0.0 or np.corrcoef(x, y)[0, 1] ** 2 < ELASTIC:
        return None
    sizes = float(np.std(y) / np.std(x)), float(np.std(y))
    unknowns = [Unknown(s, -math.inf, math.inf, s) for s in sizes]
    return block_fit(lambda a: a[0] * x + a[1] - y, unknowns, level)
