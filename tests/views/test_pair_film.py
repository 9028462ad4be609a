"""Films and figures of runs of pairs: what is where in the picture, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.views import film
from hapticclay.views.arm_sticks import in_space, sticks_of
from hapticclay.views.film import FilmOptions
from hapticclay.views.pair_stage import PairReel, PairStage, look_of
from hapticclay.views.sticks import KNOB, LEAST_ASPECT
from hapticclay.views.touched import body_of
from tests.views.test_film import needs_gl

DEVICE = hc.Device(6.0, 0.1)
LAW = hc.JointPD((400.0,), (50.0,))


def slides(**kw):
    given = {"leader_operator": hc.Operator(2.0, 2.0, 10.0), "t_max": 0.2}
    return hc.Pair(DEVICE, DEVICE, LAW, hc.Link(delay=0.02), **(given | kw))


def arms(name, **kw):
    arm = hc.MjcfArm(name)
    n = len(arm.names)
    return hc.Pair(arm, arm, hc.JointPD((20.0,) * n, (0.5,) * n), hc.Link(), t_max=0.05, **kw)


@pytest.fixture(scope="module")
def record():
    pair = slides(follower_clay=hc.Contact(50.0, 1.0, 3.0), muscle=hc.Step((5.0, 0.0), 0.0))
    return hc.simulate(pair)


@pytest.mark.parametrize("q", [(0.3, 0.9), (1.2, -2.0)])
def test_two_links_reach_the_handle_of_the_jacobian(q):
    """The handle's motion with each joint, by differences: their error is 1e-6 of a link."""
    arm, h = hc.Arm(), 1e-6
    u = hc.model.arm.jacobians(*q, arm.links)
    want = np.array([[u[0] + u[2], u[2]], [u[1] + u[3], u[3]]])
    for j in range(2):
        ahead, behind = (sticks_of(arm, np.array(q) + s * h * np.eye(2)[j]).handle for s in (1, -1))
        np.testing.assert_allclose((ahead - behind)[:2] / (2 * h), want[:, j], atol=1e-8)


def test_forces_have_their_axes_in_space():
    arm = hc.MjcfArm("planar_2r", plane="yx")
    np.testing.assert_array_equal(in_space(arm, np.array([[1.0, 2.0]])), [[2.0, 1.0, 0.0]])


@pytest.mark.parametrize("name", ["planar_2r", "haptic_3", "five_bar", "leader_7"])
@pytest.mark.parametrize("camera", ["room", "top"])
def test_cameras_see_both_arms_apart(name, camera):
    pair = arms(name)
    q = np.array([pair.leader.q, pair.leader.q + 0.02])
    stage = PairStage(pair, (q, q), np.zeros((2, 2, 3)), camera, 1.0)
    stage.pose(q[[1, 1]], np.zeros((2, 3)))
    which = stage.model.camera(camera).id
    turned = np.zeros(9)
    film.mujoco.mju_quat2Mat(turned, stage.model.cam_quat[which])
    half = math.tan(math.radians(0.5 * stage.model.cam_fovy[which]))
    spans = []
    for shown in stage._shown:
        places = np.concatenate([shown.segments.reshape(-1, 3), shown.handle[None]])
        x, y, z = ((places - stage.model.cam_pos[which]) @ turned.reshape(3, 3)).T
        across, high = x / (-z * half * LEAST_ASPECT), y / (-z * half)
        assert np.abs(across).max() < 1.0 and np.abs(high).max() < 1.0
        spans.append((across.min(), across.max()))
    assert spans[0][1] < spans[1][0]  # leader left of follower


@pytest.mark.parametrize("start, along", [(5e-3, 1.0), (-5e-3, -1.0)])
def test_a_wall_stands_where_the_handle_meets_it(start, along):
    """Its face is a knob's radius beyond the handle that has just reached it."""
    pair = slides(follower_clay=hc.Contact(500.0, unilateral=True, start=start))
    body = body_of(pair, 1, np.array([0.1, 0.2, 0.3]), 0.5)
    face = body.place - along * body.half * [1.0, 0.0, 0.0]
    np.testing.assert_allclose(face, [0.1 + start + along * KNOB * 0.5, 0.2, 0.3])
    assert not body.moves and body_of(pair, 0, np.zeros(3), 0.5) is None


