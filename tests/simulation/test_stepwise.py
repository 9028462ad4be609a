"""Simulation: a run step by step gives the numbers of simulate, and takes forces and torques."""

import copy
import pickle
import threading
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import native
from hapticclay.simulation import run

fast = pytest.mark.skipif(not native.is_there(), reason="needs the compiled kernel")
CUT = hc.constant_cut(clay=(0.01, 0.02), length=0.03)
HELD = replace(CUT, operator=hc.Operator())
HARD = hc.Hardware(
    delay=5e-4, encoder=100_000, velocity="difference", velocity_window=3, jitter=1e-4,
    force_noise=0.1, passivity=True,
)  # fmt: skip
SCENES = {
    "cut": CUT,
    "hand": replace(CUT, operator=hc.Operator(), inertia_shaping=True),
    "stiff": hc.constant_cut(b=1e6, clay=(0.001, 0.00102), length=0.0011, t_max=2.0, dt=1e-3),
    "accurate": replace(CUT, integrator="accurate"),
    "sampled": replace(CUT, control="sampled", Ts=7.2e-4),
    "hardware": replace(CUT, control="sampled", Ts=7.2e-4, hardware=HARD),
    "driven": hc.stability_test(t_max=0.2),
    "driven accurate": replace(hc.stability_test(t_max=0.1), integrator="accurate"),
    "driven sampled": hc.stability_test(t_max=0.1, control="sampled"),
    "growing": replace(hc.variable_cut(dt=1e-3), start=(0.045, 0.0), t_max=1.0),
    "another compensator": replace(
        CUT, gain=(0.5, 0.2), compensator=hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    ),
    "unstable": replace(CUT, gain=(300.0, 300.0)),
}


def narrow(name):
    """The scene, in 1 mm of clay in place of 10 where it is a cut."""
    s = SCENES[name]
    return replace(s, clay=hc.slab(90.0, 0.01, 0.011), length=0.013) if s.length == 0.03 else s


@pytest.mark.parametrize("name", SCENES)
def test_steps_give_the_record_and_the_states_of_simulate(name):
    s = narrow(name)
    want = hc.simulate(s, engine="python")
    assert len(want.crossings) >= 3 or s.length != 0.013
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

    s = hc.Scenario(control="sampled", render="physical", t_max=0.2, length=None)
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
        (lambda: hc.Simulation(CUT).reset("cut"), "scenario"),
        (lambda: hc.Simulation(CUT).restore(CUT), "snapshot"),
        (lambda: hc.SimulationBatch([CUT] * 2).reset(scenario=3), "scenario"),
        (lambda: hc.SimulationBatch([CUT] * 2).reset([[0, 1], [1]]), "runs"),
        (lambda: hc.SimulationBatch([CUT] * 2).advance(mask=[[True], [True, False]]), "mask"),
        (lambda: hc.SimulationBatch([CUT] * 2).set(operator=3), "operator"),
        (lambda: hc.SimulationBatch([CUT] * 2).set(b=[[1.0], [1.0, 2.0]]), "b[0]"),
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


ARRAYS = "t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"


def same(a, b):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), name)
    assert (a.outcome, a.crossings, a.stops, a.energy) == (
        b.outcome,
        b.crossings,
        b.stops,
        b.energy,
    )


@pytest.mark.parametrize("name", ["cut", "accurate", "hardware", "driven", "unstable"])
def test_many_steps_at_once_are_as_many_single_ones(name):
    s, counts = narrow(name), (1, 7, 300, 4095, 5000, 100_000)
    with hc.Simulation(s, engine="python") as sim:
        at = 0
        for n in counts:
            sim.advance(n)
            at += n
            if sim.outcome is None:
                assert sim.t == pytest.approx(at * s.dt, abs=1e-12)
    same(sim.record(), hc.simulate(s, engine="python"))


