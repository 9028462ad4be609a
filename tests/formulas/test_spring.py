"""The laws of clay that springs back, against closed forms and their own energy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.formulas import spring


def cycle(k, limit, x, steps=4001):
    """Force over place, energy stored and lost, along a way x(s)."""
    rest, out, lost = 0.0, [], 0.0
    for p in x:
        rest, f, stored, more = spring.spring_step(k, limit, 0.0, rest, p)
        lost += more
        out.append((p, f, stored, lost))
    return np.array(out)


def test_the_loop_of_an_elastic_plastic_spring():
    # a cycle between -x and x loses 4 F (x - F/k); in the first quarter F (x - F/k)
    k, F, x = 2000.0, 3.0, 0.01
    way = x * np.concatenate((np.linspace(0, 1, 500), np.linspace(1, -1, 1000)[1:],
                              np.linspace(-1, 1, 1000)[1:]))  # fmt: skip
    out = cycle(k, F, way)
    assert np.abs(out[:, 1]).max() == F
    area = 4.0 * F * (x - F / k)
    assert out[-1, 3] - out[499, 3] == pytest.approx(area, rel=1e-12)  # sums of 2000 terms
    assert out[499, 3] == pytest.approx(F * (x - F / k), rel=1e-12)
    p, f = out[499:, 0], out[499:, 1]
    # by the trapezium rule, but for the corners in single steps of it
    assert np.trapezoid(f, p) == pytest.approx(area, rel=1e-4)


def test_the_relaxing_spring_under_steady_motion_and_at_rest():
    # z = v tau (1 - exp(-t/tau)) while it moves, and falls as exp(-t/tau) when it is held
    k, tau, v, h = 500.0, 0.05, 0.02, 1e-3
    z = 0.0
    for i in range(200):
        z, f, stored, _ = spring.relaxing_step(k, tau, 0.0, z, v * h, h)
        assert z == pytest.approx(v * tau * -math.expm1(-(i + 1) * h / tau), rel=1e-12)
        assert f == k * z and stored == 0.5 * k * z * z
    held = z
    for i in range(200):
        z, *_ = spring.relaxing_step(k, tau, 0.0, z, 0.0, h)
        assert z == pytest.approx(held * math.exp(-(i + 1) * h / tau), rel=1e-12)


SIZE, WAY = st.floats(1e-3, 1e3), st.sampled_from([-1.0, 0.0, 1.0])


@given(
    k=st.floats(1.0, 1e8), limit=st.one_of(st.just(math.inf), SIZE), way=WAY,
    moves=st.lists(st.floats(-1e-2, 1e-2), min_size=1, max_size=30),
)  # fmt: skip
def test_a_spring_loses_what_it_takes_and_does_not_return(k, limit, way, moves):
    rest, p, f, stored, work, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for dp in moves:
        before, held = f, stored
        rest, f, stored, more = spring.spring_step(k, limit, way, rest, p + dp)
        assert more >= 0.0 and (f * way >= 0.0) and abs(f) <= limit * (1.0 + 1e-12)
        # between an elastic and a plastic part of a move the force is kinked: work is what is
        # stored and lost, at least what the lower of the two forces does
        work = stored - held + more
        assert work <= max(abs(before), abs(f)) * abs(dp) * (1.0 + 1e-9) + 1e-9 * (held + stored)
        lost, p = lost + more, p + dp
    assert lost >= 0.0


@given(
    tau=st.floats(1e-4, 10.0), way=WAY, h=st.floats(1e-5, 1e-2),
    moves=st.lists(st.floats(-1e-3, 1e-3), min_size=1, max_size=30),
)  # fmt: skip
def test_a_relaxing_spring_never_gives_energy(tau, way, h, moves):
    z, total, stored = 0.0, 0.0, 0.0
    for dp in moves:
        z, f, stored, lost = spring.relaxing_step(800.0, tau, way, z, dp, h)
        assert lost >= 0.0 and f * way >= 0.0
        total += lost
    assert total + stored >= 0.0


def test_bad_springs_are_refused():
    for bad in (
        dict(k=-1.0), dict(k=1e12), dict(limit=1.0), dict(k=1.0, limit=0.0), dict(tau=0.0),
        dict(k=1.0, tau=0.1), dict(unilateral=True),  # without effect
    ):  # fmt: skip
        with pytest.raises(hc.ParameterError, match=r"spring\."):
            hc.Spring(**bad)
    with pytest.raises(hc.ParameterError, match=r"clay\.springs"):
        hc.Profile((0.0,), (0.0, 0.0), springs=(hc.Spring(k=1.0),))
    assert hc.Profile((0.0,), (0.0, 0.0), springs=(hc.Spring(), hc.Spring())).springs == ()
