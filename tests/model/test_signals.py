"""Multisines against their definition, term by term, and against quadrature."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from hapticclay.errors import ParameterError
from hapticclay.model.signals import Multisine, Signal


def spelt_out(signal, t, axis):
    return sum(
        signal.amplitude[axis] * np.cos(w * t + p[axis])
        for w, p in zip(signal.omega, signal.phase, strict=True)
    )


@given(st.integers(0, 2**32 - 1), st.floats(0.2, 3.0), st.floats(0.0, 10.0))
def test_rms_period_and_value(seed, rms, t):
    m = Multisine(rms=(rms, 0.5 * rms), low=0.2, high=1.5, period=10.0, seed=seed)
    s = Signal(m)
    assert len(s.omega) == 14 and s.omega[0] == pytest.approx(0.4 * np.pi)
    for i in (0, 1):
        assert s(t)[i] == pytest.approx(spelt_out(s, t, i), abs=1e-12)
    grid = np.arange(
        0.0, 10.0, 0.1
    )  # more than two samples of the highest line: the sums are exact
    assert np.sqrt(np.mean(s(grid) ** 2, axis=0)) == pytest.approx(m.rms, rel=1e-9)
    np.testing.assert_allclose(s(grid + 10.0), s(grid), atol=1e-11)


@given(st.floats(0.0, 50.0), st.floats(1e-3, 3.0))
def test_mean_is_the_integral(begin, span):
    s = Signal(Multisine(rms=(1.0, 2.0), low=0.5, high=2.0, period=4.0, seed=7))
    for i in (0, 1):
        exact = (
            quad(
                lambda t, i=i: spelt_out(s, t, i), begin, begin + span, epsabs=1e-12, epsrel=1e-12
            )[0]
            / span
        )
        # the terms are of size 1; quadrature over spans of some periods keeps 1e-9
        assert s.mean(begin + 0.5 * span, 0.5 * span)[i] == pytest.approx(exact, abs=1e-8)


def test_lines_are_spread_over_the_logarithm():
    s = Signal(Multisine(low=0.1, high=10.0, period=10.0, lines=9))
    f = s.omega / (2.0 * np.pi)
    assert len(f) <= 9 and f[0] == pytest.approx(0.1) and f[-1] == pytest.approx(10.0)
    np.testing.assert_allclose(f * 10.0, np.round(f * 10.0), atol=1e-9)


def test_seed_decides():
    a, b = Multisine(seed=1), Multisine(seed=2)
    assert np.all(Signal(a)(1.0) == Signal(a)(1.0)) and Signal(a)(1.0)[0] != Signal(b)(1.0)[0]


@pytest.mark.parametrize(
    "kw",
    [
        dict(rms=(-1.0, 0.0)),
        dict(low=0.0),
        dict(low=3.0, high=2.0),
        dict(period=0.0),
        dict(high=1e9),
        dict(seed=-1),
        dict(seed=1.5),
        dict(low=0.11, high=0.12),
        dict(lines=0),
        dict(lines=10_000),
    ],
)
def test_bad_multisines_are_refused(kw):
    with pytest.raises(ParameterError, match="multisine"):
        dataclasses.replace(Multisine(), **kw)
