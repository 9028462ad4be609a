"""All engines make the same run, to the last bit: CPython, the compiled kernel, batches.

An entry of KINDS is a method with some parts, in scenes that differ in numbers. `present` finds
every trait of `model.support` under every method that takes it.
"""

import dataclasses
import itertools

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.kernel import hardware, kick, records
from hapticclay.kernel.native import is_there
from hapticclay.model import support
from hapticclay.model.cells import Profile
from hapticclay.model.clay import LAWS, Clay
from hapticclay.model.constants import TS
from hapticclay.model.signals import Multisine
from hapticclay.simulation import batch, record
from hapticclay.simulation.run import Run
from tests.hunt import HUNTS, some
from tests.kernel import guards
from tests.kernel.test_kick import HANDS, NEAR, OTHER, ZEROS
from tests.kernel.test_own_controller import to_pose
from tests.kernel.test_signals_in_runs import CASES as SIGNALS

native = pytest.mark.skipif(not is_there(), reason="needs the compiled kernel")
GROWING = Clay(
    Profile((0.01,), (50.0, 100.0), growth=(0.0, 300.0)),
    Profile((0.01,), (50.0, 100.0), growth=(9.0, 0.0)),
)
WAVE = Multisine(rms=(1.0, 0.5), low=0.2, high=3.0, period=5.0, seed=5)
LAYERS = Clay(
    Profile((0.01, 0.02, 0.03), (0.0, 50.0, 500.0, 5.0)), Profile((0.001,), (10.0, 90.0), along="y")
)

PHYSICAL = dict(
    jitter=5e-5, dropout_probability=0.05, encoder=65536, velocity="difference",
    velocity_window=5, velocity_filter=200.0,
    adc_bits=12, force_noise=0.05, force_filter=400.0, dac_bits=14, dac_range=(30.0, 20.0),
    delay=1.7 * TS, friction=(0.02, 0.01), seed=4,
)  # fmt: skip
ALL = PHYSICAL | dict(passivity=True, coupling=hc.Coupling(3000.0, 300.0))
HAND = hc.Operator()
METHODS = {  # with steps as long as the scenes bear: each costs the same in CPython
    "fast": dict(dt=7.2e-4),
    "accurate": dict(integrator="accurate", dt=2e-3),
    "held": dict(control="sampled", dt=7.2e-4),
    "physical": dict(control="sampled", render="physical", dt=7.2e-4),
}


def run(method, clay, **more):
    """A slanted path of 0.15 s through clay."""
    kw = dict(t_max=0.15, force=(2.0, 0.7), length=None, stop_when_unstable=False) | METHODS[method]
    hardware = more.pop("hardware", None)
    more["hardware"] = hc.Hardware(**hardware) if hardware else None
    return dataclasses.replace(hc.free(), clay=clay, **(kw | more))


def variants(method, clay, common, **changes):
    """Scenes of one kind by name: what they have in common, and what each changes."""
    return {
        name: run(method, **({"clay": clay} | common | change)) for name, change in changes.items()
    }


def signals(method, clay, among=SIGNALS, **common):
    """Driven by each signal, both ways."""
    dt = {} if "Ts" in common else dict(dt=4e-3)
    common = dict(force=(0.0, 0.0), t_max=0.66) | dt | common
    return {
        name: run(method, clay, muscle=2.0 * signal, command=1e-4 * signal, **common)
        for name, (signal, *_) in SIGNALS.items()
        if signal.varies and name in among
    }


