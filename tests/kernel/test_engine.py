"""The MJCF files compile without a warning and mean what they say."""

import dataclasses
import threading

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.formulas import arm
from hapticclay.kernel import arm as arms
from hapticclay.kernel import dynamics, engine, mover, path, records
from hapticclay.model.signals import Multisine
from hapticclay.views import stage
from tests.oracles.links import Links
from tests.waiting import PATIENCE


def test_operational_inertia_at_home_is_read_from_the_engine():
    model = hc.build(hc.free())
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    J, M = np.zeros((3, 2)), np.zeros((2, 2))
    mujoco.mj_jacSite(model, data, J, None, model.site("handle").id)
    mujoco.mj_fullM(model, data, M)
    Lambda = np.linalg.inv(J[:2] @ np.linalg.solve(M, J[:2].T))
    np.testing.assert_allclose(Lambda, np.diag([1 / 0.7919, 1 / 0.131]), atol=1e-9)
    np.testing.assert_allclose(data.site("handle").xpos, [0.35, 0.24, 0.0], atol=1e-15)


def test_inertia_matrix_is_the_same_at_every_pose_and_velocity_adds_no_torque():
    model = hc.build(hc.free())
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    seen = []
    for _ in range(20):
        data.qpos[:], data.qvel[:] = rng.uniform(-3, 3, 2), rng.uniform(-10, 10, 2)
        mujoco.mj_forward(model, data)
        M = np.zeros((2, 2))
        mujoco.mj_fullM(model, data, M)
        seen.append(M)
        np.testing.assert_allclose(data.qfrc_bias, 0.0, atol=1e-12)
    np.testing.assert_allclose(seen, np.broadcast_to(seen[0], (20, 2, 2)), rtol=1e-13)
    I1, I2 = 0.24**2 / 0.7919, 0.35**2 / 0.131
    np.testing.assert_allclose(seen[0], [[I1 + I2, I2], [I2, I2]], rtol=1e-14)


@pytest.mark.parametrize(
    "scenario", [hc.free(), hc.constant_cut(operator=hc.Operator())], ids=["free", "constant"]
)
def test_headless_scene_holds_nothing_that_it_does_not_need(scenario):
    m = hc.build(scenario)
    for count in (
        "ngeom",
        "nsensor",
        "npair",
        "nmesh",
        "ntex",
        "nmat",
        "nlight",
        "ncam",
        "nhfield",
        "ntendon",
        "neq",
        "nflex",
        "nskin",
        "na",
        "nplugin",
        "nuserdata",
    ):
        assert getattr(m, count) == 0, count
    assert (m.nq, m.nv, m.nbody) == (2, 2, 3)


def binary(model):
    out = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, out)
    return out.tobytes()


@pytest.mark.parametrize(
    "part",
    [
        {"operator": hc.Operator()},
        {"inertia_shaping": True},
        {"muscle": Multisine(rms=(1.0, 1.0), low=0.2, high=3.0, period=5.0, seed=1)},
        {"control": "sampled"},
        {
            "control": "sampled",
            "hardware": hc.Hardware(encoder=4096, friction=(0.1, 0.1), passivity=True),
        },
    ],
    ids=lambda part: "-".join(part),
)
def test_parts_that_live_in_the_loop_leave_the_model_as_it_is(part):
    """A scene without them pays nothing; with them the engine pays nothing."""
    plain = hc.constant_cut()
    assert binary(hc.build(dataclasses.replace(plain, **part))) == binary(hc.build(plain))


def test_looking_at_a_run_leaves_its_model_as_it_is():
    """Pictures have a model of their own."""
    s = hc.constant_cut()
    before = binary(hc.build(s))
    stage.picture(s.arm, None, (0.01, 0.005))
    assert binary(hc.build(s)) == before


def test_clay_is_two_dampers_that_free_space_does_without():
    assert hc.build(hc.free()).nu == 2
    m = hc.build(hc.constant_cut())
    assert [m.actuator(i).name for i in range(m.nu)] == ["shoulder", "elbow", "clay_x", "clay_y"]


