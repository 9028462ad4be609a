"""Spaces of parameters: ranges, and grids, Latin hypercubes and Sobol sequences over them."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..errors import ParameterError, choice, integer, number_in
from ..fields import join_names
from ..files import MOST_SETTINGS, parse_toml, read_text, versions
from ..scene.changes import named_values
from ..scene.earlier_names import with_present_names
from ..scene.experiments import EXPERIMENTS, parameter_unit
from ..scene.files import read_settings
from ..scene.scenario import Scenario

SWEEP_SCHEMA = "hapticclay-sweep-2"
DESIGNS = ("grid", "lhs", "sobol")
RANGE_PATTERN = r"(?P<low>[^:]+):(?P<high>[^:]+?)(:(?P<n>\d+))?\s*(?P<log>log)?"
MOST_RUNS = 10_000_000  # runs in one sweep


@named
@dataclass(frozen=True)
class Range:
    """Values of one parameter: from low to high, evenly spaced or by constant factors; or a list.

    Attributes:
        low: smallest value.
        high: largest value.
        n: number of values on a grid; None for designs that sample between low and high.
        log: whether neighbours differ by a constant factor.
        values: the list; empty for none.
    """

    low: float
    high: float
    n: int | None = None
    log: bool = False
    values: tuple[float, ...] = ()

    @classmethod
    def parse(cls, field: str, text: object, unit: str = "") -> Range:
        """Parses "1:1000:50log", "0.2:2:20", "0.2:2", "1:1000log" or "1,2,5".

        Args:
            field: name for the error.
            text: the range; a number or a list of numbers is accepted too. Each number may have a
                unit, as in "0.1ms:1ms:5".
            unit: unit of the parameter.

        Raises:
            ParameterError: it is none of these.
        """
        bound = 'must be like "1:1000:50log", "0.2:2:20", "0.2:2" or "1,2,5", from low to high'
        items = (
            text if isinstance(text, list | tuple) else None if isinstance(text, str) else [text]
        )
        try:
            if items is None:
                found = re.fullmatch(RANGE_PATTERN, str(text).strip())
                if found:
                    low, high, n = (
                        number_in(field, found["low"], unit),
                        number_in(field, found["high"], unit),
                        int(found["n"]) if found["n"] else None,
                    )
                    finite = math.isfinite(low) and math.isfinite(high)
                    if (
                        not finite
                        or n == 0
                        or (found["log"] and low <= 0.0)
                        or (n != 1 and low >= high)
                    ):
                        raise ValueError
                    return cls(low, high, n, bool(found["log"]))
                items = str(text).split(",")
            values = tuple(number_in(field, x, unit) for x in items)  # type: ignore[union-attr]
            if not values or not all(map(math.isfinite, values)):
                raise ValueError
        except ParameterError:  # of a unit
            raise
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(field, text, bound) from None
        return cls(min(values), max(values), len(values), False, values)

    def grid(self) -> np.ndarray:
        """The values, shape (n,)."""
        if self.values:
            return np.array(self.values)
        assert self.n
        return (
            np.geomspace(self.low, self.high, self.n)
            if self.log
            else np.linspace(self.low, self.high, self.n)
        )

    def spread(self, u: np.ndarray) -> np.ndarray:
        """Samples of the unit interval spread over the range.

        Args:
            u: samples in [0, 1); they select from the list if there is one.
        """
        if self.values:
            return np.array(self.values)[(u * len(self.values)).astype(int)]
        if self.log:
            return self.low * (self.high / self.low) ** u
        return self.low + (self.high - self.low) * u


@named
@dataclass(frozen=True)
class Sweep:
    """Runs of one experiment, or of a scenario file, over a space of its numbers.

    A number is a parameter of the experiment, as on the command line, or any field of the scenario
    by dotted name : "servo.x.G.damping", "gain.x", "compensator.den.1". A pair
    without axis gets the value on both axes. "operator.mass" adds an arm at the handle.

    Attributes:
        experiment: a name in EXPERIMENTS; not used with a scenario.
        vary: ranges by name.
        fixed: values by name, the same in all runs.
        design: "grid" (all combinations, the last parameter fastest), "lhs" (Latin hypercube) or
            "sobol".
        runs: number of runs of "lhs" and "sobol"; None for "grid".
        seed: seed of both.
        chunk: runs per file, 1 to 100,000; None for as many as a process makes in 1.5 s, or in 5 %
            of the time spent so far.
        scenario: plain data of a scenario file, from `read_settings`; empty for the experiment.
    """

    experiment: str
    vary: dict[str, Range]
    fixed: dict[str, Any] = dataclasses.field(default_factory=dict)
    design: str = "grid"
    runs: int | None = None
    seed: int = 0
    chunk: int | None = None
    scenario: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        choice("experiment", self.experiment, tuple(EXPERIMENTS))
        choice("design", self.design, DESIGNS)
        integer("seed", self.seed, 0, 2**32 - 1)
        if self.chunk is not None:
            self._size()
        if not self.vary:
            raise ParameterError("grid", "", "must vary a parameter, as in b=1:1000:50log")
        for name in self.vary.keys() & self.fixed.keys():
            bound = "is varied: leave it out of the fixed ones"
            raise ParameterError(name, self.fixed[name], bound)
        if (self.runs is None) != (self.design == "grid"):
            raise ParameterError(
                "runs", self.runs, "must be given for 'lhs' and 'sobol', and for them alone"
            )
        for name, r in self.vary.items():
            if not r.values and (r.n is None) == (self.design == "grid"):
                told = (
                    "must have a count, as in 1:1000:50log"
                    if self.runs is None
                    else "must have no count: runs gives it"
                )
                raise ParameterError(
                    name,
                    f"{r.low:g}:{r.high:g}{f':{r.n}' if r.n else ''}",
                    f"{told} ({self.design})",
                )
        integer("runs", len(self), 1, MOST_RUNS)
        self.run_scenario(self.points(0, 1)[0])  # raises the errors of the first run

    def __len__(self) -> int:
        if self.runs is not None:
            return integer("runs", self.runs, 1, MOST_RUNS)
        return math.prod(r.n or 1 for r in self.vary.values())

    def _size(self) -> int:
        return integer("chunk", self.chunk, 1, 100_000)

    @property
    def chunks(self) -> int:
        """Number of files."""
        return -(-len(self) // self._size())

    def chunk_runs(self, number: int) -> range:
        """The runs of one file.

        Args:
            number: of the file, from 0.
        """
        size = self._size()
        return range(number * size, min((number + 1) * size, len(self)))

    def points(self, first: int, last: int) -> np.ndarray:
        """Parameters of some runs, shape (last - first, parameters).

        Args:
            first: number of the first run.
            last: number of the run after the last.
        """
        axes = list(self.vary.values())
        if self.design == "grid":
            index = np.unravel_index(np.arange(first, last), [r.n or 1 for r in axes])
            return np.column_stack([r.grid()[i] for r, i in zip(axes, index, strict=True)])
        unit = _unit_samples(self.design, len(axes), len(self), self.seed)[first:last]
        return np.column_stack([r.spread(u) for r, u in zip(axes, unit.T, strict=True)])

    @property
    def title(self) -> str:
        """Name of the experiment or the scenario."""
        return str(self.scenario.get("name", "scenario")) if self.scenario else self.experiment

    def run_scenario(self, point: np.ndarray) -> Scenario:
        """The scenario of one run.

        Args:
            point: its parameters, a row of `points`.

        Raises:
            ParameterError: there is no such parameter, or a value is out of its bounds.
        """
        settings = self.scenario or {"experiment": self.experiment}
        varied = dict(zip(self.vary, point.tolist(), strict=True))
        return Scenario.of(settings, self.fixed, varied)

    def described(self) -> dict[str, Any]:
        """The sweep as plain data."""
        return {"schema": SWEEP_SCHEMA, **dataclasses.asdict(self)}

    def digest(self) -> str:
        """Fingerprint of the sweep and of the release that runs it."""
        text = json.dumps({**self.described(), "release": versions()["hapticclay"]}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


@functools.lru_cache(1)  # a worker needs it for each chunk
def _unit_samples(design: str, dimensions: int, runs: int, seed: int) -> np.ndarray:
    """A sample of the unit cube, shape (runs, dimensions)."""
    from scipy.stats import qmc

    kind = qmc.LatinHypercube if design == "lhs" else qmc.Sobol
    with np.errstate(all="ignore"):
        engine = kind(dimensions, rng=np.random.default_rng(seed))
    if design == "sobol":  # balance needs a power of two; the first runs of these are used
        return engine.random_base2(max(0, math.ceil(math.log2(runs))))[:runs]  # type: ignore[attr-defined]
    return engine.random(runs)


@checked
def parse_grid(text: str) -> dict[str, Range]:
    """Reads "b=1:1000:50log gain=0.2:2:20 force=1:2 log"; units as in "dt=0.1ms:1ms:5log".

    Args:
        text: the ranges.

    Raises:
        ParameterError: a word is not name=range, or a name stands twice.
    """
    return grid_in_units(text, parameter_unit)


def grid_in_units(text: str, unit_of: Callable[[str], str]) -> dict[str, Range]:
    """Reads ranges as `parse_grid` does."""
    how = (
        "must be name=low:high:n, name=low:high:nlog, name=low:high (sampled) or name=a,b,c, "
        "each name once"
    )
    if not isinstance(text, str):
        raise ParameterError("grid", text, how)
    together = re.sub(r"\s+log(?!\S)", "log", text)
    return {
        name: Range.parse(name, values, unit_of(name))
        for name, values in _split_words("grid", together, how).items()
    }


def parse_fixed(text: str) -> dict[str, Any]:
    """Reads "t_max=2 inertia_shaping=true force=1,0 growth=30/s arm.l1=30cm"."""
    return named_values("fixed", text.split())


def _split_words(field: str, text: str, how: str) -> dict[str, str]:
    """Splits words name=value; `how` describes the format for the error."""
    out: dict[str, str] = {}
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals or not name or name in out:
            raise ParameterError(field, word, how)
        out[name] = value
    return out


def load_sweep(path: Path) -> dict[str, Any]:
    """Reads a sweep from TOML: experiment or scenario, design, runs, seed, chunk, vary, fixed."""
    try:
        data = parse_toml(read_text(path, MOST_SETTINGS))
    except (OSError, ValueError) as error:
        fault = getattr(error, "strerror", None) or error
        raise ParameterError("spec", str(path), f"must be a TOML file ({fault})") from None
    fields = [f.name for f in dataclasses.fields(Sweep)]
    for name in data:
        choice("field of the spec", name, fields)
    for name in ("vary", "fixed"):
        if not isinstance(data.get(name, {}), dict):
            raise ParameterError(name, data[name], "must be a table")
        data[name] = _flat(with_present_names(data.get(name, {})))
    if "scenario" in data:
        if "experiment" in data or not isinstance(data["scenario"], str):
            bound = "must be the path of a scenario file; remove the experiment"
            raise ParameterError("scenario", data["scenario"], bound)
        data["scenario"] = read_settings(path.parent / data["scenario"])
    data["vary"] = {k: Range.parse(k, v, parameter_unit(k)) for k, v in data["vary"].items()}
    return {"experiment": "constant", **data}


def _flat(table: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    """Flattens a nested table to dotted names: a.b = 1 and "a.b" = 1 are equivalent."""
    out: dict[str, Any] = {}
    for name, value in table.items():
        inner = join_names(path, name)
        out |= _flat(value, inner) if isinstance(value, dict) else {inner: value}
    return out
