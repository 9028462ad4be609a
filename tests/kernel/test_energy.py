"""The energy ledger against integrals of the exact solution."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.cli.run import run_table
from hapticclay.kernel import engine
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.simulation import run
from tests.hunt import examples
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


# ---- any scene: the ledger closes to the order of the method -------------------------------------

ANY = st.integers(0, 2**32 - 1)


def drawn_clay(r, most=3.0):
    """Clay of any law behind 3 mm, with damping up to 10^most N.s/m; None for none."""
    kind, edges = r.integers(0, 7), (0.003, 0.03)
    b = (0.0, float(10 ** r.uniform(0.0, most)), 1.0)
    if kind == 0:
        return None
    if kind == 1:
        return Clay.of_groove(hc.Groove(x=(-0.03, 0.07), y=(-0.03, 0.03), pressure=20e3))
    if kind == 2:
        x = Profile(edges, b, growth=(0.0, 200.0, 0.0))
        return Clay(x, x)
    if kind == 3:
        x = Profile(edges, (0.0, min(b[1], 100.0), 1.0))  # stiff clay has no other axes
        return Clay(x, x, angle=float(r.uniform(-3.0, 3.0)))
    if kind == 4:
        springs = hc.Spring(), hc.Spring(k=200.0, limit=0.5), hc.Spring()
        x = Profile(edges, b, springs=springs)
        return Clay(x, x)
    x = Profile(edges, b, Fy=(0.0, float(r.uniform(0.1, 3.0)), 0.1))
    return Clay(x, x, isotropic=bool(kind == 5))


def drawn(seed, most=3.0, **more):
    """A short slanted run from any speed through any clay, with weak or strong motors."""
    r = np.random.default_rng(seed)
    clay = drawn_clay(r, most)
    if clay is not None and more.get("integrator") == "accurate" and (clay.springs or clay.groove):
        clay = Clay(Profile((0.003,), (0.0, 20.0)), Profile((), (0.0,)))
    weak = tuple(10 ** r.uniform(-1.0, 1.0, 2)) if r.random() < 0.3 else (40.0, 40.0)
    return dataclasses.replace(
        hc.free(), force=tuple(r.uniform(-3.0, 3.0, 2)), length=None, t_max=0.06, clay=clay,
        dt=float(r.choice([3.6e-4, 1e-3, 2e-3])), stop_when_unstable=False,
        velocity=tuple(r.uniform(-0.3, 0.3, 2)) if r.random() < 0.5 else (0.0, 0.0),
        inertia_shaping=bool(r.random() < 0.3), torque_limit=weak, gain=(0.5, 0.5), **more,
    )  # fmt: skip


def open_by(scene, engine="python"):
    """Residual over throughput; 0 where nothing moves."""
    e = hc.simulate(scene, engine=engine).energy
    return abs(e["residual"]) / e["throughput"] if e["residual"] else 0.0


def finer(scene, n):
    """The scene at an n-th of its step, with the same control samples."""
    Ts = scene.dt if scene.control == "sampled" else None
    return dataclasses.replace(scene, dt=scene.dt / n, Ts=Ts)


CONTROL = {
    "continuous": {},
    "held": dict(control="sampled"),
    "physical": dict(control="sampled", render="physical"),
}


@pytest.mark.parametrize("control", CONTROL)
@given(ANY)
@examples(8)
def test_without_a_hand_the_ledger_closes_to_rounding_in_any_clay(control, seed):
    """Sums over some hundred kicks, each rounded at the largest of its terms."""
    assert open_by(drawn(seed, 5.0, **CONTROL[control])) < 1e-11


@pytest.mark.parametrize("control", CONTROL)
@given(ANY, st.floats(-1.0, 6.0), st.floats(-1.0, 4.0), st.sampled_from([0.0, 0.05, 2.0]))
@examples(6)
def test_with_any_hand_it_closes_at_second_order(control, seed, damper, spring, mass):
    """A quarter of the step leaves a sixteenth; an eighth, as short runs do not show the order.

    One change from sliding to sticking leaves more, of first order: up to some 1e-5.
    """
    hand = hc.Operator(mass, 10.0**damper, 10.0**spring)
    s = drawn(seed, 5.0, operator=hand, **CONTROL[control])
    coarse = open_by(s)
    assert coarse < 1e-2
    assert open_by(finer(s, 4), "auto") < max(coarse / 8.0, 1e-4)


@given(ANY)
@examples(5)
def test_the_accurate_method_closes_at_fourth_order(seed):
    """A quarter of the step leaves 1/256; a 64th, as above. Clay is soft enough for whole steps."""
    s = drawn(seed, 2.0, integrator="accurate")
    coarse = open_by(s)
    assert coarse < 1e-2
    assert open_by(finer(s, 4), "auto") < max(coarse / 64.0, 1e-8)


@pytest.mark.parametrize("damper", [1e5, 3e5])
def test_a_stiff_damper_takes_the_energy_that_there_was(damper):
    """Stopped within a few steps, the arm loses its energy to the damper.

    The servo, which goes on at first, adds some.
    """
    s = dataclasses.replace(
        hc.free(), force=(0.0, 0.0), length=None, t_max=0.1, velocity=(0.1, 0.0),
        operator=hc.Operator(0.0, damper, 0.0),
    )  # fmt: skip
    r = hc.simulate(s)
    (q1, q2), arm = r.q[0], s.arm
    angles, lengths = np.array([q1, q1 + q2]), np.array([arm.l1, arm.l2])
    rates = np.linalg.solve([-lengths * np.sin(angles), lengths * np.cos(angles)], s.velocity)
    had = 0.5 * float(rates**2 @ [arm.I1, arm.I2])
    assert r.energy["kinetic"] == pytest.approx(-had, rel=1e-3)
    assert r.energy["hand_damper"] == pytest.approx(had + r.energy["motors"], rel=1e-3)
    assert r.energy["motors"] < 0.1 * had
    assert abs(r.energy["residual"]) < 1e-6 * had


@pytest.mark.parametrize(
    "hardware",
    [None, hc.Hardware(friction=(0.02, 0.01), adc_bits=12), hc.Hardware(passivity=True),
     hc.Hardware(coupling=hc.Coupling(3000.0, 300.0))],
)  # fmt: skip
def test_held_clay_takes_its_force_times_the_way(hardware):
    """Between two samples the force is held, so its work is that force times the way."""
    s = hc.constant_cut(control="sampled", t_max=1.0, start=(0.045, 0.0))
    r = hc.simulate(dataclasses.replace(s, hardware=hardware))
    work = float((r.fe[:-1] * np.diff(r.p, axis=0)).sum())
    assert r.energy["clay"] == 0.0 and work > 1e-3
    assert r.energy["rendered_clay"] == pytest.approx(work, rel=1e-4)  # the arm's path is curved


def test_physical_clay_has_no_rendered_one():
    r = hc.simulate(hc.constant_cut(control="sampled", render="physical", t_max=0.1))
    assert "rendered_clay" not in r.energy and "clay" in r.energy


def test_a_run_prints_how_far_its_ledger_is_open():
    r = hc.simulate(hc.constant_cut(operator=hc.Operator(), force=(2.0, 0.0), t_max=0.5))
    share = abs(r.energy["residual"]) / r.energy["throughput"]
    told = [x for x in run_table(r).splitlines() if x.startswith("energy: ")]
    assert told == [f"energy: balanced within {share:.1e} of {r.energy['throughput']:.4g} J"]
