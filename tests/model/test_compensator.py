"""Any compensator: what is taken and refused, its realisation, and its states over a step."""

import math
from decimal import Decimal

import control
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import signal
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import compensator as formula
from hapticclay.kernel import records, servo
from hapticclay.model import compensator
from hapticclay.model.compensator import ORDER, Compensator

EPS = np.finfo(float).eps
OMEGA = np.logspace(-2, 5, 40)
fast_or_slow = st.just(0.0) | st.floats(-1, 5).map(lambda e: 10.0**e)  # [rad/s]


def pair_of(r, angle):
    """Two complex poles of this size."""
    p = -r * np.exp(1j * angle)
    return [p, p.conjugate()]


groups = st.one_of(
    fast_or_slow.map(lambda r: [-r]),
    fast_or_slow.map(lambda r: [-r, -r]),
    st.builds(pair_of, fast_or_slow, st.floats(0.0, 0.5 * math.pi)),
)
poles = st.lists(groups, min_size=1, max_size=ORDER).map(
    lambda gs: [p for g in gs for p in g][: ORDER + 1]
)


def closed(roots):
    """Whether each complex root has its conjugate, and the order is allowed."""
    return 1 <= len(roots) <= ORDER and abs(sum(roots).imag) <= 0.0


poles = poles.filter(closed)


@st.composite
def shapes(draw):
    """Compensators of orders 1 to 4, with real zeros up to as many."""
    p = draw(poles)
    zeros = draw(st.lists(st.floats(-1e3, 1e3), max_size=len(p)))
    return Compensator.zpk(zeros, p, draw(st.floats(0.1, 10.0)))


def response(c, s):
    return np.polyval(c.num, s) / np.polyval(c.den, s)


# ---- what is taken


def test_coefficients_are_divided_by_the_first_of_the_denominator():
    c = Compensator((0.0, 3.0, 6.0), (0.0, 2.0, 20.0, 0.0))
    assert (c.num, c.den) == ((1.5, 3.0), (1.0, 10.0, 0.0)) and c.order == 2
    assert Compensator([3], [2.0, 20, 0]) == Compensator((1.5,), (1.0, 10.0, 0.0))  # type: ignore[arg-type]


def test_printed_one():
    assert Compensator() == compensator.PRINTED == Compensator.zpk([], [0.0, -10.0])
    assert Compensator().lag == (1.0, 10.0)
    A, B, C, D = Compensator().state_space()  # its states are delta and its rate
    assert (A.tolist(), B.tolist(), C.tolist(), D) == ([[0, 1], [0, -10]], [0, 1], [1, 0], 0.0)


@pytest.mark.parametrize(
    "c,lag",
    [
        (Compensator((3.0,), (1.0, 0.5, 0.0)), (3.0, 0.5)),
        (Compensator((1.0,), (1.0, 0.0, 0.0)), (1.0, 0.0)),
        (Compensator((1.0,), (1.0, -1.0, 0.0)), None),
        (Compensator((1.0,), (1.0, 10.0, 1e-9)), None),
        (Compensator((1.0, 2.0), (1.0, 10.0, 0.0)), None),
        (Compensator((1.0,), (1.0, 0.0)), None),
    ],
)
def test_which_ones_are_an_integrator_behind_a_lag(c, lag):
    assert c.lag == lag


@given(shapes())
def test_roots_give_the_response_that_they_stand_for(c):
    num, den = c.fraction
    s = 1j * OMEGA
    np.testing.assert_array_equal(num.coef, c.num[::-1])
    np.testing.assert_array_equal(den.coef, c.den[::-1])
    assert (len(c.poles), len(c.zeros)) == (c.order, len(c.num) - 1)
    np.testing.assert_allclose(num(s) / den(s), response(c, s), rtol=1e-9)


@given(
    st.lists(st.floats(-1e3, 1e3), max_size=2),
    poles.filter(lambda p: len(p) > 1),
    st.floats(0.1, 9),
)
def test_zpk_is_the_product_of_its_factors(zeros, p, gain):
    c, s = Compensator.zpk(zeros, p, gain), 1j * OMEGA
    # a sum of coefficients where the product is near 0 loses digits: beside the largest terms
    num = np.prod([s - z for z in zeros], axis=0) * gain if zeros else gain * np.ones(len(s))
    den = np.prod([s - x for x in p], axis=0)
    for found, exact, coefficients in ((c.num, num, c.num), (c.den, den, c.den)):
        terms = np.polyval(np.abs(coefficients), OMEGA)
        assert np.all(np.abs(np.polyval(found, s) - exact) <= 40 * EPS * terms)


