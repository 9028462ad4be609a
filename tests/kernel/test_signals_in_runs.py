"""Runs under signals of every shape against independent solutions, and their orders.

With shaping each axis is linear: it is solved by DOP853 at 1e-12 from break to break of the signal,
which is written out here a second time as a plain function of time.
"""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.errors import ParameterError
from tests.hunt import some
from tests.oracles import axis_rates

TH = (0.25, 2.0, 6.0)
T_MAX = 0.768  # a whole number of all steps below
TIMES = (0.0, 0.1, 0.3, 0.35, 0.5, 0.8)
FORCES = (0.0, 2.0, -1.0, 1.5, 0.5, 0.0)


def chirp(t, log=False):
    """2 sin of a phase that goes from 1 to 6 Hz within 0.5 s from 0.1 s on."""
    x = t - 0.1
    if not 0.0 <= x < 0.5:
        return 0.0
    cycles = (6 ** (x / 0.5) - 1) * 0.5 / math.log(6) if log else x + 0.5 * 5 / 0.5 * x**2
    return 2.0 * math.sin(2 * math.pi * cycles + 0.3)


def pulses(t):
    return 2.0 * (t >= 0.05 and (t - 0.05) % 0.2 < 0.06)


WAVE = hc.Multisine((1.0, 0.0), 0.5, 3.0, 2.0, seed=3)


def multisine(t, m=WAVE):
    return sum(
        m.amplitude[0] * math.cos(w * t + p)
        for w, p in zip(m.omega.tolist(), m.phase[:, 0].tolist(), strict=True)
    )


TRAIN = [0.05, 0.11, 0.25, 0.31, 0.45, 0.51, 0.65, 0.71]
BOTH = (1.0, 0.5)  # every signal acts on y at half its size; multisines have other phases there
CASES = {  # signal, its value along x, times at which it breaks
    "constant": (hc.Constant((1.5, 0.75)), lambda t: 1.5, []),
    "step on the samples": (hc.Step((2.0, 1.0), 0.192), lambda t: 2.0 * (t >= 0.192), [0.192]),
    "step off the samples": (hc.Step((2.0, 1.0), 0.1234), lambda t: 2.0 * (t >= 0.1234), [0.1234]),
    "ramp": (
        hc.Ramp((9.0, 4.5), 0.101, 0.3003),
        lambda t: 9.0 * (min(max(t, 0.101), 0.3003) - 0.101),
        [0.101, 0.3003],
    ),
    "pulse": (
        hc.Pulse((4.0, 2.0), 0.0777, 0.1),
        lambda t: 4.0 * (0.0777 <= t < 0.1777),
        [0.0777, 0.1777],
    ),
    "pulses": (hc.Pulse((2.0, 1.0), 0.05, 0.06, 0.2), pulses, TRAIN),
    "chirp": (hc.Chirp((2.0, 1.0), 1.0, 6.0, 0.5, 0.3, start=0.1), chirp, [0.1, 0.6]),
    "log chirp": (
        hc.Chirp((2.0, 1.0), 1.0, 6.0, 0.5, 0.3, log=True, start=0.1),
        lambda t: chirp(t, True),
        [0.1, 0.6],
    ),
    "samples": (
        hc.Samples(TIMES, [(f, 0.5 * f) for f in FORCES]),
        lambda t: float(np.interp(t, TIMES, FORCES)),
        list(TIMES[1:]),
    ),
    "held samples": (
        hc.Samples(TIMES, [(f, 0.5 * f) for f in FORCES], "hold"),
        lambda t: FORCES[sum(t >= x for x in TIMES) - 1],
        list(TIMES[1:]),
    ),
    "function": (
        hc.Function(lambda t: (2.0 * np.sin(20.0 * t) ** 2, np.sin(20.0 * t) ** 2)),
        lambda t: 2.0 * math.sin(20.0 * t) ** 2,
        [],
    ),
    "sum": (
        hc.Step((2.0, 1.0), 0.1234)
        - 0.5 * hc.Chirp((2.0, 1.0), 1.0, 6.0, 0.5, 0.3, start=0.1)
        + hc.Function(lambda t: (math.exp(-t), 0.5 * math.exp(-t)))
        + WAVE,
        lambda t: 2.0 * (t >= 0.1234) - 0.5 * chirp(t) + math.exp(-t) + multisine(t),
        [0.1, 0.1234, 0.6],
    ),
}


def solved(times, breaks, uh=lambda t: 0.0, command=lambda t: 0.0, axis=0):
    """p of one axis with Th at times, from break to break."""
    rates = axis_rates(axis, scene().gain[axis], TH)
    edges = [0.0, *[x for x in breaks if 0.0 < x < T_MAX], T_MAX]
    z, out = np.zeros(6), np.zeros(len(times))
    start = command(0.0)
    for a, b in zip(edges, edges[1:], strict=False):

        def rhs(t, z, a=a, b=b):
            t = min(max(t, a + 1e-13), b - 1e-13)  # as the signal is in between
            return rates(z, 0.0, uh(t), command(t) - start)

        s = solve_ivp(rhs, (a, b), z, "DOP853", rtol=1e-12, atol=1e-15, dense_output=True)
        z, mine = s.y[:, -1], (times >= a) & (times <= b)
        out[mine] = s.sol(times[mine])[0]
    return out


