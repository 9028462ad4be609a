"""An arm from a file as a device: against MuJoCo's kinematics, statics and the theory of walls."""

import json
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.ports import Exchanges, Inverse3, Trajectory, loop_report
from hapticclay.ports.device import SimulatedDevice, held_scenario
from hapticclay.ports.driven_arm import TARGET_STIFFNESS, Drive
from hapticclay.ports.service import REST
from tests.ports.conftest import tick
from tests.ports.test_rosbridge import RosClient

TEXT = """<mujoco model="pen"><compiler angle="radian" autolimits="true"/>
<option gravity="0 0 -9.81"/><worldbody>
<body><joint name="turn" axis="0 0 1" damping="0.02" armature="1e-4" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02" mass=".5"/>
<body pos="0 0 .2"><joint name="lift" axis="0 1 0" damping=".02" armature="1e-4" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".015" mass=".3"/>
<body pos=".2 0 0"><joint name="bend" axis="0 1 0" damping=".02" armature="1e-4" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 .15 0 0" size=".01" mass=".1"/>
<site name="handle" pos=".15 0 0"/></body></body></body></worldbody></mujoco>"""
POSE = (0.3, 0.2, 0.6)
HAND = hc.Operator(0.25, 8.0, 200.0)
PERIOD = 0.005


def pen(text=TEXT, hand=HAND, Ts=1e-3, **kw):
    """A device of three joints and three axes, held by a hand."""
    return held_scenario(hc.MjcfArm(text_arm(text), **({"pose": POSE} | kw)), Ts, hand)


def text_arm(text):
    return mujoco.MjSpec.from_string(text)


class Oracle:
    """The engine's own kinematics of the same file."""

    def __init__(self, text=TEXT):
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)

    def put(self, q):
        self.data.qpos[:], self.data.qvel[:] = q, 0.0
        mujoco.mj_forward(self.model, self.data)
        return self.data.site("handle").xpos.copy()

    def jacobian(self, q):
        self.put(q)
        J = np.zeros((3, 3))
        mujoco.mj_jacSite(self.model, self.data, J, None, self.model.site("handle").id)
        return J

    def held(self, q, mass):
        """Torques that hold the arm and a mass at its handle."""
        J = self.jacobian(q)
        return self.data.qfrc_bias - J.T @ (mass * np.array(self.model.opt.gravity))


def xyz(part):
    return np.array([part[c] for c in "xyz"])


def angles(state):
    return np.radians([state["angular_position"][f"a{i}"] for i in range(3)])


# ---- a program in three axes ---------------------------------------------------------------------


def test_a_force_acts_by_the_transposed_jacobian_and_the_hand_balances_it(served):
    """Without joint friction the hand gives way by F/k along each axis."""
    force, oracle = np.array((0.8, -0.5, 0.6)), Oracle()
    server, client = served(pen(), period=PERIOD)
    c = client()
    for _ in range(400):
        state = c.state(tick(*force))
    q = angles(state)
    assert xyz(state["current_cursor_force"]) == pytest.approx(force, abs=1e-12)
    # the slowest motion decays within 0.1 s: after 2 s 2e-9 of its 4 mm are left
    assert xyz(state["cursor_position"]) - REST == pytest.approx(force / HAND.spring, abs=1e-9)
    moved = oracle.put(q) - oracle.put(POSE)
    assert xyz(state["cursor_position"]) - REST == pytest.approx(moved, abs=1e-12)
    r = server.record()
    assert r.q[-1] == pytest.approx(q, abs=1e-9)
    expected = oracle.held(r.q[-1], HAND.mass) + oracle.jacobian(r.q[-1]).T @ force
    assert r.tau[-1] == pytest.approx(expected, abs=1e-9)


def test_each_sample_has_the_torques_and_the_velocity_of_its_pose(served):
    """While the arm moves: torques of the sample, J q' as the velocity."""
    force, oracle, scene = (2.0, 1.0, -1.5), Oracle(), pen()
    device = SimulatedDevice(scene, period=1e-3)
    device.drive(Drive(force=force))
    seen = []
    for _ in range(60):
        device.advance()
        seen.append(device.sensed)
    r = device.record()
    assert np.abs(r.qd).max() > 0.1
    for k, sample in enumerate(seen):
        J = oracle.jacobian(sample.angles)
        assert sample.velocity == pytest.approx(J @ sample.rates, abs=1e-12)
        assert r.q[k] == pytest.approx(sample.angles, abs=1e-12)
        held = oracle.held(sample.angles, HAND.mass)
        assert r.tau[k] == pytest.approx(held + J.T @ force, abs=1e-12)


