"""Populations of hands: the mass, damper and spring of an arm at a handle, and bands over them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named, part
from ..errors import Bound, ParameterError, Real, choice, number
from ..fields import Seed
from ..model.operator import Operator
from ..results import Result
from ..scene.virtual_wall import VirtualWall
from ..theory import wall_limits
from ..theory.gain_limits import gain_limit
from ..theory.hand_boxes import Box
from ..theory.loops import Loop
from .distribution import LAWS, Distribution, normal_score
from .stability_map import Progress

HAND = ("mass", "damper", "spring")
HAND_UNITS = ("kg", "N.s/m", "N/m")
PAIRS = tuple(f"{a}, {b}" for a, b in itertools.combinations(HAND, 2))
MOST_HANDS = 100_000
Correlations = Annotated[tuple[float, float, float], Bound(-1.0, 1.0, names=PAIRS)]
Variation = Annotated[float, Bound(1e-3, 10.0)]


@part("hands.")
class Hands:
    """A population of hands: the known distribution of mass, damper and spring of Th.

    Attributes:
        mass: [kg], a number or its distribution over the population.
        damper: [N.s/m], likewise.
        spring: [N/m], likewise.
        source: publication of the numbers; "" for your own numbers.
        spread: meaning of the spread, such as "subjects" or "assumed".
        subjects: number of people who were measured, 0 where that is not known.
        correlation: correlation of the normal scores of (mass, damper), (mass, spring) and (damper,
            spring), -1 to 1; for log-normal pairs that of the logarithms. 0 where none was
            published.
    """

    mass: Annotated[Real | Distribution, Bound(0.0, unit="kg")]
    damper: Annotated[Real | Distribution, Bound(0.0, unit="N.s/m")]
    spring: Annotated[Real | Distribution, Bound(0.0, unit="N/m")]
    source: str = ""
    spread: str = ""
    subjects: Annotated[int, Bound(0, 1_000_000)] = 0
    correlation: Correlations = (0.0, 0.0, 0.0)

    def __post_init__(self):
        for name, value in self._values.items():
            if isinstance(value, Distribution) and (value.law == "normal" or value.first < 0.0):
                laws = ", ".join(x for x in LAWS if x != "normal")
                bound = f"must have no negative values: {laws}, from 0 on"
                raise ParameterError(f"hands.{name}", value, bound)
        if np.linalg.eigvalsh(self._correlations).min() < -1e-12:
            bound = "must be correlations of three numbers: no three numbers have these"
            raise ParameterError("hands.correlation", self.correlation, bound)

    @classmethod
    @checked
    def around(cls, operator: Operator, variation: Variation = 0.3, **about: Any) -> Hands:
        """Log-normal hands around a mean: an assumption for data without a published spread.

        Args:
            operator: mean of the hands.
            variation: standard deviation over mean of each number, 0.001 to 10.
            **about: other attributes.
        """
        mass, damper, spring = (
            Distribution("log-normal", x, variation * x) if x else 0.0
            for x in (operator.mass, operator.damper, operator.spring)
        )
        spread = f"assumed: {100.0 * variation:g} % of the mean"
        return cls(mass, damper, spring, **{"spread": spread, **about})

    @property
    def random(self) -> tuple[str, ...]:
        """Which of mass, damper and spring vary."""
        return tuple(n for n, x in self._values.items() if isinstance(x, Distribution))

    @property
    def median(self) -> Operator:
        """The hand with median mass, damper and spring."""
        values = self._values.values()
        return Operator(*(x.median if isinstance(x, Distribution) else x for x in values))

    @property
    def _values(self) -> dict[str, float | Distribution]:
        return {name: getattr(self, name) for name in HAND}

    @property
    def _correlations(self) -> np.ndarray:
        md, ms, ds = self.correlation
        return np.array([[1.0, md, ms], [md, 1.0, ds], [ms, ds, 1.0]])

    def spread_over(self, u: np.ndarray) -> np.ndarray:
        """Masses [kg], dampers [N.s/m] and springs [N/m] for samples, shape (n, 3).

        A Gaussian copula gives them the correlation of the population.

        Args:
            u: samples of the unit cube, 0 < u < 1, shape (n, 3).
        """
        z = normal_score(u)
        if any(self.correlation):
            w, v = np.linalg.eigh(self._correlations)  # singular ones have no Cholesky factor
            z = z @ (v * np.sqrt(np.maximum(w, 0.0))) @ v.T
        out = np.empty_like(z)
        for i, x in enumerate(self._values.values()):
            out[:, i] = x.of_score(z[:, i]) if isinstance(x, Distribution) else x
        return out

    @checked
    def sample(self, n: Annotated[int, Bound(1, MOST_HANDS)], seed: Seed = 0) -> list[Operator]:
        """Draw hands.

        Args:
            n: number of hands, 1 to 100000.
            seed: seed of the generator.
        """
        u = open_uniform(np.random.default_rng(seed), (n, 3))
        return [Operator(*row) for row in self.spread_over(u).tolist()]

    @checked
    def box(self, share: Annotated[float, Bound(0.0, 1.0 - 1e-9)] = 0.9) -> Box:
        """Ranges that contain a given share of each number separately, for `worst_case`.

        Args:
            share: share of the population between the ends of each range, 0 to 1.
        """
        out = 0.5 * (1.0 - share)
        ends = {}
        for name, x in self._values.items():
            both = x.spread(np.array([out, 1.0 - out])) if isinstance(x, Distribution) else x
            ends[name] = (float(np.min(both)), float(np.max(both)))
        return Box(**ends)

    def row(self, name: str) -> list[str]:
        """A row of a table of populations: name, mass, damper, spring, subjects, spread, source.

        Args:
            name: name of the population.
        """
        values = self._values.values()
        texts = [x.text() if isinstance(x, Distribution) else f"{x:g}" for x in values]
        return [name, *texts, str(self.subjects or "-"), self.spread or "none", self.source]


PAPER_HAND = "Her, Hsu, Lan, Karkoub 2002, J. Intelligent and Robotic Systems 35, Eq. 19"
POSTURE_HAND = (
    "van Beek, Bergmann Tiest, Mugge, Kappers 2015, Scientific Reports 5:18004, caption of Fig. 3"
)
# Only numbers read at their source. docs/robustness.md names other measurements, without
# numbers, because we had no access to their tables.
POPULATIONS = {
    "paper": Hands(0.25, 2.0, 6.0, PAPER_HAND),
    "posture": Hands(0.554, 6.45, 135.0, POSTURE_HAND, "one trial of one participant", 1),
    "published range": Hands(
        Distribution("log-uniform", 0.25, 0.554),
        Distribution("log-uniform", 2.0, 6.45),
        Distribution("log-uniform", 6.0, 135.0),
        f"{PAPER_HAND}; {POSTURE_HAND}",
        "assumed: log-uniform between two published hands",
    ),
}


def hands_of(given: str | Hands) -> Hands:
    """A population, itself or by its name in POPULATIONS."""
    if isinstance(given, Hands):
        return given
    return POPULATIONS[choice("hands", given, tuple(POPULATIONS))]


def open_uniform(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform random numbers in 0 < u < 1, whose normal scores are finite."""
    return (rng.integers(0, 2**52, shape) + 0.5) * 2.0**-52


