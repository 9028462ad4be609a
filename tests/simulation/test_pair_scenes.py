"""What the arms of a pair touch, what they are, and their hardware, in runs."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from tests.oracles import touched_pairs

DEVICE, LAW = hc.Device(1.0, 0.5), hc.JointPD((400.0,), (40.0,))
ARM, HAND = hc.Arm(), hc.Operator(0.25, 2.0, 6.0)
LAW_2 = hc.JointPD((20.0, 10.0), (1.0, 0.5))
PUSH = hc.Pulse((4.0, 0.0), 0.0, 0.1)


def one(**kw):
    usual = {"leader": DEVICE, "follower": DEVICE, "law": LAW, "muscle": PUSH, "t_max": 0.4}
    return hc.Pair(**{**usual, **kw})


def planar(arm, share=0.3):
    """The numbers of a two-link arm as MJCF: link 2 is balanced, its mass at the elbow."""
    m = share * arm.I1 / arm.l1**2
    of = (arm.I1 - m * arm.l1**2, arm.I2)
    inertia = [f'diaginertia="{x!r} {x!r} {x!r}"' for x in of]
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="joint1" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1" {inertia[0]}/>
    <body pos="{arm.l1!r} 0 0"><joint name="joint2" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="{m!r}" {inertia[1]}/><site name="handle" pos="{arm.l2!r} 0 0"/>
    </body></body></worldbody></mujoco>"""
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), pose=[math.pi / 2, -math.pi / 2])


def gantry(m=2.0, b=0.3):
    """A mass on three slides."""
    slides = "".join(
        f'<joint name="{n}" type="slide" axis="{a}" damping="{b}"/>'
        for n, a in (("a", "1 0 0"), ("b", "0 1 0"), ("c", "0 0 1"))
    )
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody><body>{slides}
    <geom size="0.01" mass="{m}"/><site name="handle"/></body></worldbody></mujoco>"""
    return hc.MjcfArm(mujoco.MjSpec.from_string(text))


# ---- a wall that may be left ---------------------------------------------------------------------


@pytest.mark.parametrize("start, B", [(0.002, 0.0), (0.002, 8.0), (0.0, 8.0)])
def test_a_wall_is_met_and_left_as_scipy_has_it(start, B):
    """Second order in the engine's step of 0.5 ms: (w h)^2/12 of the motion, w^2 = K/m, a touch."""
    pair = one(follower_clay=hc.Contact(5000.0, B, unilateral=True, start=start), Ts=1e-3)
    found = hc.simulate(pair)
    push = np.where(np.arange(400) < 100, 4.0, 0.0)
    want = touched_pairs.solve(pair, touched_pairs.Wall(1.0, 0.5, 5000.0, B, start), 400, push)
    touched = want[:, 2] > 0.0
    assert 0.05 < touched.mean() < 0.95 and np.diff(touched.astype(int)).min() == -1
    scale = np.abs(want[:, 0]).max()
    share = 4.0 * 5000.0 * (0.5e-3) ** 2 / 12.0  # touches and lettings go
    np.testing.assert_allclose(found.leader[:, 0], want[:, 0], atol=share * scale)
    np.testing.assert_allclose(found.follower[:, 0], want[:, 1], atol=share * scale)
    assert found.contact[:, 0].min() == 0.0
    # but within a step of a touch, where a damped wall's force jumps
    near = np.convolve(np.diff(touched, prepend=touched[0]), [1, 1, 1], "same") > 0
    most = np.abs(want[:, 2]).max()
    np.testing.assert_allclose(found.contact[~near, 0], want[~near, 2], atol=10.0 * share * most)


def test_a_wall_of_the_other_side_is_the_mirror_image():
    wall = hc.Contact(3000.0, 5.0, unilateral=True, start=0.002)
    found = hc.simulate(one(follower_clay=wall, t_max=0.2))
    other = one(follower_clay=replace(wall, start=-0.002), t_max=0.2)
    other = hc.simulate(replace(other, muscle=hc.Pulse((-4.0, 0.0), 0.0, 0.1)))
    np.testing.assert_array_equal(found.follower, -other.follower)
    np.testing.assert_array_equal(found.contact[:, 0], -other.contact[:, 0])
    assert found.contact.max() > 1.0


