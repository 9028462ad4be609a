"""Ctrl-C at every line of a call: nothing is lost, and all that follows has the same bits.

Or an error says that there is nothing to go on from; a restart or a snapshot is then.
"""

import dataclasses

import pytest

import hapticclay as hc
from hapticclay.kernel.native import is_there
from hapticclay.kernel.row import CHUNK
from tests.hunt import some
from tests.interruptions import interrupted, lines_of
from tests.kernel.test_engines import ALL, same, yields

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