# ---- bands -----------------------------------------------------------------------------------


@named
@dataclass(frozen=True, repr=False)
class Band(Result):
    """A limit over a parameter, as a band over a population of hands.

    Attributes:
        x_name: the parameter and its unit.
        y_name: the limit and its unit.
        x: values of the parameter, shape (n,).
        limits: limit for each hand, inf for none, shape (n, hands).
        hands: the hands, drawn from the population.
        nominal: limit of the hand of medians, shape (n,).
        told: description of the population.
    """

    drawn_by = "hapticclay.views.robustness_plots:band_plot"

    x_name: str
    y_name: str
    x: np.ndarray
    limits: np.ndarray
    hands: list[Operator]
    nominal: np.ndarray
    told: str

    def headline(self) -> str:
        """Least limit of the hands drawn, in one line."""
        i = int(self.least.argmin())
        least = f"{self.y_name} at least {self.least[i]:.4g}"
        return f"{self.told}: {least}, at {self.x_name} = {self.x[i]:.4g}"

    @checked
    def quantile(self, share: Annotated[float, Bound(0.0, 1.0)]) -> np.ndarray:
        """Limit that a share of the hands does not exceed, shape (n,).

        Args:
            share: 0 to 1.
        """
        return np.quantile(self.limits, share, axis=1, method="inverted_cdf")

    @property
    def least(self) -> np.ndarray:
        """Least limit of the hands drawn, shape (n,)."""
        return self.limits.min(axis=1)

    def tables(self) -> dict[str, dict[str, Sequence]]:
        """The numbers of the figure, by table name: columns by name with unit."""
        y = self.y_name
        columns = {"5 %": self.quantile(0.05), "median": self.quantile(0.5),
                   "95 %": self.quantile(0.95), "least": self.least,
                   "hand of medians": self.nominal}  # fmt: skip
        rows: dict[str, Sequence] = {self.x_name: self.x.tolist()}
        rows |= {f"{y}, {k}": v.tolist() for k, v in columns.items()}
        hands: dict[str, Sequence] = {
            f"{n} [{u}]": [getattr(h, n) for h in self.hands]
            for n, u in zip(HAND, HAND_UNITS, strict=True)
        }
        return {"band": rows, "hands": hands}


