"""Ctrl-C at every line of a call: nothing is lost, and all that follows has the same bits.

Or an error says that there is nothing to go on from; a restart or a snapshot is then.
"""

import dataclasses
import pickle
import signal
import threading

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.kernel.native import is_there
from hapticclay.kernel.row import CHUNK
from hapticclay.live.session import Session
from hapticclay.simulation.pair_run import PairRun
from tests.hunt import some
from tests.interruptions import interrupted, lines_of, signals_within
from tests.kernel.test_engines import ALL, same, yields

# where ctypes calls a law, it reports an interruption before dropping it, and the run notes it
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

native = pytest.mark.skipif(not is_there(), reason="needs the compiled kernel")
FORCE, LATER = (2.0, 0.2), (1.0, -0.1)
# borders every 0.2 mm, where a check of the monitor is due as well
LAYERS = hc.Clay(
    hc.Profile(tuple(2e-4 * i for i in range(1, 900)), tuple(20.0 + i % 2 for i in range(900))),
    hc.Profile((), (5.0,)),
)
SCENES = {
    "crossings": hc.Scenario(clay=LAYERS, length=None, t_max=3.2, dt=3.6e-4, force=FORCE),
    "stops": hc.Scenario(
        clay=yields(0.6, 0.0, 1.0, 20.0), length=None, t_max=1.0, dt=1.2e-4, operator=hc.Operator(),
        muscle=hc.Pulse((1.5, 0.5), 0.1, 0.0251, 0.05), force=FORCE,
    ),
    "hardware": hc.Scenario(
        clay=LAYERS, length=None, t_max=3.2, dt=3.6e-4, force=FORCE, control="sampled",
        operator=hc.Operator(), hardware=hc.Hardware(**ALL),
    ),
    "diverges": dataclasses.replace(
        hc.constant_cut(gain=(25.0, 0.5), t_max=2.0, dt=2.4e-4), stop_when_unstable=True
    ),
}  # fmt: skip
BEFORE = CHUNK - 6  # the first check of the monitor, and what follows it, lie ahead
END = CHUNK + 30


def begun(scene, **how):
    """A simulation shortly before a check, and its snapshot."""
    sim = hc.Simulation(SCENES[scene], **how)
    sim.advance(BEFORE)
    return sim, sim.snapshot()


def to_end(sim, end=END):
    """Goes on to a sample, or to the end of the run."""
    left = end - round(sim.t / sim.scenario.dt)
    if left > 0 and sim.outcome is None:
        sim.advance(left)
    return sim


def eight_samples(sim):
    """A snapshot at sample 200, where the simulation is left, and the record of eight more."""
    sim.advance(200)
    start = sim.snapshot()
    sim.advance(8)
    want = sim.record()
    sim.reset()
    sim.restore(start)
    return start, want


def places(call, least=20):
    """Lines at which a call is interrupted: some, from the first to the last; in a hunt all."""
    n = lines_of(call)
    assert n > least
    return some(range(1, n + 1), 12)


CALLS = {
    "steps": lambda sim: sim.advance(20),
    "one step": lambda sim: sim.step(),
    "force": lambda sim: sim.advance(20, force=LATER),
    "gain": lambda sim: sim.set(gain=(0.7, 0.3)),
    "clay": lambda sim: sim.set(b=0.5),
    "numbers": lambda sim: sim.numbers(),
    "diverging": lambda sim: sim.diverging,
    "snapshot": lambda sim: sim.snapshot(),
}


@native
@pytest.mark.parametrize("again", [None, 3])
@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("scene", SCENES)
def test_a_simulation_goes_on_from_an_interruption_anywhere(scene, name, again):
    call = CALLS[name]
    sim, start = begun(scene)
    call(sim)
    record = to_end(sim).record()
    sim.reset()
    sim.restore(start)
    for k in places(lambda: call(sim)):
        sim.reset()
        sim.restore(start)
        assert interrupted(lambda: call(sim), k, again), k
        if name in ("force", "gain", "clay"):
            call_again(sim, call, name)
        same(to_end(sim).record(), record, (k, again))