RANDOM = np.random.default_rng(3)
SMOOTH = hc.Smooth((0.0, 0.04), (-0.01, 0.02), np.round(RANDOM.uniform(0.0, 120.0, (7, 6)), 1))
CELLS = hc.Grid(
    tuple(0.002 * i for i in range(1, 9)), tuple(0.001 * i for i in range(-2, 9)),
    np.round(RANDOM.uniform(0.0, 120.0, (9, 12)), 1), growth=RANDOM.uniform(0.0, 9.0, (9, 12)),
)  # fmt: skip
TURNED, OTHERWISE = Clay(SMOOTH, CELLS, 0.5), Clay(SMOOTH, CELLS, -2.0)
GROWTH = Profile((0.001, 0.005, 0.01, 0.02), (0.0, 50.0, 5.0, 90.0, 10.0), growth=(0, 9, 0, 200, 0))
GROWS = Clay(GROWTH, GROWTH)
STIFF, SOFT = (
    Clay(Profile((0.003, 0.02), (0.0, x, 20.0)), Profile((0.001,), (10.0, y), "y"))
    for x, y in ((1e5, 90.0), (1e3, 1e5))
)
BLOCK = hc.Groove(x=(-0.03, 0.07), y=(-0.03, 0.03), pressure=20e3)
WEAK = dict(torque_limit=(0.3, 0.2))
SHAKEN = dict(operator=HAND, muscle=WAVE)
LED = dataclasses.replace(WAVE, rms=(1e-3, 2e-3))


def yields(Fy, K, n, b, along=False, angle=0.0):
    """Clay that yields, behind 3 mm; y has half of each but n."""
    laws = [
        Profile((0.003, 0.03), (0.0, x * b, 1.0), Fy=(0.0, x * Fy, 0.1), K=(0.0, x * K, 0.0),
                n=(1.0, n, 1.0))
        for x in ((1.0, 1.0) if along else (1.0, 0.5))
    ]  # fmt: skip
    return Clay(*laws, angle, isotropic=along)


COULOMB, BINGHAM = (0.5, 0.0, 1.0, 0.0), (0.6, 0.0, 1.0, 20.0)
THINS, THICKENS, HELD = (0.5, 2.0, 0.4, 10.0), (0.3, 30.0, 1.5, 2.0), (6.0, 0.0, 1.0, 0.0)
FLOWS = dict(coulomb=COULOMB, bingham=BINGHAM, thins=THINS, thickens=THICKENS, holds=HELD)
PULSE = hc.Step((2.0, 0.5), 0.0) + hc.Step((-4.5, -0.9), 0.04) + hc.Ramp((40.0, 15.0), 0.09, 0.14)


def flows(method, along=False, angles=(0.0,), b=1.0, **common):
    """A handle pushed to rest and on again in clay of each law."""
    common = dict(operator=HAND, muscle=PULSE, force=(1.0, 0.2), start=(0.002, 0.0)) | common
    return {
        f"{name}, {angle:g}": run(
            method, yields(*law[:3], b * (law[3] or 1.0), along, angle), **common
        )
        for (name, law), angle in zip(FLOWS.items(), itertools.cycle(angles), strict=False)
    } | {"weak": run(method, yields(*BINGHAM[:3], b * 20.0, along, angles[0]), **common, **WEAK)}


def springs(**common):
    """Walls that spring back, yield and relax."""
    out = {}
    for name, spring in {
        "gives way": hc.Spring(k=2e3, limit=1.0, k1=500.0, tau=0.1),
        "surface": hc.Spring(k=2e4, limit=3.0, k1=1e3, tau=0.05, unilateral=True),
        "lasts": hc.Spring(k=800.0),
    }.items():
        law = Profile(
            (0.003, 0.02), (0.0, 20.0, 5.0), Fy=(0.0, 0.5, 0.2),
            springs=(hc.Spring(), spring, hc.Spring()),
        )  # fmt: skip
        out[name] = run(clay=Clay(law, Profile((), (3.0,))), **common)
    return out


def grooves(method, damping=0.0, **common):
    """Clay that stays cut, fresh and cut, soft and hard, beneath layers and turned."""
    law = Profile((0.005, 0.02), (0.0, 40.0, 10.0))
    hard = dataclasses.replace(BLOCK, gradient=1e6, damping=damping)
    block = dataclasses.replace(BLOCK, damping=damping)
    common = dict(force=(3.0, 1.0), start=(0.0045, 0.0), t_max=0.06) | common
    return variants(
        method, Clay(law, law, angle=0.3, groove=block), common,
        cut={}, hard=dict(clay=Clay(law, law, angle=0.3, groove=hard)), weak=WEAK,
        steep=dict(force=(0.5, 3.0), length=0.004, start=(0.0039, 0.0)),
    )  # fmt: skip