def scene(**kw):
    s = hc.free(inertia_shaping=True, operator=hc.Operator(), force=(0.0, 0.0), t_max=T_MAX)
    return dataclasses.replace(s, length=None, **kw)


SHARED = 0.024 * np.arange(33)  # the samples that all steps share [s]


@functools.cache
def paths(name, drive):
    """p of each axis at those samples."""
    _, value, breaks = CASES[name]
    out = []
    for i in (0, 1) if name != "sum" else (0,):  # its multisine has other phases along y
        how = {"uh": lambda t, i=i: BOTH[i] * value(t)}
        if drive == "command":
            how = {"command": lambda t, i=i: 1e-3 * BOTH[i] * value(t)}
        out.append(solved(SHARED, breaks, **how, axis=i))
    return out


def errors_of(name, drive, integrator, steps):
    """Largest error at the samples that all steps share, over the largest p of the axis."""
    signal = CASES[name][0] if drive == "muscle" else 1e-3 * CASES[name][0]
    out = []
    for dt in steps:
        r = hc.simulate(scene(**{drive: signal}, integrator=integrator, dt=dt))
        assert r.outcome.code in ("time limit", "stalled")
        keep = np.isclose(r.t / 0.024, np.rint(r.t / 0.024), rtol=0, atol=1e-9)
        np.testing.assert_allclose(r.t[keep], SHARED, rtol=0, atol=1e-12)
        out.append(
            max(
                np.max(np.abs(r.p[keep, i] - exact)) / np.max(np.abs(exact))
                for i, exact in enumerate(paths(name, drive))
            )
        )
    return np.array(out)


# counted from its start, a constant command is none
COMMANDS = some([(name, "command") for name in CASES if name != "constant"], 6)
DRIVES = [*((name, "muscle") for name in CASES), *COMMANDS]


@pytest.mark.parametrize(("name", "drive"), DRIVES)
def test_kick_is_of_second_order_under_any_signal(name, drive):
    """Jumps included, on the samples or off: each kick takes the exact mean.

    The constant of the error changes with the place of a jump within its step: error/dt^2 stays
    within a factor of 3 while a loss of one order would make it 4.
    """
    steps = np.array([4e-3, 3e-3, 2e-3, 1e-3])
    constants = errors_of(name, drive, "fast", steps) / steps**2
    assert constants.max() < 3.0 * constants.min() and constants.max() < 400.0, constants


@pytest.mark.parametrize(("name", "drive"), DRIVES)
def test_accurate_runs_are_of_fourth_order_under_any_signal(name, drive):
    """Steps end on jumps and kinks, and see the near side of them."""
    steps = np.array([8e-3, 4e-3, 2e-3])
    errors = errors_of(name, drive, "accurate", steps)
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 3.6 < order < 4.7 and errors[-1] < 3e-7, (order, errors)


def test_sampled_runs_converge_at_second_order_under_a_jump():
    """The arm between the samples of a control of 2.88 ms, the jump off all samples.

    A jump of 2 N that is a tenth of a step late moves the handle by 1e-5 m.
    """
    s = scene(muscle=CASES["step off the samples"][0], control="sampled", Ts=2.88e-3, dt=2.88e-3)
    s = dataclasses.replace(s, t_max=0.576, render="physical")
    parts = np.array([1, 2, 4, 8])
    *p, exact = (hc.simulate(dataclasses.replace(s, dt=2.88e-3 / n)).p[::n] for n in (*parts, 64))
    constants = [np.abs(x - exact).max() * n**2 for x, n in zip(p, parts, strict=True)]
    assert max(constants) < 2e-6, constants


WAYS = [
    dict(),
    dict(integrator="accurate", dt=1e-3),
    dict(control="sampled", Ts=1.44e-3),
    dict(control="sampled", dt=1.8e-4, Ts=3.6e-4, hardware=hc.Hardware(jitter=5e-5, delay=1e-4)),
]
ARRAYS = ("t", "p", "v", "fh", "fe", "tau", "delta", "q", "qd")


@pytest.mark.parametrize("kw", WAYS)
def test_a_constant_signal_is_a_constant_force(kw):
    s = dataclasses.replace(scene(**kw), t_max=0.2)
    a = hc.simulate(dataclasses.replace(s, muscle=hc.Constant((1.0, 0.5)), force=(0.5, 0.0)))
    b = hc.simulate(dataclasses.replace(s, force=(1.5, 0.5)))
    for x in ARRAYS:
        np.testing.assert_array_equal(getattr(a, x), getattr(b, x))
    assert not a.scenario.driven


