"""The energy ledger against integrals of the exact solution."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.kernel import engine
from hapticclay.simulation import run
from tests.oracles import Linear


def exact_clay_and_hand(b, K, uh, th):
    """Energy that clay and hand damper take along x up to 20 cm, shaped:

    quadrature beside the exact equations.
    """
    z, t = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0], float), 0.0
    for edge, c in ((0.05, 0.0), (0.15, b), (0.20, 0.0)):
        A = Linear(0, c, K, uh, th).A

        def rhs(t, z, A=A, c=c):
            return np.concatenate((A @ z[:7], [c * z[1] ** 2, th[1] * z[1] ** 2]))

        def hit(t, z, edge=edge):
            return z[0] - edge

        hit.terminal = True
        s = solve_ivp(rhs, (t, 60), z, "DOP853", rtol=1e-12, atol=1e-14, events=hit)
        z, t = s.y[:, -1], s.t[-1]
    m, _, k = th
    return z[7], z[8], 0.5 * z[1] ** 2 / 0.7919, 0.5 * m * z[1] ** 2 + 0.5 * k * z[0] ** 2


@pytest.mark.parametrize(
    "uh,th", [(1.0, (0, 0, 0)), (2.0, (0.25, 2.0, 6.0))], ids=["hand off", "hand on"]
)
def test_every_entry_converges_to_the_exact_integral_at_second_order(uh, th):
    clay, hand, _, stored = exact_clay_and_hand(90.0, 1.0, uh, th)
    steps = np.array([4e-3, 2e-3, 1e-3, 5e-4])
    errors = []
    for dt in steps:
        e = hc.simulate(
            hc.constant_cut(
                force=(uh, 0.0),
                operator=hc.Operator() if any(th) else None,
                inertia_shaping=True,
                dt=float(dt),
            )
        ).energy
        assert e["muscle"] == pytest.approx(uh * 0.20, rel=1e-3)
        errors.append(
            abs(e["clay"] - clay) + abs(e["hand_damper"] - hand) + abs(e["hand_stored"] - stored)
        )
    assert errors[-1] < 3e-6
    assert 1.7 < np.polyfit(np.log(steps), np.log(errors), 1)[0] < 2.6, errors


@pytest.mark.parametrize(
    "kw",
    [
        dict(),
        dict(inertia_shaping=True),
        dict(b=1e6, t_max=2.0),
        dict(gain=(1.0, 1.0)),
        dict(dt=5e-3),
        dict(force=(1.0, 0.4)),
        dict(torque_limit=(0.2, 0.1)),
    ],
)
def test_balance_closes_to_rounding_without_a_hand(kw):
    e = hc.simulate(hc.constant_cut(**kw)).energy
    assert abs(e["residual"]) < 1e-12 * e["throughput"]
    assert e["clay"] > 0.0 and e["kinetic"] > 0.0


def test_residual_with_a_hand_is_small_and_converges():
    steps = np.array([4e-3, 2e-3, 1e-3, 3.6e-4])
    rest = []
    for dt in steps:
        e = hc.simulate(
            hc.constant_cut(operator=hc.Operator(), force=(2.0, 0.0), dt=float(dt))
        ).energy
        rest.append(abs(e["residual"]) / e["throughput"])
    assert rest[-1] < 1e-6
    assert np.polyfit(np.log(steps), np.log(rest), 1)[0] > 1.5, rest


def test_an_engine_that_disobeys_shows_in_the_balance(monkeypatch):
    """The dampers left out of the engine, as a wrong model would: the residual tells."""
    plain = engine.build

    def build(scenario):
        model = plain(scenario)
        model.actuator_gainprm[2:] = 0.0
        return model

    monkeypatch.setattr(engine, "build", build)
    monkeypatch.setattr(run, "_idle", [])  # engines that were built before
    for name in ("python", "native"):
        e = hc.simulate(hc.constant_cut(t_max=2.0), engine=name).energy
        assert abs(e["residual"]) > 1e-3 * e["throughput"]


def test_reference_kinetic_energy_of_the_shaped_handle():
    """At the nominal pose the arm's inertia along x is 1/0.7919 kg."""
    r = hc.simulate(hc.free(inertia_shaping=True, length=0.1))
    kinetic = 0.5 * r.v[-1, 0] ** 2 / 0.7919
    assert r.energy["kinetic"] == pytest.approx(kinetic, rel=1e-9)