MORE = {
    "whole cut": hc.constant_cut(dt=1e-3),  # more than two buffers of samples
    "muscle": dataclasses.replace(
        hc.free(operator=hc.Operator(), t_max=1.0, dt=1e-3), clay=GROWING, length=None, muscle=WAVE
    ),
    "command": dataclasses.replace(
        hc.free(t_max=0.5), command=dataclasses.replace(WAVE, rms=(1e-3, 2e-3))
    ),
    "growth": dataclasses.replace(hc.free(t_max=2.0, dt=1e-3), clay=GROWING),
    "layers": dataclasses.replace(hc.free(t_max=1.0, force=(1.0, 0.3), dt=1e-3), clay=LAYERS),
    "at speed": dataclasses.replace(
        hc.constant_cut(b=1e4, t_max=0.05, torque_limit=(1e5, 1e5)), velocity=(2.0, 0.0)
    ),
    "backwards": hc.constant_cut(start=(0.052, 0.0), force=(-1.0, 0.0), t_max=0.4),
    "along a border": hc.constant_cut(start=(0.1501, 0.0), force=(0.0, 1.0), t_max=0.3),
    "diverged": hc.constant_cut(gain=(1.0, 1.5), start=(0.051, 0.0), force=(1.0, 1.0)),
    "thrown out of reach": hc.constant_cut(gain=(1e4, 1e4), torque_limit=(1e6, 1e6)),
    "unstable, goes on": dataclasses.replace(
        hc.constant_cut(gain=(25.0, 0.5), t_max=2.0), stop_when_unstable=False
    ),
    "stretched": hc.constant_cut(force=(1.0, 50.0), start=(0.0, 0.1), length=0.15),
    "stalled": hc.constant_cut(force=(0.0, 0.0), t_max=1.2, dt=1e-3),
    "one short step": hc.constant_cut(t_max=1e-5),
    "not on the grid": hc.constant_cut(t_max=0.1001),
    "coarse": hc.constant_cut(dt=0.02, t_max=3.0),
}


STILL = {  # by the accurate method as well
    "cut": hc.constant_cut(force=(2.0, 0.0), start=(0.04, 0.0)),
    "off axis, origin": hc.constant_cut(force=(1.0, 0.3), start=(0.04, 0.0), t_max=1.0),
    "stiff: substeps": hc.constant_cut(b=2e4, start=(0.0498, 0.0), t_max=0.05),
    "diverged": hc.constant_cut(gain=(1.0, 2.5), start=(0.051, 0.0), force=(1.0, 0.1)),
    "stretched": dataclasses.replace(MORE["stretched"], torque_limit=(1e4, 1e4)),
    "not on the grid": hc.constant_cut(t_max=0.9007),
    **{name: MORE[name] for name in ("layers", "at speed", "backwards", "one short step")},
}
OWN = hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01))


FORMED = dict(compensator=ZEROS, operator=HANDS, **OTHER)
FILTERED = dict(
    jitter=8e-5, dropout_probability=0.1, delay=0.4 * TS, force_filter=500.0, filter_order=1
)


BENT = """<mujoco><option density="300" viscosity="1" gravity="0 -9.81 0"/><worldbody>
<body gravcomp="0.5"><joint name="a" damping="0.1 0.2 0.1" stiffness="1 2 3" range="-3 3"/>
<geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0"/><body pos="0.3 0 0">
<joint name="b" ref="90" damping="0 0.3"/><geom type="capsule" size="0.02" fromto="0 0 0 0 0.2 0"/>
<site name="handle" pos="0 0.25 0"/></body></body></worldbody><tendon><fixed name="t" damping="0.1"
stiffness="5" springlength="0.2" armature="0.01"><joint joint="a" coef="1"/><joint joint="b"
coef="-0.5"/></fixed></tendon></mujoco>"""