def visited(sim):
    """The record of a run that is changed and returned to a snapshot, and the samples read."""
    seen, taken = [], None
    for i in range(60):
        sim.advance(1 + 30 * (i % 3), force=(1.0 + 0.05 * i, 0.1))
        if i % 4:  # samples one after the other, and now and then none
            seen.append(sim.numbers())
        if i == 20:
            taken = sim.snapshot()
        if i == 25:
            sim.restore(taken)
        if i == 35:
            sim.set(gain=(0.9, 1.1))
        if i == 45:
            sim.set(b=1.2)
    for n in (1, 4000, *[500] * 20):  # past looks of the monitor, to the end
        sim.advance(n)
        seen.append([*sim.state.p, *sim.numbers()])
    assert sim.outcome is not None
    return sim.record(), np.concatenate(seen)


@fast
@pytest.mark.parametrize("s", [HELD, SCENES["hardware"]], ids=["held", "hardware"])
def test_compiled_steps_give_the_same_bits(s, monkeypatch):
    monkeypatch.setattr(run, "CHUNK", 1024)  # rows between two looks
    s = replace(s, t_max=1.2, length=None)
    found = []
    for engine in ("python", "native"):
        with hc.Simulation(s, engine=engine) as sim:
            found.append(visited(sim))
    (want, told), (got, seen) = found
    same(want, got)
    assert np.array_equal(told, seen, equal_nan=True)


def held(sim, n, force):
    """The states of the next steps under a force."""
    out = []
    for _ in range(n):
        sim.step(force=force)
        out.append([np.array(x) for x in sim.state])
    return out


@pytest.mark.parametrize("name", ["cut", "accurate", "hardware", "yields", "springs", "groove"])
def test_a_snapshot_returns_to_where_it_was_taken(name):
    special = {
        "yields": hc.slab(hc.Flow(Fy=0.4, b=10.0), 0.002, 0.02),
        "springs": hc.Clay(
            hc.Profile((0.002,), (0.0, 20.0), springs=(hc.Spring(), hc.Spring(k=300.0, limit=0.2))),
            hc.Profile((), (5.0,)),
        ),
        "groove": hc.Clay.of_groove(hc.Groove((0.002, 0.03), (-0.01, 0.01), pressure=2e4)),
    }
    s = SCENES.get(name) or replace(CUT, clay=special[name], length=None)
    far = 4000 if name == "cut" else 400  # past a look of the monitor, or not
    with hc.Simulation(s) as sim:
        sim.advance(150, force=(1.5, 0.2))
        taken = sim.snapshot()
        first = held(sim, 120, (2.0, -0.3))
        sim.advance(far, force=(-2.0, 0.1))
        other = sim.t
        sim.restore(pickle.loads(pickle.dumps(taken)))
        assert sim.t == pytest.approx(150 * s.dt) and sim.t != other
        again = held(sim, 120, (2.0, -0.3))
        rest = sim.record()
    for a, b in zip(first, again, strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)
    with hc.Simulation(s) as straight:  # and the record is that of the way taken
        straight.advance(150, force=(1.5, 0.2))
        straight.advance(120, force=(2.0, -0.3))
        same(straight.record(), rest)


@pytest.mark.parametrize("name", ["cut", "hardware", "driven"])
@pytest.mark.parametrize("twin", [copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))])
def test_a_copy_goes_on_by_itself(name, twin):
    sim = hc.Simulation(SCENES[name])
    sim.advance(100, force=(1.5, 0.0))
    other = twin(sim)
    ends = []
    for each in (sim, other):
        each.advance(50, force=(1.0, 0.4))
        ends.append(each.record())
    same(*ends)


def test_a_gain_from_a_sample_on_is_that_of_the_exact_loop():
    """After a change of K the handle follows the free loop with the new K: its steady speed."""
    s = replace(CUT, clay=hc.slab(20.0), length=None, t_max=4.0, inertia_shaping=True)
    speeds = []
    with hc.Simulation(s) as sim:
        for K in (0.4, 0.8, 0.2):
            sim.set(gain=(K, 0.2))
            sim.advance(3500)
            speeds.append(sim.state.v[0])
            assert sim.scenario.gain == (K, 0.2)
    # C = K/(s (s + 10)): uh = (10/K + b) v, where nothing else resists
    exact = [1.0 / (10.0 / K + 20.0) for K in (0.4, 0.8, 0.2)]
    np.testing.assert_allclose(speeds, exact, rtol=2e-3)  # the pose still turns