SYSTEMS = {
    "control.tf": lambda: control.tf([2.0, 8.0], [2.0, 24.0, 0.0]),
    "control.zpk": lambda: control.zpk([-4.0], [0.0, -12.0], 1.0),
    "control.ss": lambda: control.ss([[0, 1], [0, -12.0]], [[0], [1]], [[4.0, 1.0]], [[0.0]]),
    "control.tf2ss": lambda: control.ss(control.tf([1.0, 4.0], [1.0, 12.0, 0.0])),
    "scipy tf": lambda: signal.TransferFunction([2.0, 8.0], [2.0, 24.0, 0.0]),
    "scipy zpk": lambda: signal.ZerosPolesGain([-4.0], [0.0, -12.0], 1.0),
    "scipy ss": lambda: signal.StateSpace([[0, 1], [0, -12.0]], [[0], [1]], [[4.0, 1.0]], [[0.0]]),
    "scipy lti": lambda: signal.lti([1.0, 4.0], [1.0, 12.0, 0.0]),
    "coefficients": lambda: ([1, 4], [1, 12, 0]),
    "arrays": lambda: (np.array([1.0, 4.0]), np.array([1.0, 12.0, 0.0])),
    "Compensator": lambda: Compensator((1.0, 4.0), (1.0, 12.0, 0.0)),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_of_other_packages(name):
    c = Compensator.of(SYSTEMS[name]())
    assert c.order == 2 and len(c.num) == 2
    np.testing.assert_allclose(c.num, (1.0, 4.0), rtol=1e-12)
    np.testing.assert_allclose(c.den, (1.0, 12.0, 0.0), rtol=1e-12, atol=1e-12)
    assert hc.free(inertia_shaping=True).compensator == Compensator()


@pytest.mark.parametrize("name", [n for n in SYSTEMS if n not in ("coefficients", "arrays")])
def test_a_scenario_takes_them_for_one_axis_or_both(name):
    system, c = SYSTEMS[name](), Compensator.of(SYSTEMS[name]())
    assert hc.Scenario(compensator=system).compensators == (c, c)
    assert hc.Scenario(compensator=(Compensator(), system)).compensators == (Compensator(), c)


@example(Compensator((1.0, 0.0, 0.0), (1.0, 737.9242694454202, 133352.14321633242)))
@given(shapes())
def test_state_space_of_another_package_keeps_the_response(c):
    """By way of python-control's and SciPy's realisations; those of fast poles lose digits."""
    if max(np.abs(c.poles)) > 1e3:
        return
    s = 1j * OMEGA

    def size(numerator):
        return np.abs(np.polyval(np.abs(numerator), OMEGA) / np.polyval(c.den, s))

    # numerators come from a difference of polynomials of the size of the denominator
    allowed = 1e-6 * size(c.num) + 1e-12 * np.max(np.abs(c.num)) * size(c.den)
    for system in (control.ss(control.tf(c.num, c.den)), signal.lti(c.num, c.den).to_ss()):
        back = Compensator.of(system)
        whole = np.multiply(c.num[0], c.den)
        gain = len(c.num) == len(c.den) and np.allclose(c.num, whole, 1e-12, 1e-12)
        assert back.order == c.order or (gain and back.order == 0)
        assert np.all(np.abs(response(back, s) - response(c, s)) <= allowed)


# ---- what is refused


@pytest.mark.parametrize(
    "system,said",
    [
        (lambda: control.tf([1.0], [1.0, -0.5], 0.01), "continuous time"),
        (lambda: control.tf([1.0], [1.0, -0.5], True), "continuous time"),
        (lambda: control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.01), "continuous time"),
        (lambda: signal.dlti([1.0], [1.0, -0.5], dt=0.01), "continuous time"),
        (lambda: control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "one input"),
        (
            lambda: control.tf([[[1.0], [1.0]]], [[[1.0, 1.0], [1.0, 2.0]]]),
            "one input",
        ),
        (
            lambda: signal.StateSpace(-np.eye(2), np.ones((2, 1)), np.eye(2), np.zeros((2, 1))),
            "one input",
        ),
        (
            lambda: signal.StateSpace(-np.eye(2), np.eye(2), np.ones((1, 2)), np.zeros((1, 2))),
            "one input",
        ),
        (lambda: control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "proper"),
        (lambda: signal.TransferFunction([1.0, 0.0, 0.0], [1.0, 1.0]), "proper"),
        (lambda: "PID", "must be a Compensator"),
        (lambda: 3.0, "must be a Compensator"),
        (lambda: None, "must be a Compensator"),
        (lambda: ([1.0], [1.0, 2.0], 3.0), "must be a Compensator"),
        (lambda: (["a"], [1.0]), "must be a Compensator"),
    ],
)
def test_systems_that_are_refused(system, said):
    for take in (Compensator.of, lambda c: hc.Scenario(compensator=c)):
        with pytest.raises(ParameterError, match=said) as e:
            take(system())
        assert e.value.field.startswith("compensator")