def test_clay_that_gives_way_keeps_a_dent_as_scipy_has_it():
    """An elastic, plastic wall: its dent, its force and where the follower leaves it."""
    k, limit, start = 4000.0, 1.5, 0.001
    springs = hc.Spring(), hc.Spring(k, limit=limit, unilateral=True)
    clay = hc.Clay(hc.Profile((start,), (0.0, 0.0), springs=springs), hc.Profile((), (0.0,)))
    pair = one(follower_clay=clay, Ts=1e-3)
    found = hc.simulate(pair)
    wall = touched_pairs.Wall(1.0, 0.5, k, 0.0, start, limit)
    want = touched_pairs.solve(pair, wall, 400, np.where(np.arange(400) < 100, 4.0, 0.0))
    dent = wall.rest - start
    assert dent > 0.002 and want[-1, 2] == 0.0
    share = k * (0.5e-3) ** 2 / 12.0
    scale = np.abs(want[:, 1]).max()
    np.testing.assert_allclose(found.follower[:, 0], want[:, 1], atol=share * scale)
    assert found.follower.max() - limit / k - start == pytest.approx(dent, abs=share * scale)
    assert found.contact[:, 0].max() == pytest.approx(limit, rel=1e-12)


def test_yielding_clay_holds_the_follower():
    """Below its yield force clay does not move: the leader pulls with Kp x less than Fy."""
    flow = hc.Profile((), (1.0,), Fy=(3.0,))
    found = hc.simulate(one(follower_clay=hc.Clay(flow, flow), t_max=0.2, muscle=None))
    assert not np.any(found.follower)
    pushed = one(follower_clay=hc.Clay(flow, flow), muscle=hc.Step((2.0, 0.0), 0.0), t_max=0.8)
    found = hc.simulate(pushed)
    assert np.abs(found.follower).max() < 1e-16  # rounding
    assert found.leader[-1, 0] == pytest.approx(2.0 / 400.0, rel=1e-3)
    found = hc.simulate(replace(pushed, muscle=hc.Step((5.0, 0.0), 0.0), t_max=4.0, Ts=2e-3))
    # what the yield force leaves moves 2 kg behind 2 N.s/m, but for a start of some 50 ms
    rate = np.diff(found.follower[:, 0])[-1] / 2e-3
    assert rate == pytest.approx(1.0 - math.exp(-4.0), rel=1e-3)


def test_energy_of_a_push_against_a_wall():
    """Work of the hand = motion, dampers, the spring that is pressed, and what the link took."""
    pair = one(follower_clay=hc.Contact(3000.0, 0.0, unilateral=True, start=0.001), Ts=1e-3)
    found = hc.simulate(replace(pair, t_max=0.15))
    q = np.hstack([found.leader, found.follower])
    v = np.gradient(q, found.t, axis=0)
    work = 4.0 * (q[100, 0] - q[0, 0])
    lost = np.trapezoid(0.5 * (v[:-1] ** 2).sum(axis=1), found.t[:-1])
    kept = 0.5 * (v[-2] ** 2).sum() + 0.5 * 3000.0 * max(q[-2, 1] - 0.001, 0.0) ** 2
    assert kept > 1e-4
    # rates by differences, 1 ms of some 50 ms
    assert found.energy[-2] == pytest.approx(work - lost - kept, abs=2e-3 * work)


def test_joint_friction_bears_a_wall():
    """At rest a pressed wall holds what friction does not: K e within the push -+ 2 fc."""
    rough = hc.Device(1.0, 5.0, friction=0.5)
    wall = hc.Contact(2000.0, 10.0, unilateral=True)
    pair = hc.Pair(rough, rough, LAW, follower_clay=wall, muscle=hc.Step((4.0, 0.0), 0.0))
    found = hc.simulate(replace(pair, t_max=1.0))
    assert np.abs(np.diff(found.follower[-50:, 0])).max() < 1e-9
    # slower than 1 um/s, of which the damper makes 1e-5 N
    assert found.contact[-1, 0] == pytest.approx(2000.0 * found.follower[-1, 0], abs=1e-5)
    assert 3.0 - 1e-6 <= found.contact[-1, 0] <= 5.0 + 1e-6


