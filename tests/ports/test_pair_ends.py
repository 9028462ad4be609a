"""Both ends of a pair as devices: against springs in series, the run of a scene and kinematics."""

import contextlib
import json
import socket
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.ports import serve_pair
from hapticclay.ports.driven_arm import TARGET_STIFFNESS
from hapticclay.ports.service import REST
from tests.ports.conftest import Client, tick
from tests.waiting import until

DEVICE, LAW = hc.Device(0.5, 1.0), hc.JointPD((400.0,), (20.0,))
PAIR = hc.Pair(DEVICE, DEVICE, LAW, hc.Link(delay=4e-3), Ts=2e-3)


@contextlib.contextmanager
def clients(servers):
    with contextlib.ExitStack() as stack:
        made = [Client(s.url) for s in servers.served.values()]
        for client in made:
            stack.callback(client.socket.close)
        yield made


def along_x(state):
    return state["cursor_position"]["x"] - REST[0]


def test_a_hand_and_a_spring_of_two_programs_rest_where_theirs_balance():
    """2 N through the law and a spring of 200 N/m; 3 s leave 2e-4 of the motion."""
    y, device = 0.0, hc.Device(0.5, 5.0)
    with (
        serve_pair(replace(PAIR, leader=device, follower=device), period=0.01) as ends,
        clients(ends) as (hand, spring),
    ):
        for _ in range(300):
            x = along_x(hand.state(tick(x=2.0)))
            y = along_x(spring.state(tick(x=-200.0 * y)))
        record = ends.record()
    assert y == pytest.approx(2.0 / 200.0, rel=1e-3)
    assert x == pytest.approx(2.0 / 200.0 + 2.0 / 400.0, rel=1e-3)
    assert record.hand[-1, 0] == pytest.approx(2.0) and record.contact[-1, 0] == pytest.approx(
        2.0, rel=1e-3
    )
    assert len(record.t) == 300 * 5  # the hand's messages alone move both arms


def test_a_constant_force_is_the_run_under_that_muscle():
    """The same arms, law and link; to rounding, since a muscle is averaged over steps."""
    with serve_pair(PAIR, end="leader", period=0.01) as ends, clients(ends) as (hand,):
        for _ in range(20):
            state = hand.state(tick(x=1.5))
        served = ends.record()
    run = hc.simulate(replace(PAIR, muscle=hc.Constant((1.5, 0.0)), t_max=0.2))
    np.testing.assert_array_equal(served.hand[1:], run.hand[1:])  # the first is from before it
    for name in ("leader", "follower", "leader_torque", "energy"):
        np.testing.assert_allclose(getattr(served, name), getattr(run, name), rtol=1e-9, atol=1e-12)
    assert ends.follower is None and state["angular_position"]["a0"] != 0.0


def test_the_same_messages_give_the_same_run_to_the_last_bit():
    def once():
        with serve_pair(PAIR, end="follower", period=0.004) as ends, clients(ends) as (tool,):
            for k in range(50):
                tool.state(tick(x=1.0 - 0.05 * k))
            return ends.record()

    first, again = once(), once()
    np.testing.assert_array_equal(first.leader, again.leader)
    assert np.abs(first.leader).max() > 1e-4  # the follower's tool moves the leader


def test_a_place_is_held_within_force_over_stiffness():
    """The hand pushes with 2 N, the follower is held 5 mm away by its client."""
    held = {"set_cursor_position": {"values": {"x": REST[0] + 0.005, "y": REST[1], "z": REST[2]}}}
    hold = json.dumps({"inverse3": [{"device_id": "04EA", "commands": held}]})
    with serve_pair(PAIR, period=0.01) as ends, clients(ends) as (hand, tool):
        for _ in range(150):
            hand.send(tick(x=2.0))
            y = along_x(tool.state(hold))
    assert y == pytest.approx(0.005 + 2.0 / TARGET_STIFFNESS, rel=1e-3)