@part("draw.")
class Draw:
    """Number of hands in a band, and their seed.

    Attributes:
        hands: number of hands, 2 to 100000.
        seed: seed of the generator, 0 to 2^32 - 1.
    """

    hands: Annotated[int, Bound(2, MOST_HANDS)] = 200
    seed: Seed = 0


@checked
def gain_band(
    loop: Loop,
    hands: str | Hands,
    b: Sequence[float],
    draw: Draw = Draw(),
    progress: Progress = iter,
) -> Band:
    """Gain limit over clay, for each hand of a population: exact, by `gain_limit`.

    A limit takes about 1.5 ms in continuous time, 30 ms with sampling or delay.

    Args:
        loop: all but clay, hand and K; sampling and delay are allowed.
        hands: the population, or its name in POPULATIONS.
        b: clay [N.s/m], shape (n,).
        draw: number of hands, and seed.
        progress: wraps the iterable of clays.

    Raises:
        ParameterError: no such population, or b out of its bounds.
    """
    parts = Loop(**{f: getattr(loop, f) for f in Loop.__dataclass_fields__})
    return _limit_band(
        ("clay b [N.s/m]", "gain limit K [1/kg]"),
        lambda x, hand: gain_limit(replace(parts, b=x, operator=hand)),
        b,
        hands_of(hands),
        draw,
        progress,
    )


@checked
def wall_band(
    wall: VirtualWall,
    hands: str | Hands,
    B: Sequence[float],
    draw: Draw = Draw(),
    progress: Progress = iter,
) -> Band:
    """Largest stable stiffness of a virtual wall over its damping, for each hand: exact.

    It is the upper end of `wall_limits.stiffness_band`, for a linear wall without friction and
    quantum.

    Args:
        wall: all but stiffness, damping and hand.
        hands: the population, or its name in POPULATIONS.
        B: virtual damping [N.s/m], shape (n,).
        draw: number of hands, and seed.
        progress: wraps the iterable of dampings.

    Raises:
        ParameterError: no such population, or B out of its bounds.
    """
    return _limit_band(
        ("virtual damping B [N.s/m]", "largest stable K [N/m]"),
        lambda x, hand: wall_limits.stiffness_band(replace(wall, B=x, operator=hand))[1],
        B,
        hands_of(hands),
        draw,
        progress,
    )


def _limit_band(
    names: tuple[str, str],
    limit: Callable[[float, Operator], float],
    x: Sequence[float],
    hands: Hands,
    draw: Draw,
    progress: Progress,
) -> Band:
    field = names[0].split()[-2]
    values = [number(field, v, unit="N.s/m") for v in x]
    if not values:
        raise ParameterError(field, x, "must hold a value")
    drawn, middle = hands.sample(draw.hands, draw.seed), hands.median
    rows, nominal = [], []
    for v in progress(values):
        rows.append([limit(v, hand) for hand in drawn])
        nominal.append(limit(v, middle))
    own = hands.spread or "own numbers"
    name = next((k for k, v in POPULATIONS.items() if v == hands), own)
    return Band(*names, np.array(values), np.array(rows), drawn, np.array(nominal), name)