def test_the_clay_from_a_sample_on_resists_with_its_new_damping():
    with hc.Simulation(replace(CUT, clay=hc.slab(20.0), length=None, t_max=4.0)) as sim:
        for factor in (1.0, 3.0, 0.5, 1.0):
            sim.set(b=factor)
            sim.advance(500)
            x = sim.state
            np.testing.assert_allclose(x.b, 20.0 * factor)
            np.testing.assert_allclose(x.fe, 20.0 * factor * x.v, rtol=1e-12)
    assert abs(sim.record().energy["residual"]) < 1e-3 * sim.record().energy["throughput"]


def test_another_operator_from_a_sample_on_holds_with_its_own_spring():
    s = replace(
        CUT, operator=hc.Operator(0.2, 4.0, 20.0), length=None, t_max=20.0, clay=None, dt=1e-3
    )
    with hc.Simulation(s) as sim:
        for k in (40.0, 160.0):
            sim.set(operator=hc.Operator(0.2, 8.0, k))
            sim.advance(3600)
            assert sim.state.p[0] == pytest.approx(1.0 / k, rel=1e-3)
    with hc.Simulation(CUT) as bare, pytest.raises(ParameterError, match="from the start on"):
        bare.set(operator=hc.Operator())


@pytest.mark.parametrize(
    "change,field",
    [(dict(gain=(-1.0, 0.1)), "gain[x]"), (dict(b=-1.0), "b"), (dict(gain=(0.1,)), "gain")],
)
def test_changes_are_refused_by_name_and_change_nothing(change, field):
    with hc.Simulation(CUT) as sim, hc.Simulation(CUT) as other:
        sim.advance(20)
        with pytest.raises(ParameterError) as e:
            sim.set(**change)
        assert e.value.field == field
        sim.advance(20)
        other.advance(40)
        assert np.array_equal(sim.state.p, other.state.p)


def test_divergence_is_told_within_20_ms_and_long_before_the_verdict():
    s = hc.constant_cut(gain=(2.0, 2.0), start=(0.06, 0.0))
    verdict = hc.simulate(s, engine="python").outcome
    assert verdict.code == "diverged"
    with hc.Simulation(s) as sim:
        while not sim.diverging and sim.t < verdict.time + 1.0:
            sim.step()
        assert verdict.time <= sim.t <= verdict.time + 0.02 + 2 * s.dt
        assert sim.outcome is None  # the verdict waits for the end of its samples
    with hc.Simulation(CUT) as calm:
        while calm.outcome is None:
            calm.advance(100)
            assert not calm.diverging


def test_a_new_beginning_is_a_new_simulation():
    cut = replace(CUT, t_max=0.4)
    other, wired = replace(cut, gain=(0.6, 0.2)), replace(SCENES["hardware"], t_max=0.4)
    with hc.Simulation(cut) as sim:
        sim.advance(200, force=(2.0, 0.0))
        sim.set(b=2.0)
        for s in (cut, other, wired):
            sim.reset(None if s is cut else s)
            sim.advance(100_000)
            same(sim.record(), hc.simulate(s, engine="python"))
            sim.reset(cut)


GATE = {"inside": threading.Event(), "may go on": threading.Event()}


def waits(t, q, qd, fh, state, params):
    """A law that waits in its second sample until it may go on."""
    if t > 0.0 and not GATE["inside"].is_set():
        GATE["inside"].set()
        assert GATE["may go on"].wait(60.0)
    return (0.0, 0.0), state