def test_joint_torques_cannot_act_and_that_is_told():
    torques = {"set_angular_torques": {"values": {"a0": 1.0, "a1": 0.0}}}
    message = json.dumps({"inverse3": [{"device_id": "04EA", "commands": torques}]})
    with serve_pair(PAIR, period=0.01) as ends, clients(ends) as (hand, _):
        hand.state(message)
        told = ends.leader.service.notices
        assert ends.record().leader[-1, 0] == 0.0
    assert list(told) == ["joint torques cannot act: the motors are those of the pair"]


def test_messages_to_the_follower_wait_for_the_leader():
    with serve_pair(PAIR, period=0.01) as ends, clients(ends) as (_, tool):
        for _ in range(3):
            tool.state(tick(x=1.0))
        assert ends.leader.service.device.t == 0.0 and not ends.recorded
        with pytest.raises(RuntimeError, match="has not run"):
            ends.record()


def test_three_axes_of_an_arm_are_where_its_kinematics_say():
    arm = hc.MjcfArm("haptic_3")
    law = hc.JointPD((20.0,) * 3, (0.4,) * 3)
    pair = hc.Pair(arm, arm, law, hc.Link(), Ts=1e-3)
    with serve_pair(pair, period=0.01) as ends, clients(ends) as (hand, tool):
        for _ in range(20):
            seen = hand.state(tick(z=0.5)), tool.state(tick())
        record = ends.record()
    assert abs(record.hand[-1][arm.axes.index("z")]) == pytest.approx(0.5)
    for state, device in zip(seen, (ends.leader, ends.follower), strict=True):
        q = np.radians([state["angular_position"][f"a{i}"] for i in range(3)])
        want = arm.handle(q) - arm.handle() + REST
        found = [state["cursor_position"][c] for c in "xyz"]
        np.testing.assert_allclose(found, want, atol=1e-9)
        assert device.service.device.t == pytest.approx(0.2)
    assert np.abs(record.follower[-1] - record.follower[0]).max() > 1e-4


def test_two_links_in_closed_form_at_a_wall():
    """A force along x presses the follower's tool on the wall, whose depth is force over K."""
    law, wall = (
        hc.JointPD((60.0,) * 2, (3.0,) * 2),
        hc.Contact(400.0, 20.0, axis="x", unilateral=True),
    )
    pair = hc.Pair(hc.Arm(), hc.Arm(), law, hc.Link(), Ts=1e-3, follower_clay=wall)
    with serve_pair(pair, period=0.01) as ends, clients(ends) as (hand, tool):
        for _ in range(300):
            hand.state(tick(x=2.0))
            x = along_x(tool.state(tick()))
        record = ends.record()
    force = record.contact[-1, 0]
    assert force == pytest.approx(400.0 * x, rel=0.02) and 1.0 < force < 2.05


def test_in_real_time_both_arms_run_and_forces_are_let_go():
    with serve_pair(PAIR, clock="wall", every=5) as ends, clients(ends) as (hand, tool):

        def moved():
            hand.state(tick(x=3.0))
            return along_x(tool.state(tick())) > 1e-3

        until(moved, pause=0.0)
        record = ends.record()
    assert record.follower[-1, 0] > 5e-4
    np.testing.assert_allclose(np.diff(record.t), 5 * PAIR.Ts)


@pytest.mark.parametrize(
    "pair, given, told",
    [
        (PAIR, {"period": 3e-3}, "whole multiple of the control sample"),
        (replace(PAIR, link=hc.Link(delay=3.1415e-4)), {}, "whole parts"),
        (hc.Scenario(), {}, "pair"),
    ],
)
def test_refused(pair, given, told):
    with pytest.raises(hc.ParameterError, match=told), serve_pair(pair, **given):
        pass


def test_a_taken_port_ends_both():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(hc.ParameterError, match="cannot listen"):
            with serve_pair(PAIR, port=port):
                pass
