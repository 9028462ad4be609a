"""Many runs step by step, for learning environments and your own Monte Carlo loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked
from ..errors import Bound, ParameterError, array_of, integer, is_series, number
from ..kernel.engine import warnings_caught
from ..model.operator import Operator
from ..scene.scenario import Scenario
from .batch import checked_scenarios, cores
from .engines import engine_for
from .monitor import Outcome
from .run import COLUMNS
from .stepwise import MOST, MOST_GAIN, Alone, gain_of, mended, started_with_operator
from .vectored import VectoredRuns


def _shown(name: str, words: str) -> Any:
    """A property: an array of the present samples."""
    at = COLUMNS[name]
    return property(lambda batch: batch.numbers()[:, at : at + 2].copy(), doc=words)


@checked
class SimulationBatch:
    """Many runs that advance on request, each with the numbers of `Simulation`.

        with hc.SimulationBatch([scenario] * 64) as sims:
            while not sims.ended.all():
                sims.advance(55, force=policy(sims.p, sims.v))
                sims.reset(sims.ended)

    Runs may differ in anything. Compiled, all advance in one call on all cores, but for runs under
    a varying force or command, or with a controller of your own. Results are arrays over runs,
    copied at each access. No record is kept: a run holds at most its last 4095 samples, for the
    monitor, half a megabyte.

    A run that has ended stays at its last good sample until `reset`.

    Args:
        scenarios: what to run, one per run.
        engine: as in `simulate`.
        workers: threads of compiled steps; None for one per core.
        monitored: as in `Simulation`.

    Raises:
        ParameterError: there is no scenario, one is of another type, or is refused as by
            `simulate`.
    """

    _noun = "batch"

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        *,
        engine: str = "auto",
        workers: Annotated[int | None, Bound(1, 1024)] = None,
        monitored: bool = True,
    ):
        engine = engine_for(engine)
        self._warned: set[Any] = set()
        given = list(checked_scenarios(scenarios, self._warned))
        if not given:
            raise ParameterError("scenarios", scenarios, "must hold at least one Scenario")
        self._closed = False
        self._run = VectoredRuns(given, engine, workers or cores(), monitored)

    def __enter__(self) -> SimulationBatch:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._run.runs)

    def close(self) -> None:
        """Closes the batch; no further step can be made.

        Raises:
            RuntimeError: another thread uses it.
        """
        if not self._closed:
            with Alone(self, mends=False) as runs:
                self._closed = True
                runs.close()

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Refused: the runs lie in memory that their threads share.

        Raises:
            TypeError: always.
        """
        remedy = "make another of the same scenarios, or copy a Simulation"
        raise TypeError(f"{type(self).__name__} cannot be copied or pickled: {remedy}")

    def advance(
        self,
        n: int = 1,
        *,
        force: Any = None,
        mask: Any = None,
    ) -> None:
        """Makes n steps of each run, fewer if it ends; none if it has ended.

        Args:
            n: number of steps, at least 1.
            force: muscle force uh on each handle from this sample on [N], in place of the
                scenario's constant force, shape (N, 2); None for those in effect.
            mask: which runs to advance, shape (N,); None for all. Forces of the other runs are
                ignored.

        Raises:
            ParameterError: a value is no finite number within 1e6, or an array has another shape.
            RuntimeError: the batch is closed, or another thread uses it.
        """
        n = integer("n", n, 1, 1_000_000_000)
        with Alone(self) as runs, warnings_caught():
            chosen = np.ones(len(self), bool) if mask is None else self._mask("mask", mask)
            which = np.flatnonzero(chosen & ~runs.over)
            if force is not None:
                runs.push(which, self._forces(force, chosen)[which])
            runs.advance(which, n)

    def reset(
        self,
        runs: Any = None,
        scenario: Scenario | Sequence[Scenario] | None = None,
    ) -> None:
        """Restarts runs.

        Args:
            runs: index of one, indices, or a mask, shape (N,); None for all.
            scenario: what to run, one for all of these or one each; None for the same as before.

        Raises:
            ParameterError: there is no such run, or the number of scenarios does not match.
        """
        which = self._indices("runs", runs)
        given: list[Scenario | None] = [None] * len(which)
        if scenario is not None:
            several = not isinstance(scenario, Scenario)
            given = list(_each("scenario", scenario, len(which), several))
            list(checked_scenarios(given, self._warned))
        with Alone(self, mends=False) as all_:
            if all_.pending:
                all_.mend(which)
            all_.restart(which, given)

    def set(
        self,
        runs: Any = None,
        *,
        gain: Any = None,
        operator: Operator | tuple[Operator | None, Operator | None] | Sequence[Any] | None = None,
        b: Any = None,
    ) -> None:
        """Changes numbers from this sample on, in runs that have not ended.

        Args:
            runs: index of one, indices, or a mask, shape (N,); None for all.
            gain: K of x and y [1/kg], one pair for all of these runs or shape (n, 2).
            operator: the operator's arm, as in a Scenario, or a list with one per run. A run
                without an operator cannot get one.
            b: as in `Simulation.set`, one for all of these runs or shape (n,).

        Raises:
            ParameterError: a value is out of its bounds, or an operator would be added or removed;
                no run is changed then.
        """
        which = self._indices("runs", runs)
        n = len(which)
        one = operator is None or isinstance(operator, Operator | tuple)
        operators = _each("operator", operator, n, not one)
        gains = None if gain is None else self._gains(gain, n)
        factors = _each("b", b, n, is_series(b))
        with Alone(self) as all_:
            each = zip(which, operators, factors, strict=True)
            changes = [_changes(k, all_.given[k], hand, b) for k, hand, b in each]
            for k, change in zip(which, changes, strict=True):
                if change:
                    all_.change(k, lambda s, change=change: replace(s, **change))
            if gains is not None:
                all_.set_gain(np.array(which, np.int64), gains)

    # ---- results

    def numbers(self) -> np.ndarray:
        """The present samples as rows, see `Simulation.numbers`, shape (N, 18)."""
        with Alone(self) as runs, warnings_caught():
            return runs.show().copy()

    def torque_reached(self, n: int, k: int = 1) -> np.ndarray:
        """As `Simulation.torque_reached`, of each run [N.m], shape (N, 2).

        Args:
            n: number of samples, at least 1.
            k: how many reach it, at least 1; with 1 it is the largest torque.
        """
        n, k = integer("n", n, 1, 1_000_000_000), integer("k", k, 1, 1_000_000_000)
        with Alone(self) as runs:
            return runs.torque_reached(n, k)

    @property
    def t(self) -> np.ndarray:
        """Time of the present sample of each run [s], shape (N,)."""
        return mended(self).times.copy()

    p = _shown("p", "Handle positions [m], shape (N, 2), as `Simulation.state`.")
    v = _shown("v", "Handle velocities [m/s], shape (N, 2).")
    fh = _shown("fh", "Forces of the operators on the handles [N], shape (N, 2).")
    fe = _shown("fe", "Resisting forces of the clay [N], shape (N, 2).")
    b = _shown("b", "Damping of the clay [N.s/m], shape (N, 2).")
    q = _shown("q", "Joint angles [rad], shape (N, 2).")
    qd = _shown("qd", "Joint rates [rad/s], shape (N, 2).")
    tau = _shown("tau", "Motor torques [N.m], shape (N, 2).")
    delta = _shown("delta", "Compensator outputs [m], shape (N, 2).")

    @property
    def ended(self) -> np.ndarray:
        """Which runs have ended, shape (N,)."""
        return mended(self).over.copy()

    @property
    def outcomes(self) -> list[Outcome | None]:
        """How each run ended; None while it is running."""
        return mended(self).outcomes

    @property
    def diverging(self) -> np.ndarray:
        """Which motions so far are unstable by the rules of the monitor, shape (N,).

        Evaluated every 20 ms of simulated time, as `Simulation.diverging`; the runs continue.
        """
        with Alone(self) as runs:
            return runs.look()

    @property
    def scenarios(self) -> list[Scenario]:
        """The scenarios, with the forces, gains, operators and clay now in effect."""
        with Alone(self) as runs:
            return [runs.scenario(k) for k in range(len(self))]

    # ---- arguments

    def _mask(self, field: str, value: Any) -> np.ndarray:
        mask, n = _array_or_none(value), len(self)
        if mask is None or mask.dtype != bool or mask.shape != (n,):
            raise ParameterError(field, value, f"must be True or False for each run, shape ({n},)")
        return mask

    def _indices(self, field: str, value: Any) -> list[int]:
        """Indices of runs: of one, of several, of a mask, or of all."""
        n = len(self)
        if value is None:
            return list(range(n))
        given = _array_or_none(value)
        if given is None:
            raise ParameterError(field, value, "must be the index of a run, indices, or a mask")
        if given.dtype == bool and given.ndim:
            return np.flatnonzero(self._mask(field, value)).tolist()
        return [integer(field, x, 0, n - 1) for x in np.atleast_1d(given).tolist()]

    def _gains(self, value: Any, n: int) -> np.ndarray:
        """Gains of n runs [1/kg], shape (n, 2): one for all, or one each."""
        given = array_of("gain", value)
        if given.shape == (n, 2) and ((given >= 0.0) & (given <= MOST_GAIN)).all():
            return given
        each = _each("gain", value, n, np.ndim(value) == 2)
        return np.array([gain_of(x) for x in each]).reshape(n, 2)

    def _forces(self, value: Any, mask: np.ndarray) -> np.ndarray:
        force, n = array_of("force", value), len(self)
        if force.shape != (n, 2):
            raise ParameterError("force", value, f"must be (x, y) of each run, shape ({n}, 2)")
        bad = mask[:, None] & ~(np.abs(force) <= MOST)
        for i, j in np.argwhere(bad)[:1].tolist():
            number(f"force[{i}, {'xy'[j]}]", float(force[i, j]), -MOST, MOST, unit="N")
        return force


def _array_or_none(value: Any) -> np.ndarray | None:
    """The array of a value; None for rows of unequal length, of which there is none."""
    try:
        return np.asarray(value)
    except ValueError:
        return None


def _changes(k: int, given: Scenario, hand: Any, factor: Any) -> dict[str, Any]:
    """Checked fields of the scenario of run k that an operator and a factor b change."""
    changes: dict[str, Any] = {}
    if hand is not None:
        started_with_operator(given, hand)
        changes["operator"] = replace(given, operator=hand).operator
    if factor is not None:
        factor = number(f"b[{k}]", factor, 0.0, 1e6)
        changes["clay"] = given.clay and given.clay.scaled(factor)
    return changes


def _each(field: str, value: Any, n: int, several: bool) -> Sequence[Any]:
    """One value per run: those given, or one for all."""
    if not several:
        return [value] * n
    if not is_series(value) or len(values := list(value)) != n:
        raise ParameterError(field, value, f"must be one, or one for each of {n} runs")
    return values
