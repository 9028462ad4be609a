"""Controllers of one's own on arms from files, beside the loop of a joint law, and runs."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.theory.client_loop import with_hands_of
from hapticclay.theory.joint_gains import joint_loop

TS = 2e-3
LIFT = """<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1" damping="3"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><site name="h"/></body></worldbody></mujoco>"""


def law_of(Kp, Kd, at, held=0.0):
    """A joint law as a function: it holds the weight of the pose, or lets the arm sag."""

    def law(t, q, qd, fh, state, params):
        torques = np.array(held) - np.array(Kp) * (np.array(q) - at) - np.array(Kd) * np.array(qd)
        return tuple(torques.tolist()), state

    return hc.Controller(law)


ARMS = {
    "two joints": (lambda: hc.MjcfArm("planar_2r"), {}),
    "closed": (lambda: hc.MjcfArm("five_bar"), {}),
    "three axes, a hand": (
        lambda: hc.MjcfArm("haptic_3", friction=[0.0] * 3),
        {"operator": hc.Operator(0.05, 1.0, 30.0)},
    ),
    "seven joints": (lambda: hc.MjcfArm("leader_7", friction=[0.0] * 7), {}),
    "a slide": (lambda: hc.MjcfArm(mujoco.MjSpec.from_string(LIFT)), {}),
}


def scene(name, delay=0.0, law=None, **kw):
    make, more = ARMS[name]
    arm = make()
    n, M = len(arm.names), np.diag(arm.mass_matrix())
    Kp, Kd = 400.0 * M, 10.0 * M
    hands = hc.Scenario(
        arm=arm, controller=hc.JointPD((1.0,) * n, (1.0,) * n), Ts=TS, **more
    )  # fmt: skip
    rows = ["xyz".index(x) for x in hands.axes]
    masses = np.array([hand.mass for hand in hands.hands])
    weight = masses * np.array(arm.mechanism.model.opt.gravity)[rows]
    arm.mechanism.at(arm.q)
    held = arm.mechanism.moving(np.zeros(n)).bias - arm.jacobian()[rows].T @ weight
    controller = law or law_of(Kp, Kd, arm.q, held)
    parts = dict(hardware=hc.Hardware(delay=delay)) if delay else {}
    return (
        replace(hands, controller=controller, force=(0.0,) * len(rows), **parts, **kw),
        hc.JointPD(tuple(Kp.tolist()), tuple(Kd.tolist())),
    )


@pytest.mark.parametrize("delay", [0.0, 3.4e-3])
@pytest.mark.parametrize("name", ARMS)
def test_poles_are_those_of_the_loop_of_the_joints(name, delay):
    """Another map of the same loop: differences of static torques are good to 1e-9 of them."""
    s, law = scene(name, delay)
    found = hc.theory.controller_stability(s)
    loop = joint_loop(with_hands_of(s), law, TS, delay, compensated=False)
    z = loop.eigenvalues
    np.testing.assert_allclose(found.rest, s.arm.q, atol=1e-9)
    largest = np.sort(np.abs(z))[::-1][:3]
    np.testing.assert_allclose(np.abs(found.poles)[: len(largest)], largest, rtol=1e-6)
    assert found.stable is bool(loop.stable())


@pytest.mark.parametrize("name", ["two joints", "three axes, a hand", "a slide"])
def test_runs_turn_at_the_largest_gain(name):
    s, law = scene(name, 2e-3)
    found = hc.theory.controller_stability(s)
    assert 1.0 < found.high < np.inf
    for share, grows in ((0.9, False), (1.1, True)):
        K = share * found.high
        arm = s.arm
        held = s.controller.law(0.0, tuple(arm.q), (0.0,) * len(arm.q), (), (), ())[0]
        Kp, Kd = K * np.array(law.Kp), K * np.array(law.Kd)
        beside = law_of(Kp, Kd, arm.q + 1e-5, held)
        run = hc.simulate(
            replace(
                s, controller=beside, dt=TS / 4, t_max=0.6, stop_when_unstable=False
            )  # fmt: skip
        )
        moved = np.abs(run.qd).max(axis=1)
        early, late = moved[: len(moved) // 4].max(), moved[-len(moved) // 8 :].max()
        assert bool(late > 2.0 * early) is grows, (share, early, late)


def test_rest_is_found_where_the_weight_sags():
    """A spring of 400 M holds 2 kg: it gives by m g over Kp."""
    s, _ = scene("a slide", law=law_of((800.0,), (20.0,), np.zeros(1)))
    found = hc.theory.controller_stability(s)
    assert found.rest[0] == pytest.approx(-2.0 * 9.81 / 800.0, rel=1e-9)


def test_matrices_stand_for_the_law():
    s, law = scene("a slide")  # along z, and clay's plane has a second axis
    D = np.array([[-law.Kp[0], -law.Kd[0], 0.0, 0.0]])
    none = np.zeros
    matrices = hc.theory.LinearLaw(none((0, 0)), none((0, 4)), none((1, 0)), D)
    by_law = hc.theory.controller_stability(s)
    found = hc.theory.controller_stability(s, matrices=matrices)
    assert found.high == pytest.approx(by_law.high, rel=1e-6)
    two = hc.theory.LinearLaw(none((0, 0)), none((0, 6)), none((2, 0)), none((2, 6)))
    with pytest.raises(hc.ParameterError, match="matrices.*must have D of the shape .1, 4."):
        hc.theory.controller_stability(s, matrices=two)


def test_friction_of_the_joints_is_left_out_and_said_so():
    s, _ = scene("a slide")
    rough = replace(s, arm=hc.MjcfArm(s.arm.file, friction=[1.0]))
    assert "joint friction" in hc.theory.controller_stability(rough).left_out