# ---- along one axis ------------------------------------------------------------------------------

ON_AXES = [
    hc.Contact(300.0, 2.0, 0.5, axis="y"),
    hc.Contact(300.0, 2.0, 0.5, axis="x"),
    hc.Contact(3000.0, 5.0, axis="y", unilateral=True, start=0.001),
]


@pytest.mark.parametrize("contact", ON_AXES)
def test_three_slides_are_three_pairs_of_one_axis(contact):
    """A contact along an axis acts on that alone: rounding apart, one pair for each axis."""
    three = hc.JointPD((400.0,) * 3, (40.0,) * 3)
    more = {"Ts": 1e-3, "t_max": 0.15}
    both = hc.Pulse((3.0, 2.0), 0.0, 0.05)
    arm = gantry()
    found = hc.simulate(hc.Pair(arm, arm, three, follower_clay=contact, muscle=both, **more))
    assert found.contact.shape == (150, 3)
    device = hc.Device(2.0, 0.3)
    for i, axis in enumerate("xyz"):
        force = (3.0, 2.0, 0.0)[i]
        own = replace(contact, axis=None) if contact.axis == axis else None
        alone = hc.Pair(device, device, LAW, follower_clay=own, **more)
        alone = hc.simulate(replace(alone, muscle=hc.Pulse((force, 0.0), 0.0, 0.05)))
        np.testing.assert_allclose(found.leader[:, i], alone.leader[:, 0], atol=1e-14)
        np.testing.assert_allclose(found.follower[:, i], alone.follower[:, 0], atol=1e-14)
        np.testing.assert_allclose(found.contact[:, i], alone.contact[:, 0], atol=1e-10)


def test_a_hand_at_the_follower_is_an_object_of_its_numbers():
    held = one(follower_clay=hc.Contact(50.0, 2.0, 0.5))
    by_hand = one(follower_operator=hc.Operator(0.5, 2.0, 50.0))
    a, b = hc.simulate(held), hc.simulate(by_hand)
    np.testing.assert_array_equal(a.follower, b.follower)
    np.testing.assert_array_equal(a.contact, b.contact)
    assert hc.theory.pair_limits(held).delay == hc.theory.pair_limits(by_hand).delay


def test_an_object_at_the_leader_is_a_hand_of_its_numbers():
    held = one(leader_clay=hc.Contact(50.0, 2.0, 0.5))
    by_hand = one(leader_operator=hc.Operator(0.5, 2.0, 50.0))
    np.testing.assert_array_equal(hc.simulate(held).leader, hc.simulate(by_hand).leader)
    assert hc.theory.pair_limits(held).delay == hc.theory.pair_limits(by_hand).delay


# ---- the two-link arm ----------------------------------------------------------------------------

TOUCHED = [
    None,
    hc.Contact(300.0, 2.0, 0.5),
    hc.Contact(300.0, 2.0, 0.5, axis="y"),
    hc.Contact(2000.0, 5.0, axis="y", unilateral=True, start=-0.001),
]


@pytest.mark.parametrize("runs", ["host", "drive"])
@pytest.mark.parametrize("touched", TOUCHED)
def test_the_arm_in_closed_form_is_the_model_of_its_numbers(touched, runs):
    """The full motion, 0.2 rad and more, through other formulas: rounding of 125 samples."""
    law = replace(LAW_2, runs=runs)
    more = {"Ts": 2e-3, "t_max": 0.25, "leader_operator": HAND, "follower_clay": touched}
    pair = hc.Pair(ARM, ARM, law, hc.Link(delay=4e-3), **more)
    pair = replace(pair, muscle=hc.Pulse((5.0, 2.0), 0.0, 0.2))
    model = replace(pair, leader=planar(ARM), follower=planar(ARM))
    a, b = hc.simulate(pair), hc.simulate(model)
    assert np.ptp(a.leader, axis=0).min() > 0.1
    for name in ("leader", "follower", "leader_torque", "hand", "contact", "energy"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=1e-10, err_msg=name)
    if runs == "host" or touched is None:  # what is touched is the same to drives
        found, other = hc.theory.pair_limits(pair), hc.theory.pair_limits(model)
        assert found.delay == pytest.approx(other.delay, rel=1e-9)


