"""Limits of arms by theory, and runs half a percent on either side of each."""

import itertools
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from benchmarks import arm_flips

LEADER = hc.JointPD(
    (240.0, 240.0, 240.0, 240.0, 24.0, 31.0, 25.0), (3.0, 3.0, 3.0, 3.0, 0.2, 0.2, 0.2),
    velocity="filter", cutoff=90.0,
)  # fmt: skip
SMALL = hc.JointPD((2.0, 2.0), (0.02, 0.02))
PLANAR = hc.JointPD((20.0, 20.0), (1.0, 1.0), velocity="difference")


def plain(card):
    return hc.MjcfArm(card, friction=[0.0] * len(hc.MjcfArm(card).names))


# arm, law, Ts, delay, steps in a sample, seconds, and how many limits, Kp first
LOOPS = {
    "seven joints": ("leader_7", LEADER, 2e-3, 2e-3, 2, 2.0, 19),
    "seven joints, 2.6 samples late": ("leader_7", LEADER, 1e-3, 2.6e-3, 2, 2.4, 7),
    "planar": ("planar_2r", PLANAR, 1e-3, 1e-3, 4, 6.0, 7),
    "five-bar, exact rates": ("five_bar", SMALL, 1e-3, 0.0, 4, 0.16, 2),
}


def turned(rows):
    """Names of the limits whose runs are on the side that theory says, and on the other."""
    good, bad = [], []
    for name, _, inside, outside in rows:
        (good if inside < 0.0 < outside else bad).append((name, inside, outside))
    return good, bad


@pytest.mark.parametrize("name", LOOPS)
def test_runs_turn_at_the_limits_of_gains_and_delay(name):
    card, law, Ts, delay, steps, seconds, most = LOOPS[name]
    rows = arm_flips.flips(plain(card), law, Ts, delay, dt=Ts / steps, t_max=seconds)
    good, bad = turned(itertools.islice(rows, most))
    assert len(good) == most and not bad, bad


def test_one_step_a_sample_finds_limits_of_Kp_to_a_percent(monkeypatch):
    """A step of second order: (omega Ts)^2/12 is 0.9 % where joint 5 buzzes."""
    monkeypatch.setattr(arm_flips, "SHARE", 0.01)
    rows = arm_flips.flips(plain("leader_7"), LEADER, 2e-3, 2e-3, t_max=2.4)
    good, bad = turned(itertools.islice(rows, 7))
    assert len(good) == 7 and not bad, bad


def test_runs_turn_at_the_limits_of_walls():
    """Along all axes of seven joints."""
    rows = arm_flips.wall_flips(
        plain("leader_7"), 5.0, arm_flips.HAND, 2e-3, 2e-3, "difference", t_max=8.0
    )
    good, bad = turned(rows)
    assert [x[0] for x in good] == [f"wall along {c}" for c in "xyz"], bad


def test_runs_turn_at_the_limit_of_a_wall_of_a_closed_chain():
    """The engine's soft constraints lose a tenth of it; here they hold exactly."""
    rows = arm_flips.wall_flips(
        plain("five_bar"), 1.0, hc.Operator(0.05, 5.0, 6.0), 1e-3, 1e-3, t_max=0.4
    )
    good, bad = turned(rows)
    assert len(good) == 2 and not bad, bad


def test_growth_beyond_a_limit_is_that_of_the_map():
    """log(radius)/Ts, for one joint far beyond its limit, and all others as they are."""
    arm, Ts = plain("leader_7"), 1e-3
    law = replace(LEADER, Kp=(*LEADER.Kp[:6], 65.0))
    found = hc.theory.joint_limits(arm, law, Ts, Ts)
    run = arm_flips.free_run(arm, law, Ts, Ts, dt=Ts / 4, t_max=6.0)
    # the step's own error, and what is left of other modes
    assert arm_flips.growth(run) == pytest.approx(np.log(found.radius) / Ts, rel=5e-3)


PAN = """<mujoco><worldbody><body>
<joint name="pan" axis="0 0 1" damping="0.6" frictionloss="0.052"/>
<inertial pos="0 0 0" mass="0.5" diaginertia="0.03 0.03 0.0433"/>
<site name="handle" pos="0.2 0 0"/></body></worldbody></mujoco>"""


def test_a_limit_cycle_of_friction_fed_forward_is_that_of_harmonic_balance():
    """A shoulder of an SO-101 under a published law, see docs/arm.md."""
    arm = hc.MjcfArm(mujoco.MjSpec.from_string(PAN))
    law = hc.JointPD((15.0,), (0.5,), velocity="difference", friction=[(0.2, 20.0, 0.05)])
    found = hc.theory.friction_cycle(arm, law, 2e-3)
    cycles = [i for i, kind in enumerate(found.kind) if kind == "limit cycle"]
    assert len(cycles) == 1
    s = hc.Scenario(
        arm=arm, controller=replace(law, reference=(0.02,)), Ts=2e-3, dt=1e-3, t_max=10.0,
        force=(0.0, 0.0), stop_when_unstable=False,
    )  # fmt: skip
    q = hc.simulate(s).q[-5000:, 0]
    q = q - 0.5 * (q.max() + q.min())
    up = np.flatnonzero((q[:-1] < 0.0) & (q[1:] >= 0.0))
    frequency = (len(up) - 1) / ((up[-1] - up[0]) * s.dt)
    assert q.max() == pytest.approx(found.amplitude[cycles[0]], rel=0.05)
    assert frequency == pytest.approx(found.frequency[cycles[0]], rel=0.05)
    counted = replace(s, hardware=hc.Hardware(encoder=4096))
    assert np.ptp(hc.simulate(counted).q[-1000:]) < 1e-4
