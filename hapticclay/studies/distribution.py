"""Distributions of one parameter: four laws with two parameters each."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from ..arguments import part
from ..errors import ParameterError, choice, number_in
from ..scene.changes import split_words

LawName = Literal["normal", "log-normal", "uniform", "log-uniform"]
LAWS = get_args(LawName)
SIDES = ("mean", "standard deviation", "low", "high")


@part("distribution.")
class Distribution:
    """Distribution of a random number. Both numbers have the unit of the parameter.

    Attributes:
        law: "normal" or "log-normal", known by mean and standard deviation; "uniform" or
            "log-uniform" (the logarithm is uniform), known by their least and greatest value.
        first: mean, or least value; > 0 for the laws of a logarithm.
        second: standard deviation, > 0; or greatest value, above the least.
    """

    law: LawName
    first: float
    second: float

    def __post_init__(self):
        if self.law.startswith("log") and self.first <= 0.0:
            name = SIDES[0] if self.law == "log-normal" else SIDES[2]
            raise ParameterError(f"distribution {name}", self.first, f"must be > 0 ({self.law})")
        if self.law.endswith("normal"):
            if self.second <= 0.0:
                raise ParameterError(f"distribution {SIDES[1]}", self.second, "must be > 0")
        elif self.second <= self.first:
            bound = f"must be > {self.first:g}, the low end"
            raise ParameterError(f"distribution {SIDES[3]}", self.second, bound)

    @classmethod
    def parse(cls, field: str, text: object, unit: str = "") -> Distribution:
        """Reads "normal:0:0.02", "log-normal:2:0.5", "uniform:0:1e-3" or "log-uniform:1:100".

        Args:
            field: name for the error.
            text: the distribution; its numbers may have units, as in "uniform:0:1ms".
            unit: unit of the parameter.

        Raises:
            ParameterError: it is none of these.
        """
        if not isinstance(text, str):
            raise ParameterError(field, text, "must be a text such as normal:0:0.02")
        law, *numbers = text.split(":")
        choice(f"law of {field}", law, LAWS)
        try:
            first, second = (number_in(field, x, unit) for x in numbers)
        except ParameterError:  # of a unit
            raise
        except ValueError:
            sides = "LOW:HIGH" if "uniform" in law else "MEAN:SD"
            bound = f"must be like {law}:{sides}"
            raise ParameterError(field, text, bound) from None
        return cls(law, first, second)  # type: ignore[arg-type]

    @property
    def logarithm(self) -> tuple[float, float]:
        """Mean and standard deviation of the logarithm of a log-normal number."""
        variance = math.log1p((self.second / self.first) ** 2)
        return math.log(self.first) - 0.5 * variance, math.sqrt(variance)

    @property
    def median(self) -> float:
        """Median of the distribution."""
        return float(self.spread(np.array([0.5]))[0])

    def spread(self, u: np.ndarray) -> np.ndarray:
        """Quantiles: values below which given shares of the numbers lie; uniform shares sample it.

        Args:
            u: shares, 0 < u < 1, any shape.
        """
        if self.law == "uniform":
            return self.first + (self.second - self.first) * u
        if self.law == "log-uniform":
            return self.first * (self.second / self.first) ** u
        return self.of_score(normal_score(u))

    def of_score(self, z: np.ndarray) -> np.ndarray:
        """Values at the quantiles of given standard normal numbers.

        Args:
            z: standard normal numbers, any shape.
        """
        if self.law == "normal":
            return self.first + self.second * z
        if self.law == "log-normal":
            mean, sd = self.logarithm
            return np.exp(mean + sd * z)
        return self.spread(_normal_share(z))

    def share_below(self, x: np.ndarray) -> np.ndarray:
        """Cumulative distribution: share of the numbers below given values, 0 to 1.

        Args:
            x: values, any shape.
        """
        x = np.asarray(x, dtype=float)
        if self.law == "normal":
            return _normal_share((x - self.first) / self.second)
        if self.law == "uniform":
            return np.clip((x - self.first) / (self.second - self.first), 0.0, 1.0)
        with np.errstate(divide="ignore"):
            log = np.log(np.maximum(x, 0.0))
        if self.law == "log-normal":
            mean, sd = self.logarithm
            return _normal_share((log - mean) / sd)
        low = math.log(self.first)
        return np.clip((log - low) / (math.log(self.second) - low), 0.0, 1.0)

    def text(self, digits: int = 4) -> str:
        """The distribution in words, as in "log-normal, 2 ± 0.5".

        Args:
            digits: significant digits.
        """
        a, b = f"{self.first:.{digits}g}", f"{self.second:.{digits}g}"
        return f"{self.law}, {a} {'±' if self.law.endswith('normal') else 'to'} {b}"


def normal_score(u: np.ndarray) -> np.ndarray:
    """Quantiles of the standard normal distribution."""
    from scipy.special import ndtri

    return ndtri(u)


def _normal_share(z: np.ndarray) -> np.ndarray:
    from scipy.special import ndtr

    return ndtr(z)


def parse_laws(text: str, unit_of: Callable[[str], str] = lambda _: "") -> dict[str, Distribution]:
    """Reads "delay=uniform:0:1e-3 pose.x=normal:0:0.02", each name once."""
    if not isinstance(text, str):
        raise ParameterError("vary", text, "must be a text such as delay=uniform:0:1e-3")
    how = "must be name=law:number:number, as in delay=uniform:0:1e-3, each name once"
    laws = split_words("vary", text.split(), how).items()
    return {name: Distribution.parse(name, law, unit_of(name)) for name, law in laws}