@pytest.mark.parametrize("share, grows", [(0.99, False), (1.01, True)])
def test_the_arm_in_closed_form_grows_beyond_the_gain_of_theory(share, grows):
    law = hc.JointPD((60.0, 40.0), (1.5, 1.0))
    small = hc.Pulse((1e-3, 1e-3), 0.0, 0.02)
    pair = hc.Pair(ARM, ARM, law, hc.Link(delay=6e-3), Ts=2e-3, leader_operator=HAND, muscle=small)
    factor = share * hc.theory.pair_limits(pair).gain
    stiff = replace(law, Kp=tuple(factor * x for x in law.Kp))
    assert hc.simulate(replace(pair, law=stiff, t_max=3.0)).grows is grows


def test_the_arm_in_closed_form_cuts_a_groove():
    """Clay that stays cut, for the two-link arm."""
    groove = hc.Groove((0.005, 0.08), (-0.05, 0.05), pressure=1e4)
    clay = hc.Clay.of_groove(groove)
    pair = hc.Pair(ARM, ARM, LAW_2, follower_clay=clay, muscle=hc.Step((8.0, 0.0), 0.0), t_max=0.4)
    found = hc.simulate(pair)
    free = hc.simulate(replace(pair, follower_clay=None))
    assert found.contact[:, 0].max() > 0.5 and found.motion[-1] < free.motion[-1]


# ---- hardware ------------------------------------------------------------------------------------


def test_a_device_of_coarse_counts_follows_from_half_a_count_on():
    """With stiffness alone a leader read as 0 pulls nobody; then by whole counts."""
    coarse = hc.Device(1.0, 0.5, quantum=1e-3)
    law = hc.JointPD((400.0,), (0.0,))
    pair = hc.Pair(coarse, coarse, law, muscle=hc.Step((0.2, 0.0), 0.0), t_max=0.1)
    found = hc.simulate(pair)
    read = np.flatnonzero(found.leader[:, 0] > 0.5e-3)[0]
    assert not np.any(found.follower[: read + 1]) and np.any(found.follower[read + 2])
    counts = found.leader_torque / (400.0 * 1e-3)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-12)
    assert any("encoder: left out" in x for x in hc.theory.pair_limits(pair).assumed)


def test_encoders_of_joints_count_from_their_own_zero():
    """Torques are whole counts times Kp, from the count at which the arm starts."""
    arm = planar(ARM)
    law = hc.JointPD((20.0, 10.0), (0.0, 0.0))
    counted = hc.Hardware(encoder=(2000, 500))
    pair = hc.Pair(arm, arm, law, leader_hardware=counted, follower_hardware=counted, t_max=0.1)
    found = hc.simulate(replace(pair, muscle=hc.Step((3.0, 1.0), 0.0)))
    steps = found.leader_torque / (np.array([20.0, 10.0]) * math.tau / np.array([2000, 500]))
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(steps).max() >= 1.0
    closed = replace(pair, leader=ARM, follower=ARM, muscle=hc.Step((3.0, 1.0), 0.0))
    np.testing.assert_allclose(hc.simulate(closed).leader, found.leader, atol=1e-9)


def test_motors_saturate_and_converters_round():
    """A held leader: the follower gets what its converter gives, up to its range."""
    law, still = hc.JointPD((400.0,), (0.0,)), hc.Device(1.0, 0.0)
    stiff = hc.Operator(1.0, 2.0, 0.0)
    limited = hc.Hardware(dac_range=(1.5, 1.5))
    pair = hc.Pair(still, still, law, leader_operator=stiff, follower_hardware=limited)
    found = hc.simulate(replace(pair, muscle=hc.Step((40.0, 0.0), 0.0), t_max=0.1))
    assert np.abs(found.follower_torque).max() > 10.0
    speed = np.diff(found.follower[:, 0]) / 1e-3
    assert np.diff(speed).max() == pytest.approx(1.5e-3, rel=1e-9)
    # 4 bits over -8 to 8 N: a step of 1 N, below half of which nothing moves
    rough = hc.Hardware(dac_bits=4, dac_range=(8.0, 8.0))
    found = hc.simulate(
        replace(pair, follower_hardware=rough, muscle=hc.Step((1.0, 0.0), 0.0), t_max=0.2)
    )
    first = np.flatnonzero(np.abs(found.follower_torque[:, 0]) > 0.5)[0]  # held before the sample
    assert not np.any(found.follower[:first]) and found.follower[first, 0] > 0.0


