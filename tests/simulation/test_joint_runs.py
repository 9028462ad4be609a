"""Runs of arms from files: step by step, stored, judged, refused."""

import copy
import math
import pickle
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.simulation import record

HAND = hc.Operator(0.0, 2.0, 6.0)
CLAY = hc.Clay(hc.Profile((0.002,), (0.0, 20.0)), hc.Profile((), (3.0,)))
IO = hc.Hardware(encoder=8192, delay=1.3e-3, jitter=1e-5, dropout_probability=0.05)
LEADER_KP = (240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0)
LEADER = hc.JointPD(
    LEADER_KP, (3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2), velocity="filter", cutoff=90.0
)  # fmt: skip


def scene(card, Kp=4.0, Kd=0.05, away=0.1, **kw):
    arm = hc.MjcfArm(card)
    n = len(arm.names)
    law = hc.JointPD((Kp,) * n, (Kd,) * n, velocity="difference", reference=tuple(arm.q + away))
    common = dict(Ts=1e-3, dt=5e-4, t_max=0.06, operator=HAND, force=(1.0, 0.5), clay=CLAY)
    return hc.Scenario(arm=arm, controller=law, hardware=IO, **(common | kw))


SCENES = {
    "planar": scene("planar_2r"),
    "physical": scene("planar_2r", render="physical"),
    "closed": scene("five_bar", 0.5, 0.01, 0.05),
    "closed, three axes": scene("haptic_3", 0.5, 0.01, t_max=0.03),
    "seven joints": scene("leader_7", 40.0, 1.0),
}


def same(a, b):
    for name in record.ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), name)
    assert a.outcome == b.outcome and a.crossings == b.crossings and a.energy == b.energy


@pytest.mark.parametrize("name", SCENES)
def test_steps_copies_and_snapshots_are_the_run(name):
    s = SCENES[name]
    whole = hc.simulate(s)
    with hc.Simulation(s) as sim:
        sim.advance(15)
        state = sim.state
        for field in ("q", "qd", "tau", "p", "v", "fh"):
            assert getattr(state, field).shape == getattr(whole, field)[15].shape, field
            np.testing.assert_array_equal(getattr(state, field), getattr(whole, field)[15], field)
        shot, copied = sim.snapshot(), copy.deepcopy(sim)
        pickled = pickle.loads(pickle.dumps(sim))
        sim.advance(20, force=(-3.0, 2.0))
        sim.restore(pickle.loads(pickle.dumps(shot)))
        for one in (sim, copied, pickled):
            while one.outcome is None:
                one.step(force=s.force)
            same(one.record(), whole)


@pytest.mark.parametrize("name", SCENES)
def test_a_record_and_its_scenario_are_stored(name, tmp_path):
    s = SCENES[name]
    r = hc.simulate(s)
    r.save(tmp_path / "r")
    again = hc.Record.load(tmp_path / "r")
    same(again, r)
    s.save(tmp_path / "s.toml")
    same(hc.simulate(hc.Scenario.load(tmp_path / "s.toml")), r)


def test_an_arm_from_a_spec_is_stored_with_its_file(tmp_path):
    spec = mujoco.MjSpec.from_string(TEXT)
    s = replace(SCENES["planar"], arm=hc.MjcfArm(spec), controller=hc.JointPD((1.0,), (0.1,)))
    s = replace(s, force=(0.2, 0.0), clay=None)
    again = pickle.loads(pickle.dumps(s))
    same(hc.simulate(again), hc.simulate(s))