USES = {  # of both kinds, and of a simulation
    "advance": lambda sim: sim.advance(3),
    "numbers": lambda sim: sim.numbers(),
    "set": lambda sim: sim.set(b=1.0),
    "reset": lambda sim: sim.reset(),
    "close": lambda sim: sim.close(),
    "diverging": lambda sim: sim.diverging,
}
MORE_USES = {
    "step": lambda sim: sim.step(force=(1.0, 0.0)),
    "snapshot": lambda sim: sim.snapshot(),
    "record": lambda sim: sim.record(),
    "copy": copy.deepcopy,
}
MAKERS = {
    "simulation": hc.Simulation,
    "batch": lambda scene, engine: hc.SimulationBatch([scene], engine=engine, workers=1),
}


def hold(holds):
    """Makes the next run of the law wait, or not."""
    for event in GATE.values():
        event.clear() if holds else event.set()


@pytest.mark.parametrize("engine", ["python", "auto"])
@pytest.mark.parametrize("kind", MAKERS)
def test_a_thread_of_its_own_is_asked_for(kind, engine):
    """While a thread is inside a step, each use by another is refused, and the run goes on."""
    scene = replace(CUT, control="sampled", controller=hc.Controller(waits))
    hold(False)
    alone, sim, failed = hc.Simulation(scene), MAKERS[kind](scene, engine=engine), []
    alone.advance(50)
    hold(True)

    def other():
        try:
            sim.advance(50)
        except Exception as error:
            failed.append(error)

    thread = threading.Thread(target=other)
    thread.start()
    try:
        assert GATE["inside"].wait(60.0)
        refused = f"another thread uses this {kind}: give each thread its own"
        for use in (USES | (MORE_USES if kind == "simulation" else {})).values():
            with pytest.raises(RuntimeError, match=f"^{refused}$"):
                use(sim)
    finally:
        GATE["may go on"].set()
        thread.join()
    assert not failed
    assert np.array_equal(np.ravel(sim.numbers()), alone.numbers())


def test_a_law_that_uses_its_own_simulation_is_refused():
    sims = []

    def meddles(t, q, qd, fh, state, params):
        sims[0].step()
        return (0.0, 0.0), state

    scene = replace(CUT, control="sampled", controller=hc.Controller(meddles))
    sims.append(hc.Simulation(scene))
    with pytest.raises(RuntimeError, match="another thread uses this simulation"):
        sims[0].advance(5)


def snapshot_of(scene, **how):
    sim = hc.Simulation(scene, **how)
    sim.advance(53)
    return sim.snapshot()


BOTH = replace(CUT, operator=(hc.Operator(), None))
PLANAR = hc.MjcfArm("planar_2r")
JOINTS = hc.Scenario(
    arm=PLANAR, controller=hc.JointPD((20.0, 20.0), (0.5, 0.5)), control="sampled", Ts=1e-3,
    dt=1e-3, t_max=1.0,
)  # fmt: skip
OTHERS = {
    "arm": (CUT, lambda: snapshot_of(JOINTS), "clay"),
    "clay": (CUT, lambda: snapshot_of(replace(CUT, clay=hc.slab(hc.Flow(Fy=0.3)))), "clay"),
    "muscle": (CUT, lambda: snapshot_of(replace(CUT, muscle=hc.Step((1.0, 0.0), 0.1))), "muscle"),
    "dt": (CUT, lambda: snapshot_of(replace(CUT, dt=5e-4)), "dt"),
    "planar_2r in place of the two-link arm": (
        replace(JOINTS, arm=hc.Arm(), controller=None), lambda: snapshot_of(JOINTS), "arm"
    ),
    "hardware": (
        replace(CUT, control="sampled", hardware=hc.Hardware(delay=1e-3)),
        lambda: snapshot_of(replace(CUT, control="sampled", hardware=hc.Hardware(delay=9e-3))),
        "hardware",
    ),
    "operator": (CUT, lambda: snapshot_of(BOTH), "operator"),
    "every": (CUT, lambda: snapshot_of(CUT, every=7), "every"),
    "recorded": (CUT, lambda: snapshot_of(CUT, recorded=False), "recorded"),
    "monitored": (CUT, lambda: snapshot_of(CUT, monitored=False), "monitored"),
}  # fmt: skip