@pytest.mark.parametrize(
    "num,den,field",
    [
        ((1.0, 0.0, 0.0), (1.0, 1.0), "num"),
        ((0.0,), (1.0, 1.0), "num"),
        ((), (1.0, 1.0), "num"),
        ((1.0,), (0.0, 0.0), "den"),
        ((1.0,), (), "den"),
        ((1.0,), (1.0,) * 6, "den"),
        ((1.0,), (float("nan"), 1.0), "den"),
        ((float("inf"),), (1.0, 1.0), "num"),
        ((1.0,), ("s", 1.0), "den"),
        (3.0, (1.0, 1.0), "num"),
        ((1e300,), (1e-300, 1.0), "num"),
    ],
)
def test_bad_coefficients_are_refused(num, den, field):
    with pytest.raises(ParameterError) as e:
        Compensator(num, den)
    assert e.value.field.startswith(f"compensator.{field}")


@pytest.mark.parametrize(
    "zeros,p,field",
    [
        ([], [-1.0 + 1j], "poles"),
        ([-1j], [-1.0, -2.0], "zeros"),
        ([-1.0, -2.0], [-1.0], "num"),
        (["fast"], [-1.0], "zeros"),
        ([], [-1.0] * 5, "den"),
    ],
)
def test_bad_roots_are_refused(zeros, p, field):
    with pytest.raises(ParameterError) as e:
        Compensator.zpk(zeros, p)
    assert e.value.field == f"compensator.{field}"


# ---- its realisation


def at_frequencies(A, B, C, D):
    n = len(B)
    return np.array([C @ np.linalg.solve(1j * w * np.eye(n) - A, B) + D for w in OMEGA])


@given(shapes())
def test_state_space_answers_as_that_of_scipy(c):
    A, B, C, D = signal.tf2ss(np.atleast_1d(c.num), np.atleast_1d(c.den))
    own, other = (
        at_frequencies(*c.state_space()),
        at_frequencies(A, B[:, 0], C[0], float(D[0, 0])),
    )
    # beside the terms that its zeros cancel; a solution keeps as many digits as poles are apart
    scale = np.polyval(np.abs(c.num), OMEGA) / np.abs(np.polyval(c.den, 1j * OMEGA)) + abs(D[0, 0])
    size = np.polyval(np.abs(c.den), OMEGA) / np.abs(np.polyval(c.den, 1j * OMEGA))
    assert np.all(np.abs(own - other) <= 1e-9 * scale * size)


def test_a_gain_alone_has_no_states():
    A, B, C, D = Compensator((2.0,), (4.0,)).state_space()
    assert (A.shape, B.shape, C.shape, D) == ((0, 0), (0,), (0,), 0.5)


