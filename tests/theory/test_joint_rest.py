"""Joints without stiffness, joints that fall, headlines of unstable arms, lowest rates, walls."""

import itertools
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from tests.oracles.joint_verdicts import Held

HINGE = """<mujoco><option gravity="0 0 {gravity}"/><worldbody><body>
<joint name="a" axis="0 1 0" damping="{damping}" stiffness="{stiffness}" armature="{armature}"/>
<inertial pos="0 0 {height}" mass="1" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody></mujoco>"""
MGL, D = 1.962, 0.05  # of the upright pendulum [N.m/rad], and its damping [N.m.s/rad]


def hinge(damping, height=0.0, armature=0.1, stiffness=0.0, **how):
    text = HINGE.format(
        gravity=-9.81, damping=damping, stiffness=stiffness, armature=armature, height=height
    )
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), **how)


def upright(**how):
    return hinge(D, 0.2, **how)


def limits(arm, Kp, Kd, Ts=1e-3, delay=0.0, **law):
    return hc.theory.joint_limits(arm, hc.JointPD((Kp,), (Kd,), **law), Ts, delay)


@pytest.mark.parametrize("velocity", ["exact", "difference"])
@pytest.mark.parametrize("slope", [0.0, 0.4, 0.6])
def test_the_friction_that_a_joint_without_stiffness_may_be_fed_is_its_own(slope, velocity):
    """Steady motion decays by D, less the slope: at z = 1 no rounding of the hold takes part."""
    found = limits(hinge(0.5), 0.0, 0.0, velocity=velocity, friction=[(0.0, 1.0, slope)])
    assert found.stable is (slope < 0.5)
    assert found.friction_slope[0] == pytest.approx(0.5, rel=1e-9)
    assert found.Kd[0, 0] == pytest.approx(max(0.0, slope - 0.5), abs=1e-9)


def test_gravity_fed_forward_late_takes_damping_away():
    """Of an upright pendulum: D - m g l (delay + Ts/2), so D/(m g l) of lateness and no more."""
    found = limits(upright(), 0.0, 0.0, 1e-3, 1e-3)
    # but for the ripple of the held torque, (Ts/M) m g l Ts/12 of it: 1e-6
    assert found.delay_left == pytest.approx(D / MGL - 1.5e-3, rel=2e-6)
    assert found.friction_slope[0] == pytest.approx(D - 1.5e-3 * MGL, rel=2e-6)
    for share, stable in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
        assert limits(upright(), 0.0, 0.0, 1e-3, 1e-3 + share * found.delay_left).stable is stable


@pytest.mark.parametrize("name, step", [("damping", 1e-3), ("armature", 1e-3)])
def test_how_limits_at_rest_move(name, step):
    """As central differences of the limits themselves, which are linear to 1e-6 at this step."""
    arm = upright()
    found = limits(arm, 0.0, 0.0, 1e-3, 1e-3)
    here = getattr(arm, name)[0]
    sides = [
        limits(replace(arm, **{name: (here * (1.0 + s * step),)}), 0.0, 0.0, 1e-3, 1e-3)
        for s in (1.0, -1.0)
    ]
    for of, by in (
        (lambda x: x.delay_left, found.delay_change[0]),
        (lambda x: x.friction_slope[0], found.friction_slope_change[0]),
    ):
        moved = (of(sides[0]) - of(sides[1])) / (2.0 * step * here)
        column = ("armature", "damping").index(name)
        assert by[column] == pytest.approx(moved, rel=1e-4, abs=1e-6)


def test_a_joint_that_nothing_damps_carries_no_stiffness():
    """A spring that is held swings up; at rest without gains nothing grows."""
    found = limits(hinge(0.0), 0.0, 0.0)
    assert found.stable and found.Kp[0].tolist() == [0.0, 0.0]
    assert found.friction_slope[0] == 0.0 and found.Kd[0, 0] == 0.0 < found.Kd[0, 1]


def test_friction_of_the_host_beside_gains_in_drives():
    """Own map of held, late friction; the printed digits."""
    arm = hc.MjcfArm("leader_7")
    Kp, Kd = (240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2)
    law = hc.JointPD(Kp, Kd, runs="drive", friction=[(0.0, 1.0, 0.0)] * 7)
    found = hc.theory.joint_limits(arm, law, 1e-3, 1e-3)
    right = [5.56, 4.68, 4.59, 5.51, 1.10, 1.12, 0.233]
    assert [float(f"{x:.3g}") for x in found.friction_slope] == right
    linear = arm.linear()
    S, damping = linear.stiffness + linear.gravity_stiffness + np.diag(Kp), linear.damping
    held = linear.inertia, damping + np.diag(Kd), S, -linear.gravity_stiffness
    for share, grows in ((1.0 - 1e-4, False), (1.0 + 1e-4, True)):
        fed = np.diag([0.0] * 6 + [share * found.friction_slope[6]])
        assert Held(*held, -fed, 1e-3, 1e-3).grows() is grows


@pytest.mark.parametrize("runs, most", [("drive", math.inf), ("host", 300.018)])
def test_a_pendulum_falls_below_its_weight_whatever_damps_it(runs, most):
    """A real eigenvalue beyond 1 by (m g l - Kp)/Kd Ts: for no Kd is it below 1."""
    found = limits(upright(gravity="acts"), 1.0, 0.1, runs=runs)
    assert not found.stable
    assert np.isnan(found.Kd).all() and np.isnan(found.Kd_scale).all()
    assert found.Kp[0] == pytest.approx((MGL, most), rel=1e-5)
    assert (found.least_scale, found.scale) == pytest.approx((MGL, most), rel=1e-5)
    end = "or more" if math.isinf(most) else "to 300"
    assert f"all Kp times 1.962 {end} would be stable" in found.headline()
    for Kd in (1e3, 1e6, 1e9):
        assert not limits(upright(gravity="acts"), 1.0, Kd, runs=runs).stable