def test_the_arm_rests_where_no_program_drives_it(served):
    """Gravity is compensated, the hand's weight too.

    Motors begin without torque: the bias of the first step is that of rates off by dt/2 times the
    acceleration of a fall, 1e-5 of the weight, once.
    """
    _, client = served(pen(), period=PERIOD)
    c = client()
    for _ in range(40):
        state = c.state("{}")
    assert xyz(state["cursor_position"]) == pytest.approx(REST, abs=1e-9)
    acting = SimulatedDevice(pen(gravity="acts"), period=PERIOD)
    acting.advance(200)
    assert acting.sensed.position[2] < -0.02 or acting.ended  # it falls


def test_late_motors_hold_the_weight_from_the_start():
    """Until the first torque arrives, 2.5 ms late, they hold that of the pose: a fall is 3e-5 m."""
    scene = replace(pen(), hardware=hc.Hardware(delay=2.5e-3))
    device = SimulatedDevice(scene, period=PERIOD)
    device.advance(40)
    assert device.sensed.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_target_is_held_within_the_pull_of_the_hand(served):
    """Springs of hand and target: p = (k h + K t)/(k + K), so |p - t| is at most F/K."""
    target, aim = np.array((0.004, -0.006, 0.005)), (0.01, 0.01, -0.01)
    _, client = served(pen(), period=PERIOD, hand=Trajectory.to(aim))
    c = client()
    place = dict(zip("xyz", (target + REST).tolist(), strict=True))
    command = {"set_cursor_position": {"position": place}}
    for _ in range(400):
        state = c.state(json.dumps({"inverse3": [{"device_id": "04EA", "commands": command}]}))
    p = xyz(state["cursor_position"]) - REST
    k, K = HAND.spring, TARGET_STIFFNESS
    assert p == pytest.approx((k * np.array(aim) + K * target) / (k + K), abs=1e-8)
    pull = np.linalg.norm(k * (np.array(aim) - p))
    assert np.linalg.norm(p - target) <= pull / K * (1.0 + 1e-6)
    assert state["control_mode"] == "position"


def test_torques_of_three_joints_act(served):
    """At rest the hand's spring balances them: tau = J' k p."""
    torques, oracle = (0.05, -0.04, 0.03), Oracle()
    _, client = served(pen(), period=PERIOD)
    c = client()
    body = {"set_angular_torques": {"torques": dict(zip(("a0", "a1", "a2"), torques, strict=True))}}
    for _ in range(400):
        state = c.state(json.dumps({"inverse3": [{"device_id": "04EA", "commands": body}]}))
    p = xyz(state["cursor_position"]) - REST
    found = oracle.jacobian(angles(state)).T @ (HAND.spring * p)
    assert found == pytest.approx(torques, abs=1e-9)
    assert state["control_domain"] == "angular"
    assert list(state["current_angular_torques"].values()) == pytest.approx(list(torques))


def test_torques_are_limited_to_those_of_the_largest_force():
    device = SimulatedDevice(pen(), largest_force=2.0)
    reach = np.array((math.hypot(0.0, 0.55), 0.35, 0.15))  # along the links, stretched
    device.drive(Drive(torques=(1.0, 7.0, 0.1)))
    assert device.torques == pytest.approx(np.array((1.0, 7.0, 0.1)) * 2.0 * reach[1] / 7.0)


def test_the_hand_moves_along_three_axes(served):
    way = Trajectory((0.0, 0.5), ((0.0, 0.0, 0.0), (0.01, -0.008, 0.012)))
    _, client = served(pen(), period=PERIOD, hand=way)
    c = client()
    for _ in range(400):
        state = c.state("{}")
    assert xyz(state["cursor_position"]) - REST == pytest.approx((0.01, -0.008, 0.012), abs=1e-8)


def test_ticks_give_the_same_run_to_the_last_bit(served):
    texts = []
    for _ in range(2):
        scene = pen(hand=replace(HAND, damper=3.0))
        server, client = served(scene, period=PERIOD, hand=Trajectory.to((0.0, 0.004, 0.008)))
        c, seen = client(), []
        x = y = z = 0.0
        for _ in range(60):
            state = c.state(tick(x, y, z))
            seen.append(json.dumps(state))
            x, y, z = -300.0 * (xyz(state["cursor_position"]) - REST)
        texts.append(seen)
        c.socket.close()
    assert texts[0] == texts[1]


# ---- fewer axes, more joints ---------------------------------------------------------------------