STATELESS = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[0.5]]
GAINS = {
    "control.tf": lambda: control.tf([2.0], [4.0]),
    "control.zpk": lambda: control.zpk([], [], 0.5),
    "control.ss": lambda: control.ss([], [], [], [[0.5]]),
    "control.tf2ss": lambda: control.ss(control.tf([2.0], [4.0])),
    "control product": lambda: control.ss([], [], [], [[0.25]]) * 2.0,
    "scipy tf": lambda: signal.TransferFunction([2.0], [4.0]),
    "scipy zpk": lambda: signal.ZerosPolesGain([], [], 0.5),
    "scipy ss": lambda: signal.StateSpace(*STATELESS),
    "scipy tf2ss": lambda: signal.TransferFunction([2.0], [4.0]).to_ss(),  # a state at 0, unseen
    "scipy zpk2ss": lambda: signal.ZerosPolesGain([], [], 0.5).to_ss(),
    "not driven": lambda: control.ss(-np.eye(2), np.zeros((2, 1)), np.ones((1, 2)), [[0.5]]),
    "not seen": lambda: control.ss([[0, 1], [0, 2.0]], [[0], [1]], np.zeros((1, 2)), [[0.5]]),
}


@pytest.mark.parametrize("name", GAINS)
def test_gains_of_other_packages_have_no_states(name):
    """Exactly, and at any frequency what their own package answers, within roundings."""
    system = GAINS[name]()
    c = Compensator.of(system)
    assert (c.num, c.den, c.order) == ((0.5,), (1.0,), 0)
    s = hc.Scenario(compensator=(system, Compensator()))
    assert s.compensators == (c, Compensator())
    assert hc.Scenario(compensator=system).compensators == (c, c)
    theirs = signal.freqresp(system, OMEGA)[1] if "scipy" in name else system(1j * OMEGA)
    np.testing.assert_allclose(response(c, 1j * OMEGA), theirs, rtol=1e-14)


@pytest.mark.parametrize("name", ["control.ss", "scipy ss"])
def test_a_gain_of_zero_is_refused_as_a_numerator_of_zeros(name):
    make = control.ss if name == "control.ss" else signal.StateSpace
    with pytest.raises(ParameterError, match="not all of them 0") as e:
        Compensator.of(make(*STATELESS[:3], [[0.0]]))
    assert e.value.field == "compensator.num"


@given(shapes())
def test_numbers_for_the_loops_are_the_realisation_and_zeros(c):
    form, n = np.array(compensator.form_numbers(c)), c.order
    A, B, C, D = c.state_space()
    a, b, out = form[:16].reshape(ORDER, ORDER), form[16:20], form[20:24]
    for own, all_of_it in ((A, a[:n, :n]), (B, b[:n]), (C, out[:n])):
        np.testing.assert_array_equal(own, all_of_it)
    assert form[24] == D and not a[n:].any() and not a[:, n:].any()
    assert len(form) == formula.FORM and not b[n:].any() and not out[n:].any()


# ---- how a step carries its states


def formed(numbers, order):
    """A model with gains of 1 and the numbers of both compensators."""
    m = records.Model()
    m.formed, m.order, m.form[:], m.x.K, m.y.K = 1, order, numbers, 1.0, 1.0
    return m


def held(form, n, i, h):
    """Phi and Gamma of `exponential`, of the whole size, begun at a place that is not 0."""
    e = [math.nan] * formula.WORK
    for j in range(40):
        e[j] = 0.0
    formula.exponential(form, n, i, h, e, 20)
    assert not any(e[:20])
    return np.array(e[20:36]).reshape(ORDER, ORDER), np.array(e[36:40])


def augmented(c, h):
    A, B, _, _ = c.state_space()
    n = c.order
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A, B
    return M * h


@given(shapes(), shapes(), st.just(0.0) | st.floats(-7, -1).map(lambda e: 10.0**e))
def test_exponential_is_that_of_scipy(x, y, h):
    form, n = compensator.form_numbers(x) + compensator.form_numbers(y), max(x.order, y.order)
    for i, c in enumerate((x, y)):
        Phi, Gamma = held(form, n, i, h)
        M, own = augmented(c, h), c.order
        E = expm(M)
        # squaring doubles what came before, as often as the norm is a power of 2; in SciPy as well
        bound = 2000 * EPS * max(1.0, np.abs(M).sum(axis=1).max())
        P, G = Phi[:own, :own], Gamma[:own]
        np.testing.assert_allclose(P, E[:own, :own], atol=bound * np.abs(E).max())
        np.testing.assert_allclose(G, E[:own, own], atol=bound * np.abs(E[:own, own]).max())
        np.testing.assert_array_equal(Phi[own:n, own:n], np.eye(n - own))  # states without a part
        assert not Gamma[own:].any() and not Phi[:own, own:].any() and not Phi[own:, :own].any()