def call_again(sim, call, name):
    """Makes the interrupted call in full: of the steps only those that are left."""
    made = round(sim.t / sim.scenario.dt) - BEFORE
    if name != "force":
        call(sim)
    elif made < 20:
        sim.advance(20 - made, force=LATER)


@native
@pytest.mark.parametrize("again", [None, 3])
@pytest.mark.parametrize("what", ["reset", "restore", "record", "close"])
def test_a_call_that_begins_or_ends_a_run_may_be_made_again(what, again):
    whole, start = begun("crossings")
    before = pickle.dumps(whole)
    if what == "reset":
        whole.reset()
    want = whole.record() if what in ("record", "close") else to_end(whole).record()
    if what == "restore":
        with hc.Simulation(SCENES["crossings"]) as other:
            other.advance(77)
            before = pickle.dumps(other)

    def again_begun():
        sim = pickle.loads(before)
        return sim, {
            "reset": sim.reset, "restore": lambda sim=sim: sim.restore(start), "record": sim.record,
            "close": sim.close,
        }[what]  # fmt: skip

    for k in places(again_begun()[1]):
        sim, call = again_begun()
        interrupted(call, k, again)
        call()
        same(sim.record() if what in ("record", "close") else to_end(sim).record(), want, k)


@pytest.mark.parametrize("engine", ["python", "auto"])
@pytest.mark.parametrize("scene", ["crossings", "stops"])
def test_within_a_step_an_error_says_so_or_nothing_is_lost(scene, engine):
    """In CPython an exception may come within a step: a restart, or a snapshot, helps then."""
    s = dataclasses.replace(
        SCENES[scene], clay=LAYERS if scene == "crossings" else SCENES[scene].clay
    )
    sim = hc.Simulation(s, engine=engine)
    start, want = eight_samples(sim)
    told = 0
    for k in places(lambda: sim.advance(8)):
        sim.reset()
        sim.restore(start)
        interrupted(lambda: sim.advance(8), k)
        try:
            same(to_end(sim, 208).record(), want, k)
        except RuntimeError as error:
            assert "reset it, or restore a snapshot" in str(error)
            told += 1
            with pytest.raises(RuntimeError, match="reset it"):
                sim.numbers()
    assert bool(told) == (engine == "python" or not is_there())


@pytest.mark.parametrize("engine", ["python", "auto"])
def test_ctrl_c_itself_waits_for_the_end_of_a_step(engine):
    """So that nothing is lost in CPython, either."""
    sim = hc.Simulation(SCENES["crossings"], engine=engine)
    start, want = eight_samples(sim)
    for k in places(lambda: sim.advance(8)):
        sim.reset()
        sim.restore(start)
        assert interrupted(lambda: sim.advance(8), k, by_signal=True)
        same(to_end(sim, 208).record(), want, k)


@native  # Python itself says what it drops
def test_ctrl_c_within_the_terms_of_a_chain_is_not_dropped():
    """Python computes them for compiled steps, which would go on with those of the step before."""
    arm = hc.MjcfArm("five_bar")
    law = hc.JointPD((2.0, 2.0), (0.02, 0.02))
    scene = hc.Scenario(arm=arm, controller=law, Ts=1e-3, dt=1e-3, t_max=0.1, force=(0.2, 0.1))
    sim = hc.Simulation(scene)
    sim.advance(20)
    start = sim.snapshot()
    sim.advance(3)
    want, told = sim.numbers(), 0
    for k in places(lambda: (sim.restore(start), sim.advance(3))):
        sim.restore(start)
        interrupted(lambda: sim.advance(3), k)
        try:
            assert to_end(sim, 23).numbers() == want, k
        except RuntimeError as error:
            assert "reset it, or restore a snapshot" in str(error)
            told += 1
    assert told


# ---- batches -------------------------------------------------------------------------------------

