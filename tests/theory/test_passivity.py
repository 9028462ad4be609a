"""Passivity against dense frequencies, against hands that would prove it wrong, and against
records.
"""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from hapticclay.theory import linear_loop, loop_passivity

OMEGA = np.geomspace(1e-2, 1e4, 20_001)


def shown(axis, K, b, omega):
    """Z = fh/v from the printed blocks."""
    s = 1j * omega
    g, g1, w, kd, kp = ((910.19, 41.8, 0.7919, 41.1, 432.0), (765.5, 30.3, 0.131, 32.4, 492.46))[
        "xy".index(axis)
    ]
    H = g / (s**2 + g1 * s + g) * K / (s**2 + 10 * s) + w / (s**2 + kd * s + kp)
    return b + 1 / (s * H)


@given(axis=st.sampled_from("xy"), K=st.floats(0.01, 10.0), b=st.floats(0.0, 500.0))
def test_passivity_against_dense_frequencies(axis, K, b):
    v = hc.theory.passivity(axis, K, b)
    dense = shown(axis, K, b, OMEGA).real
    assert v.margin <= dense.min() + 1e-9 * np.abs(dense).max()
    assert v.margin == pytest.approx(dense.min(), rel=1e-3, abs=1e-2)  # the grid about a minimum
    assert v.verdict == (v.margin >= 0.0 and linear_loop.stable(hc.theory.Loop(axis, b, K=K)))
    for low, high in v.fails:
        inside = (OMEGA > low * 1.001) & (OMEGA < high * 0.999)
        assert np.all(dense[inside] < 0.0)


@settings(max_examples=60)
@given(
    axis=st.sampled_from("xy"),
    K=st.floats(0.005, 3.0),
    b=st.floats(1.0, 500.0),
    m=st.floats(0.0, 10.0),
    d=st.floats(0.0, 10.0),
    k=st.just(0.0) | st.floats(0.1, 1e4),
)
def test_a_passive_handle_is_stable_with_every_hand(axis, K, b, m, d, k):
    assume(hc.theory.passivity(axis, K, b).margin > 1e-3 and hc.theory.passivity(axis, K, b))
    assert hc.theory.coupled_stability(axis, K, b, operator=Operator(m, d + 1e-3, k))


@pytest.mark.parametrize("axis,K,b", [("x", 3.0, 90.0), ("y", 0.2, 90.0), ("y", 0.5, 90.0)])
def test_an_active_handle_has_a_passive_hand_that_undoes_it(axis, K, b):
    """Stable left alone and with the nominal hand, yet a mass or spring that resonates where Re Z <
    0 makes it ring.
    """
    v = hc.theory.passivity(axis, K, b)
    assert (
        not v
        and v.fails
        and hc.theory.coupled_stability(axis, K, b, Operator())
        and hc.theory.coupled_stability(axis, K, b)
    )
    X = shown(axis, K, b, np.array([v.omega]))[0].imag
    worst = Operator(0.0, 0.0, v.omega * X) if X > 0.0 else Operator(-X / v.omega, 0.0, 0.0)
    assert not hc.theory.coupled_stability(axis, K, b, operator=worst)


def test_clay_passivity_is_colgate_and_schenkels_closed_form():
    for b, Ts, k in [(90.0, 3.6e-4, 0.0), (50.0, 1e-3, 2000.0), (0.0, 1e-3, 1e4)]:
        need = k * Ts / 2 + b
        v = hc.theory.clay_passivity(b, Ts, damping=need + 1.0, stiffness=k)
        assert v and v.margin == pytest.approx(
            1.0, abs=1e-9 * (1 + need)
        )  # exact where the grid ends, at pi/Ts
        assert not hc.theory.clay_passivity(b, Ts, damping=need - 1.0, stiffness=k)
    assert hc.theory.clay_passivity(90.0, 3.6e-4).fails and not hc.theory.clay_passivity(
        90.0, 3.6e-4
    )


def test_port_energy_is_what_the_ledger_says_went_in():
    r = hc.simulate(hc.constant_cut(t_max=3.0, force=(2.0, 0.0)))
    assert hc.port_energy(r).sum(axis=1)[-1] == pytest.approx(
        r.energy["muscle"], rel=1e-5
    )  # trapezoid against kicks
    v = hc.observed_passivity(r)
    assert v and v.margin >= -1e-9 and np.isnan(v.omega)


def test_the_observer_sees_an_active_device():
    """A negative damper of 3 N.s/m in a made-up record gives back what the hand never put in."""
    r = hc.simulate(hc.constant_cut(t_max=0.2))
    fake = dataclasses.replace(
        r,
        v=np.sin(20.0 * r.t)[:, None] * [1.0, 0.0],
        fh=-3.0 * np.sin(20.0 * r.t)[:, None] * [1.0, 0.0],
    )
    v = hc.observed_passivity(fake)
    assert not v
    t = r.t[-1]
    exact = -3.0 * (t / 2 - np.sin(40.0 * t) / 80.0)
    assert v.margin == pytest.approx(exact, rel=1e-4)  # (omega dt)^2


@pytest.mark.parametrize(
    "call,field",
    [
        (lambda: hc.theory.passivity("x", 1.0, -1.0), "b"),
        (lambda: hc.theory.clay_passivity(90.0, 0.0), "Ts"),
        (lambda: loop_passivity.colgate_schenkel(lambda z: z, 1e-3, -1.0), "damping"),
    ],
)
def test_bad_input_is_refused(call, field):
    with pytest.raises(ParameterError) as e:
        call()
    assert e.value.field == field