TEXT = """<mujoco><worldbody><body><joint name="a" axis="0 0 1"/>
<inertial pos="0.1 0 0" mass="0.2" diaginertia="1e-3 1e-3 1e-3"/>
<site name="handle" pos="0.2 0 0"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("card", ["haptic_3", "leader_7"])
def test_a_hand_pushes_along_three_axes(card):
    """Given in steps, from a snapshot, in a batch or in the scenario: the same run."""
    force = (0.5, -0.2, 0.3)
    s = scene(card, 5.0, 0.1, 0.0, force=force, clay=None, t_max=0.02)
    whole = hc.simulate(s)
    flat = hc.simulate(replace(s, force=force[:2]))
    assert np.abs(whole.p[:, 2] - flat.p[:, 2]).max() > 1e-6
    with hc.Simulation(replace(s, force=(0.0, 0.0))) as sim:
        sim.step(force=force)
        shot = sim.snapshot()
        sim.advance(5, force=(9.0, 9.0, 9.0))
        sim.restore(shot)
        while sim.outcome is None:
            sim.step()
        for name in ("p", "v", "q", "tau", "fh"):
            np.testing.assert_array_equal(getattr(sim.record(), name), getattr(whole, name), name)
    with hc.SimulationBatch([s, s]) as sims:
        sims.advance(10, force=np.array([force[:2], (0.0, 0.0)]))
        np.testing.assert_array_equal(sims.p[0], whole.p[10, :2])
        assert sims.scenarios[1].force == (0.0, 0.0, 0.3)


@pytest.mark.parametrize("force", [(1.0,), (1.0, 2.0, 3.0, 4.0), 2.0, (1.0, 2.0, "x")])
def test_a_force_along_axes_that_the_handle_has_not_is_refused(force):
    with pytest.raises(hc.ParameterError, match="force"), hc.Simulation(SCENES["planar"]) as sim:
        sim.step(force=force)
    with pytest.raises(hc.ParameterError, match="force"):
        replace(SCENES["closed, three axes"], force=force)
    for s in (hc.Scenario(), SCENES["planar"]):
        with pytest.raises(hc.ParameterError, match=r"2 numbers \(x, y\), got 3"):
            replace(s, force=(1.0, 2.0, 3.0))


# ---- verdicts ------------------------------------------------------------------------------------


def leader(scale, **kw):
    law = replace(LEADER, Kp=tuple(scale * x for x in LEADER_KP))
    arm = hc.MjcfArm("leader_7", friction=[0.0] * 7, **kw)
    law = replace(law, reference=tuple(arm.q + 1e-3))
    io = hc.Hardware(delay=2e-3)
    return hc.Scenario(
        arm=arm, controller=law, Ts=2e-3, dt=1e-3, t_max=20.0, hardware=io, force=(0.0, 0.0)
    )


@pytest.mark.parametrize("scale", [1.4, 1.5, 2.0])
def test_the_joint_that_buzzes_is_named(scale):
    r = hc.simulate(leader(scale))
    limits = hc.theory.joint_limits(r.scenario.arm, r.scenario.controller, 2e-3, 2e-3)
    assert not limits.stable
    assert r.outcome.code == "diverged" and r.outcome.axis == limits.joint == "joint7"
    assert "joint_limits" in r.outcome.advice


@pytest.mark.parametrize("other", [HAND, hc.Operator(0.1, 2.0, 6.0)])
@pytest.mark.parametrize(("scale", "code"), [(1.2, "time limit"), (2.0, "diverged")])
def test_a_driven_arm_is_judged_where_theory_says_that_it_is_unstable(scale, code, other):
    swing = hc.Multisine((1.0, 1.0))
    given = replace(leader(scale), operator=(HAND, other), muscle=swing, t_max=2.0)
    assert hc.simulate(given).outcome.code == code


def test_a_stable_arm_comes_to_rest_without_a_verdict():
    r = hc.simulate(leader(1.2))
    assert r.outcome.code == "time limit" and np.abs(r.qd[-100:]).max() < 1e-6


def test_motors_at_their_limits_make_a_limit_cycle():
    r = hc.simulate(replace(leader(2.0, torque_limit=[6.0] * 7), stop_when_unstable=False))
    assert r.outcome.code == "limit cycle" and r.outcome.axis.startswith("joint")
    assert np.abs(r.tau).max() == 6.0


def test_a_joint_that_leaves_its_range_ends_the_run():
    arm = hc.MjcfArm("leader_7")
    law = hc.Controller(lambda t, q, qd, fh, state, params: ((0.0,) * 3 + (9.0,) + (0.0,) * 3, ()))
    s = hc.Scenario(arm=arm, controller=law, Ts=1e-3, t_max=5.0, force=(0.0, 0.0))
    r = hc.simulate(s)
    high = arm.ranges[3, 1]
    assert r.outcome.code == "out of reach" and r.outcome.axis == "joint4"
    assert high - 0.05 < r.q[-1, 3] <= high


@pytest.mark.parametrize("name", ["haptic_3", "five_bar", "leader_7"])
@pytest.mark.parametrize("gravity", ["compensated", "acts"])
def test_gravity_is_compensated_under_any_controller(name, gravity):
    """The same torques by a law of one's own and by gains: the same motion to rounding."""
    arm = hc.MjcfArm(name, gravity=gravity)
    n, aim = len(arm.names), arm.q + 0.02

    def pd(t, q, qd, fh, state, params):
        return tuple(2.0 * (a - x) - 0.1 * w for a, x, w in zip(aim, q, qd, strict=True)), state

    gains = hc.JointPD((2.0,) * n, (0.1,) * n, reference=aim.tolist())
    own, law = (
        hc.simulate(
            hc.Scenario(arm=arm, controller=c, Ts=1e-3, dt=5e-4, t_max=0.2, force=(0.0, 0.0))
        )
        for c in (hc.Controller(pd), gains)
    )
    assert np.abs(law.q[-1] - law.q[0]).max() > 1e-3
    np.testing.assert_allclose(own.q, law.q, rtol=0.0, atol=1e-11)