HEAVY = dataclasses.replace(
    hc.constant_cut(b=20.0, t_max=300.0), length=None, force=(0.1, 0.0), clay=hc.slab(1e5),
    integrator="accurate",
)  # fmt: skip
BATCH = [*SCENES.values()]


def numbers_alone(scenes, n):
    """The samples of each run after n steps by itself."""
    out = []
    for s in scenes:
        sim = hc.Simulation(s, recorded=False)
        sim.advance(n)
        out.append(sim.numbers())
    return np.array(out)


BATCH_CALLS = {
    "steps": lambda b: b.advance(20),
    "force": lambda b: b.advance(20, force=np.tile(LATER, (len(b), 1))),
    "gain": lambda b: b.set(gain=(0.7, 0.3)),
    "clay": lambda b: b.set(b=0.5),
    "numbers": lambda b: b.numbers(),
    "reset": lambda b: b.reset(),
    "diverging": lambda b: b.diverging,
}


def in_step(batch, end):
    """Brings each run of a batch to a sample, or to its end."""
    for k, s in enumerate(BATCH):
        left = end - round(float(batch.t[k]) / s.dt) if not batch.ended[k] else 0
        if left > 0:
            mask = np.arange(len(batch)) == k
            batch.advance(left, mask=mask)
    return batch


@native
@pytest.mark.parametrize("again", [None, 2])
@pytest.mark.parametrize("name", BATCH_CALLS)
def test_a_batch_goes_on_from_an_interruption_anywhere(name, again):
    call = BATCH_CALLS[name]
    batch = hc.SimulationBatch(BATCH, workers=2)

    def begin():
        batch.reset(scenario=BATCH)
        batch.advance(BEFORE)

    begin()
    call(batch)
    end = END - BEFORE if name == "reset" else END
    want = in_step(batch, end).numbers()
    begin()
    for k in some(range(1, lines_of(lambda: call(batch)) + 1), 5):
        begin()
        interrupted(lambda: call(batch), k, again)
        if name == "force":
            full = np.array([round(float(t) / s.dt) for t, s in zip(batch.t, BATCH, strict=True)])
            for j in np.flatnonzero(~batch.ended & (full < BEFORE + 20)).tolist():
                forces = np.tile(LATER, (len(batch), 1))
                batch.advance(BEFORE + 20 - full[j], force=forces, mask=np.arange(len(batch)) == j)
        elif name in ("gain", "clay", "reset"):
            call(batch)
        assert np.array_equal(in_step(batch, end).numbers(), want, equal_nan=True), k
    batch.close()


@native
def test_threads_end_before_rows_are_used_again():
    """Ten times Ctrl-C: no thread goes on, and the numbers are those of each run alone."""
    scenes = [HEAVY, HEAVY, *BATCH]
    want = numbers_alone(scenes, 50)
    batch = hc.SimulationBatch(scenes, workers=2)
    main, over, caught = threading.main_thread().ident, threading.Event(), 0

    def send():
        while not over.wait(0.003):
            signal.pthread_kill(main, signal.SIGINT)

    thread = threading.Thread(target=send)
    with signals_within("simulation_batch.py"):
        thread.start()
        while caught < 10:
            try:
                batch.advance(1_000_000)
            except KeyboardInterrupt:
                caught += 1
        over.set()
        thread.join()
        before = batch.numbers()
        assert np.array_equal(batch.numbers(), before, equal_nan=True)
        batch.reset()
        batch.advance(50)
    assert np.array_equal(batch.numbers(), want, equal_nan=True)
    batch.close()


# ---- sessions, pairs, environments, files --------------------------------------------------------


