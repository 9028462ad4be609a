"""Limit cycles under friction fed forward: against runs by matrix exponentials and the engine's."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.theory.fed_friction import Fed, Joint
from hapticclay.theory.joint_loop import JointLoop
from tests.oracles import joints

TS = 2e-3
ONE = np.ones((1, 1))
# Shoulder pan of the SO-101 (MuJoCo Menagerie, robotstudio_so101): M of the arm at its zero
# position, damping and friction of its servos. Law of a bilateral prototype for it (LeRobot,
# branch add-biteleop-so101).
PAN = {"M": 0.043285623, "damping": 0.6, "coulomb": 0.052}
LAW = {"P": 15.0, "R": 0.5, "Fc": 0.2, "k": 20.0, "Fv": 0.05}
TEXT = """
<mujoco><option gravity="0 0 0"/><worldbody><body name="link">
  <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>
  <site name="handle" pos="0.2 0 0"/>
  <joint name="pan" axis="0 0 1" armature="{}" damping="{}" frictionloss="{}"/>
</body></worldbody></mujoco>
"""


def pan_arm():
    text = TEXT.format(PAN["M"] - 1e-3, PAN["damping"], PAN["coulomb"])
    return hc.MjcfArm(mujoco.MjSpec.from_string(text))


def pushed(counts=None):
    """Positions of a run of the simulator, pushed for a moment."""
    scenario = hc.Scenario(
        arm=pan_arm(),
        controller=pan_law(),
        Ts=TS,
        t_max=6.0,
        force=(0.0, 0.0),
        length=None,
        muscle=hc.Pulse((0.0, 20.0), 0.0, 0.02),
        hardware=hc.Hardware(encoder=counts) if counts else None,
    )
    record = hc.simulate(scenario)
    return record.q[:, 0], record.t[1] - record.t[0]


def pan_law(Kp=LAW["P"]):
    friction = [(LAW["Fc"], LAW["k"], LAW["Fv"])]
    return hc.JointPD([Kp], [LAW["R"]], velocity="difference", friction=friction)


def measured(q, Ts=TS):
    """Amplitude and frequency of the second half of a run."""
    q = q[len(q) // 2 :]
    q = q - 0.5 * (q.max() + q.min())
    up = np.flatnonzero((q[:-1] < 0.0) & (q[1:] >= 0.0))
    t = up + q[up] / (q[up] - q[up + 1])
    return 0.5 * np.ptp(q), (len(t) - 1) / (t[-1] - t[0]) / Ts


def joint_and_run(matrices, gains, j=0, counts=None, **of):
    """A joint of a loop, and a run of it."""
    of = {"coulomb": 0.052, "delay": 0.0, "velocity": "difference", "cutoff": None} | of
    loop = JointLoop(*matrices, *gains, TS, of["delay"], of["velocity"], of["cutoff"])
    joint = Joint(loop, j, of["coulomb"], Fed(LAW["Fc"], LAW["k"], loop, counts))
    count = 2.0 * math.pi / counts if counts else None
    run = joints.FrictionRun(matrices, gains, fed_torque, TS, joint=j, count=count, **of)
    return joint, run.positions(0.02 * np.eye(loop.n)[j], 7.0)


def fed_torque(w):
    return LAW["Fc"] * math.tanh(LAW["k"] * w)


def test_a_published_law_by_its_fundamental():
    """An independent describing function has 9.48 mrad at 2.90 Hz; half the last digit."""
    found = hc.theory.friction_cycle(pan_arm(), pan_law(), TS)
    assert found.kind == ("threshold", "limit cycle")
    assert found.first_amplitude[1] == pytest.approx(9.48e-3, abs=5e-6)
    assert found.first_frequency[1] == pytest.approx(2.90, abs=5e-3)
    assert found.slope[0] == pytest.approx(4.05)
    assert found.rests[0] == pytest.approx(0.052 / 15.0)


def test_runs_cycle_likewise():
    """The friction's jump leaves 3e-3 of the frequency; the mean behind an encoder half a percent.

    With few counts the joint comes to rest.
    """
    for counts, rel in ((None, 4e-3), (65536, 8e-3)):
        found = hc.theory.friction_cycle(pan_arm(), pan_law(), TS, counts=counts)
        at = found.amplitude[1], found.frequency[1]
        assert measured(*pushed(counts)) == pytest.approx(at, rel=rel)
    q, _ = pushed(4096)
    assert np.ptp(q[len(q) // 2 :]) == 0.0


def test_the_engine_cycles_likewise():
    """With friction that is nearly hard; as soft as by default it slows the cycle by 4 %."""
    found = hc.theory.friction_cycle(pan_arm(), pan_law(), TS)
    text = TEXT.format(PAN["M"] - 1e-3, PAN["damping"], PAN["coulomb"])
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = TS / 20, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for timeconst, rel in ((2e-4, 0.01), (0.02, 0.05)):
        model.dof_solref[:] = timeconst, 1.0
        data = mujoco.MjData(model)
        data.qpos[0] = last = 0.02
        out = []
        for _ in range(2000):
            q = data.qpos[0]
            w, last = (q - last) / TS, q
            data.qfrc_applied[0] = -15.0 * q - 0.45 * w + 0.2 * math.tanh(20.0 * w)
            mujoco.mj_step(model, data, 20)
            out.append(data.qpos[0])
        amplitude, frequency = measured(np.array(out))
        assert found.amplitude[1] == pytest.approx(amplitude, rel=rel)
        assert found.frequency[1] == pytest.approx(frequency, rel=rel)


@pytest.mark.parametrize(
    "of",
    [
        {},
        {"delay": TS},
        {"delay": 1.3e-3},
        {"velocity": "exact"},
        {"velocity": "filter", "cutoff": 90.0},
        {"coulomb": 0.0},
    ],
)
def test_all_harmonics_are_those_of_a_run(of):
    """20 harmonics: the friction's jump leaves 2e-4 of the amplitude, 4e-3 of the frequency."""
    joint, run = joint_and_run(
        (PAN["M"] * ONE, 0.6 * ONE, 0.0 * ONE), (15.0 * ONE, 0.45 * ONE), **of
    )
    cycle = list(joint.cycles())[-1]
    amplitude, frequency = measured(run)
    assert cycle.kind == "limit cycle" and cycle.harmonics == 20
    assert cycle.amplitude == pytest.approx(amplitude, rel=3e-4)
    assert cycle.frequency == pytest.approx(frequency, rel=4e-3)