def test_clay_ahead_begins_at_its_border_and_clay_around_is_a_ball():
    beyond = hc.Clay(hc.Profile((5e-3,), (0.0, 10.0)), hc.Profile((), (0.0,)))
    body = body_of(slides(follower_clay=beyond), 1, np.zeros(3), 1.0)
    assert body.place[0] - body.half[0] == pytest.approx(5e-3 + KNOB)
    around = hc.Clay(hc.Profile((), (10.0,)), hc.Profile((), (10.0,)))
    assert body_of(slides(leader_clay=around), 0, np.ones(3), 1.0).half is None


def test_objects_move_on_their_spring():
    body = body_of(slides(follower_clay=hc.Contact(50.0, 1.0, 3.0)), 1, np.zeros(3), 1.0)
    assert body.moves and body.spring and body.half is not None


@needs_gl
def test_two_links_in_closed_form_are_filmed():
    law = hc.JointPD((20.0,) * 2, (1.0,) * 2)
    found = hc.simulate(hc.Pair(hc.Arm(), hc.Arm(), law, hc.Link(), t_max=0.02))
    shots = [x.copy() for x in film.frames(found, FilmOptions(magnify=50.0, plots=False), 200)]
    assert any((a != b).any() for a, b in zip(shots, shots[1:], strict=False))


@needs_gl
def test_frames_move_with_the_pair(record):
    options = FilmOptions(speed=0.05, size=(640, 480), plots=False)
    shots = [x.copy() for x in film.frames(record, options, 2)]
    assert len(shots) == len(film.samples_shown(record, 0.05, 2))
    assert all((a != b).any() for a, b in zip(shots, shots[1:], strict=False))
    blue = shots[-1].astype(int) @ [-1, 0, 1] > 60
    red = shots[-1].astype(int) @ [1, 0, -1] > 60
    assert blue.sum() > 200 and red.sum() > 200  # knobs and arrows of leader and follower


@needs_gl
def test_plots_grow_beside_it(record):
    shots = [x.copy() for x in film.frames(record, FilmOptions(speed=0.1), 4)]
    plots = [int((x[:, 600:] < 200).any(axis=-1).sum()) for x in shots]
    assert plots[-1] > plots[0]


def test_a_film_lasts_and_its_motion_is_seen(record):
    """A slide's rail is as long as its motion asks; joints are magnified to a quarter radian."""
    assert look_of(record) == {"speed": pytest.approx(record.t[-1] / 8.0), "magnify": 1.0}
    joints = hc.simulate(arms("planar_2r"))
    assert look_of(joints)["magnify"] * joints.motion.max() == pytest.approx(0.25)


def test_a_record_from_a_file_has_no_pair_to_film(record, tmp_path):
    again = hc.PairRecord.load(record.save(tmp_path / "run.json"))
    np.testing.assert_array_equal(again.off, record.off)
    assert again.pair is None and again.headline() == record.headline()
    with pytest.raises(hc.ParameterError, match="must have its pair"):
        PairReel(again, "room")


def test_error_is_that_of_what_the_link_asks_for():
    """The follower opposite, and twice as far: off by delay and law alone."""
    plain = hc.simulate(slides(t_max=0.1))
    turned = hc.simulate(replace(slides(t_max=0.1), axes=(-1,)))
    np.testing.assert_allclose(turned.off, -plain.off, atol=1e-15)
    assert turned.error == pytest.approx(plain.error)


def test_figure_shows_error_ports_and_the_bound_of_controllers():
    link = hc.Link("position-force", 0.02, passivity=True, energy=0.004)
    found = hc.simulate(replace(slides(), link=link))
    _, error, _, energy = found.plot().axes
    np.testing.assert_array_equal(error.lines[0].get_ydata(), 1e3 * found.off[:, 0])
    for line, x in zip(energy.lines, (*found.port_energy.T, found.energy), strict=False):
        np.testing.assert_array_equal(line.get_ydata(), 1e3 * x)
    assert energy.lines[-1].get_ydata()[0] == -8.0