def test_damper_is_backward_euler_in_the_engine():
    model = hc.build(hc.constant_cut(dt=1e-3))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    data.qvel[:] = [-0.1 / 0.24, 0.1 / 0.24]  # motion along x alone
    data.ctrl[2] = 1e6
    mujoco.mj_step(model, data)
    J = np.zeros((3, 2))
    data.qpos[:] = model.key("home").qpos
    mujoco.mj_forward(model, data)
    mujoco.mj_jacSite(model, data, J, None, model.site("handle").id)
    z = 1e6 * 1e-3 * 0.7919
    assert (J @ data.qvel)[0] == pytest.approx(0.1 / (1 + z), rel=1e-9)


def test_scenario_sets_step_and_torque_limits():
    m = hc.build(hc.constant_cut(dt=1e-3, torque_limit=(3.0, 4.0)))
    assert m.opt.timestep == 1e-3
    np.testing.assert_array_equal(m.actuator_ctrlrange[:2], [[-3, 3], [-4, 4]])


def test_scene_to_open_by_hand_compiles_and_steps_without_warning():
    with engine.warnings_caught() as caught:
        model = mujoco.MjModel.from_xml_path(str(engine.mjcf_folder() / "scene.xml"))
        data = mujoco.MjData(model)
        rng = np.random.default_rng(1)
        for _ in range(1000):
            data.ctrl[:2] = rng.uniform(-1, 1, 2)
            mujoco.mj_step(model, data)
    assert caught == []
    assert model.ngeom > 0 and model.opt.timestep == 0.00036


ANGLES, RATES, TORQUES = (st.tuples(*[st.floats(-x, x)] * 2) for x in (7.0, 50.0, 40.0))


@given(
    st.sampled_from([0.0, 0.4, None]), st.tuples(*[st.floats(0.02, 3.0)] * 2), ANGLES, RATES,
    TORQUES, TORQUES, st.tuples(*[st.floats(0.0, 1e6)] * 2), st.floats(1e-5, 1e-2),
)  # fmt: skip
def test_pieces_of_a_step_give_the_bits_of_the_engines_own(angle, lengths, q, w, tau, push, b, dt):
    clay = None if angle is None else dataclasses.replace(hc.slab(1.0), angle=angle)
    mine = hc.Arm(l1=lengths[0], l2=lengths[1])
    scenario = dataclasses.replace(
        hc.free(), arm=mine, origin=lengths, clay=clay, start=(0, 0), length=None
    )
    moved = mover.Mover(scenario)
    whole = mujoco.MjData(moved.model)
    moved.model.opt.timestep = dt
    for data in (whole, moved.data):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:], data.ctrl[:2] = q, w, push, tau
        data.ctrl[2:] = b[: moved.model.nu - 2]
    for _ in range(3):
        mujoco.mj_step(moved.model, whole)
        dynamics.step(moved.plain)
        assert whole.qpos.tobytes() == moved.data.qpos.tobytes()
        assert whole.qvel.tobytes() == moved.data.qvel.tobytes()


def test_an_engine_that_steps_otherwise_than_by_its_pieces_is_refused(monkeypatch):
    def other(model, data, step=mujoco.mj_step):
        step(model, data)
        data.qvel[1] = np.nextafter(data.qvel[1], 1.0)

    mover.check_pieces(hc.build(hc.free()))
    monkeypatch.setattr(mujoco, "mj_step", other)
    with pytest.raises(RuntimeError, match=r"mujoco 4\..*install mujoco 4\.0"):
        mover.check_pieces(hc.build(hc.free()))


def diverge():
    """A step of which the engine warns."""
    model = hc.build(hc.free())
    data = mujoco.MjData(model)
    data.qvel[:] = 1e300
    mujoco.mj_step(model, data)


def test_threads_that_collect_warnings_get_their_own_and_leave_things_as_they_were(
    tmp_path, monkeypatch
):
    """Two overlap, and the first ends first: no file is written; the user's function is back."""
    monkeypatch.chdir(tmp_path)
    told, both, first_over, found = [], threading.Event(), threading.Event(), {}
    user = told.append

    def second():
        with engine.warnings_caught() as caught:
            both.set()
            first_over.wait(PATIENCE)
            diverge()
        found["second"] = caught

    mujoco.set_mju_user_warning(user)
    try:
        with engine.warnings_caught() as caught:
            thread = threading.Thread(target=second)
            thread.start()
            both.wait(PATIENCE)
            diverge()
        first_over.set()
        thread.join()
        assert mujoco.get_mju_user_warning() is user
        diverge()
    finally:
        mujoco.set_mju_user_warning(None)
    assert len(caught) == len(found["second"]) == len(told) > 0
    assert list(tmp_path.iterdir()) == []