@pytest.mark.parametrize("engine", ["python", "auto"])
@pytest.mark.parametrize("name", OTHERS)
def test_a_snapshot_of_another_scenario_is_refused_and_changes_nothing(name, engine):
    scene, taken, field = OTHERS[name]
    sim, twin = (hc.Simulation(scene, engine=engine) for _ in range(2))
    for each in (sim, twin):
        each.advance(37)
    with pytest.raises(hc.ParameterError, match=f"same scenario: {field}") as fault:
        sim.restore(taken())
    assert "\n" not in str(fault.value)
    for each in (sim, twin):
        each.advance(100)
    same(sim.record(), twin.record())


@pytest.mark.parametrize("what", ["state", "before", "rows"])
def test_a_damaged_snapshot_is_refused_and_changes_nothing(what):
    sim, twin = hc.Simulation(CUT), hc.Simulation(CUT)
    for each in (sim, twin):
        each.advance(37)
    x = sim.snapshot()
    damaged = {
        "state": x._replace(saved=x.saved._replace(state=x.saved.state[:-8])),
        "before": x._replace(before=x.before._replace(arrays=x.before.arrays[:-1])),
        "rows": x._replace(rows=np.zeros((10_000, 16))),
    }[what]
    with pytest.raises(hc.ParameterError, match="must be as it was taken"):
        sim.restore(damaged)
    for each in (sim, twin):
        each.advance(100)
    same(sim.record(), twin.record())


def test_torques_given_in_steps_return_with_a_snapshot():
    """Those in effect when it was taken; not into a simulation without any."""
    scene = replace(CUT, control="sampled")
    sim = hc.Simulation(scene)
    sim.advance(40, torque=(0.3, -0.1))
    taken = sim.snapshot()
    sim.advance(40)
    want = sim.numbers()
    sim.advance(40, torque=(0.0, 0.5))
    sim.restore(taken)
    sim.advance(40)
    assert sim.numbers() == want
    with pytest.raises(hc.ParameterError, match="torque"):
        hc.Simulation(scene).restore(taken)


def test_a_snapshot_with_another_force_gain_hand_and_clay_is_right():
    """Of another simulation that began with others, and of one in which they were changed."""
    scene = replace(CUT, operator=hc.Operator())
    other = replace(scene, force=(0.4, 0.2), gain=(0.6, 0.4), operator=hc.Operator(0.3, 2.0, 5.0))
    for begins, changes in ((other, {}), (scene, dict(gain=(0.7, 0.2), b=2.0))):
        there, here = hc.Simulation(begins), hc.Simulation(scene)
        there.advance(60)
        there.set(**changes)
        there.advance(40, force=(0.3, 0.1))
        here.advance(37)
        here.restore(there.snapshot())
        for each in (there, here):
            each.advance(5000)
        same(here.record(), there.record())


@pytest.mark.parametrize("engine", ["python", "auto"])
def test_a_simulation_keeps_the_samples_of_simulate(engine):
    s = replace(CUT, t_max=1.6, dt=2e-4)
    want = hc.simulate(s, every=7)
    with hc.Simulation(s, engine=engine, every=7) as sim:
        sim.advance(2500, force=s.force)
        twin = pickle.loads(pickle.dumps(sim))
        for each in (sim, twin):
            each.advance(10_000)
            got = each.record()
            for array in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"):
                assert np.array_equal(getattr(want, array), getattr(got, array)), array
            assert got.outcome == want.outcome and got.energy == want.energy


def test_a_simulation_without_record_makes_the_same_steps_and_keeps_none():
    """Two checks of the monitor and the end lie within."""
    s = replace(CUT, t_max=1.6, dt=2e-4)
    with hc.Simulation(s, engine="python") as kept:
        bare = hc.Simulation(s, engine="python", recorded=False)
        for _ in range(4):
            for sim in (kept, bare):
                sim.advance(2300, force=(0.5, 0.1))
            assert kept.numbers() == bare.numbers()
        assert kept.outcome == bare.outcome
        assert kept.outcome.code == "time limit"
        assert bare.state.t == kept.state.t
    with pytest.raises(RuntimeError, match="recorded=True"):
        bare.record()
    bare.close()