def exact_exponential(M):
    """By its series in 60 digits, scaled and squared."""
    from decimal import localcontext

    with localcontext() as context:
        context.prec = 60
        n = len(M)
        a = [[Decimal(float(x)) for x in row] for row in M]
        halvings = max(0, math.ceil(math.log2(max(1.0, np.abs(M).sum(axis=1).max()))) + 1)
        a = [[x / 2**halvings for x in row] for row in a]

        def times(p, q):
            return [[sum(p[i][k] * q[k][j] for k in range(n)) for j in range(n)] for i in range(n)]

        total = [[Decimal(int(i == j)) for j in range(n)] for i in range(n)]
        term = total
        for k in range(1, 45):
            term = [[x / k for x in row] for row in times(term, a)]
            total = [
                [p + q for p, q in zip(r, s, strict=True)] for r, s in zip(total, term, strict=True)
            ]
        for _ in range(halvings):
            total = times(total, total)
        return np.array([[float(x) for x in row] for row in total])


@pytest.mark.parametrize(
    "p,h",
    [
        ([0.0, -10.0], 1.8e-4),
        ([-35195.0, -35195.0], 5e-4),
        ([-1e5, -1e5], 0.1),
        ([-1e5, -1e5, -1e5, 0.0], 0.1),
        ([-1e5 + 1e5j, -1e5 - 1e5j, -10.0, 0.0], 0.01),
        ([-9e4, 0.0, -33.7, -33.7], 0.072),
        ([-1e-3, -1e5], 0.1),
        ([0.0, 0.0, 0.0, 0.0], 0.1),
        ([3.0, -2.0 + 50.0j, -2.0 - 50.0j], 0.1),
    ],
)
def test_exponential_keeps_its_digits(p, h):
    c = Compensator.zpk([], p)
    n = c.order
    form = compensator.form_numbers(c) * 2
    E = exact_exponential(augmented(c, h))
    for i in (0, 1):
        Phi, Gamma = held(form, n, i, h)
        # beside the largest: slow states that a fast pole drives are sums that nearly cancel
        np.testing.assert_allclose(Phi[:n, :n], E[:n, :n], atol=1e-11 * np.abs(E).max())
        np.testing.assert_allclose(Gamma[:n], E[:n, n], atol=1e-11 * np.abs(E[:n, n]).max())


@given(
    shapes(),
    st.floats(1e-6, 1e-2),
    st.just(1.0) | st.floats(0.0, 1.0),
    st.tuples(*[st.floats(-1, 1)] * 5),
)
def test_a_kick_shows_the_output_at_its_sample_and_ends_half_a_step_later(c, before, share, x):
    """Half a step to the sample and half a step on, each by SciPy's exponential.

    Between equal steps the force is held, between others it is one impulse at the sample.
    """
    if max(np.abs(c.poles)) > 1e3:
        return  # the digits of fast ones: above
    after, f, n = share * before, x[4], c.order
    other = Compensator((1.0, 3.0), (1.0, 2.0))
    form = compensator.form_numbers(other) + compensator.form_numbers(c)
    z = list(x[:n]) + [0.0] * (ORDER - n)
    _, B, C, D = c.state_space()
    held_force, early, whole = (f, 0.0, 0.0) if before == after else (0.0, after, before + after)
    at = expm(augmented(c, 0.5 * before)) @ (*x[:n], held_force)
    kicked = at[:n] + 0.5 * whole * B * f
    end = expm(augmented(c, 0.5 * after)) @ (*kicked, held_force)
    at[:n] += 0.5 * early * B * f
    m, s, k = formed(form, max(n, 1)), records.State(), records.Kick()
    s.y.z[:], k.y.net, k.before, k.after = z, f, before, after
    servo.output(m, s, k)
    shown = k.y.delta + k.y.feed * f
    scale = np.abs(C).sum() + abs(D)
    assert shown == pytest.approx(C @ at[:n] + D * f, abs=1e-11 * scale * (1 + np.abs(at).max()))
    servo.advance_states(m, s, k, 1)
    z = k.y.z
    bound = 1e-11 * (1 + np.abs(end).max())
    np.testing.assert_allclose(z[:n], end[:n], atol=bound)
    assert not any(z[n:])