def arms(method, **common):
    """Arms from files: planar, closed, spatial, with all that may act on them."""
    spring = (hc.Spring(), hc.Spring(k=300.0), hc.Spring())
    law = Profile((0.002, 0.01), (0.0, 20.0, 5.0), springs=spring)
    clay = Clay(law, Profile((0.001,), (3.0, 8.0), "y"))
    out = {}
    for i, (card, plane) in enumerate(
        (("planar_2r", None), ("five_bar", None), ("haptic_3", "zx"), ("leader_7", "yz"))
    ):
        arm = hc.MjcfArm(card, plane=plane, torque_limit=[3.0] * len(hc.MjcfArm(card).names))
        n = len(arm.names)
        kind = ("difference", "filter", "exact", "filter")[i]
        law = hc.JointPD(
            (4.0,) * n, (0.05,) * n, velocity=kind, cutoff=90.0 if kind == "filter" else None,
            reference=tuple(arm.q + 0.1), friction=((0.05, 20.0, 0.001),) * n,
            velocity_bits=12, velocity_range=30.0,
        )  # fmt: skip
        parts = dict(
            arm=arm, controller=law, clay=clay, Ts=1e-3, dt=5e-4, t_max=0.03, operator=HAND,
            muscle=WAVE, force=(1.0, 0.5), stop_when_unstable=False, render=method,
            hardware=hc.Hardware(encoder=4096, delay=1.3e-3, dac_bits=12, jitter=2e-5),
        )  # fmt: skip
        out[card] = hc.Scenario(**parts | common)
    bent = hc.MjcfArm(
        mujoco.MjSpec.from_string(BENT), friction=[0.05, 0.02], torque_limit=[3.0, 3.0]
    )
    out["bent"] = dataclasses.replace(out["planar_2r"], arm=bent)
    return out | {"own law": dataclasses.replace(out["planar_2r"], controller=OWN)}


def straight(method):
    """The arm is bent, but measured exactly straight, by encoders of four counts."""
    return variants(
        method, LAYERS, dict(hardware=dict(encoder=4), force=(1.0, 150.0), t_max=0.6, dt=2e-3),
        measured={}, uneven=dict(hardware=dict(encoder=4, jitter=3e-4, dropout_probability=0.1)),
        rubs=dict(hardware=dict(encoder=4, jitter=3e-4, friction=(1e6, 0.01))),
    )  # fmt: skip


def pulled_apart(method):
    """A hand pulls a closed chain to where it cannot be closed: an end of the run, no error."""
    arm = hc.MjcfArm("five_bar")
    n, parts = len(arm.names), dict(arm=arm, force=(0.0, -30.0), stop_when_unstable=False)
    law = hc.JointPD((0.5,) * n, (0.01,) * n)
    return {
        f"{Ts:g}": hc.Scenario(controller=law, Ts=Ts, dt=Ts, t_max=30 * Ts, render=method, **parts)
        for Ts in (1e-3, 5e-3)
    }


FINE = Profile(
    tuple(round(1e-4 * i - 0.01, 6) for i in range(300)),
    tuple(100.0 + 100.0 * (i % 2) for i in range(301)),
)


def thrown(method, velocity, t_max):
    """A handle that is beyond many borders of fine layers at the end of a step."""
    hand = hc.Operator(0.0, 1.0, 1e5)
    common = dict(force=(200.0, 50.0), operator=hand, torque_limit=(1e5, 1e5), dt=0.02)
    return variants(method, Clay(FINE, FINE), common, thrown=dict(velocity=velocity, t_max=t_max))