def test_a_session_goes_on_from_an_interruption_anywhere():
    """A slice that is ended early is completed by the next call, a change as well."""

    def play(session, k=None, at=0):
        calls = [
            lambda: session.advance(0.01),
            lambda: session.change(gain=(0.4, 0.3)),
            lambda: session.change(b=1.5),
            lambda: session.advance(0.02),
        ]
        session.pull((0.01, 0.002))
        session.advance(0.005)
        for j, call in enumerate(calls):
            if j == at and k is not None:
                interrupted(call, k)
                session.mend()
                if j in (1, 2):
                    call()
                elif session.t < 0.0149:  # before its slice was known
                    call()
            else:
                call()
        session.pull(None)
        session.advance(0.01)
        return session

    want = play(Session(SCENES["diverges"]))
    record = want.record()
    for at in range(4):
        session = Session(SCENES["diverges"])
        session.pull((0.01, 0.002))
        n = lines_of(lambda session=session: session.advance(0.01))
        for k in some(range(1, n + 1), 12):
            played = play(Session(SCENES["diverges"]), k, at)
            if round(played.t, 9) != round(want.t, 9):
                continue  # interrupted before the call had begun: nothing was asked for yet
            got = played.record()
            same(got, record, (at, k))
            assert [f.t for f in played.frames] == [f.t for f in want.frames]


PAIR = hc.Pair(
    leader=hc.Arm(), follower=hc.Arm(), law=hc.JointPD((20.0, 20.0), (0.5, 0.5)),
    link=hc.Link(delay=2e-3), Ts=1e-3, t_max=0.02, muscle=hc.Constant((1.0, 0.5)),
)  # fmt: skip


def test_a_pair_goes_on_or_says_that_it_cannot():
    whole = PairRun(PAIR)
    for _ in range(8):
        whole.advance()
    want, told, went_on = whole.record(), 0, 0
    run = PairRun(PAIR)
    n = lines_of(run.advance)
    for k in some(range(1, n + 1), 40):
        run = PairRun(PAIR)
        run.advance()
        interrupted(run.advance, k)
        try:
            while run.step < whole.step:
                run.advance()
            for name in ("t", "leader", "follower", "energy"):
                assert np.array_equal(getattr(run.record(), name), getattr(want, name)), (k, name)
            went_on += 1
        except RuntimeError as error:
            assert "start it again" in str(error)
            m = len(run.record().t)  # what was recorded before is right
            assert 1 <= m <= 2 and np.array_equal(run.record().leader, want.leader[:m])
            told += 1
    assert told and went_on


@pytest.mark.parametrize("many", [False, True])
def test_an_environment_asks_for_a_reset_after_an_interrupted_step(many):
    gymnasium = pytest.importorskip("gymnasium")
    import hapticclay.gym  # noqa: F401

    make = gymnasium.make_vec if many else gymnasium.make
    name = "hapticclay/CutLine-v0"
    env = make(name, num_envs=3) if many else make(name).unwrapped
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape, np.float32)
    want = [env.step(action)[0] for _ in range(4)]
    env.reset(seed=1)
    for k in some(range(1, lines_of(lambda: env.step(action)) + 1), 12):
        env.reset(seed=1)
        interrupted(lambda: env.step(action), k)
        try:
            env.step(action)
        except RuntimeError as error:
            assert "reset" in str(error)
            env.reset(seed=1)
            got = [env.step(action)[0] for _ in range(4)]
            np.testing.assert_array_equal(got, want)
    env.close()


def test_a_record_is_saved_whole_or_not_at_all(tmp_path):
    """The one before stays until the new one is there; no temporary file remains."""
    before, after = (hc.simulate(hc.constant_cut(t_max=t)) for t in (0.05, 0.06))
    n = lines_of(lambda: after.save(tmp_path))
    names = {x.name for x in tmp_path.iterdir()}
    kept = set()
    for k in some(range(1, n + 1), 60):
        before.save(tmp_path)
        interrupted(lambda: after.save(tmp_path), k)
        assert {x.name for x in tmp_path.iterdir()} == names, k
        loaded = hc.Record.load(tmp_path)
        kept.add(len(loaded.t) == len(before.t))
        same(loaded, before if len(loaded.t) == len(before.t) else after, k)
    assert kept == {False, True}
