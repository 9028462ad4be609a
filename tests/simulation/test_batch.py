"""Many short runs at once: each as it is alone, from a generator that is not held."""

import dataclasses
import random
import signal
import time
import weakref

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.model.controller import SERVO, Servo
from hapticclay.simulation import batch, record

pytest.importorskip("numba")
CUT = hc.constant_cut(start=(0.02, 0.0), t_max=0.05)
WIRED = dataclasses.replace(CUT, control="sampled", interface=hc.Interface(delay=2e-4))


def varied(like, rng, **own):
    """The same scene with other numbers."""
    u = [rng.random() for _ in range(9)]
    hand = hc.Operator(0.1 + u[0], 1.0 + u[1], 5.0 * u[2])
    wires = like.interface and dataclasses.replace(like.interface, delay=2e-3 * u[8])
    numbers = dict(
        gain=(0.2 + u[3], 0.2 + u[4]),
        force=(3.0 * u[5], u[6] - 0.5),
        operator=hand if like.operator else None,
        start=(0.045 + 0.01 * u[7], 0.01 * u[8]),
        velocity=(0.4 * u[0], 0.1 * u[1]),
        interface=wires,
    )
    return dataclasses.replace(like, **{**numbers, **own})


def kinds(rng):
    """Scenes of every kind that is made together, and of some that are not; without end."""
    grown = hc.variable_cut(t_max=0.05)
    other = Servo(dataclasses.replace(SERVO[0].G, damping=30.0), SERVO[0].S)
    rich = hc.Interface(
        delay=1e-4, encoder=4000, velocity="difference", window=3, velocity_filter=80.0,
        adc_bits=12, dac_bits=12, force_filter=200.0, friction=(0.02, 0.01),
    )  # fmt: skip
    guarded = hc.Interface(delay=1e-4, passivity=True, coupling=hc.Coupling(5e3, 5.0))
    while True:
        b = rng.uniform(5.0, 300.0)
        clay = hc.slab(b, 0.05, 0.06)
        yield varied(CUT, rng, clay=clay)
        yield varied(dataclasses.replace(CUT, operator=hc.Operator()), rng)
        yield varied(CUT, rng, clay=hc.slab(1e5 * b, 0.05, 0.15))  # stiff
        yield varied(CUT, rng, clay=None, shaping=True)
        yield varied(CUT, rng, operator=(hc.Operator(0.2, b, 1.0), None))
        yield varied(CUT, rng, servo=(other if b > 100.0 else SERVO[0], SERVO[1]))
        yield varied(CUT, rng, origin=(rng.uniform(0.0, 0.02), 0.15), torque_limit=(9.0, 5.0))
        yield varied(CUT, rng, clay=None, start=(0.058, 0.0), velocity=(0.3, 0.0), length=0.06)
        yield varied(
            CUT, rng, clay=hc.Clay(hc.Profile((0.05,), (1.0, b)), hc.Profile((0.0,), (b, 2.0), "y"))
        )
        yield varied(WIRED, rng, clay=clay)
        yield varied(dataclasses.replace(WIRED, operator=hc.Operator()), rng, clay=clay)
        yield varied(dataclasses.replace(WIRED, interface=None), rng, clay=clay)
        yield varied(dataclasses.replace(WIRED, interface=rich), rng, clay=clay)
        yield varied(dataclasses.replace(WIRED, interface=guarded), rng, clay=clay, Ts=7.2e-4)
        yield varied(WIRED, rng, clay=clay, render="implicit")
        yield dataclasses.replace(CUT, gain=(100.0 * b, 100.0 * b), start=(0.06, 0.0), t_max=0.3)
        # and, one by one
        yield dataclasses.replace(grown, start=(rng.uniform(0.0, 0.01), 0.0))
        yield varied(CUT, rng, clay=hc.slab(hc.Flow(Fy=0.5, b=b), 0.05, 0.15))
        yield dataclasses.replace(CUT, integrator="accurate", gain=(rng.uniform(0.1, 1.0), 0.2))
        yield varied(WIRED, rng, interface=hc.Interface(jitter=2e-5, force_noise=0.01))


def entry(s):
    """The summary of a run alone, in Python."""
    brief = record.brief(hc.simulate(s, engine="python"))
    return np.array([batch.summary_entry(*brief)], batch.SUMMARY)


@pytest.mark.parametrize("threads", [1, 3])
def test_summaries_of_short_runs_are_those_of_simulate_bit_for_bit(threads):
    rng, scenes = random.Random(threads), []
    source = kinds(rng)

    def generated():
        for _ in range(20 * 8):
            scenes.append(next(source))
            yield scenes[-1]

    found = hc.simulate_batch(generated(), keep="summaries", threads=threads)
    assert len(found) == len(scenes) == 160
    for i, s in enumerate(scenes):
        alone = entry(s)
        for name in batch.SUMMARY.names:
            assert found[name][i].tobytes() == alone[name][0].tobytes(), (i, i % 20, name)
    # all ways to end, and runs that cross
    assert {"finished", "time limit", "diverged"} <= set(found["code"])
    assert found["crossings"].max() >= 2


