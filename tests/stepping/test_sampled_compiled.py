"""Sampled runs, compiled, against those of Python to the last bit: each part, and all of them."""

import dataclasses

import pytest

import hapticclay as hc
from hapticclay.model.constants import TS
from hapticclay.stepping.run import EngineStore, Run, completed
from tests.stepping.test_compiled import GROWING, LAYERS, WAVE, fast, same

ALL = dict(
    jitter=5e-5, dropout_probability=0.05, encoder=65536, velocity="difference",
    velocity_window=5, velocity_filter=200.0,
    adc_bits=12, force_noise=0.05, force_filter=400.0, dac_bits=14, dac_range=(30.0, 20.0),
    delay=1.7 * TS, friction=(0.02, 0.01), passivity=True, coupling=hc.Coupling(3000.0, 300.0),
    seed=4,
)  # fmt: skip
PHYSICAL = {name: x for name, x in ALL.items() if name not in ("passivity", "coupling")}
HAND = dict(operator=hc.Operator())
STIFF = dict(render="physical", b=1e5, gain=(1.0, 0.1))
SCENES = {  # of eight kinds, each compiled for some 12 s: every part is in one of them
    "ideal": (None, {}),
    "substeps": (None, dict(dt=1e-4, Ts=4e-4)),
    "stiff": (None, STIFF | HAND),
    "not stable": (None, dict(b=8e3, start=(0.02, 0.0), gain=(1.0, 0.1), t_max=1.0)),
    "not on the grid": (None, dict(t_max=0.1001)),
    "weak": (None, dict(torque_limit=(0.3, 0.2))),
    "layers": (ALL, dict(clay=LAYERS, **HAND)),
    "growing": (None, dict(clay=GROWING, render="physical", muscle=WAVE)),
    "driven": (
        ALL,
        dict(
            inertia_shaping=True, muscle=WAVE,
            command=dataclasses.replace(WAVE, rms=(1e-3, 2e-3)),
        ),
    ),
    "all": (ALL, HAND),
    "all, stiff": (PHYSICAL, STIFF),
    "all, slow": (ALL | dict(delay=0.01), dict(dt=1e-4, Ts=0.05, **HAND)),
    "first order": (dict(force_filter=500.0, filter_order=1), {}),
    "jitter and delay": (dict(jitter=8e-5, delay=0.4 * TS, dropout_probability=0.1), {}),
}  # fmt: skip


def scene(name):
    parts, kw = SCENES[name]
    kw = dict(t_max=0.3, clay=(0.01, 0.05), force=(2.0, 0.1), control="sampled") | kw
    more = {x: kw.pop(x) for x in ("torque_limit", "muscle", "command") if x in kw}
    if not isinstance(kw["clay"], tuple):
        more["clay"] = kw.pop("clay")
    parts = hc.Hardware(**parts) if parts else None
    return dataclasses.replace(hc.constant_cut(**kw), hardware=parts, **more)


@fast
@pytest.mark.parametrize("name", SCENES)
def test_both_ways_of_running_agree_to_the_last_bit(name):
    s = scene(name)
    same(hc.simulate(s, engine="python"), hc.simulate(s, engine="native"))


@fast
@pytest.mark.parametrize("name", ["ideal", "all", "not stable", "growing"])
def test_the_end_of_a_run_alone_is_that_of_the_whole_run(name):
    from hapticclay.stepping import compiled

    run = Run(scene(name), 1, compiled.KERNEL)
    run.go(None)
    last, _ = completed(scene(name), 10**9, compiled.KERNEL, EngineStore(), brief=True)
    brief, whole = last.brief(), run.brief()
    assert brief[0] == whole[0] and brief[2] == whole[2] and brief[4] == whole[4]
    assert [tuple(map(float, x)) for x in brief[3]] == [tuple(map(float, x)) for x in whole[3]]


def test_a_run_paused_at_every_sample_is_the_run():
    s = dataclasses.replace(scene("all"), t_max=0.05)
    whole, parts = Run(s, 1), Run(s, 1)
    whole.go(None)
    while parts.outcome is None:
        parts.advance(parts.filled + 1)
    parts.flush()
    for name, x in whole.arrays().items():
        assert (x == parts.arrays()[name]).all(), name
    assert whole.balance() == parts.balance()
