"""Limits of virtual walls against stepped maps, quadrature and the published conditions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies.growth import growth_rate
from hapticclay.theory import wall_limits
from hapticclay.theory.loop_passivity import colgate_schenkel
from tests.hunt import HUNTS, examples

DEVICE = hc.Device(mass=0.1, damper=1.0)


@st.composite
def walls(draw, whole=False):
    Ts = draw(st.sampled_from([2e-4, 1e-3, 5e-3]))
    size = draw(st.floats(0.05, 5.0))
    delay = draw(st.sampled_from([0.0, 1.0, 2.0] if whole else [0.0, 0.3, 1.0, 1.5, 2.0]))
    exact = draw(st.booleans())
    hand = draw(st.sampled_from([None, hc.Operator(), hc.Operator(1.0, 5.0, 300.0)]))
    return hc.VirtualWall(
        K=draw(st.floats(0.0, 5.0)) * size / Ts**2 * 0.1,
        B=draw(st.floats(-0.2, 0.8)) * size / Ts,
        M=draw(st.sampled_from([0.0, 0.2])) * size,
        device=hc.Device(mass=size, damper=draw(st.floats(0.0, 0.5)) * size / Ts),
        operator=hand,
        Ts=Ts,
        delay=delay * Ts,
        velocity="exact" if exact else "difference",
        velocity_window=1 if exact else draw(st.integers(1, 4)),
        velocity_filter=None if exact else draw(st.sampled_from([None, 0.05 / Ts])),
    )


class Stepped:
    """A wall as its definition says it, event by event; shares nothing with the map."""

    def __init__(self, wall, omega=0.0, push=0.0, x=0.0, v=0.0):
        d, h = wall.device, wall.hand
        m = d.mass + h.mass
        # place, velocity, held force, force of the hand
        self.a = np.zeros((4, 4), dtype=complex)
        self.a[0, 1] = 1.0
        self.a[1] = [-h.spring / m, -(d.damper + h.damper) / m, 1.0 / m, push / m]
        self.a[3, 3] = 1j * omega
        self.z = np.array([x, v, 0.0, 1.0], dtype=complex)
        self.wall, self.past, self.w, self.last, self.queue = wall, [], 0.0, 0.0, []
        self.past = [0.0] * (wall.velocity_window + 1)

    def sample(self):
        """One sample; yields the pieces of the hold as (state before, length)."""
        w, T = self.wall, self.wall.Ts
        x = self.z[0]
        self.past = [*self.past[1:], x]
        v = self.z[1]
        if w.velocity == "difference":
            v = (x - self.past[0]) / (w.velocity_window * T)
            if w.velocity_filter is not None:
                keep = math.exp(-2.0 * math.pi * w.velocity_filter * T)
                v = keep * self.w + (1.0 - keep) * v
        self.w = v
        self.queue.append([w.delay, -(w.K * x + w.B * v + w.M * (v - self.last) / T)])
        self.last = v
        left, pieces = T, []
        while left > 1e-12 * T:
            if self.queue and self.queue[0][0] <= 1e-9 * T:
                self.z[2] = self.queue.pop(0)[1]
            h = min(left, self.queue[0][0] if self.queue else math.inf)
            pieces.append((self.z.copy(), h))
            self.z = expm(h * self.a) @ self.z
            for entry in self.queue:
                entry[0] -= h
            left -= h
        return pieces


@examples(15)
@given(walls())
def test_the_map_makes_the_samples_of_a_stepped_wall(wall):
    less = wall_limits.wall_differences(wall)
    z = np.zeros(len(less))
    z[0], z[1] = 1e-3, 0.02
    moves = wall.B or wall.M
    if moves and wall.velocity == "difference":
        z[2] = z[0]  # came from 0 within the last sample
    other = Stepped(wall, x=z[0], v=z[1])
    for _ in range(15):
        place = other.z[0]
        assert z[0] == pytest.approx(place.real, rel=1e-8, abs=1e-8 * np.abs(z[:2]).max())
        z = z + less @ z
        other.sample()


@examples(12)
@given(walls())
def test_the_band_ends_where_the_wall_becomes_unstable(wall):
    low, high = hc.walls.stiffness_band(wall)
    if 0.0 < high < math.inf:
        for K, stable in (
            (0.5 * (low + high), True),
            (0.9999 * high, True),
            (1.0001 * high, False),
        ):
            assert hc.walls.stable_wall(replace(wall, K=K)) == stable
    if low:
        assert not hc.walls.stable_wall(replace(wall, K=0.999 * low))
    if not high:
        scale = (wall.device.mass + wall.hand.mass) / wall.Ts**2
        assert not any(hc.walls.stable_wall(replace(wall, K=K * scale)) for K in (1e-4, 1e-2, 1.0))


@examples(15)
@given(st.floats(-0.9, 3.0), st.floats(1e-3, 5.0), st.sampled_from([0.0, 1.0]), st.booleans())
def test_jury_in_closed_form_is_the_band(beta, b, samples, hand):
    Ts, m = 1e-3, 0.4 if hand else 0.1
    wall = hc.VirtualWall(
        B=beta * b * m / Ts,
        device=hc.Device(mass=0.1, damper=b * m / Ts),
        operator=hc.Operator(0.3, 0.0, 0.0) if hand else None,
        Ts=Ts,
        delay=samples * Ts,
    )
    high = hc.walls.stiffness_band(wall)[1]
    assert hc.walls.jury_limit(wall) == pytest.approx(high, rel=1e-6, abs=1e-9 * m / Ts**2)


def test_without_damper_the_closed_form_is_that_of_two_samples():
    # b = 0, no delay: z^3 + (-2 + (a + c)/2) z^2 + (1 + a/2) z - c/2, a = K Ts^2/m, c = B Ts/m;
    # Jury: 1 - c^2/4 > |1 + a/2 + c/2 (-2 + (a + c)/2)|, so a < 2 c (2 - c)/(2 + c)
    c = 0.7
    wall = hc.VirtualWall(device=hc.Device(mass=0.1), B=c * 0.1 / 1e-3)
    asked = (4.0 * c - 2.0 * c * c) / (2.0 + c) * 0.1 / 1e-6
    assert hc.walls.jury_limit(wall) == pytest.approx(asked, rel=1e-9)


@pytest.mark.parametrize("samples", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("damper", [0.0, 1.0, 2000.0])
def test_the_boundary_of_hulin_is_that_of_the_bands(samples, damper):
    B, K = hc.walls.hulin_boundary(0.1, damper, 1e-3, samples, 21)
    assert B[0] == -damper and K[0] == 0.0
    for b, k in list(zip(B, K, strict=True))[1:-1]:
        wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=damper), B=b, delay=samples * 1e-3)
        ends = hc.walls.stiffness_band(wall)
        assert min(abs(end - k) for end in ends) < 1e-7 * K.max()


@pytest.mark.parametrize(
    ("samples", "one", "five"), [(0.0, 0.0095, 0.048), (1.0, 0.0085, 0.042), (2.0, 0.0066, 0.032)]
)
def test_the_linear_rule_holds_in_its_range(samples, one, five):
    # docs/equations.md, section 7, states these values of (b + B) Ts/m
    for x, share in ((one, 0.01), (five, 0.05)):
        for b in (0.0, 0.5, 1.0):
            wall = hc.VirtualWall(
                device=hc.Device(mass=1.0, damper=b * x / 1e-3), B=(1.0 - b) * x / 1e-3,
                delay=samples * 1e-3,
            )  # fmt: skip
            error = hc.walls.hulin_limit(wall) / hc.walls.stiffness_band(wall)[1] - 1.0
            assert abs(error) < share


# ---- runs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parts",
    [
        dict(delay=0.0),
        dict(delay=5e-4),
        dict(delay=1e-3),
        dict(delay=2e-3),
        dict(delay=3e-4, velocity_window=3),
    ],
)
def test_runs_grow_beyond_the_band_and_decay_within_it(parts):
    wall = hc.VirtualWall(B=5.0, device=DEVICE, **parts)
    limit = hc.walls.stiffness_band(wall)[1]
    rates = [
        growth_rate(hc.simulate(replace(wall, K=x * limit).scenario(1.2, push=1e-4)), "x")
        for x in (0.998, 1.002)
    ]
    assert rates[0] < 0.0 < rates[1]


# ---- passivity -----------------------------------------------------------------------------------


@given(st.floats(0.1, 50.0), st.floats(-60.0, 60.0), st.sampled_from([1e-4, 1e-3]))
def test_the_passive_stiffness_is_that_of_colgate_and_schenkel(b, B, Ts):
    wall = hc.VirtualWall(B=B, device=hc.Device(damper=b), Ts=Ts)
    K = hc.walls.colgate_schenkel_limit(wall)
    assert K == pytest.approx(max(0.0, 2.0 * (b - abs(B)) / Ts), rel=1e-12)
    if K:
        least = hc.walls.passivity_index(
            replace(wall, K=K), np.linspace(1e-3, 1.0, 999) * math.pi / Ts
        )
        assert least.min() == pytest.approx(0.0, abs=2e-5 * b)


@examples(12)
@given(walls(whole=True))
def test_with_window_filter_and_delay_the_condition_decides(wall):
    wall = replace(wall, velocity="difference", velocity_window=wall.velocity_window, operator=None)
    K, Ts = hc.walls.colgate_schenkel_limit(wall), wall.Ts
    whole = round(wall.delay / Ts)
    keep = (
        0.0 if wall.velocity_filter is None else math.exp(-2 * math.pi * wall.velocity_filter * Ts)
    )

    def H(z, K):
        D = (
            (1.0 - z**-wall.velocity_window)
            / (wall.velocity_window * Ts)
            * (1.0 - keep)
            / (1.0 - keep / z)
        )
        return (K + (wall.B + wall.M * (1.0 - 1.0 / z) / Ts) * D) / z**whole

    def passive(K):
        return colgate_schenkel(lambda z: H(z, K), Ts, wall.device.damper).margin

    size = wall.device.damper + K * Ts
    if K:
        assert passive(0.999 * K) > -1e-6 * size and passive(1.001 * K) < 1e-6 * size
    else:
        assert passive(1e-3 * max(wall.device.damper, 1.0) / Ts) < 1e-6 * (size + abs(wall.B))


@examples(25)
@given(
    st.floats(0.02, 0.98), st.floats(0.02, 1.0), st.integers(0, 3), st.floats(1e-3, 3.0),
    st.floats(-0.5, 0.5),
)  # fmt: skip
def test_a_fraction_of_delay_asks_for_what_the_worst_middle_does(part, turn, whole, K, B):
    # energy per sample of samples exp(j k a) and middles Q exp(j k a): a quadratic in Q
    Ts, b, a = 1e-3, 1.0, math.pi * turn
    wall = hc.VirtualWall(
        K=K * b / Ts, B=B * b, device=hc.Device(damper=b), Ts=Ts, delay=(whole + part) * Ts
    )
    z = np.exp(1j * a)
    H = (wall.K + wall.B * (1.0 - 1.0 / z) / Ts) / z**whole

    def left(b, Q):
        lost = b * (abs(Q - 1.0) ** 2 / part + abs(z - Q) ** 2 / (1.0 - part)) / Ts
        return lost + (np.conj(H) * (z - 1.0) * Q).real

    asked = b - hc.walls.passivity_index(wall, a / Ts)[0]
    at_limit = replace(wall, device=hc.Device(damper=asked))
    worst = wall_limits.worst_middle(at_limit, a)
    scale = abs(H) + asked / Ts
    assert left(asked, worst) == pytest.approx(0.0, abs=1e-9 * scale)  # none to spare, and
    for step in (1e-3, 1e-3j, -1e-3, -1e-3j):  # every other middle leaves more
        assert left(asked, worst + step) >= left(asked, worst)


def test_a_fraction_of_delay_lies_between_whole_ones():
    def limit(samples):
        wall = hc.VirtualWall(B=0.1, device=DEVICE, delay=samples * 1e-3)
        return hc.walls.colgate_schenkel_limit(wall)

    found = [limit(x) for x in (0.0, 1e-6, 0.3, 0.7, 1.0 - 1e-6, 1.0)]
    assert found[0] == pytest.approx(found[1], rel=1e-2)  # sqrt of the fraction
    assert found[-1] == pytest.approx(found[-2], rel=1e-2)
    assert sorted(found[1:], reverse=True) == found[1:]


def test_an_exact_velocity_is_not_passive():
    wall = hc.VirtualWall(B=0.1, device=DEVICE, velocity="exact")
    assert hc.walls.colgate_schenkel_limit(wall) == 0.0
    assert hc.walls.passivity_index(wall, 10.0)[0] == -math.inf
    assert hc.walls.colgate_schenkel_limit(replace(wall, B=0.0)) == pytest.approx(2000.0)


def test_friction_and_quantum():
    wall = hc.VirtualWall(device=hc.Device(0.1, 5.0, friction=0.02, quantum=1e-5))
    assert hc.walls.abbott_okamura_limit(wall) == pytest.approx(2.0 * 0.02 / 1e-5)
    assert hc.walls.abbott_okamura_limit(replace(wall, Ts=5e-3)) == pytest.approx(2.0 * 5.0 / 5e-3)
    assert hc.walls.abbott_okamura_limit(replace(wall, device=DEVICE)) == pytest.approx(2000.0)
    for field in ("B", "M", "delay"):
        with pytest.raises(ParameterError, match=f"wall.{field}"):
            hc.walls.abbott_okamura_limit(replace(wall, **{field: 1e-3}))


# ---- what the hand feels -------------------------------------------------------------------------


STEADY = (
    dict(),
    dict(delay=0.4e-3, velocity_window=3, velocity_filter=80.0),
    dict(delay=2e-3, M=0.02),
    dict(velocity="exact", delay=1e-3),
)
TURNS = ((1, 17), (2, 5), (9, 10), (13, 7))


@pytest.mark.parametrize(
    "parts, turn",
    [
        (parts, turn)
        for i, parts in enumerate(STEADY)
        for j, turn in enumerate(TURNS)
        if HUNTS or (i + j) % 2 == 0
    ],
)
def test_the_impedance_is_that_of_the_steady_motion(turn, parts):
    wall = hc.VirtualWall(K=400.0, B=2.0, device=hc.Device(0.1, 3.0), **parts)
    p, q = turn  # omega Ts = pi p/q: the motion repeats itself after 2 q samples
    omega = math.pi * p / (q * wall.Ts)
    assert hc.walls.stable_wall(wall)
    stepped = Stepped(wall, omega=omega, push=1.0)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    total, t = 0.0, 0.0
    settled = 2 * q * math.ceil(3000 / (2 * q))
    for k in range(settled + 2 * q):
        for z, h in stepped.sample():
            if k >= settled:
                for x, w in zip(0.5 * h * (nodes + 1.0), 0.5 * h * weights, strict=True):
                    v = (expm(x * stepped.a) @ z)[1]
                    total += w * v * np.exp(-1j * omega * (t + x))
            t += h
    # the hand's force at t is exp(j omega t)
    V = total / (2 * q * wall.Ts)
    assert hc.walls.wall_impedance(wall, omega)[0] == pytest.approx(1.0 / V, rel=1e-7)


def test_a_slow_hand_feels_spring_and_dampers():
    wall = hc.VirtualWall(K=800.0, B=2.0, device=hc.Device(0.1, 3.0))
    omega = np.array([1e-3, 1e-2])
    asked = 800.0 / (1j * omega) + 5.0 - 800.0 * 0.5e-3
    assert hc.walls.wall_impedance(wall, omega) == pytest.approx(asked, rel=1e-6)
    assert hc.walls.wall_impedance(replace(wall, K=0.0, B=0.0), omega) == pytest.approx(
        0.1j * omega + 3.0, rel=1e-12
    )


# ---- hands and refusals --------------------------------------------------------------------------


def test_no_hand_of_the_box_is_worse_than_its_limit():
    wall = hc.VirtualWall(B=5.0, device=DEVICE, delay=1e-3, velocity_filter=100.0)
    box = hc.theory.Box(mass=(0.0, 1.0), damper=(0.0, 8.0), spring=(0.0, 500.0))
    limit = hc.walls.hand_box_limit(wall, box)
    for hand in [*box.corners(), *box.sample(40)]:
        assert hc.walls.stiffness_band(replace(wall, operator=hand))[1] >= (1.0 - 1e-6) * limit
    one = hc.theory.Box(mass=(0.2, 0.2), damper=(1.0, 1.0), spring=(5.0, 5.0))
    alone = hc.walls.stiffness_band(replace(wall, operator=hc.Operator(0.2, 1.0, 5.0)))[1]
    assert hc.walls.hand_box_limit(wall, one) == alone


def test_a_free_device_is_stable_if_it_is_damped():
    assert hc.walls.stable_wall(hc.VirtualWall(device=DEVICE))
    assert not hc.walls.stable_wall(hc.VirtualWall())
    assert hc.walls.stiffness_band(hc.VirtualWall()) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("ask", "field"),
    [
        (lambda w: hc.walls.hand_box_limit(w, 1.0), "box"),
        (lambda w: hc.walls.wall_impedance(w, [0.0]), "omega"),
        (lambda w: hc.walls.passivity_index(w, [[1.0]]), "omega"),
        (lambda w: hc.walls.jury_limit(replace(w, delay=5e-4)), "wall.delay"),
        (lambda w: hc.walls.jury_limit(replace(w, velocity_window=2)), "wall.velocity_window"),
        (lambda w: hc.walls.stable_wall(replace(w, velocity_window=700)), "wall.velocity_window"),
        (lambda w: hc.walls.hulin_boundary(0.1, 1.0, 1e-3, 101.0), "samples"),
    ],
)
def test_what_is_refused(ask, field):
    with pytest.raises(ParameterError, match=field):
        ask(hc.VirtualWall(B=1.0, device=DEVICE))
