"""Signals against their definitions, term by term, and their means against quadrature."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import pieces as formula
from hapticclay.model import pieces
from hapticclay.model.signals import Multisine


def spelt_out(signal, t, axis):
    return sum(
        signal.amplitude[axis] * np.cos(w * t + p[axis])
        for w, p in zip(signal.omega, signal.phase, strict=True)
    )


@given(st.integers(0, 2**32 - 1), st.floats(0.2, 3.0), st.floats(0.0, 10.0))
def test_rms_period_and_value(seed, rms, t):
    m = Multisine(rms=(rms, 0.5 * rms), low=0.2, high=1.5, period=10.0, seed=seed)
    s = m
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
    s = Multisine(rms=(1.0, 2.0), low=0.5, high=2.0, period=4.0, seed=7)
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
    s = Multisine(low=0.1, high=10.0, period=10.0, lines=9)
    f = s.omega / (2.0 * np.pi)
    assert len(f) <= 9 and f[0] == pytest.approx(0.1) and f[-1] == pytest.approx(10.0)
    np.testing.assert_allclose(f * 10.0, np.round(f * 10.0), atol=1e-9)


def test_seed_decides():
    a, b = Multisine(seed=1), Multisine(seed=2)
    assert np.all(a(1.0) == a(1.0)) and a(1.0)[0] != b(1.0)[0]


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


sizes = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
times = st.floats(0.0, 2.0)
spans = st.floats(0.05, 1.0)


@st.composite
def shapes(draw):
    """A signal, its value written out as a function of a number, and where it breaks."""
    kind, size, t = draw(st.integers(0, 7)), draw(sizes), draw(times)
    a, b = draw(spans), draw(spans)
    unit, breaks = None, [t, t + a]
    if kind == 0:
        return hc.Constant(size), lambda x: np.array(size), []
    if kind == 1:
        signal, unit = hc.Step(size, t), lambda x: float(x >= t)
    elif kind == 2:
        end = draw(st.sampled_from([None, t + a]))
        signal = hc.Ramp(size, t, end)
        unit = lambda x: max(0.0, min(x, math.inf if end is None else end) - t)  # noqa: E731
    elif kind == 3:
        signal, unit = hc.Pulse(size, t, a), lambda x: float(t <= x < t + a)
    elif kind == 4:
        signal = hc.Pulse(size, t, a, a + b)
        unit = lambda x: float(x >= t and (x - t) % (a + b) < a)  # noqa: E731
        breaks = [t + k * (a + b) + d for k in range(int(6.0 / (a + b)) + 1) for d in (0.0, a)]
    elif kind == 5:
        log = draw(st.booleans())
        high = draw(st.floats(1.0, 30.0))
        signal = hc.Chirp(size, 1.0, high, a, 0.4, log, t)

        def unit(x):
            u = x - t
            if not 0.0 <= u < a:
                return 0.0
            if log and high > 1.0:
                return math.sin(2 * math.pi * a * (high ** (u / a) - 1) / math.log(high) + 0.4)
            return math.sin(2 * math.pi * (u + 0.5 * (high - 1.0) / a * u * u) + 0.4)

    elif kind == 6:
        knots = [t, t + a, t + a + b]
        values = [size, draw(sizes), draw(sizes)]
        between = draw(st.sampled_from(["linear", "hold"]))
        outside = draw(st.sampled_from(["hold", "zero"]))
        signal = hc.Samples(knots, values, between, outside)

        def value(x):
            if outside == "zero" and not knots[0] <= x < knots[-1]:
                return np.zeros(2)
            if between == "linear":
                return np.array([np.interp(x, knots, [v[i] for v in values]) for i in (0, 1)])
            return np.array(values[max(sum(x >= k for k in knots) - 1, 0)])

        return signal, value, knots
    else:
        signal = hc.Function(lambda x: (size[0] * np.cos(x), size[1] * np.cos(x)))
        unit, breaks = math.cos, []
    return signal, lambda x: np.array(size) * unit(x), breaks


def quadrature(value, breaks, begin, end, i):
    edges = [begin, *sorted(x for x in breaks if begin < x < end), end]
    parts = [(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a > 1e-12]
    return sum(
        quad(lambda x: value(x)[i], a, b, epsabs=1e-11, epsrel=1e-11, limit=200)[0]
        for a, b in parts
    )


@given(shapes(), st.floats(0.0, 4.0), st.floats(1e-3, 1.0))
def test_values_and_means_are_those_of_the_formula(case, t, h):
    """The mean over any interval is the integral, whatever breaks lie in it."""
    signal, value, breaks = case
    if all(abs(t - x) > 1e-9 for x in breaks):
        np.testing.assert_allclose(signal(t), value(t), rtol=1e-9, atol=1e-11)
    t += h  # runs begin at 0
    for i in (0, 1):
        exact = quadrature(value, breaks, t - h, t + h, i) / (2.0 * h)
        # 1e-11 of quadrature, over intervals of a hundredth of a second and more, values of 10
        assert signal.mean(t, h)[i] == pytest.approx(exact, rel=1e-9, abs=2e-8)
    many = signal.mean(np.array([t, t + 0.1]), np.array([h, 0.0]))
    np.testing.assert_allclose(many, [signal.mean(t, h), signal(t + 0.1)], rtol=1e-12, atol=1e-12)


@given(st.lists(shapes(), min_size=1, max_size=4), st.floats(1.0, 3.0), st.floats(1e-3, 1.0))
def test_sums_and_the_loops_table_say_the_same(cases, t, h):
    """What the loops read: cubics to fourth order in the step, all else to rounding."""
    signal = hc.Sum([case[0] for case in cases]) - 2.0 * hc.Multisine((1.0, 0.5), seed=3)
    wave = -2.0 * hc.Multisine((1.0, 0.5), seed=3)
    want = sum([case[0].mean(t, h) for case in cases], wave.mean(t, h))
    np.testing.assert_allclose(signal.mean(t, h), want, rtol=1e-12, atol=1e-12)
    table = pieces.loop_table(signal.cosines, signal.pieces(0.0, 4.096, 1e-3), 1e-9).ravel()
    # (2 pi 30 Hz 0.5 ms)^4/2000 of 20 in a value, next to none in a mean
    np.testing.assert_allclose(formula.mean_of_table(table, t, h), want, rtol=1e-9, atol=1e-8)
    if all(abs(t - x) > 1e-6 for case in cases for x in case[2]):
        value = formula.mean_of_table(table, t, 0.0)
        np.testing.assert_allclose(value, signal(t), rtol=1e-6, atol=2e-6)


def test_signals_add_up_flat_and_keep_what_dataclasses_promise():
    a, b, c = hc.Step((1.0, 0.0), 1.0), hc.Multisine(), hc.Constant((0.0, 2.0))
    assert a + b + c == hc.Sum((a, b, c)) == sum([a, b, c]) and (a + b).factors is None
    assert a - 2 * (b - c) == hc.Sum((a, b, c), (1.0, -2.0, 2.0))
    assert np.float64(2.0) * a == a * 2 == hc.Sum((a,), (2.0,))
    assert not c.varies and not (c + c).varies and (c + a).varies
    samples = hc.Samples(np.array([0.0, 1.0]), np.ones((2, 2)))
    for x in (a + b, samples, hc.Chirp((1.0, 0.0), 1.0, 2.0, 3.0), hc.Pulse((1.0, 0.0), 0.0, 1.0)):
        x(1.0)  # whatever is kept for later does not count
        assert x == dataclasses.replace(x) == pickle.loads(pickle.dumps(x)) and hash(x)
        assert set(dataclasses.asdict(x)) == {f.name for f in dataclasses.fields(x)}
    assert dataclasses.asdict(samples)["values"] == ((1.0, 1.0), (1.0, 1.0))


def test_what_jumps_has_the_value_from_the_jump_on():
    for signal in (hc.Step((1.0, 2.0), 0.5), hc.Pulse((1.0, 2.0), 0.5, 0.2, 0.5)):
        np.testing.assert_array_equal(signal([0.5 - 1e-12, 0.5]), [(0.0, 0.0), (1.0, 2.0)])
    held = hc.Samples((0.0, 0.5), ((0.0, 0.0), (1.0, 2.0)), "hold")
    np.testing.assert_array_equal(held([0.5 - 1e-12, 0.5]), [(0.0, 0.0), (1.0, 2.0)])


@pytest.mark.parametrize(
    "make, field, told",
    [
        (lambda: hc.Step((1.0, 0.0), -1.0), "step.time", ">= 0"),
        (lambda: hc.Step(1.0, 0.0), "step.value", "2 numbers"),
        (lambda: hc.Ramp((1.0, 0.0), 2.0, 2.0), "ramp.end", "> 2"),
        (lambda: hc.Pulse((1.0, 0.0), 0.0, 0.0), "pulse.width", "> 0"),
        (lambda: hc.Pulse((1.0, 0.0), 0.0, 0.2, 0.1), "pulse.period", "> 0.2"),
        (lambda: hc.Chirp((1.0, 0.0), 0.0, 1.0, 1.0), "chirp.low", "> 0"),
        (lambda: hc.Chirp((1.0, 0.0), 2.0, 1.0, 1.0), "chirp.high", ">= 2"),
        (lambda: hc.Samples([0.0, 1.0, 1.0], np.ones((3, 2))), "samples.t[2]", "ascend"),
        (lambda: hc.Samples([0.0, 1.0], [(0, 0), (1, math.nan)]), "samples.values[1]", "finite"),
        (lambda: hc.Samples([0.0, 1.0], [0.0, 1.0]), "samples.values", "pair"),
        (lambda: hc.Samples([], []), "samples.t", "times"),
        (lambda: hc.Samples([0.0], [(0, 0)], "liner"), "samples.between", "'linear'"),
        (lambda: hc.Samples([0.0], [(0, "a")]), "samples.values", "numbers"),
        (lambda: hc.Function(3.0), "function.f", "f(t)"),
        (lambda: hc.Sum(()), "sum.parts", "signals"),
        (lambda: hc.Sum((hc.Multisine(), 1.0)), "sum.parts[1]", "Signal"),
        (lambda: math.inf * hc.Multisine(), "sum.factors[0]", "finite"),
        (lambda: hc.Scenario(muscle=3.0), "muscle", "must be a Signal or None"),
    ],
)
def test_what_is_no_signal_is_refused_by_name(make, field, told):
    with pytest.raises(ParameterError) as e:
        make()
    assert e.value.field == field and told in str(e.value)
    with pytest.raises(TypeError):
        hc.Multisine() + 1.0


@pytest.mark.parametrize(
    "text, kw, field, told",
    [
        ("t,f_x,fy\n0,1,2\n", {}, "columns", "did you mean 'f_x'"),
        ("t,fx,fy\n0,1,2\n0.1,abc,2\n", {}, "path", "line 3, column 'fx'"),
        ("t,fx,fy\n0,1\n", {}, "path", "line 2: must have 3 cells"),
        ("t,fx,fy\n0,1,inf\n", {}, "path", "line 2, column 'fy'"),
        ("", {}, "path", "empty"),
        ("t,fx,fy\n", {}, "path", "line of numbers"),
        ("t,fx,fy\n1,0,0\n0,0,0\n", {}, "samples.t[1]", "ascend"),
        ("t,fx,fy\n0,1,2\n", dict(columns=("t", "fx")), "columns", "three"),
        ("0,1,2\n", {}, "columns", "name its columns"),
    ],
)
def test_bad_files_are_refused_with_place_and_name(tmp_path, text, kw, field, told):
    (tmp_path / "f.csv").write_text(text)
    with pytest.raises(ParameterError) as e:
        hc.Samples.csv(tmp_path / "f.csv", **kw)
    assert e.value.field == field and told in str(e.value)


def test_columns_of_a_file_are_found_by_name(tmp_path):
    text = "\ufeffforce y, time ,other,force x\r\n2,0,a,1\r\n\r\n4,0.5,b,3\r\n"
    (tmp_path / "f.csv").write_text(text, encoding="utf-8", newline="")
    read = hc.Samples.csv(tmp_path / "f.csv", ("time", "force x", "force y"), outside="zero")
    assert read == hc.Samples((0.0, 0.5), ((1.0, 2.0), (3.0, 4.0)), outside="zero")
    assert read == hc.Samples.of(tmp_path / "f.csv", ("time", "force x", "force y"), outside="zero")
    with pytest.raises(ParameterError, match="No such file"):
        hc.Samples.csv(tmp_path / "none.csv")


def test_functions_of_arrays_are_asked_once_and_others_time_by_time():
    calls = []

    def together(t):
        calls.append(np.size(t))
        return np.sin(t), 0.5

    def each(t):
        return (1.0, 0.0) if t < 0.5 else (0.0, t)

    t = np.linspace(0.0, 1.0, 101)
    f = hc.Function(together)
    np.testing.assert_allclose(f(t), np.column_stack((np.sin(t), np.full(101, 0.5))), rtol=1e-12)
    f(t)
    assert sorted(calls) == [1, 1, 1, 101, 101]
    np.testing.assert_allclose(hc.Function(each)(t), [each(x) for x in t])
    # one that takes arrays for something else is found out
    odd = hc.Function(lambda t: (np.max(t), 0.0))
    np.testing.assert_allclose(odd(t)[:, 0], t)


def test_a_unit_that_a_caller_states_goes_before_that_of_the_file(tmp_path):
    path = tmp_path / "force.csv"
    path.write_text("t,fx [N],fy_mN\n0,1,2\n")
    read = hc.Samples.of(path, ("t", "fx", "fy"), units={"fx": "kN", "t": "ms"})
    assert read.values == ((1000.0, 2e-3),)
    for units, told in (
        ({"fz": "N"}, "units = 'fz'"),
        ({"fx": "N/m"}, "not in"),
        ({"fx": "?"}, "fx"),
    ):
        with pytest.raises(ParameterError, match=told):
            hc.Samples.of(path, ("t", "fx", "fy"), units=units)