def test_gains_that_are_too_low_are_never_said_to_be_stable_or_less():
    """Factor 1 lies below the interval, in it, or above it."""
    arm = upright(gravity="acts")
    for Kp, words in (
        (1.0, "times 1.962 to 300 would"),
        (1e4, "times 0.03 or less (0.0001962 or more) would"),
    ):
        assert words in limits(arm, Kp, 0.1).headline()
    assert "stable at" in limits(arm, 100.0, 0.1).headline()


RESONANT = {"damping": 0.0207888, "stiffness": 238.194, "armature": 0.0346264}


def test_a_window_of_unstable_rates_is_not_passed_over():
    """The spring's resonance passes the Nyquist frequency at 26.5 Hz: there the loop grows."""
    Ts, delay, Kp, Kd = 0.00238428, 0.000226565, 0.787227, 0.0812974
    found = limits(hinge(**RESONANT), Kp, Kd, Ts, delay)
    one = np.ones((1, 1))
    M, damping, S = (RESONANT[x] * one for x in ("armature", "damping", "stiffness"))

    def grows(rate):
        return Held(M, damping, S, Kp * one, Kd * one, 1.0 / rate, delay).grows()

    assert [grows(f) for f in (30.0, 27.0, 26.86, 26.5, 26.0)] == [False, False, True, True, False]
    assert grows(found.slowest_rate * (1.0 + 1e-6)) is False
    assert grows(found.slowest_rate * (1.0 - 1e-6)) is True
    assert found.slowest_rate == pytest.approx(26.877, abs=5e-4)


WRIST = """<mujoco><worldbody><body><joint name="a" axis="0 1 0" armature=".01"/>
<inertial pos=".1 0 0" mass=".4" diaginertia=".0005 .0005 .0005"/>
<body pos=".2 0 0"><joint name="b" axis="0 1 0" armature=".01"/>
<inertial pos=".03 0 0" mass=".15" diaginertia=".0001 .0001 .0001"/></body></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("Kp, low, high", [(0.0, 0.0, 0.671), (10.0, 0.0314, 0.643)])
def test_too_much_damping_has_a_factor_that_works(Kp, low, high):
    """A wrist in a loop that buzzes at Kd 2.5, with and without stiffness."""
    arm = hc.MjcfArm(mujoco.MjSpec.from_string(WRIST))
    law = hc.JointPD((Kp, Kp), (2.5, 2.5), velocity="difference")
    found = hc.theory.joint_limits(arm, law, 5e-3, 5e-3)
    assert [float(f"{x:.3g}") for x in found.Kd_scale] == [low, high]
    least = " (0.03136 or more)" if low else ""
    assert f"or less{least} would be stable" in found.headline()
    assert f"all Kd times {math.floor(1e4 * found.Kd_scale[1]) / 1e4:.4g} or" in found.headline()
    linear = arm.linear()
    square = linear.inertia, linear.damping, linear.stiffness + linear.gravity_stiffness
    for share, grows in ((1.0 - 1e-4, False), (1.0 + 1e-4, True)):
        R = 2.5 * share * found.Kd_scale[1] * np.eye(2)
        P = Kp * np.eye(2) - linear.gravity_stiffness
        assert Held(*square, P, R, 5e-3, 5e-3, "difference").grows() is grows


BARE = """<mujoco><worldbody><body><joint name="a" axis="0 1 0" armature=".02"/>
<inertial pos="0 0 .2" mass="1" diaginertia=".01 .01 .01"/><body pos="0 0 .4">
<joint name="b" axis="0 1 0" armature=".02"/>
<inertial pos="0 0 .1" mass=".5" diaginertia=".003 .003 .003"/><site name="ee" pos="0 0 .3"/>
</body></body></worldbody></mujoco>"""


def wall(B, damping=(0.0, 0.0)):
    arm = hc.MjcfArm(mujoco.MjSpec.from_string(BARE), pose=[0.3, 1.0], damping=damping)
    return hc.theory.wall_limit(arm, "z", B, None, 1e-3)


def test_a_wall_on_an_arm_that_grows_by_itself_has_a_cause():
    found = wall(5.0)
    words = found.headline()
    assert math.isnan(found.K) and "no wall is stable: without damping in its joints" in words
    assert "by 0.0103 1/s, under gravity that is fed forward and held" in words
    assert f"up to {wall(5.0, (0.01, 0.01)).K:.4g} N/m" in words


def test_a_wall_of_too_much_damping_says_so():
    words = wall(5000.0, (0.01, 0.01)).headline()
    assert "B = 5000 N.s/m is too much; with B = 500 N.s/m up to" in words
    assert wall(500.0, (0.01, 0.01)).K > 0.0


@pytest.mark.parametrize("gravity", ["acts", "compensated"])
@pytest.mark.parametrize("runs", ["host", "drive"])
def test_no_sentence_has_nan_or_inf(gravity, runs):
    """Stable and unstable arms with all kinds of missing limits."""
    arms = [upright(gravity=gravity), hinge(0.0, gravity=gravity), hinge(0.5, gravity=gravity)]
    for arm, Kp, Kd in itertools.product(arms, (0.0, 1.0, 1e5), (0.0, 0.1, 1e3)):
        found = limits(arm, Kp, Kd, 1e-3, 1e-3, runs=runs)
        said = [found.headline(), found.advice()]
        assert not any(x in " ".join(said).replace("information", "") for x in ("nan", "inf")), said
