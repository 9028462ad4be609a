"""The largest gain for a margin: it has the margin, and a little more has not."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.theory import linear_loop
from hapticclay.theory.design import DESIGN_BAND
from tests.hunt import HUNTS, examples
from tests.theory.test_margins import loop_by_its_parts

MARGINS = [
    (dict(gain_margin=2.0), lambda m: m.gain[1] - 2.0),
    (dict(phase_margin=math.radians(45.0)), lambda m: m.phase - math.radians(45.0)),
    (dict(disk_margin=0.5), lambda m: m.disk - 0.5),
    (dict(delay_margin=0.02), lambda m: m.delay - 0.02),
]


@examples(2)
@given(axis=st.sampled_from("xy"), b=st.floats(20.0, 300.0), on=st.booleans())
@pytest.mark.parametrize("asked,left", MARGINS)
def test_the_margin_is_there_and_not_a_bit_further(asked, left, axis, b, on):
    th = hc.Operator() if on else None
    K = hc.theory.design_gain(axis, b, th, **asked)
    assert left(hc.theory.margins(axis, K, b, th)) >= 0.0
    assert left(hc.theory.margins(axis, K * (1 + 1e-9), b, th)) < 1e-8
    for factor in (0.1, 0.5, 0.9):  # every lower gain has it too
        assert left(hc.theory.margins(axis, factor * K, b, th)) >= 0.0


OMEGA = np.geomspace(1e-6, 1e7, 40_001)


def margins_of(L):
    """Gain, phase, disk and delay margin of L on OMEGA, by crossings between its points."""
    L, w = np.asarray(L), OMEGA
    up = np.flatnonzero(np.diff(np.signbit(L.imag)))
    t = L.imag[up] / (L.imag[up] - L.imag[up + 1])
    real = L.real[up] + t * (L.real[up + 1] - L.real[up])
    real = real[(real < 0.0) & (real > -1.0)]
    level = np.log(np.abs(L))
    at = np.flatnonzero(np.diff(np.signbit(level)))
    t = level[at] / (level[at] - level[at + 1])
    lag = np.unwrap(np.angle(-L))
    lag, omega = lag[at] + t * (lag[at + 1] - lag[at]), w[at] + t * (w[at + 1] - w[at])
    ahead = lag % (2.0 * np.pi)
    late = 0.0 if abs(L[-1]) >= 1.0 else np.min(ahead / omega, initial=math.inf)
    return np.array(
        [
            np.min(-1.0 / real, initial=math.inf),
            np.min(np.minimum(ahead, 2.0 * np.pi - ahead), initial=math.inf),
            2.0 / np.max(np.abs((1.0 - L) / (1.0 + L))),
            late,
        ]
    )


@examples(6)
@given(
    axis=st.sampled_from("xy"),
    b=st.floats(0.5, 3.0).map(lambda x: 10.0**x),
    th=st.none() | st.just(hc.Operator()) | st.just(hc.Operator(2.0, 20.0, 300.0)),
    zero=st.floats(0.3, 2.5).map(lambda x: 10.0**x),
    pole=st.floats(0.3, 2.5).map(lambda x: 10.0**x),
    asked=st.sampled_from(
        [
            (1.5, 0.0, 0.0, 0.0),
            (1.0, 0.8, 0.0, 0.0),
            (1.0, 0.0, 0.8, 0.0),
            (1.0, 0.0, 0.0, 4e-3),
            (2.0, 0.5, 0.5, 1e-3),
        ]
    ),
    at=st.sampled_from(["compensator", "force"]),
)
@example("y", 200.0, hc.Operator(), 20.0, 40.0, (1.0, 0.0, 0.8, 0.0), "compensator")
def test_every_gain_up_to_the_design_keeps_the_margins_and_a_little_more_does_not(
    axis, b, th, zero, pole, asked, at
):
    """Margins need not fall as K rises: those of K = 1e6 say nothing of lower K."""
    names = ("gain_margin", "phase_margin", "disk_margin", "delay_margin")
    C = hc.Compensator((1.0, zero), (1.0, pole, 0.0))
    found = hc.theory.design_gain(
        axis, b, th, compensator=C, at=at, **dict(zip(names, asked, strict=True))
    )
    loop = loop_by_its_parts(axis, 1.0, b, th, C, at)(OMEGA)
    alone = 0.0 if at == "compensator" else loop_by_its_parts(axis, 0.0, b, th, C, at)(OMEGA)
    if found == 0.0:  # the servo alone lacks the margin
        assert np.any(margins_of(alone + 1e-9 * (loop - alone)) < np.array(asked))
        return
    top = min(found, 1e6)
    for K in top * np.geomspace(1e-4, 0.999, 20):
        # linear interpolation on a grid of 7e-4 in log omega, of a phase that turns by a half turn
        # within a tenth of a decade
        assert np.all(margins_of(alone + K * (loop - alone)) >= np.array(asked) * (1.0 - 1e-3))
    if found < 1e6 and found < 0.999 * hc.theory.gain_limit(axis, b, th, compensator=C):
        assert np.any(margins_of(alone + 1.005 * found * (loop - alone)) < np.array(asked))


def test_a_margin_kept_at_a_huge_gain_is_no_margin_at_lower_ones():
    C = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    parts = dict(compensator=C, operator=hc.Operator())
    K = hc.theory.design_gain("y", 200.0, disk_margin=0.8, **parts)
    assert (
        hc.theory.margins("y", 1e6, 200.0, **parts).disk
        > 0.8
        > hc.theory.margins("y", 1.0, 200.0, **parts).disk
    )
    assert hc.theory.margins("y", K, 200.0, **parts).disk == pytest.approx(0.8, rel=1e-9)
    assert K == pytest.approx(0.0886, rel=1e-3)  # of a scan over 400 gains, as printed


@pytest.mark.parametrize(
    "kw", [dict(), dict(Ts=1e-3), dict(delay=1e-3), dict(Ts=1e-3, delay=1.5e-3)]
)
def test_gain_margin_divides_the_gain_limit(kw):
    for axis in "xy":
        assert hc.theory.design_gain(axis, 90.0, gain_margin=2.5, **kw) == pytest.approx(
            hc.theory.gain_limit(axis, 90.0, **kw) / 2.5, rel=1e-9
        )


def test_without_clay_and_hand_any_gain_will_do():
    assert hc.theory.design_gain("x", 0.0, gain_margin=2.0) == math.inf


def test_transparency_error_is_its_integral():
    low, high = DESIGN_BAND

    def miss(x):
        return abs(1 - hc.theory.transparency("x", 1.0, 90.0, np.array([math.exp(x)]))[0]) ** 2

    exact = math.sqrt(
        quad(miss, math.log(low), math.log(high), epsabs=1e-12)[0] / math.log(high / low)
    )
    assert hc.theory.transparency_error("x", 1.0, 90.0) == pytest.approx(
        exact, rel=1e-6
    )  # Simpson, steps of 1 %: h^4


def test_shapes_are_compared_at_equal_margin_the_best_first():
    shapes = [
        hc.Compensator(),
        hc.Compensator((1.0,), (1.0, 40.0, 0.0)),
        hc.Compensator((1.0,), (1.0, 2.0, 0.0)),
        hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0)),
    ]
    for axis in "xy" if HUNTS else "y":
        found = hc.theory.compare(
            axis, 90.0, shapes, hc.Operator(), disk_margin=0.5, delay_margin=0.005
        )
        assert {d.compensator for d in found} == set(shapes)
        assert np.all(np.diff([d.error for d in found]) > 0)
        assert found[0].compensator == hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))  # a lead pays
        for d in found:
            assert min(d.margins.disk - 0.5, d.margins.delay - 0.005) == pytest.approx(
                0.0, abs=1e-9
            )
            assert d.margins.stable
            assert linear_loop.stable(hc.theory.Loop(axis, 90.0, compensator=d.compensator, K=d.K))


def test_a_shape_without_a_largest_gain_is_refused():
    with pytest.raises(ParameterError, match="largest K"):
        lead = hc.Compensator((1.0, 5.0), (1.0, 40.0, 0.0))
        hc.theory.compare("x", 90.0, [lead], hc.Operator(), disk_margin=0.5)


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(gain_margin=0.5), "gain_margin"),
        (dict(phase_margin=4.0), "phase_margin"),
        (dict(disk_margin=3.0), "disk_margin"),
        (dict(at="motor"), "at"),
        (dict(phase_margin=0.5, Ts=1e-3), None),
    ],
)
def test_bad_input_is_refused(kw, field):
    with pytest.raises(ParameterError) as e:
        hc.theory.design_gain("x", 90.0, **kw)
    assert field in (None, e.value.field)