def test_the_numbers_of_a_sample_are_those_of_its_state():
    with hc.Simulation(CUT, engine="python") as sim:
        sim.advance(50, force=(1.0, 0.2))
        x = sim.state
        names = "q", "p", "v", "fh", "tau", "delta", "b", "qd", "fe"
        assert sim.numbers() == [float(a) for name in names for a in getattr(x, name)]


def test_an_unmonitored_run_goes_on_where_the_monitor_would_end_it():
    s = hc.constant_cut(gain=(2.0, 2.0), start=(0.06, 0.0))
    end = hc.simulate(s, engine="python").outcome
    assert end.code in ("diverged", "limit cycle")
    with hc.Simulation(s, engine="python", recorded=False, monitored=False) as sim:
        sim.advance(end.step + 200)
        assert sim.outcome is None and not sim.diverging


@pytest.mark.parametrize("many", [False, True])
def test_the_torque_that_k_samples_reach_is_the_kth_largest(many):
    """Against the torques of the samples themselves, read one by one."""
    runs = [CUT, SCENES["sampled"]]
    with hc.SimulationBatch(runs, engine="python") if many else hc.Simulation(CUT) as sim:
        taus = []
        for _ in range(12):
            sim.advance(1, force=[[2.0, 1.0], [0.5, 3.0]] if many else (2.0, 1.0))
            taus.append(np.abs(np.atleast_2d(sim.tau if many else sim.state.tau)))
        sim.advance(1)
        last = np.sort(np.stack(taus)[-8:], axis=0)
        for k in (1, 3, 8):
            assert np.array_equal(np.atleast_2d(sim.torque_reached(8, k)), last[-k])
        assert not np.any(sim.torque_reached(8, 9))  # 9 of 8 samples reach nothing


@fast
@pytest.mark.parametrize("engine", ["python", "native"])
def test_strained_samples_are_those_whose_torque_is_at_a_limit(engine):
    s = hc.constant_cut(gain=(2.0, 2.0), start=(0.06, 0.0), t_max=0.1)
    torque = np.abs(hc.simulate(s).tau[:101])
    limits = np.quantile(torque, (0.3, 0.8), axis=0)[[0, 1], [0, 1]]  # a sample may be just at one
    with hc.SimulationBatch([s, s], engine=engine) as batch, hc.Simulation(s, engine=engine) as sim:
        batch.advance(100)
        sim.advance(100)
        for n in (1, 40, 1000):
            expected = np.count_nonzero(torque[:100][-n:] >= limits, axis=0).tolist()
            assert sim._run.strained(n, limits.tolist()) == expected
            assert batch._run.strained(n, limits.tolist()).tolist() == [expected] * 2
        assert 0 < min(expected) and max(expected) < 100


@fast
def test_what_a_batch_shows_in_the_turn_of_its_steps_is_what_it_shows_later():
    """Also where a run ends within it, or its samples fill their buffer."""
    scenes = [hc.constant_cut(t_max=0.5), hc.free(t_max=3.0), hc.constant_cut(gain=(30.0, 0.5))]
    now, later = (hc.SimulationBatch(scenes, engine="native") for _ in range(2))
    for n in (1, 300, 1500, 4000):
        for batch, shows in ((now, True), (later, False)):
            which = np.flatnonzero(~batch._run.over)
            batch._run.advance(which, n, shows=shows)
        np.testing.assert_array_equal(now.numbers(), later.numbers())
    assert now.ended.tolist() == [True, False, True] or now.ended.all()


def test_runs_of_an_unmonitored_batch_go_on_too():
    s = hc.constant_cut(gain=(2.0, 2.0), start=(0.06, 0.0))
    end = hc.simulate(s, engine="python").outcome
    assert end.code in ("diverged", "limit cycle")
    for monitored in (True, False):
        with hc.SimulationBatch([s], engine="python", monitored=monitored) as batch:
            batch.advance(end.step + 4200)
            assert batch.ended.all() == monitored