length, inertia = st.floats(0.05, 2.0), st.floats(1e-3, 10.0)
angle = st.floats(-3.1, 3.1)


def test_the_file_of_the_arm_is_the_papers():
    """arm.xml as it stands, opened by hand, has the numbers that a run gives it."""
    text = '<mujoco><include file="arm.xml"/></mujoco>'
    files = {"arm.xml": (engine.mjcf_folder() / "arm.xml").read_bytes()}
    by_hand = mujoco.MjSpec.from_string(text, include=files).compile()
    ours = engine.compose_spec(["arm.xml"], hc.Arm()).compile()
    for name in ("body_pos", "site_pos", "body_mass", "body_inertia"):
        np.testing.assert_array_equal(getattr(by_hand, name), getattr(ours, name), name)
    assert by_hand.body("link2").pos[0] == 0.24 and by_hand.site("handle").pos[0] == 0.35


@given(st.builds(hc.Arm, length, length, inertia, inertia), angle, angle)
@settings(max_examples=30)  # each compiles a model
def test_the_model_is_that_of_any_arm(a, q1, q2):
    """Kinematics and inertia by the engine, by first principles, and by the formulas."""
    own, links, bound = Links(a.l1, a.l2, a.I1, a.I2), a.links, 1e-14 * max(1.0, a.l1 + a.l2)
    p, J, M = engine.arm_at((q1, q2), a)
    np.testing.assert_allclose(p, own.forward((q1, q2)), atol=bound)
    m = records.Model()
    m.links[:] = links
    np.testing.assert_allclose(arms.place(m, q1, q2), p, atol=bound)
    np.testing.assert_allclose(J, own.jacobian((q1, q2)), atol=bound)
    np.testing.assert_allclose(M, own.M, rtol=1e-13)
    u = arm.jacobian(q1, q2, links)
    wxx, wxy, wyy = arm.mobility(u, links)
    W = J @ np.linalg.solve(M, J.T)
    rounding = 4e-16 * np.linalg.cond(M) * links[4]
    np.testing.assert_allclose([[wxx, wxy], [wxy, wyy]], W, atol=rounding)


@pytest.mark.parametrize("clay", [None, hc.constant_cut().clay])
def test_a_run_steps_the_arm_of_its_scenario(clay):
    a = hc.Arm(0.3, 0.25, 0.2, 0.5)
    model = hc.build(dataclasses.replace(hc.free(), clay=clay, arm=a))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, M)
    # in absolute angles the inertia is diag(I1, I2): M = T' diag T with T = [[1, 0], [1, 1]]
    assert M == pytest.approx(np.array([[0.7, 0.5], [0.5, 0.5]]), rel=1e-14)
    assert data.site("handle").xpos[:2] == pytest.approx([0.55, 0.0], abs=1e-15)
    plain = hc.build(dataclasses.replace(hc.free(), clay=clay))
    assert binary(plain) != binary(model)
    assert binary(plain) == binary(
        hc.build(dataclasses.replace(hc.free(), clay=clay, arm=hc.Arm()))
    )


def test_a_step_beyond_arithmetic_keeps_the_events_before_it(monkeypatch):
    """Machine code goes on with NaN, CPython raises: the crossings and stops are the same."""
    law = hc.Profile((-0.002, 0.002), (5.0, 50.0, 20.0), Fy=(0.0, 1.0, 1.0))
    push = hc.Samples((0.0, 0.2, 0.21), ((4.0, 0.0), (4.0, 0.0), (0.0, 0.0)))
    s = dataclasses.replace(
        hc.free(), clay=hc.Clay(law, hc.Profile((), (20.0,))), force=(0.0, 0.0), muscle=push,
        t_max=0.5, length=None, start=(-0.005, 0.0),
    )  # fmt: skip
    whole = hc.simulate(s, engine="python")
    assert len(whole.crossings) == 2 and whole.stops
    careful, last = path.step_to_event, whole.stops[-1].start + s.dt

    def breaking(m, s):
        if s.t > last:
            raise ZeroDivisionError
        careful(m, s)

    monkeypatch.setattr(path, "step_to_event", breaking)
    broken = hc.simulate(s, engine="python")
    assert broken.outcome.code == "out of reach" and len(broken.t) < len(whole.t)
    assert broken.crossings == whole.crossings
    assert [x.start for x in broken.stops] == [x.start for x in whole.stops]