def test_a_force_sensor_has_its_steps():
    """With position-force the leader's torque is the measured force: levels of 10/2^4 N."""
    link = hc.Link("position-force")
    rough = hc.Hardware(adc_bits=5, adc_range=10.0)
    wall = hc.Contact(2000.0, 20.0, unilateral=True)
    pair = one(link=link, follower_clay=wall, follower_hardware=rough, leader_operator=HAND)
    found = hc.simulate(pair)
    levels = found.leader_torque / (10.0 / 16.0)
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-12)
    assert np.abs(levels).max() >= 1.0
    noisy = replace(
        pair, follower_hardware=hc.Hardware(force_noise=0.1, seed=3), follower_clay=None
    )
    torque = hc.simulate(replace(noisy, t_max=0.5)).leader_torque[1:, 0]
    assert np.std(torque) == pytest.approx(0.1, rel=4.0 / math.sqrt(2 * len(torque)))  # 4 sigma


def test_friction_of_the_two_link_arm_holds_it():
    """Below the friction of its joints the follower stands still; theory leaves that out."""
    rough = hc.Hardware(friction=(0.5, 0.5))
    pair = hc.Pair(ARM, ARM, LAW_2, follower_hardware=rough, muscle=hc.Step((0.1, 0.0), 0.0))
    found = hc.simulate(replace(pair, t_max=0.2))
    assert not np.any(found.follower - found.follower[0]) and np.ptp(found.leader) > 0.0
    drives = replace(pair, law=replace(LAW_2, runs="drive"), t_max=0.05)
    assert not np.any(np.ptp(hc.simulate(drives).follower, axis=0) > 1e-15)
    assert any("joint friction: left out" in x for x in hc.theory.pair_limits(pair).assumed)


# ---- theory, and what is refused -----------------------------------------------------------------


def test_theory_takes_wall_and_clay_as_what_is_never_left():
    object_ = one(follower_clay=hc.Contact(800.0, 6.0), link=hc.Link("position-force"))
    wall = replace(object_, follower_clay=hc.Contact(800.0, 6.0, unilateral=True, start=0.01))
    spring = hc.Spring(500.0, k1=300.0, tau=1.0, unilateral=True)
    clay = hc.Clay(
        hc.Profile((0.01,), (2.0, 6.0), Fy=(0.0, 1.0), springs=(hc.Spring(), spring)),
        hc.Profile((), (0.0,)),
    )
    found = [hc.theory.pair_limits(x) for x in (object_, wall, replace(wall, follower_clay=clay))]
    for other in found[1:]:
        assert other.delay == pytest.approx(found[0].delay, rel=1e-9)
        assert other.radius == pytest.approx(found[0].radius, rel=1e-9)
    assert any("as if never left" in x for x in found[1].assumed)
    assert any("largest damping and stiffness" in x for x in found[2].assumed)
    assert not any("never left" in x for x in found[0].assumed)