def test_a_handle_of_two_axes_serves_two(served, caplog):
    """The third reads as at rest; forces on it and torques of a third joint are told once."""
    scene = held_scenario(
        hc.MjcfArm("planar_2r", friction=(0.0, 0.0)), 1e-3, replace(HAND, damper=30.0)
    )
    server, client = served(scene, period=PERIOD)
    c = client()
    for _ in range(500):
        state = c.state(tick(0.6, -0.4, 5.0))
    assert xyz(state["cursor_position"]) - REST == pytest.approx((0.003, -0.002, 0.0), abs=1e-8)
    assert xyz(state["current_cursor_force"]) == pytest.approx((0.6, -0.4, 0.0), abs=1e-12)
    body = {"set_angular_torques": {"torques": {"a0": 0.01, "a2": 1.0}}}
    for _ in range(2):
        c.send(json.dumps({"inverse3": [{"device_id": "04EA", "commands": body}]}))
    assert [x.message for x in caplog.records] == [
        "force along z, where the handle does not move, is recorded and cannot act",
        "torques beyond the arm's 2 joints cannot act",
    ]
    exchanges = server.exchanges[0]
    assert exchanges.axes == 2 and exchanges.asked[0].tolist() == [0.6, -0.4, 5.0]


def test_seven_joints_are_driven_by_forces_and_by_name_in_ros(served, caplog):
    scene = held_scenario(hc.MjcfArm("leader_7"), 1e-3)
    _, client = served(scene, period=PERIOD)
    body = {"set_angular_torques": {"torques": {"a0": 0.01}}}
    client().send(json.dumps({"inverse3": [{"device_id": "04EA", "commands": body}]}))
    assert "3 joint torques were given: this arm has 7 joints" in caplog.text
    server, _ = served(scene, period=PERIOD, inverse3=Inverse3(protocol="rosbridge"))
    ros = RosClient(server.url)
    ros.subscribe("/arm/measured_js", "sensor_msgs/JointState")
    start = ros.receive()["msg"]
    assert start["name"] == list(scene.joints)
    assert start["position"] == pytest.approx(scene.arm.q, abs=1e-12)
    ros.advertise("/arm/servo_jf", "sensor_msgs/JointState")
    efforts = [0.2, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    for _ in range(10):
        ros.publish("/arm/servo_jf", {"effort": efforts})
        found = ros.receive()["msg"]
    assert found["effort"] == pytest.approx(efforts) and found["position"] != start["position"]
    ros.publish("/arm/servo_jf", {"effort": "much"})
    assert "servo_jf without an effort" in ros.receive()["msg"]
    ros.socket.close()


def test_a_closed_chain_is_served(served):
    """haptic_3: torques of its motors, its parallelogram projected."""
    arm = hc.MjcfArm("haptic_3", friction=(0.0, 0.0, 0.0))
    _, client = served(held_scenario(arm, 1e-3, HAND), period=PERIOD)
    c = client()
    for _ in range(300):
        state = c.state(tick(0.4, 0.6, -0.4))
    assert xyz(state["cursor_position"]) - REST == pytest.approx((0.002, 0.003, -0.002), abs=1e-7)


URDF = """<robot name="boom"><link name="base"/>
<joint name="swing" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="5" velocity="9"/></joint>
<link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="0.4"/>
<inertia ixx="1e-4" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="tilt" type="revolute"><parent link="arm"/><child link="tip"/><origin xyz="0.2 0 0"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="9"/></joint>
<link name="tip"><inertial><origin xyz="0.05 0 0"/><mass value="0.2"/>
<inertia ixx="1e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def test_a_body_of_a_urdf_is_a_handle(served, tmp_path):
    """The frame of the last link moves on a circle, where hand and force balance along it."""
    (tmp_path / "boom.urdf").write_text(URDF)
    arm = hc.MjcfArm(tmp_path / "boom.urdf", site="tip")
    _, client = served(held_scenario(arm, 1e-3, HAND), period=PERIOD)
    c = client()
    for _ in range(600):
        state = c.state(tick(y=0.6, z=1.0))
    angle = math.radians(state["angular_position"]["a0"])
    x, y, z = xyz(state["cursor_position"]) - REST
    circle = 0.2 * (math.cos(angle) - 1.0), 0.2 * math.sin(angle), 0.0
    assert (x, y, z) == pytest.approx(circle, abs=1e-12)
    force = np.array((-HAND.spring * x, 0.6 - HAND.spring * y))
    assert force @ (-math.sin(angle), math.cos(angle)) == pytest.approx(0.0, abs=1e-6)


def test_a_joint_that_slides_is_shown_in_metres(served):
    text = """<mujoco><worldbody><body><joint name="rail" type="slide" axis="0 1 0"/>
    <geom size=".05" mass="1"/><site name="handle"/></body></worldbody></mujoco>"""
    scene = held_scenario(hc.MjcfArm(text_arm(text)), 1e-3, HAND)
    _, client = served(scene, period=PERIOD)
    c = client()
    for _ in range(900):  # a mass of 5.4 kg, 9 % damped
        state = c.state(tick(y=0.5))
    assert state["angular_position"]["a0"] == pytest.approx(0.5 / HAND.spring, abs=1e-8)
    assert xyz(state["cursor_position"]) - REST == pytest.approx((0.0, 0.0025, 0.0), abs=1e-8)


# ---- the report ----------------------------------------------------------------------------------

FLOATING = TEXT.replace("0 0 -9.81", "0 0 0")


def wall_of(scene, K, axis="z", messages=400):
    """A client that renders a spring along an axis, one period late; its exchanges."""
    device_axis, out = "xyz".index(axis), []
    with hc.ports.serve(scene, period=PERIOD) as server:
        from tests.ports.conftest import Client

        c, x = Client(server.url), 0.0
        for i in range(messages):
            push = [0.0, 0.0, 0.0]
            push[device_axis] = -K * x + (0.02 if i < 3 else 0.0)
            state = c.state(tick(*push))
            x = float((xyz(state["cursor_position"]) - REST)[device_axis])
            out.append(x)
        c.socket.close()
        found = server.exchanges[0]
    return np.array(out), found


LIGHT, HEAVY = hc.Operator(0.25, 3.0, 40.0), hc.Operator(2.0, 12.0, 300.0)


@pytest.mark.parametrize(
    ("axis", "hand"), [("x", LIGHT), ("z", LIGHT), ("z", (LIGHT, HEAVY)), ("x", (LIGHT, HEAVY))]
)
def test_the_limit_is_that_of_the_wall_and_of_runs(axis, hand):
    """Of the theory of walls, which finds limits on the circle and not by eigenvalues."""
    scene = pen(FLOATING, hand=hand)
    _, exchanges = wall_of(scene, 100.0, axis, 150)
    report = loop_report(exchanges, scene)
    assert report.K == pytest.approx(100.0, rel=1e-6)
    assert np.abs(report.normal)["xyz".index(axis)] == pytest.approx(1.0, abs=1e-9)
    assert "rotor inertia (armature): of the file" in report.assumed
    assert report.assumed[0].endswith("about the arm's pose") and "left out" in report.assumed[-1]
    assert abs(report.B) < 1e-6
    if hand is LIGHT:
        wall = hc.theory.wall_limit(scene.arm, axis, 0.0, hand, PERIOD, report.delay)
        assert report.limit == pytest.approx(wall.K, rel=1e-5)
    for share, grows in ((0.95, False), (1.05, True)):
        x, _ = wall_of(scene, share * report.limit, axis, 500)
        early, late = np.abs(x[50:150]).max(), np.abs(x[400:]).max()
        assert bool(late > early) is grows, (share, early, late)


def test_exchanges_of_three_axes_are_kept(tmp_path):
    _, found = wall_of(pen(), 50.0, messages=12)
    again = Exchanges.load(found.save(tmp_path / "exchanges.csv"))
    assert again.axes == 3 and np.array_equal(again.table(), found.table())
    head = (tmp_path / "exchanges.csv").read_text().splitlines()[0]
    assert "z_m" in head and "asked_z_N" in head and "across" not in head
    planar = hc.Scenario(operator=HAND, force=(0.0, 0.0), length=None)
    with pytest.raises(ParameterError, match="a handle of 2 axes"):
        loop_report(again, planar)


# ---- what is refused -----------------------------------------------------------------------------


def test_what_cannot_be_served_is_refused():
    scene = pen()
    with (
        pytest.raises(ParameterError, match="plane"),
        hc.ports.serve(scene, inverse3=Inverse3(plane="xz")),
    ):
        pass
    planar = held_scenario(hc.MjcfArm("planar_2r"), 1e-3)
    with pytest.raises(ParameterError, match=r"hand.points.* must have x and y each"):
        SimulatedDevice(planar, hand=Trajectory.to((0.0, 0.0, 0.1)))
    with pytest.raises(ParameterError, match=r"hand.points.* x, y and z"):
        Trajectory((0.0, 1.0), ((0.0,), (0.1,)))
    with pytest.raises(ParameterError, match=r"arm.pose.turn.* -2 to 2"):
        pen(pose=(3.0, 0.0, 0.0))
    limp = SimulatedDevice(replace(scene, operator=None))
    with pytest.raises(ParameterError, match="spring"):
        SimulatedDevice(limp.scenario, hand=Trajectory.to((0.0, 0.0, 0.0)))


def test_a_hand_of_three_axes_is_read_from_a_log(tmp_path):
    file = tmp_path / "hand.csv"
    file.write_text("t,x [mm],y,z [cm]\n0,1,0.002,0.3\n1,0,0,0\n")
    found = Trajectory.of_file(file)
    assert np.allclose(found.points, ((0.001, 0.002, 0.003), (0.0, 0.0, 0.0)), atol=1e-15)