@pytest.mark.parametrize("kw", WAYS[:3])
def test_a_multisine_in_a_sum_is_the_multisine(kw):
    wave = hc.Multisine((1.0, 0.5), 0.5, 3.0, 2.0)
    s = dataclasses.replace(scene(command=1e-3 * wave, **kw), t_max=0.2)
    a, b = (hc.simulate(dataclasses.replace(s, muscle=x)) for x in (wave, hc.Sum((wave,))))
    for x in ARRAYS:
        np.testing.assert_array_equal(getattr(a, x), getattr(b, x))


@pytest.mark.parametrize("kw", WAYS)
def test_a_function_is_asked_within_the_run_alone_and_part_by_part(kw):
    """Once for each half step and twice in it, where both drives are its; never far ahead."""
    asked = []

    def f(t):
        asked.append(float(t))  # refuses arrays
        return math.sqrt(t), math.sqrt(T_MAX - t)  # refuses any time outside

    s = scene(muscle=hc.Function(f), **kw)
    r = hc.simulate(s)
    assert r.outcome.code == "time limit"
    assert min(asked) == 0.0 and max(asked) == pytest.approx(T_MAX, abs=1e-12)
    assert len(asked) < 6.3 * T_MAX / s.dt + 100
    asked.clear()
    steady = hc.Function(lambda t: asked.append(float(t)) or (0.1, 0.0))
    long = dataclasses.replace(s, muscle=steady, t_max=1e5)
    hc.simulate(long, every=1000, progress=lambda t, x: True)
    assert len(asked) < 6.3 * 2 * 4200 and max(asked) < 2 * 4200 * s.dt


@pytest.mark.parametrize("engine", ["python", "native"])
def test_what_a_function_does_wrong_is_named_with_its_time(engine):
    for f, told in (
        (lambda t: (1.0, 0.0 if t < 0.5 else math.nan), "not (1.0, nan)"),
        (lambda t: (1.0 / (0.5 - t), 0.0) if t == 0.5 else (0.0, 0.0), "ZeroDivisionError"),
        (lambda t: 1.0 if t >= 0.5 else (0.0, 0.0), "not 1.0"),
    ):
        with pytest.raises(ParameterError, match=r"function.f.*f\(0\.50*[0-9]*\)") as e:
            hc.simulate(scene(muscle=hc.Function(f), dt=1e-3), engine=engine)
        assert told in str(e.value)


def test_a_recorded_force_replays_from_a_file(tmp_path):
    """The muscle force of a run under another signal, written at half steps and read again."""
    wave = hc.Multisine((1.0, 0.5), 0.5, 3.0, 2.0) + hc.Step((1.0, 0.0), 0.25)
    t = np.unique(np.append(np.arange(0.0, T_MAX + 1e-9, 1.25e-4), (0.25 - 1e-9, 0.25)))
    f = tmp_path / "force.csv"
    np.savetxt(f, np.column_stack((wave(t), t)), "%.17g", ",", header="fx,fy,t", comments="")
    a, b = (hc.simulate(scene(muscle=x, dt=5e-4)) for x in (wave, hc.Samples.csv(f)))
    # straight lines over 0.125 ms miss (omega dt)^2/8 of 3 Hz: 7e-7 of the force
    assert np.abs(a.p - b.p).max() < 2e-6 * np.abs(a.p).max()


def test_growing_motion_under_a_constant_signal_is_instability():
    """It is not driven: a gain above its limit shows as under a constant force."""
    s = hc.constant_cut(
        gain=(30.0, 0.2), operator=hc.Operator(), force=(0.0, 0.0), start=(0.06, 0.0)
    )
    a, b = (
        hc.simulate(dataclasses.replace(s, **kw))
        for kw in (dict(muscle=hc.Constant((1.0, 0.0))), dict(force=(1.0, 0.0)))
    )
    assert a.outcome == b.outcome and a.outcome.code == "diverged"


@pytest.mark.parametrize("name", CASES)
def test_signals_survive_files(tmp_path, name):
    """In a scenario file, in a record, and by dotted name; a function is refused by its name."""
    s = hc.Scenario(muscle=CASES[name][0], command=1e-3 * CASES[name][0], t_max=0.01)
    if "Function" in repr(s.muscle):
        with pytest.raises(ParameterError, match="cannot be written"):
            s.save(tmp_path / "my.toml")
        return
    for file in ("my.toml", "my.json"):
        s.save(tmp_path / file)
        assert hc.Scenario.load(tmp_path / file) == dataclasses.replace(s, name=s.name)
    assert hc.Record.load(hc.simulate(s).save(tmp_path / "record")).scenario == s


def test_fields_of_a_signal_have_names():
    s = hc.Scenario(muscle=hc.Step((1.0, 0.0), 0.5))
    assert hc.with_fields(s, {"muscle.time": "20 ms"}).muscle == hc.Step((1.0, 0.0), 0.02)
    with pytest.raises(ParameterError, match="muscle.time"):
        hc.with_fields(s, {"muscle.tiem": 0.1})
