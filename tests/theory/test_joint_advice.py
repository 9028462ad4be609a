"""Advice for an arm's joints: each kind is followed, and the arm is stable, or carries more."""

import math
import re
from dataclasses import replace

import mujoco
import pytest

import hapticclay as hc
from tests.theory.test_joint_rest import WRIST, hinge, limits, upright

BUZZING = hc.JointPD((0.0, 0.0), (2.5, 2.5), velocity="difference")
LEADER = hc.JointPD(
    (240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2), velocity="filter", cutoff=90.0
)


def wrist():
    return hc.MjcfArm(mujoco.MjSpec.from_string(WRIST))


def of_joint(law, kind, joint, value):
    values = list(getattr(law, kind))
    values[joint] = value
    return replace(law, **{kind: tuple(values)})


LEADER_7 = hc.MjcfArm("leader_7")
FED = replace(LEADER, friction=tuple((0.0, 1.0, x) for x in [0.0] * 6 + [0.4]))
ALL_FED = replace(FED, friction=((0.0, 1.0, 60.0),) * 7)
SLACK = hinge(5e-4, 0.2, gravity="acts")  # an upright pendulum that hardly anything damps
CASES = {  # arm, law, Ts, delay, and how the advice begins
    "lower Kd of one joint": (
        LEADER_7, of_joint(LEADER, "Kd", 6, 5.0), 2e-3, 2e-3, "lower Kd of joint7"
    ),
    "raise Kd of one joint": (SLACK, hc.JointPD((2.0,), (0.0,)), 1e-3, 0.0, "raise Kd of a"),
    "lower Kp of one joint": (
        LEADER_7, of_joint(LEADER, "Kp", 6, 40.0), 2e-3, 2e-3, "lower Kp of joint7 below 34.3"
    ),
    "raise Kp of one joint": (
        upright(gravity="acts"), hc.JointPD((1.0,), (0.1,)), 1e-3, 0.0,
        "raise Kp of a to between 1.962 and 300 ",
    ),
    "lower all Kd": (
        wrist(), replace(BUZZING, Kp=(10.0, 10.0), Kd=(7.0, 2.5)), 5e-3, 5e-3, "lower all Kd"
    ),
    "less friction at one joint": (
        LEADER_7, FED, 2e-3, 2e-3, "lower the slope of the friction fed forward at joint7"
    ),
    "less friction at all": (LEADER_7, ALL_FED, 2e-3, 2e-3, "feed "),
    "both gains": (
        wrist(), replace(BUZZING, Kp=(4e3, 4e3)), 5e-3, 5e-3, "all Kp times"
    ),
    "other gains": (
        wrist(), replace(BUZZING, Kp=(1e6, 1e6), Kd=(1e4, 0.0)), 5e-3, 5e-3, "set Kp to"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_advice_that_is_followed_makes_the_arm_stable(name):
    """The change by itself, and the number that the words name as a limit."""
    arm, law, Ts, delay, words = CASES[name]
    found = hc.theory.joint_limits(arm, law, Ts, delay)
    assert not found.stable and found.advice().startswith(words), found.advice()
    timing = {"Ts": Ts, "delay": delay}
    timing |= {key: found.change[key] for key in timing if key in found.change}
    changed = replace(law, **{k: v for k, v in found.change.items() if k not in timing})
    assert hc.theory.joint_limits(arm, changed, **timing).stable


@pytest.mark.parametrize("Kp, factor", [(0.0, 0.6714), (10.0, 0.643)])
def test_a_factor_of_all_joints_stands_beside_one_joint(Kp, factor):
    """Of a wrist that buzzes at Kd 2.5."""
    law = replace(BUZZING, Kp=(Kp, Kp))
    said = hc.theory.joint_limits(wrist(), law, 5e-3, 5e-3).advice()
    assert said.startswith("lower Kd of b") and "or lower all Kd" in said
    assert f" {factor} times what they are" in said
    followed = replace(law, Kd=tuple(factor * x for x in law.Kd))
    assert hc.theory.joint_limits(wrist(), followed, 5e-3, 5e-3).stable


@pytest.mark.parametrize("kind", ["Kp", "Kd"])
def test_the_limit_that_advice_names_is_stable_and_is_one(kind):
    """At the printed number the arm is stable, and a thousandth beyond it is not."""
    law = of_joint(LEADER, kind, 6, 40.0 if kind == "Kp" else 5.0)
    said = hc.theory.joint_limits(LEADER_7, law, 2e-3, 2e-3).advice()
    named = re.search(r"(?:below|and) ([\d.]+) N", said)
    assert named
    high = float(named.group(1))
    for share, stable in ((1.0, True), (1.002, False)):
        followed = of_joint(law, kind, 6, share * high)
        assert hc.theory.joint_limits(LEADER_7, followed, 2e-3, 2e-3).stable is stable


def test_less_delay_or_a_higher_rate_where_no_gains_help():
    """An undamped arm whose weight is fed forward late grows under any law that was tried."""
    arm = hinge(0.0, 0.2)
    law = hc.JointPD((0.0,), (0.0,))
    found = hc.theory.joint_limits(arm, law, 1e-3, 5e-3)
    assert not found.stable
    changed = replace(law, **{k: v for k, v in found.change.items() if k not in ("Ts", "delay")})
    timing = {"Ts": 1e-3, "delay": 5e-3}
    timing |= {k: found.change[k] for k in timing if k in found.change}
    assert found.change and hc.theory.joint_limits(arm, changed, **timing).stable


@pytest.mark.parametrize("delay, kind", [(2e-3, "delay"), (0.0, "Ts")])
def test_a_stable_arm_carries_what_the_advice_says(delay, kind):
    found = hc.theory.joint_limits(LEADER_7, LEADER, 2e-3, delay)
    timing = {"Ts": 2e-3, "delay": delay} | found.change
    assert list(found.change) == [kind]
    after = hc.theory.joint_limits(LEADER_7, LEADER, **timing).scale
    now, then = re.findall(r"from ([\d.]+) to ([\d.]+)$", found.advice())[0]
    assert float(now) == pytest.approx(found.scale, rel=5e-4)
    assert float(then) == pytest.approx(after, rel=5e-4) and after > found.scale


def test_an_arm_without_stiffness_is_told_how_far_its_damping_may_rise():
    found = limits(hinge(0.5), 0.0, 1.0)
    assert "no Kp, all Kd up to" in found.headline() and found.change == {}
    most = float(re.findall(r"rise to ([\d.]+) times", found.advice())[0])
    assert most == pytest.approx(found.Kd_scale[1], rel=1e-3)
    assert not math.isinf(most)
