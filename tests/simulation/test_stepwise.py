"""Simulation: a run step by step gives the numbers of simulate, and takes forces and torques."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError

pytestmark = pytest.mark.plain
CUT = hc.constant_cut(clay=(0.01, 0.02), length=0.03)
HARD = hc.Interface(
    delay=5e-4, encoder=100_000, velocity="difference", window=3, jitter=1e-4, force_noise=0.1,
    passivity=True,
)  # fmt: skip
SCENES = {
    "cut": CUT,
    "hand": replace(CUT, operator=hc.Operator(), shaping=True),
    "stiff": hc.constant_cut(b=1e6, clay=(0.001, 0.00102), length=0.0011, t_max=2.0),
    "accurate": replace(CUT, integrator="accurate"),
    "sampled": replace(CUT, control="sampled", Ts=7.2e-4),
    "hardware": replace(CUT, control="sampled", Ts=7.2e-4, interface=HARD),
    "driven": hc.stability_test(t_max=0.2),
    "driven accurate": replace(hc.stability_test(t_max=0.1), integrator="accurate"),
    "driven sampled": hc.stability_test(t_max=0.1, control="sampled"),
    "growing": replace(hc.variable_cut(), t_max=5.5),
    "another compensator": replace(
        CUT, gain=(0.5, 0.2), compensator=hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    ),
    "unstable": replace(CUT, gain=(300.0, 300.0)),
}


@pytest.mark.parametrize("name", SCENES)
def test_steps_give_the_record_and_the_states_of_simulate(name):
    s = SCENES[name]
    want = hc.simulate(s, engine="python")
    states = []
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            if len(states) < 200:
                states.append(sim.state)
            sim.step(force=s.force)
        last = sim.state
    got = sim.record()
    for array in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"):
        assert np.array_equal(getattr(want, array), getattr(got, array)), array
        for i, state in enumerate(states[: len(want.t)]):
            assert np.array_equal(getattr(state, array), getattr(want, array)[i]), (array, i)
        assert np.array_equal(getattr(last, array), getattr(want, array)[-1])
    assert want.outcome == got.outcome and want.crossings == got.crossings
    assert want.energy == got.energy


def test_a_force_that_follows_the_state_is_that_of_a_damper():
    # a hand of one's own, f = 1 - 3 v by steps: within the delay of half a step on average, an
    # Operator with that damper
    s = replace(CUT, length=None, t_max=0.5)
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            v = sim.state.v
            sim.step(force=(1.0 - 3.0 * v[0], -3.0 * v[1]))
    want = hc.simulate(replace(s, operator=hc.Operator(0.0, 3.0, 0.0)))
    assert np.abs(sim.record().p - want.p).max() < 2e-5
    assert np.abs(want.p - hc.simulate(s).p).max() > 5e-4


def test_torques_of_ones_own_are_those_of_the_same_law():
    def law(t, q, qd, fh, state, params):
        return (4.0 * (1.5 - q[0]) - qd[0], 4.0 * (-1.5 - q[1]) - qd[1]), ()

    s = hc.Scenario(control="sampled", render="implicit", t_max=0.2, length=None)
    want = hc.simulate(replace(s, controller=hc.Controller(law)), engine="python")
    with hc.Simulation(s) as sim:
        for q, qd in zip(want.q, want.qd, strict=True):
            if sim.outcome is None:
                sim.step(torque=law(0.0, q, qd, None, (), ())[0])
    got = sim.record()
    # rates in the record are means around the sample, those that a law measures are exact
    assert np.abs(got.q[: len(want.q)] - want.q[: len(got.q)]).max() < 1e-3
    assert got.tau[0] == pytest.approx(want.tau[0], abs=1e-12)


def test_an_unfinished_run_is_interrupted():
    with hc.Simulation(CUT) as sim:
        for _ in range(10):
            sim.step()
        assert sim.t == 10 * CUT.dt
        r = sim.record()
        sim.step()  # it has ended
    assert r.outcome.code == "interrupted" and len(r.t) == 10
    assert sim.record().outcome == r.outcome


def test_engines_are_given_back_and_runs_side_by_side_do_not_meet():
    with hc.Simulation(CUT) as a, hc.Simulation(CUT) as b:
        for _ in range(100):
            a.step()
        for _ in range(100):
            b.step()
        assert np.array_equal(a.state.p, b.state.p)
    with pytest.raises(RuntimeError, match="closed"):
        a.step()


def test_a_closed_run_keeps_its_record_while_its_engine_runs_another():
    def halves(n):
        with hc.Simulation(CUT) as sim:
            for _ in range(n):
                sim.step()
        return sim

    want = halves(300).record()
    sim = halves(300)
    halves(500)  # in the same engine, rows and state
    got = sim.record()
    assert np.array_equal(want.p, got.p) and want.energy == got.energy and want.steps == got.steps
    assert np.array_equal(sim.state.p, want.p[-1]) and got.outcome == want.outcome
    with hc.Simulation(CUT) as unused:
        pass
    with pytest.raises(RuntimeError, match="closed"):
        _ = unused.state


@pytest.mark.parametrize(
    "do,field",
    [
        (lambda: hc.Simulation("cut"), "scenario"),
        (lambda: hc.Simulation(CUT).step(force=(1.0,)), "force"),
        (lambda: hc.Simulation(CUT).step(force=(np.nan, 0.0)), "force[x]"),
        (lambda: hc.Simulation(CUT).step(torque=(1.0, 0.0)), "control"),
    ],
)
def test_bad_steps_are_refused_by_name(do, field):
    with pytest.raises(ParameterError) as e:
        do()
    assert e.value.field == field


def test_torques_come_from_the_first_step_on():
    with hc.Simulation(replace(CUT, control="sampled")) as sim:
        sim.step()
        with pytest.raises(ParameterError, match="first step"):
            sim.step(torque=(0.0, 0.0))
    with hc.Simulation(CUT) as sim, pytest.raises(RuntimeError, match="no step"):
        sim.record()
