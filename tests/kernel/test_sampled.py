"""The sampled loop against the hybrid system, exact between samples."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model import controller
from hapticclay.model.compensator import PRINTED
from hapticclay.model.operator import Operator
from hapticclay.model.signals import Multisine
from tests.oracles import hybrid, store
from tests.oracles.hybrid import in_slab

CASES = {
    "held": dict(),
    "physical": dict(render="physical"),
    "held, shaped, off axis": dict(inertia_shaping=True, force=(1.0, 0.3)),
    "implicit, hand": dict(render="physical", operator=hc.Operator(), force=(2.0, 0.0)),
    "held, hand": dict(operator=hc.Operator(), force=(2.0, 0.0)),
}


EVERY = 5  # samples that are compared


def of_scene(s, **more):
    """What the oracle is told of a scene."""
    th = (s.operator.mass, s.operator.damper, s.operator.spring) if s.operator else None
    case = dict(Ts=s.dt, K=s.gain, uh=s.force, th=th)
    return case | dict(inertia_shaping=s.inertia_shaping, render=s.render) | more


def slab(x):
    return 90.0 if 0.03 <= x < 0.15 else 0.0


@pytest.mark.parametrize("name", CASES)
def test_position_within_1e_7_of_the_hybrid_system_borders_included(name):
    kw = dict(force=(1.5, 0.0), clay=(0.03, 0.15), t_max=0.5) | CASES[name]
    s = hc.constant_cut(control="sampled", **kw)
    case = of_scene(s, t_end=0.45, edges=(0.03, 0.15))
    at = 90.0, 0.03, 0.15, EVERY, case
    exact = store.solution(f"sampled-{name}", in_slab, *at)
    r = hc.simulate(s)
    n = len(exact.p)
    assert r.crossings and r.crossings[0].time < 0.43
    np.testing.assert_allclose(r.p[::EVERY][:n], exact.p, atol=1e-7)
    np.testing.assert_allclose(r.v[::EVERY][:n], exact.v, atol=2e-5)
    np.testing.assert_allclose(r.tau[::EVERY][:n], exact.tau, atol=1e-3)


@pytest.mark.parametrize("render", ["held", "physical"])
@pytest.mark.parametrize(
    "kw",
    [
        dict(),
        dict(start=(0.06, 0.0), velocity=(0.05, -0.02)),
        dict(inertia_shaping=True),
        dict(hardware=hc.Hardware()),
    ],
)
def test_the_first_sample_feels_the_hand_that_is_there(kw, render):
    """Spring and damper of the hand act from the start; its mass does not:

    nothing accelerated before it.
    """
    cut = hc.constant_cut(
        control="sampled",
        force=(0.5, 0.2),
        operator=hc.Operator(),
        t_max=0.2,
        render=render,
        start=(0.06, 0.02),
    )
    s = dataclasses.replace(cut, **kw)
    case = of_scene(s, t_end=0.15, edges=(), p0=s.start, v0=s.velocity)
    name = f"sampled-first-{render}-{'-'.join(x for x in kw if x != 'hardware')}"
    exact = store.solution(name, in_slab, 90.0, -np.inf, np.inf, EVERY, case)
    r = hc.simulate(s)
    n = len(exact.p)
    np.testing.assert_allclose(r.tau[0], exact.tau[0], atol=1e-12)
    np.testing.assert_allclose(r.p[::EVERY][:n], exact.p, atol=1e-7)
    np.testing.assert_allclose(r.v[::EVERY][:n], exact.v, atol=2e-5)


@pytest.mark.parametrize("operator,late", [(None, 0.0), (Operator(), 0.0), (None, 0.3)])
def test_the_recorded_force_belongs_to_its_sample(operator, late):
    """Off by second order in the sample:

    fh = uh(t) without a hand, uh - Th p with one, by central differences.
    """
    drive = Multisine((1.0, 0.5), low=2.0, high=8.0, period=1.0, seed=2)
    error, lead = [], []
    for Ts in (2e-3, 1e-3):
        parts = hc.Hardware(delay=late * Ts) if late else None
        s = hc.constant_cut(control="sampled", dt=Ts, t_max=0.5, force=(0.0, 0.0))
        r = hc.simulate(dataclasses.replace(s, muscle=drive, operator=operator, hardware=parts))
        want = drive(r.t)[1:-1]
        if operator:
            want -= 6.0 * r.p[1:-1] + 2.0 * r.v[1:-1] + 0.25 * np.diff(r.p, 2, axis=0) / Ts**2
        rate = np.gradient(want, Ts, axis=0)
        off = r.fh[1:-1] - want
        error.append(np.max(np.abs(off)))
        lead.append(np.sum(off * rate) / np.sum(rate**2) / Ts)
    assert np.max(np.abs(lead)) < 0.01  # in samples
    assert 1.8 < np.log2(error[0] / error[1]) < 2.2, error


def test_substeps_converge_to_the_hybrid_system_at_second_order():
    Ts = 4e-3
    kw = dict(
        force=(2.0, 0.0), clay=(0.03, 0.15), control="sampled", render="physical", Ts=Ts, t_max=0.45
    )
    P, *_ = hybrid(
        slab, Ts, (1.0, 0.5), (2.0, 0.0), render="physical", t_end=0.4, edges=(0.03, 0.15)
    )
    error = []
    for n in (1, 2, 4):
        r = hc.simulate(hc.constant_cut(dt=Ts / n, **kw))
        error.append(np.max(np.abs(r.p[::n][: len(P)] - P)))
    order = np.polyfit(np.log([1, 2, 4]), -np.log(error), 1)[0]
    assert 1.7 < order < 2.6, error


def test_torques_are_held_between_samples():
    r = hc.simulate(hc.constant_cut(control="sampled", dt=1.2e-4, Ts=3.6e-4, t_max=0.1))
    held = r.tau[: len(r.tau) // 3 * 3].reshape(-1, 3, 2)
    np.testing.assert_array_equal(held, np.repeat(held[:, :1], 3, axis=1))
    assert len(np.unique(held[:, 0, 0])) > 200


def test_sampled_tends_to_continuous_as_the_sample_shrinks():
    gap = []
    c = hc.simulate(hc.constant_cut(t_max=1.0))
    for dt in (1.44e-3, 7.2e-4, 3.6e-4):
        s = hc.simulate(hc.constant_cut(control="sampled", dt=dt, t_max=1.0))
        n = round(dt / 3.6e-4)
        m = min(len(s.p), len(c.p[::n])) - 1
        gap.append(np.max(np.abs(s.p[:m] - c.p[::n][:m])))
    assert 0.8 < np.polyfit(np.log([4, 2, 1]), np.log(gap), 1)[0] < 1.2, (
        gap
    )  # a hold is half a sample late


def test_rendering_a_held_force_goes_unstable_where_physical_clay_does_not():
    kw = dict(control="sampled", b=8000.0, start=(0.06, 0.0), t_max=1.0, gain=(1.0, 0.1))
    assert hc.simulate(hc.constant_cut(render="physical", **kw)).outcome.code == "time limit"
    held = hc.simulate(hc.constant_cut(render="held", **kw))
    assert held.outcome.code == "limit cycle" and np.all(np.isfinite(held.p))


def test_balance_closes():
    for render in ("held", "physical"):
        e = hc.simulate(hc.constant_cut(control="sampled", render=render, t_max=0.8)).energy
        assert abs(e["residual"]) < 1e-12 * e["throughput"]


@pytest.mark.parametrize("axis,K", [("x", 1.0), ("y", 0.5)])
def test_held_block_is_the_step_response_of_C_and_G(axis, K):
    import control

    s = control.tf("s")
    G = {"x": 910.19 / (s**2 + 41.8 * s + 910.19), "y": 765.5 / (s**2 + 30.3 * s + 765.5)}[axis]
    C = K / (s**2 + 10 * s)
    servo = controller.SERVO["xy".index(axis)]
    A, B = controller.held_compensator(servo, PRINTED, K, 0.01)
    z = np.zeros(4)
    found = []
    for _ in range(50):
        found.append(z[[0, 2]])
        z = A @ z + B
    t = np.arange(50) * 0.01
    np.testing.assert_allclose(
        [x[0] for x in found], control.step_response(C, t).outputs, atol=1e-9
    )
    np.testing.assert_allclose(
        [x[1] for x in found], control.step_response(G * C, t).outputs, atol=1e-9
    )


def test_held_blocks_of_many_gains_are_those_of_each_bit_for_bit():
    servo, gains = controller.SERVO[0], np.geomspace(1e-3, 1e5, 40)
    A, B = controller.held_compensator(servo, PRINTED, gains, 0.01)
    for i, K in enumerate(gains.tolist()):
        alone = controller.held_compensator(servo, PRINTED, K, 0.01)
        np.testing.assert_array_equal(A[i], alone[0])
        np.testing.assert_array_equal(B[i], alone[1])


SHAPES = {  # order 0 to 4: without and with an output at once, complex poles
    "gain": hc.Compensator((0.002,), (1.0,)),
    "lag": hc.Compensator((1.0, 3.0), (1.0, 12.0)),
    "lead": hc.Compensator((0.3, 2.0), (1.0, 12.0, 0.0)),
    "complex": hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)),
    "fourth": hc.Compensator.zpk((-4.0,), (0.0, -10.0, -60.0 + 90.0j, -60.0 - 90.0j), 1e3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_held_block_is_the_step_response_of_any_C_and_G(name):
    """G's gain is not its stiffness; delta by the output of the compensator's states."""
    import control

    c, servo, K = (
        SHAPES[name],
        hc.Servo(hc.SecondOrder(900.0, 55.0, 600.0), controller.SERVO[1].S),
        0.5,
    )
    s = control.tf("s")
    C = K * control.tf(c.num, c.den)
    G = 900.0 / (s**2 + 55.0 * s + 600.0)
    A, B = controller.held_compensator(servo, c, K, 0.01)
    *_, out, through = c.state_space()
    z = np.zeros(c.order + 2)
    found = []
    for _ in range(50):
        found.append((out @ z[: c.order] + K * through, z[c.order]))
        z = A @ z + B
    t = np.arange(50) * 0.01
    for system, y in zip((C, G * C), np.transpose(found), strict=True):
        np.testing.assert_allclose(y, control.step_response(system, t).outputs, atol=1e-9)


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(control="sampeld"), "control"),
        (dict(control="sampled", render="hold"), "render"),
        (dict(Ts=1e-3), "Ts"),
        (dict(control="sampled", Ts=5e-4, dt=3.6e-4), "Ts"),
        (dict(control="sampled", Ts=1e-4, dt=3.6e-4), "Ts"),
        (dict(control="sampled", integrator="accurate"), "integrator"),
    ],
)
def test_bad_choices_are_refused(kw, field):
    with pytest.raises(ParameterError) as e:
        dataclasses.replace(hc.constant_cut(), **kw)
    assert e.value.field == field
