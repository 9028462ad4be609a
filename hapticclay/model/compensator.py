"""The compensator: a proper transfer function from net force to commanded displacement."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any

import numpy as np
from numpy.polynomial import Polynomial

from .. import matrices
from ..arguments import part
from ..errors import Bound, ParameterError
from ..formulas.compensator import ORDER
from .constants import C_DEN, C_NUM

CANCELLED = 1e-12  # of a sum, relative to that of the magnitudes


@part("compensator.")
class Compensator:
    """Shape of the compensator: C = K num(s)/den(s), proper, at most of order 4.

    Coefficients are in descending powers of s, as in SciPy and python-control. They are normalised
    to a leading coefficient of den of 1.

    Attributes:
        num: numerator, at most as long as den; (1,) as printed.
        den: denominator, 1 to 5 numbers; (1, 10, 0) as printed, s^2 + 10 s (Eqs. 20, 22, 27).
    """

    num: Annotated[tuple[float, ...], Bound()] = C_NUM
    den: Annotated[tuple[float, ...], Bound()] = C_DEN

    def __post_init__(self):
        num, den = _without_leading_zeros(self.num), _without_leading_zeros(self.den)
        if not den or len(den) > ORDER + 1:
            bound = f"must be 1 to {ORDER + 1} numbers, not all of them 0: order {ORDER} at most"
            raise ParameterError("compensator.den", self.den, bound)
        if not num or len(num) > len(den):
            bound = f"must be 1 to {len(den)} numbers, not all of them 0: C must be proper"
            raise ParameterError("compensator.num", self.num, bound)
        for name, values in (("num", num), ("den", den)):
            scaled = tuple(x / den[0] for x in values)
            if not all(map(math.isfinite, scaled)):
                raise ParameterError(f"compensator.{name}", values, "must be finite over den[0]")
            object.__setattr__(self, name, scaled)

    @classmethod
    def zpk(
        cls, zeros: Iterable[complex], poles: Iterable[complex], gain: float = 1.0
    ) -> Compensator:
        """The compensator K gain (s - z1) .../((s - p1) ...).

        Args:
            zeros: its zeros [rad/s], complex ones with their conjugates.
            poles: its poles [rad/s], as many or more.
            gain: factor, in addition to K.

        Raises:
            ParameterError: a complex root lacks its conjugate, or C is not proper.
        """
        num, den = _from_roots("zeros", zeros), _from_roots("poles", poles)
        return cls(tuple(gain * x for x in num), den)

    @classmethod
    def of(cls, system: Any) -> Compensator:
        """The compensator of another package, or of (num, den).

        Args:
            system: a Compensator; a transfer function, state space or zeros-poles-gain system of
                python-control or scipy.signal, in continuous time, of one input and one output;
                or a pair of coefficients (num, den).

        Raises:
            ParameterError: the system is none of these, or its transfer function is not proper.
        """
        if isinstance(system, Compensator):
            return system
        bound = "must be a Compensator, or a system of python-control or scipy.signal"
        if getattr(system, "dt", None):
            raise ParameterError("compensator", system, f"{bound}, in continuous time")
        try:
            own = hasattr(system, "ninputs")  # python-control
            if not own and not hasattr(system, "to_tf"):  # nor scipy.signal
                num, den = system
            elif [getattr(system, f"n{x}" if own else x) for x in ("inputs", "outputs")] != [1, 1]:
                raise ParameterError("compensator", system, "must have one input, one output")
            elif hasattr(system, "A"):
                num, den = _from_state_space(system.A, system.B, system.C, system.D)
            elif own:
                num, den = system.num[0][0], system.den[0][0]
            else:
                rational = system.to_tf()
                num, den = rational.num, rational.den
            num, den = tuple(map(float, num)), tuple(map(float, den))
        except (TypeError, ValueError, AttributeError, IndexError) as error:
            if isinstance(error, ParameterError):
                raise
            raise ParameterError("compensator", system, bound) from None
        return cls(num, den)

    @property
    def order(self) -> int:
        """Number of its states."""
        return len(self.den) - 1

    @property
    def fraction(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of C/K in s."""
        return Polynomial(self.num[::-1]), Polynomial(self.den[::-1])

    @property
    def poles(self) -> np.ndarray:
        """Its poles [rad/s], shape (order,)."""
        return matrices.polynomial_roots(self.den)

    @property
    def zeros(self) -> np.ndarray:
        """Its zeros [rad/s], shape (at most order,)."""
        return matrices.polynomial_roots(self.num)

    @property
    def lag(self) -> tuple[float, float] | None:
        """(c, p) if C = K c/(s (s + p)), an integrator behind one lag as printed; else None."""
        if len(self.num) == 1 and len(self.den) == 3 and self.den[2] == 0.0 <= self.den[1]:
            return self.num[0], self.den[1]
        return None

    def state_space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """A realisation A, B, C, D of C/K: z' = A z + B f, delta = C z + D f.

        Controllable form, with vectors B and C. Time is scaled so that the fastest pole is 1 rad/s,
        which preserves the digits of fast and slow poles; for the printed compensator, see `lag`,
        it is in seconds.
        """
        n = self.order
        den = np.array(self.den)
        num = np.zeros(n + 1)
        num[n + 1 - len(self.num) :] = self.num
        D = float(num[0])
        fastest = float(np.abs(self.poles).max(initial=0.0))
        w = fastest if fastest > 0.0 and self.lag is None else 1.0
        A, B = np.zeros((n, n)), np.zeros(n)
        if n:
            A[np.arange(n - 1), np.arange(1, n)] = w
            A[n - 1] = 0.0 - (den[1:] / w ** np.arange(n))[::-1]
            B[n - 1] = 1.0
        C = ((num[1:] - D * den[1:]) / w ** np.arange(n))[::-1] if n else np.zeros(0)
        return A, B, C, D