THROWN = {
    "fast: over many borders": thrown("fast", (-5.0, 4.0), 0.08),
    "accurate: over many borders": thrown("accurate", (3.0, -9.0), 0.02),
}
KINDS = THROWN | {
    "held: plain chains pulled apart": pulled_apart("held"),
    "held: plain arms": arms("held"), "physical: plain arms": arms("physical"),
    "fast: plain": {name: dataclasses.replace(s, dt=2 * TS) for name, s in NEAR.items()} | MORE,
    "accurate: plain": {
        name: dataclasses.replace(s, integrator="accurate", dt=2e-3) for name, s in STILL.items()
    },
    "fast: signals, growth": signals("fast", GROWS, inertia_shaping=True, operator=HAND)
    | variants(
        "fast", GROWS, dict(inertia_shaping=True, operator=HAND, muscle=WAVE, command=LED),
        weak=WEAK, unstable=dict(gain=(25.0, 0.5), t_max=1.0, dt=1e-3), growing=dict(clay=GROWING),
    ),
    "fast: form, stiff": variants(
        "fast", STIFF, dict(compensator=ZEROS, inertia_shaping=True, **OTHER),
        strong=dict(torque_limit=(1e5, 1e5)), weak=WEAK | dict(t_max=0.045),
        soft=dict(clay=SOFT, t_max=0.09),
        coarse=dict(dt=5e-3, t_max=1.0),
    ),
    "fast: cells, smooth, rotated": variants(
        "fast", TURNED, dict(operator=HAND, force=(4.0, 1.0)),
        turned={}, otherwise=dict(clay=OTHERWISE), weak=WEAK, elsewhere=dict(origin=(0.1, 0.2)),
    ),
    "fast: yield by axis": flows("fast", angles=(0.5, -1.0), inertia_shaping=True),
    "fast: yield along the motion": flows("fast", True, b=1e4, operator=None, command=LED),
    "fast: springs": springs(method="fast", operator=HAND, force=(4.0, 1.0), t_max=0.24),
    "held: measured straight": straight("held"),
    "physical: measured straight": straight("physical"),
    "fast: groove": grooves("fast", **SHAKEN, inertia_shaping=True, damping=1e5),
    "accurate: signals, growth": signals("accurate", GROWS, inertia_shaping=True, operator=HAND)
    | variants(
        "accurate", GROWS, dict(inertia_shaping=True, operator=HAND, muscle=WAVE, command=LED),
        weak=WEAK, growing=dict(clay=GROWING, dt=2e-3),
    ),
    "accurate: form, cells, smooth, rotated": variants(
        "accurate", TURNED, dict(FORMED), turned={}, otherwise=dict(clay=OTHERWISE), weak=WEAK,
    ),
    "accurate: yield by axis, rotated": flows(
        "accurate", angles=(0.5, -1.0), operator=None, t_max=0.12
    ),
    "accurate: yield along the motion": flows(
        "accurate", True, compensator=ZEROS, inertia_shaping=True,
        muscle=hc.Step((2.0, 0.5), 0.0) + hc.Step((-3.0, -0.9), 0.04),
    ),
    "held: plain": variants(
        "held", LAYERS, {}, plain={}, steps=dict(dt=1e-4, Ts=4e-4), odd=dict(t_max=0.1001),
        weak=WEAK, unstable=dict(clay=hc.slab(8e3, 0.003, 0.1), gain=(1.0, 0.1), t_max=0.5),
    ),
    "held: all hardware, signals": signals(  # which samples take from what steps do
        "held", GROWS, some(SIGNALS, 6), inertia_shaping=True, operator=HAND, hardware=ALL,
        dt=5.76e-3, Ts=5.76e-3,
    )
    | variants(
        "held", GROWS,
        dict(hardware=ALL, operator=HAND, inertia_shaping=True, muscle=WAVE, command=LED),
        all={}, slow=dict(hardware=ALL | dict(delay=0.01), dt=1e-4, Ts=0.05), weak=WEAK,
    ),
    "held: form, cells, smooth, rotated, filter of first order": variants(
        "held", TURNED, dict(hardware=FILTERED, force=(4.0, 1.0)) | FORMED,
        turned={}, otherwise=dict(clay=OTHERWISE), weak=WEAK, steps=dict(dt=1e-4, Ts=4e-4),
    ),
    "held: yield by axis, springs": springs(
        method="held", operator=HAND, dt=2.5e-4, Ts=5e-4,
        hardware=dict(encoder=4096, friction=(0.02, 0.01)),
    ),
    "held: yield along the motion": flows("held", True, hardware=ALL, t_max=0.1),
    "held: groove": grooves("held"),
    "held: own controller": variants(
        "held", LAYERS, dict(controller=OWN, hardware=PHYSICAL, operator=HAND, muscle=WAVE),
        own={}, weak=WEAK,
    ),
    "physical: cells, smooth, rotated, signals": variants(
        "physical", TURNED,
        dict(operator=HAND, muscle=WAVE, command=LED, inertia_shaping=True, force=(4.0, 1.0)),
        turned={}, otherwise=dict(clay=OTHERWISE), weak=WEAK, steps=dict(dt=1e-4, Ts=4e-4),
    ),
    "physical: form, stiff, all hardware": variants(
        "physical", STIFF, dict(hardware=PHYSICAL) | FORMED,
        all={}, soft=dict(clay=SOFT), weak=WEAK,
    ),
    "physical: yield by axis, springs": springs(
        method="physical", dt=4e-5, Ts=2e-4, t_max=0.04, velocity=(0.1, 0.0)
    ),
    "physical: yield along the motion": flows(
        "physical", True, hardware=dict(delay=3e-4), t_max=0.12
    ),
    "physical: groove": grooves(
        "physical", damping=2e5, hardware=dict(delay=2e-4, encoder=8192), force=(2.5, 0.5)
    ),
    "physical: own controller": variants(
        "physical", LAYERS, dict(controller=OWN), own={}, weak=WEAK,
    ),
}  # fmt: skip
HOLDS = [x for x in KINDS if "yield" in x and x[:4] in ("fast", "accu")]
HOLDS += "fast: springs", "physical: yield along the motion"