HARD = hc.Hardware
BAD = {
    "jitter": (dict(leader_hardware=HARD(jitter=1e-5)), "leader_hardware.jitter", "hosts"),
    "losses": (
        dict(follower_hardware=HARD(dropout_probability=0.1)),
        "follower_hardware.dropout_probability", "Link(loss)",
    ),
    "delay": (dict(leader_hardware=HARD(delay=1e-3)), "leader_hardware.delay", "Pair(delay)"),
    "rates": (dict(leader_hardware=HARD(velocity="difference")), "velocity", "JointPD(velocity)"),
    "coupling": (dict(leader_hardware=HARD(coupling=hc.Coupling(1e3, 1.0))), "coupling", "None"),
    "passivity": (dict(leader_hardware=HARD(passivity=True)), "passivity", "Link(passivity)"),
    "friction": (dict(leader_hardware=HARD(friction=(1.0, 0.0))), "friction", "Device(friction)"),
    "counts of a device": (dict(leader_hardware=HARD(encoder=100)), "encoder", "Device(quantum)"),
    "sensor without use": (dict(leader_hardware=HARD(adc_bits=8)), "adc_bits", "measures no force"),
    "no range": (dict(leader_hardware=HARD(dac_bits=8)), "dac_bits", "dac_range"),
    "converter of a drive": (
        dict(law=replace(LAW, runs="drive"), leader_hardware=HARD(dac_range=(1.0, 1.0))),
        "dac_range", "drives run the law",
    ),
    "wall without stiffness": (lambda: hc.Contact(B=1.0, unilateral=True), "contact.K", "> 0"),
    "wall that moves": (lambda: hc.Contact(1.0, 0.0, 1.0, unilateral=True), "contact.mass", "be 0"),
    "start of an object": (lambda: hc.Contact(1.0, start=0.1), "contact.start", "unilateral"),
    "far wall": (lambda: hc.Contact(1.0, unilateral=True, start=11.0), "contact.start", "10"),
    "wall all around": (
        lambda: hc.Pair(ARM, ARM, LAW_2, follower_clay=hc.Contact(1.0, unilateral=True)),
        "contact.axis", "must be given",
    ),
    "across the plane": (
        lambda: hc.Pair(ARM, ARM, LAW_2, follower_clay=hc.Contact(1.0, axis="z")),
        "contact.axis", "can move",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_refused(name):
    made, field, told = BAD[name]
    with pytest.raises(hc.ParameterError) as error:
        made() if callable(made) else one(**made)
    assert field in error.value.field and told in str(error.value), str(error.value)


IN_RUNS = {
    "stiff clay": (dict(follower_clay=hc.Contact(1.0, 1e6, unilateral=True)), "at most"),
    "yield beside friction": (
        dict(
            follower=replace(DEVICE, friction=0.1),
            follower_clay=hc.Clay(*[hc.Profile((), (1.0,), Fy=(1.0,))] * 2),
        ),
        "where clay yields",
    ),
    "a groove of a device": (
        dict(follower_clay=hc.Clay.of_groove(hc.Groove((0.0, 0.1), (-0.1, 0.1), pressure=1e4))),
        "must not stay cut",
    ),
}


@pytest.mark.parametrize("name", IN_RUNS)
def test_refused_in_runs(name):
    made, told = IN_RUNS[name]
    with pytest.raises(hc.ParameterError, match=told):
        hc.simulate(one(**made))


def test_a_file_has_walls_clay_and_hardware(tmp_path):
    text = """
    muscle = {kind = "pulse", value = [5, 0], start = 0, width = "50 ms"}
    [leader]
    file = "planar_2r"
    plane = "yx"
    [law]
    Kp = [20, 10]
    Kd = [1, 0.5]
    [follower_clay]
    x = {edges = [0.01], values = [0, 20], Fy = [0, 1]}
    y = {edges = [], values = [3]}
    [leader_clay]
    K = 900
    axis = "y"
    unilateral = true
    start = "5 mm"
    [leader_hardware]
    encoder = 4096
    [follower_hardware]
    encoder = [4096, 1024]
    [follower_operator]
    mass = 0.2
    """
    file = tmp_path / "pair.toml"
    file.write_text(text)
    pair = hc.Pair.load(file)
    assert pair.leader_clay == hc.Contact(900.0, axis="y", unilateral=True, start=5e-3)
    assert isinstance(pair.follower_clay, hc.Clay) and pair.follower_clay.x.Fy == (0.0, 1.0)
    assert pair.follower_hardware.encoder == (4096, 1024) and pair.leader.plane == "yx"
    assert pair.follower_operator.mass == 0.2
    file.write_text(text.replace("unilateral", "unilatral"))
    with pytest.raises(hc.ParameterError, match="unilateral"):
        hc.Pair.load(file)