def test_runs_of_one_kind_are_made_together_and_others_are_left():
    from hapticclay.stepping import compiled

    source = kinds(random.Random(5))
    scenes = [next(source) for _ in range(20 * 5)]
    done, left = compiled.BatchPool(1).many(scenes)
    places = sorted([*left, *(i for at, _ in done for i in at.tolist())])
    assert places == list(range(100))
    alone = {i % 20 for i in left}
    assert {15, 16, 17, 18, 19} <= alone  # 15 diverges, and is judged by the monitor
    assert not alone & {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}


def test_resting_handles_are_told_as_the_monitor_tells_them():
    still = dataclasses.replace(CUT, force=(0.0, 0.0))
    bound = dataclasses.replace(CUT, torque_limit=(1e-5, 1e-5), force=(1e-4, 0.0))
    for s in (still, bound):
        found = hc.simulate_batch([s] * 40, keep="summaries")
        assert found.tobytes() == np.repeat(entry(s), 40).tobytes()
    assert hc.simulate_batch([still] * 40, keep="summaries")["code"][0] == "stalled"


def test_a_generator_is_taken_as_it_is_run():
    alive, most = weakref.WeakSet(), []

    def generated():
        for i in range(1500):
            s = dataclasses.replace(CUT, t_max=400.5 * CUT.dt, gain=(0.2 + 1e-4 * i, 0.2))
            alive.add(s)
            most.append(len(alive))
            yield s

    found = hc.simulate_batch(generated(), keep="summaries", threads=2)
    assert len(found) == 1500 and np.all(found["steps"] == 401)
    part = round(batch.PART_STEPS / 400.0) + 1
    # two parts a thread wait or run, one is being gathered; and the first, and patterns
    assert max(most) <= 5 * part + batch.MANY + 4
    assert found.nbytes == 1500 * batch.SUMMARY.itemsize


def test_no_run_is_lost_where_summaries_grow():
    n = 3000
    gains = 0.2 + 0.5 * np.arange(n) / n
    same = dataclasses.replace(CUT, t_max=20.5 * CUT.dt, length=None)
    found = hc.simulate_batch(
        (dataclasses.replace(same, gain=(k, 0.2)) for k in gains.tolist()), keep="summaries"
    )
    assert len(found) == n and np.all(found["steps"] == 21)
    for i in (0, 1, 999, 1000, 1001, n - 1):
        alone = entry(dataclasses.replace(same, gain=(float(gains[i]), 0.2)))
        assert found[i].tobytes() == alone[0].tobytes()


def test_ctrl_c_in_a_generator_without_end_ends_the_batch():
    taken = []

    def endless():
        while True:
            taken.append(None)
            if len(taken) == 500:
                signal.raise_signal(signal.SIGINT)
            yield CUT

    with pytest.raises(KeyboardInterrupt):
        hc.simulate_batch(endless(), keep="summaries", threads=2)
    assert len(taken) == 500


def test_what_a_generator_raises_or_gives_wrongly_reaches_the_caller():
    def broken(last):
        for _ in range(100):
            yield CUT
        if last is None:
            raise RuntimeError("no more")
        yield last

    with pytest.raises(RuntimeError, match="no more"):
        hc.simulate_batch(broken(None), keep="summaries")
    with pytest.raises(hc.ParameterError, match=r"scenarios\[100\]"):
        hc.simulate_batch(broken("free"), keep="summaries")
    with pytest.raises(hc.ParameterError, match=r"scenarios\[1\]"):  # and before any run
        hc.simulate_batch([CUT, "free"], keep="summaries")  # type: ignore[list-item]


@pytest.mark.perf
def test_short_runs_cost_little_more_than_their_steps():
    """A guard, not the measurement: benchmarks/throughput.py measures 1.2, and 3 one by one."""
    from benchmarks import throughput

    scenes = list(throughput.monte_carlo(1000, "continuous"))
    hc.simulate_batch(scenes[:100], keep="summaries", threads=1)
    ratios = []
    for _ in range(3):
        before = throughput.floor(scenes[0], 20_000, time.process_time)
        begin = time.process_time()
        found = hc.simulate_batch(scenes, keep="summaries", threads=1)
        took = time.process_time() - begin
        bare = 0.5 * (before + throughput.floor(scenes[0], 20_000, time.process_time))
        ratios.append(took / (bare * found["steps"].sum()))
    assert min(ratios) < 2.0