# ---- refusals ------------------------------------------------------------------------------------

ARM, PD = hc.MjcfArm("planar_2r"), hc.JointPD((1.0, 1.0), (0.1, 0.1))
BARE = hc.MjcfArm(
    mujoco.MjSpec.from_string(TEXT.replace('<site name="handle" pos="0.2 0 0"/>', ""))
)
LAYERS = hc.Clay(hc.Profile((0.002,), (0.0, 20.0)), hc.Profile((), (3.0,)))
YIELDS = hc.Clay(hc.Profile((), (1.0,), Fy=(0.5,)), hc.Profile((), (1.0,), Fy=(0.5,)))
GROOVE = hc.Groove((0.02, 0.08), (-0.02, 0.02), pressure=1e4)
BAD = {
    "no law": (dict(controller=None), "controller", "must be given"),
    "no handle": (dict(arm=BARE, controller=hc.JointPD((1.0,), (0.1,))), "site", "must name"),
    "law of another arm": (dict(controller=hc.JointPD((1.0,), (0.1,))), "Kp", "2 numbers"),
    "gains of text": (dict(controller="PD"), "controller", "must be"),
    "continuous": (dict(control="continuous"), "control", "must be 'sampled'"),
    "accurate": (dict(integrator="accurate"), "integrator", "must be 'fast'"),
    "start": (dict(start=(0.01, 0.0)), "start", "must be left out"),
    "velocity": (dict(velocity=(0.1, 0.0)), "velocity", "must be left out"),
    "origin": (dict(origin=(0.1, 0.3)), "origin", "must be left out"),
    "limits of the servo": (dict(torque_limit=(3.0, 2.0)), "torque_limit", "must be left out"),
    "command": (dict(command=hc.Step((0.01, 0.0), 0.1)), "command", "must be None"),
    "shaping": (dict(inertia_shaping=True), "inertia_shaping", "must be left out"),
    "groove": (
        dict(clay=hc.Clay(LAYERS.x, LAYERS.y, groove=GROOVE)), "clay", "must not stay cut"
    ),
    "friction of the hardware": (
        dict(hardware=hc.Hardware(friction=(0.1, 0.1))), "hardware.friction", "MjcfArm(friction)"
    ),
    "noise of the force": (
        dict(hardware=hc.Hardware(force_noise=0.1)), "hardware", "measure the force ideally"
    ),
    "coupling": (
        dict(hardware=hc.Hardware(coupling=hc.Coupling(1e3, 1.0))), "hardware.coupling",
        "must be left out",
    ),
    "passivity": (
        dict(hardware=hc.Hardware(passivity=True)), "hardware.passivity", "must be left out"
    ),
    "range of the converter": (
        dict(hardware=hc.Hardware(dac_bits=12, dac_range=(3.0, 3.0)),
             arm=replace(ARM, torque_limit=(3.0, 3.0))), "hardware.dac_range", "must be None",
    ),
    "converter without a range": (
        dict(hardware=hc.Hardware(dac_bits=12), arm=replace(ARM, torque_limit=[math.inf] * 2)),
        "arm.torque_limit", "must be finite",
    ),
    "limits of drives": (
        dict(controller=replace(PD, runs="drive"), arm=replace(ARM, torque_limit=(3.0, 3.0))),
        "arm.torque_limit", "must be none where drives",
    ),
    "stiff clay": (
        dict(clay=hc.Clay(hc.Profile((), (1e4,)), hc.Profile((), (0.0,))), render="physical"),
        "dt", "must be at most",
    ),
    "yield beside joint friction": (
        dict(clay=YIELDS, render="physical", arm=replace(ARM, friction=(0.1, 0.1))),
        "render", "must be 'held'",
    ),
    "sample not of steps": (dict(Ts=1e-3, dt=3e-4), "Ts", "multiple"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_scene_that_cannot_be_had_is_refused_in_a_line(name):
    changes, field, bound = BAD[name]
    fields = dict(arm=ARM, controller=PD, t_max=0.01) | changes
    with pytest.raises(ParameterError) as e:
        hc.simulate(hc.Scenario(**fields))
    told = str(e.value)
    assert e.value.field == field and bound in told, told
    assert "\n" not in told


@pytest.mark.parametrize("torques", [(1.0,), (1.0, 2.0, 3.0), (1.0, "x"), 3.0])
def test_a_law_that_fails_is_told(torques):
    law = hc.Controller(lambda t, q, qd, fh, state, params: (torques, state))
    with pytest.raises(hc.LawFailed if hasattr(hc, "LawFailed") else RuntimeError):
        hc.simulate(hc.Scenario(arm=ARM, controller=law, Ts=1e-3, t_max=0.01))


# ---- clay of an arm that moves on a line ---------------------------------------------------------

RAIL = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="x" type="slide"
axis="{} {} 0" damping="0.5" frictionloss="{}"/><geom size="0.01" mass="1"/><site name="handle"/>
</body></worldbody></mujoco>"""


def on_rail(direction, friction, clay, force, t_max):
    arm = hc.MjcfArm(mujoco.MjSpec.from_string(RAIL.format(*direction, friction)))
    none = hc.JointPD((0.0,), (0.0,))
    return hc.simulate(
        hc.Scenario(arm=arm, clay=clay, controller=none, render="physical", dt=1e-3, t_max=t_max,
                    force=force, stop_when_unstable=False)
    )  # fmt: skip


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.6, 0.8)])
def test_clay_yields_on_a_rail(direction):
    """v' = F - Fy - 1.5 v along the rail, in closed form."""
    flow = hc.Profile((), (1.0,), Fy=(3.0,))
    force = tuple(5.0 * x for x in direction)
    r = on_rail(direction, 0.0, hc.Clay(flow, flow, isotropic=True), force, 0.2)
    want = np.outer((2.0 / 1.5) * (1.0 - np.exp(-1.5 * r.t)), direction)
    np.testing.assert_allclose(r.v, want, atol=1e-6)  # (1.5 dt)^2/12 of 0.35 m/s, and the trace
    held = on_rail(direction, 0.0, hc.Clay(flow, flow, isotropic=True), (1.0, 0.0), 0.1)
    assert np.abs(held.p).max() < 1e-12


def test_friction_of_joints_bears_springs_of_clay():
    """Pressed by 2 N and let go, a mass with 0.5 N of friction rests where k p is within 0.5 N."""
    clay = hc.Clay(hc.Profile((), (5.0,), springs=(hc.Spring(k=400.0),)), hc.Profile((), (0.0,)))
    r = on_rail((1.0, 0.0), 0.5, clay, (2.0, 0.0), 2.0)
    assert np.abs(r.v[-1]).max() < 1e-15 and 1.5 <= 400.0 * r.p[-1, 0] <= 2.5
    still = on_rail((1.0, 0.0), 0.5, clay, (0.4, 0.0), 0.1)
    assert not np.any(still.p)