@given(shapes(), st.tuples(*[st.floats(-1, 1)] * 5))
def test_four_stages_are_a_step_of_runge_kutta(c, x):
    """(1 + ha + (ha)^2/2 + (ha)^3/6 + (ha)^4/24) z for z' = A z + B f, f held."""
    n, f = c.order, x[4]
    fastest = max(np.abs(c.poles))
    h = 0.1 / fastest if fastest else 0.1
    M = augmented(c, h)
    out = sum(np.linalg.matrix_power(M, k) / math.factorial(k) for k in range(5)) @ (*x[:n], f)
    start = z = np.array(list(x[:n]) + [0.0] * (ORDER - n))
    numbers = [0.0] * formula.FORM + compensator.form_numbers(c)
    m, rate, end = formed(numbers, n), np.empty(4), start
    for weight, ahead in ((1.0, 0.5 * h), (2.0, 0.5 * h), (2.0, h), (1.0, 0.0)):
        servo.state_rates(m, 1, z, f, rate)
        end, z = end + h / 6.0 * weight * rate, start + ahead * rate
    np.testing.assert_allclose(end[:n], out[:n], atol=1e-13 * (1 + np.abs(out).max()))


# ---- states at the start


@given(shapes(), st.floats(-2.0, 2.0))
def test_states_of_even_motion_give_that_motion(c, v):
    """Under the force that holds it, delta = v t: none if C integrates twice, else v/(s C) at 0."""
    ends = next((k for k, x in enumerate(reversed(c.den)) if x), c.order)
    if max(np.abs(c.poles)) > 1e3 or abs(c.num[-1]) < 1e-3 or (0 < min(map(abs, c.den)) < 1e-3):
        return
    if ends == 0 and v:
        with pytest.raises(ParameterError, match="without an integrator"):
            compensator.moving_states(c, v)
        return
    z, n = compensator.moving_states(c, v), c.order
    f = v * c.den[-2] / c.num[-1] if ends == 1 else 0.0
    assert not any(z[n:])
    _, _, C, D = c.state_space()
    for t in (0.0, 0.01, 0.05):
        at = expm(augmented(c, t)) @ (*z[:n], f)
        terms = np.abs(C) @ np.abs(at[:n]) + abs(D * f)
        assert C @ at[:n] + D * f == pytest.approx(v * t, abs=1e-8 * (terms + abs(v)))


def test_no_rate_is_held_without_an_integrator_however_large_the_numerator():
    c = Compensator((10.0, -12790.0, 3884220.0, -158080320.0), (1.0, 3.0, 3.0, 1.0))
    for size in (1e-6, 1.0, 1e6):
        shape = Compensator(tuple(size * x for x in c.num), c.den)
        with pytest.raises(ParameterError, match="without an integrator"):
            compensator.moving_states(shape, 1.0)


def test_states_at_the_start_as_printed():
    np.testing.assert_allclose(
        compensator.moving_states(Compensator(), 0.3), (0.0, 0.3, 0.0, 0.0), atol=1e-15
    )
    assert compensator.moving_states(Compensator((1.0,), (1.0, 5.0)), 0.0) == [0.0] * ORDER


@pytest.mark.parametrize(
    "c",
    [
        Compensator((1.0,), (1.0, 5.0)),
        Compensator((1.0, 0.0), (1.0, 10.0, 0.0)),
        Compensator((2.0,), (1.0,)),
    ],
)
def test_no_even_motion_without_an_integrator(c):
    with pytest.raises(ParameterError, match="without an integrator") as e:
        compensator.moving_states(c, 0.1)
    assert e.value.field == "velocity"


@pytest.mark.parametrize("given", ["1", "1,40,0", 3.0])
def test_what_is_no_sequence_of_numbers_is_refused_as_such(given):
    with pytest.raises(ParameterError, match="must be a sequence of numbers"):
        Compensator(given)