def same(a, b, what):
    for name in record.ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), f"{what}: {name}")
    assert a.extra.keys() == b.extra.keys()
    for name in a.extra:
        np.testing.assert_array_equal(a.extra[name], b.extra[name], f"{what}: {name}")
    np.testing.assert_array_equal(a.ground, b.ground, what)
    for name in ("outcome", "crossings", "stops", "energy", "steps"):
        assert getattr(a, name) == getattr(b, name), (what, name)


def eventful(kind, records):
    """Of each run that it passes a border; that weak motors reach their limits, that clay holds."""
    for name, r in records.items():
        assert r.crossings or name == "growing", name
        assert name != "weak" or np.any(np.abs(r.tau) >= r.scenario.torque_limit)
    assert kind not in HOLDS or any(r.stops for r in records.values())


def summary_of(r):
    """The summary of a record, as simulate_batch gives it."""
    out, crossed = np.zeros((), batch.SUMMARY), r.crossings[:8]
    for name in ("code", "axis", "time", "step"):
        out[name] = getattr(r.outcome, name)
    out["steps"], out["crossings"] = r.steps, len(r.crossings)
    out["crossing_axis"], out["crossing_time"], out["crossing_speed"] = -1, np.nan, np.nan
    out["crossing_axis"][: len(crossed)] = ["xy".index(c.axis) for c in crossed]
    out["crossing_time"][: len(crossed)] = [c.time for c in crossed]
    out["crossing_speed"][: len(crossed)] = [c.speed for c in crossed]
    for name in ("p", "v", "fh", "fe", "b"):
        out[name] = getattr(r, name)[-1, :2] if len(r.t) else np.nan
    for name in out.dtype.names[-8:]:
        out[name] = r.energy[name]
    return out


@pytest.mark.parametrize("kind", THROWN)
def test_a_thrown_handle_crosses_each_border_in_turn(kind):
    """From one to the next, or the same one back; more of them than there is room for at once."""
    (r,) = hc.simulate_batch(THROWN[kind].values())
    for axis in "xy":
        at = [FINE.edges.index(c.border) for c in r.crossings if c.axis == axis]
        assert np.abs(np.diff(at)).max(initial=0) <= 1
    assert len(r.crossings) > 64


@native
@pytest.mark.parametrize("kind", KINDS)
def test_all_engines_make_the_same_run(kind):
    scenes = KINDS[kind]
    plain = [hc.simulate(s, engine="python") for s in scenes.values()]
    if "plain" not in kind:
        eventful(kind, dict(zip(scenes, plain, strict=True)))
    compiled = [hc.simulate(s, engine="native") for s in scenes.values()]
    batch = hc.simulate_batch(scenes.values(), threads=2)
    for name, *runs in zip(scenes, plain, compiled, batch, strict=True):
        for r in runs[1:]:
            same(r, runs[0], name)
    ends = hc.simulate_batch(scenes.values(), keep="summaries")
    for name, r, end in zip(scenes, plain, ends, strict=True):
        assert end.tobytes() == summary_of(r).tobytes(), name