@pytest.mark.parametrize("j", [0, 1])
def test_with_another_joint_coupled(j):
    M = np.array([[0.0443, 0.0101], [0.0101, 0.0366]])
    e = np.eye(2)
    rate = 0.2 * e - 0.05 * np.outer(e[j], e[j])
    joint, run = joint_and_run((M, 0.05 * e, 0.0 * e), (15.0 * e, rate), j)
    cycle = list(joint.cycles())[-1]
    assert (cycle.amplitude, cycle.frequency) == pytest.approx(measured(run), rel=2e-3)


def test_growth_changes_sign_at_the_cycles():
    found = hc.theory.friction_cycle(pan_arm(), pan_law(), TS)
    rate = 2.0 * math.pi * found.first_frequency * found.first_amplitude
    growth = np.interp(rate, found.line_rate[0], found.line_growth[0])
    size = np.abs(found.line_growth).max()
    assert (np.abs(growth) < 0.15 * size).all()  # between two of six rates a decade


def test_few_counts_let_it_rest():
    matrices, gains = (PAN["M"] * ONE, 0.6 * ONE, 0.0 * ONE), (15.0 * ONE, 0.45 * ONE)
    joint, run = joint_and_run(matrices, gains, counts=4096)
    assert not list(joint.cycles()) and np.ptp(run[len(run) // 2 :]) < 1e-12
    # Fc Ts/Delta: every count saturates the law for a sample
    assert joint.fed.slope == pytest.approx(0.2 * TS * 4096 / (2.0 * math.pi), rel=1e-3)
    joint, run = joint_and_run(matrices, gains, counts=65536)
    cycle = list(joint.cycles())[-1]
    assert (cycle.amplitude, cycle.frequency) == pytest.approx(measured(run), rel=0.01)


def test_a_cycle_that_friction_would_hold_is_none():
    """The fundamental balances at a tenth of the distance at which the joint rests: a run stops."""
    matrices, gains = (0.01 * ONE, 0.02 * ONE, 0.0 * ONE), (0.4 * ONE, 0.02 * ONE)
    joint, run = joint_and_run(matrices, gains, coulomb=0.17, velocity="exact", delay=4e-3)
    assert joint.growth.max() > 0.0 and not list(joint.cycles())
    assert np.ptp(run[len(run) // 2 :]) < 1e-12


def test_the_mean_behind_an_encoder_is_straight_between_counts():
    loop = JointLoop(ONE, ONE, 0.0 * ONE, ONE, ONE, TS, 0.0, "difference")
    step = 2.0 * math.pi / 8192 / TS
    fed = Fed(0.3, 2.0, loop, 8192)
    for share in (0.25, 0.5, 1.5, 3.2):
        low = math.floor(share)
        ends = [0.3 * math.tanh(2.0 * step * n) for n in (low, low + 1)]
        mean = ends[0] + (share - low) * (ends[1] - ends[0])
        assert fed(np.array([share * step]))[0] == pytest.approx(mean, rel=6e-3)  # of the table


def test_describing_function_of_the_law():
    """Slope at small rates, 4 Fc/(pi A) at large ones."""
    loop = JointLoop(ONE, ONE, 0.0 * ONE, ONE, ONE, TS)
    fed = Fed(0.3, 5.0, loop, None)
    assert fed.describing_function(1e-5) == pytest.approx(1.5, rel=1e-8)
    assert fed.describing_function(1e3) == pytest.approx(1.2 / (math.pi * 1e3), rel=1e-6)


def test_without_stiffness_it_drifts():
    found = hc.theory.friction_cycle(pan_arm(), pan_law(Kp=0.0), TS)
    assert found.kind == ("drift",) and found.frequency[0] == 0.0
    w = found.rate[0]
    assert 0.2 * math.tanh(20.0 * w) == pytest.approx(0.052 + 1.05 * w, rel=1e-6)
    assert "drifts" in found.headline()
    # the rate grows where the line is above zero
    assert np.interp(0.5 * w, found.line_rate[0], found.line_growth[0]) > 0.0
    assert np.interp(2.0 * w, found.line_rate[0], found.line_growth[0]) < 0.0


@pytest.mark.parametrize("Kp", [15.0, 0.0, 1e6])
def test_every_outcome_is_drawn(Kp, tmp_path):
    """A cycle, a drift, and a law that is unstable by itself."""
    hc.theory.friction_cycle(pan_arm(), pan_law(Kp), TS).plot().savefig(tmp_path / "figure.png")


def test_a_law_in_the_drive_is_part_of_the_joint():
    """Its gains act between samples; only what is fed forward is held and late."""
    law = replace(pan_law(), runs="drive")
    found = hc.theory.friction_cycle(pan_arm(), law, TS, TS)
    arm = PAN["M"] * ONE, 1.1 * ONE, 15.0 * ONE
    gains = 0.0 * ONE, -0.05 * ONE
    run = joints.FrictionRun(
        arm, gains, fed_torque, TS, delay=TS, velocity="difference", coulomb=0.052
    )
    at = measured(run.positions(np.array([0.02]), 7.0))
    assert (found.amplitude[1], found.frequency[1]) == pytest.approx(at, rel=4e-3)


def test_an_arm_without_friction_is_told():
    arm = replace(pan_arm(), friction=[0.0])
    told = "no Coulomb friction at pan: all that is fed forward is excess"
    assert told in hc.theory.friction_cycle(arm, pan_law(), TS).assumed
    assert told not in hc.theory.friction_cycle(pan_arm(), pan_law(), TS).assumed


def test_what_is_refused():
    arm = pan_arm()
    with pytest.raises(hc.ParameterError, match="Fc, k, Fv"):
        hc.theory.friction_cycle(arm, hc.JointPD([1.0], [1.0]), TS)
    exact = hc.JointPD([1.0], [1.0], friction=[(1.0, 1.0, 0.0)])
    with pytest.raises(hc.ParameterError, match="where the velocity is exact"):
        hc.theory.friction_cycle(arm, exact, TS, counts=100)
    wild = hc.JointPD([1e6], [0.0], friction=[(1.0, 1.0, 0.0)])
    found = hc.theory.friction_cycle(arm, wild, TS)
    assert not found.stable and "unstable" in found.headline() and not found.kind