def _without_leading_zeros(x: tuple[float, ...]) -> tuple[float, ...]:
    first = next((i for i, value in enumerate(x) if value), len(x))
    return x[first:]


def _from_roots(name: str, given: Iterable[complex]) -> tuple[float, ...]:
    """Coefficients of the polynomial of these roots."""
    try:
        x = np.poly(np.array([complex(r) for r in given]))
    except (TypeError, ValueError):
        raise ParameterError(f"compensator.{name}", given, "must be numbers") from None
    if np.iscomplexobj(x):
        bound = "must contain the conjugate of each complex number"
        raise ParameterError(f"compensator.{name}", given, bound)
    return tuple(float(c) for c in np.atleast_1d(x))


def _from_state_space(A: Any, B: Any, C: Any, D: Any) -> tuple[Any, Any]:
    """Coefficients by way of the impulse response: D, C B, C A B, ...

    Values at rounding are set to zero, so that num has no spurious distant zeros. If all but D are
    zero, the system is a gain.
    """
    v, row = np.ravel(B), np.ravel(C)
    A = np.reshape(A, (len(v), len(v)))
    response, size = [float(np.ravel(D)[0])], np.abs(v)
    for _ in range(len(A)):
        x = float(row @ v)
        response.append(x if abs(x) > CANCELLED * float(np.abs(row) @ size) else 0.0)
        v, size = A @ v, np.abs(A) @ size
    if not any(response[1:]):
        return response[:1], (1.0,)
    den = np.poly(A)
    return np.convolve(response, den)[: len(den)], den


PRINTED = Compensator()


def form_numbers(compensator: Compensator) -> list[float]:
    """A, B, C, D of a realisation of C/K, row by row, padded with zeros to the highest order."""
    n = compensator.order
    A, B, C, D = compensator.state_space()
    a, b, c = np.zeros((ORDER, ORDER)), np.zeros(ORDER), np.zeros(ORDER)
    a[:n, :n], b[:n], c[:n] = A, B, C
    return [*a.ravel().tolist(), *b.tolist(), *c.tolist(), D]


def moving_states(compensator: Compensator, v: float) -> list[float]:
    """States of a compensator whose output is 0 and moves at v [m/s]; it needs an integrator."""
    n = compensator.order
    out = [0.0] * ORDER
    if v == 0.0:
        return out
    A, B, C, D = compensator.state_space()
    # z = z0 + z1 t under a constant force f: A z1 = 0, A z0 + B f = z1, C z1 = v, C z0 + D f = 0;
    # for C and D of size one, so that an error of z1 counts as much in the first as in the third
    size = max(np.abs(C).max(initial=0.0), abs(D))
    m, right = np.zeros((2 * n + 2, 2 * n + 1)), np.zeros(2 * n + 2)
    m[:n, n : 2 * n], m[n : 2 * n, :n], m[n : 2 * n, n : 2 * n] = A, A, -np.eye(n)
    m[n : 2 * n, 2 * n], m[2 * n, n : 2 * n] = B, C / size
    m[2 * n + 1, :n], m[2 * n + 1, 2 * n] = C / size, D / size
    right[2 * n] = 1.0  # the states scale with v itself; a tiny v must keep its digits
    z = matrices.least_squares(m, right)
    if not np.allclose(m @ z, right, rtol=0.0, atol=1e-9):
        bound = "must be 0 with a compensator without an integrator"
        raise ParameterError("velocity", v, bound)
    out[:n] = (v / size * z[:n]).tolist()
    return out