def test_the_kinds_have_every_part_with_every_method_that_takes_it():
    has = set()
    for scenes in KINDS.values():
        for s in scenes.values():
            (method,) = support.present(s, support.METHODS)
            laws = support.present(s.clay, LAWS) if s.clay else []
            found = (*laws, *support.present(s, support.PARTS))
            has |= {(method.name, x.name) for x in found}
    parts = [x.name for x in (*LAWS, *support.PARTS)]
    for method in support.METHODS:
        takes = {x for x in parts if not support.refusal(method.name, x)}
        assert takes == {x for name, x in has if name == method.name}


@pytest.mark.parametrize("engine", ["python", pytest.param("native", marks=native)])
def test_a_run_paused_at_every_sample_is_the_run(engine):
    s = dataclasses.replace(KINDS["held: all hardware, signals"]["all"], t_max=0.05)
    whole, parts = Run(s, 1, engine), Run(s, 1, engine)
    whole.go(None)
    while parts.outcome is None:
        parts.advance(parts.filled + 1)
    parts.flush()
    for name, x in whole.arrays().items():
        assert (x == parts.arrays()[name]).all(), name
    assert whole.balance() == parts.balance()


GUARDS = {
    "fields have their types": guards.checked_fields,
    "scratch is full of NaN": guards.spoiled_scratch,
    "what is tried is tried twice": guards.repeated,
}


@pytest.mark.parametrize("guard", GUARDS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_strict_run_is_the_run(kind, guard):
    """CPython, as strict as C: see guards. In the suite 0.05 s of a scene of a kind: in turns the
    first, one within, the last, each under another guard."""
    turn = [*GUARDS].index(guard)
    for name in KINDS[kind] if HUNTS else some(KINDS[kind], 3)[turn : turn + 1] or KINDS[kind]:
        s = KINDS[kind][name]
        s = s if HUNTS else dataclasses.replace(s, t_max=min(s.t_max, 0.05))
        with GUARDS[guard]():
            r = hc.simulate(s, engine="python")
        same(r, hc.simulate(s), name)


def test_a_field_of_the_wrong_type_is_refused_by_name():
    with guards.checked_fields():
        k = records.Kick()
        k.H, k.u[1], k.u[:2], k.x.v = 1.0, 2.0, (3.0, 4.0), 5.0
        assert k.u == [3.0, 4.0, 0.0, 0.0] and k.axis[0].v == 5.0
        for change in (
            lambda: setattr(k, "H", 1),
            lambda: setattr(k.y, "v", np.float64(1.0)),
            lambda: setattr(records.State(), "i", 1.0),
            lambda: setattr(records.Model(), "hand", True),
            lambda: k.u.__setitem__(2, 1),
            lambda: k.u.__setitem__(slice(None), (0.0, 1.0)),
        ):
            with pytest.raises(guards.WrongType):
                change()
    k.H = 1  # as before


def test_stale_scratch_and_an_effect_of_an_event_are_seen(monkeypatch):
    """The guards see a kick that reads what another left, and an event with an effect."""
    s = dataclasses.replace(KINDS["held: plain"]["plain"], t_max=0.02)
    r, drive, load = hc.simulate(s, engine="python"), hardware.drive, kick.load

    def counts(m, s, tau):
        s.steps += 1
        drive(m, s, tau)

    def stale(m, s, k):
        left = k.x.u if s.i > 3 else 0.0
        load(m, s, k)
        k.x.f += 0.0 * left

    with monkeypatch.context() as patch:
        patch.setattr(hardware, "drive", counts)
        once = hc.simulate(s, engine="python")
        with guards.repeated():
            assert hc.simulate(s, engine="python").steps > once.steps > r.steps
    monkeypatch.setattr(kick, "load", stale)
    assert hc.simulate(s, engine="python").outcome.code == r.outcome.code
    with guards.spoiled_scratch():
        assert hc.simulate(s, engine="python").outcome.code != r.outcome.code
