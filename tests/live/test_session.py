"""A session without graphics: a scripted hand instead of a mouse."""

import dataclasses
import functools
import math

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.kernel import native
from hapticclay.kernel.row import CHUNK
from hapticclay.live.clock import FRAME_TIME, LONGEST_SLICE, Clock
from hapticclay.live.player import Player
from hapticclay.live.replay import Replay
from hapticclay.live.run import session_scenario
from hapticclay.live.session import Session
from hapticclay.live.verdict import live_verdict
from hapticclay.views.stage import Stage
from hapticclay.views.window import Window
from tests.waiting import until


def drag(session, seconds, way=lambda t: (0.05 * t, 0.0)):
    end = session.t + seconds
    while session.t < end - 1e-6 and not session.ended:
        session.pull(way(session.t))
        session.advance(FRAME_TIME)
    return session


@pytest.mark.parametrize(
    "scenario", [hc.constant_cut(), hc.variable_cut()], ids=["constant", "variable"]
)
def test_hand_feels_the_clay(scenario):
    session = drag(Session(scenario, stiffness=10.0), 2.4, lambda t: (0.04 * t, 0.0))
    record = session.record()
    moving = (np.abs(record.v) > 1e-3) & (record.b > 0.0)
    assert moving.sum() > 1000
    np.testing.assert_allclose(record.ratio(record.fe)[moving], record.b[moving], rtol=1e-9)
    assert record.outcome.code == "finished" and record.t[-1] == pytest.approx(2.4, abs=FRAME_TIME)
    assert (
        abs(record.energy["residual"]) < 1e-4 * record.energy["throughput"]
    )  # second order in the step


def test_pull_is_the_impedance_towards_the_point():
    """fh = k (target - p) - d v - m a, from the record's own arrays; a by differences."""
    scenario = hc.constant_cut()
    record = drag(Session(scenario, stiffness=10.0), 2.0, lambda t: (0.03 * t, 0.01 * t)).record()
    th = record.scenario.operator
    assert (th.spring, th.mass) == (60.0, 0.25) and th.damper == pytest.approx(2.0 * 10**0.5)
    a = np.gradient(record.v, record.t, axis=0)
    expected = th.spring * (record.extra["target"] - record.p) - th.damper * record.v - th.mass * a
    quiet = slice(50, -50)
    still = (
        np.abs(np.gradient(a, record.t, axis=0)).max(axis=1)[quiet] < 50.0
    )  # not at a border or a new slice
    assert still.sum() > 3000
    # 2e-3 N: m a by differences across one step
    np.testing.assert_allclose(record.fh[quiet][still], expected[quiet][still], atol=2e-3)


def test_slices_are_no_part_of_the_result():
    """With a still target, slices of any length and a headless run with that force agree."""
    ends, endless = [], dataclasses.replace(hc.constant_cut(dt=1e-3), length=None)
    # some are shorter than a step, and one is as long as the rows between two looks
    looks = 1e-3 * (CHUNK - 1)
    frames = dict.fromkeys((FRAME_TIME, 0.005, 0.0005, LONGEST_SLICE), 1.2) | {looks: looks}
    for frame, end in frames.items():
        session = Session(endless, stiffness=10.0)
        session.pull((0.0, 0.0))
        session.push((2.0, 0.0))
        while session.t < end - 1e-9:
            way = session.advance(min(frame, end - session.t + 1e-9))
            assert len(way) == 2 or frame < 1e-3
        ends.append(session.record())
    still = dataclasses.replace(
        session_scenario(endless, 10.0), force=(2.0, 0.0), t_max=ends[0].t[-1]
    )
    reference = hc.simulate(still)
    for record in ends:
        n = min(len(record.t), len(reference.t)) - 2
        np.testing.assert_allclose(record.p[:n], reference.p[:n], rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(record.fh[:n], reference.fh[:n], rtol=1e-8, atol=1e-8)


def test_gain_and_damping_change_while_it_runs():
    session = Session(hc.constant_cut(dt=1e-3), stiffness=10.0)
    drag(session, 1.0, lambda t: (0.1, 0.0))
    session.change(b=2.0)
    assert session.b == (180.0, 180.0)
    drag(session, 0.5, lambda t: (0.1, 0.0))
    session.change(gain=(2.0, 0.25))
    drag(session, 0.5, lambda t: (0.1, 0.0))
    record = session.record()
    assert set(np.unique(record.b[:, 0])) == {0.0, 90.0, 180.0}
    assert set(np.unique(record.extra["gain"][:, 0])) == {1.0, 2.0}
    moving = np.abs(record.v[:, 0]) > 1e-3
    np.testing.assert_allclose(record.ratio(record.fe)[moving, 0], record.b[moving, 0], rtol=1e-9)


@pytest.mark.parametrize("key, name", [(265, "gain"), (262, "damping"), (264, "gain")])
def test_a_key_held_down_stops_at_the_bound_of_its_number(key, name):
    """1.25^100 is far beyond any bound; the window and its record go on."""
    window = Window(Session(hc.constant_cut()))
    for _ in range(100):
        window.look([key], None)
    last = getattr(window.play, name)
    window.look([key], None)
    assert (getattr(window.play, name) == last) is (key != 264)
    window.play.advance(0.02)
    assert window.play.t > 0.0 and not window.play.ended


def test_letting_go_leaves_the_handle_to_itself():
    """The hand's mass and damper remain: 10/K and d slow the handle, no spring pulls it back."""
    session = drag(Session(hc.free(dt=1e-3), stiffness=10.0), 1.5, lambda t: (0.1, 0.0))
    session.pull(None)
    for _ in range(120):
        session.advance(FRAME_TIME)
    p, v = session.frames[-1][1:3]
    assert abs(v[0]) < 1e-4 and p[0] > 0.03


def test_pause_restart_and_record_switch():
    session = drag(Session(hc.constant_cut(dt=1e-3), stiffness=10.0), 0.5)
    session.paused = True
    assert len(session.advance(FRAME_TIME)) == 0 and session.t == pytest.approx(0.5, abs=FRAME_TIME)
    session.paused, session.recording = False, False
    drag(session, 0.5)
    session.recording = True
    drag(session, 0.5)
    record = session.record()
    gap = np.diff(record.t).max()
    assert gap == pytest.approx(0.5, abs=2 * FRAME_TIME)
    session.recording = False
    session.restart()
    assert session.t == 0.0 and not session.recorded and not session.recording
    with pytest.raises(hc.ParameterError, match="nothing was recorded"):
        session.record()


def test_a_gap_in_the_record_of_clay_that_yields_leaves_out_its_forces_too():
    layer = hc.Profile((), (20.0,), Fy=(0.3,))
    scene = dataclasses.replace(hc.constant_cut(dt=1e-3), clay=hc.Clay(layer, layer))
    session = Session(scene, stiffness=10.0)
    for session.recording in (True, False, True):
        drag(session, 0.5)
    r = session.record()
    assert len(r.fe) == len(r.t) and np.diff(r.t).max() > 0.4
    moving = r.v[:, 0] > 1e-3
    assert moving.any() and (r.fe[moving, 0] > 20.0 * r.v[moving, 0] + 0.29).all()


@functools.cache
def cut_through():
    """A session that cut the slab from end to end; nothing is to change it."""
    session = Session(hc.constant_cut(dt=1e-3), stiffness=10.0, every=4)
    return drag(session, 5.0, lambda t: (0.06 * t, 0.0))


def test_record_keeps_its_extras(tmp_path):
    record = cut_through().record()
    back = hc.Record.load(record.save(tmp_path))
    assert set(back.extra) == {"removed", "removal_rate", "target", "gain"}
    for name, array in record.extra.items():
        np.testing.assert_array_equal(back.extra[name], array)
        assert len(array) == len(record.t)
    assert back.notes == record.notes and record.notes["tool"] == {"width": 0.02, "depth": 0.01}
    assert record.extra["removed"][-1] == pytest.approx(0.02 * 0.01 * 0.10, rel=1e-2)


def test_removed_volume_is_width_times_depth_times_length_and_what_the_picture_shows():
    """To 1 % in the constant cut: the slab is 10 cm long, and the path nearly straight."""
    session = cut_through()
    stage = Stage(session.scenario, session.tool)
    stage.carve([f[1] for f in session.frames])
    volume = session.record().extra["removed"][-1]
    assert volume == pytest.approx(0.02 * 0.01 * 0.10, rel=1e-2)
    assert stage.removal.volume == pytest.approx(volume, rel=2e-3)  # chords of 1/60 s


def test_clay_is_removed_while_recording_is_off_too():
    """The record lacks a detour; its volume is still that of the picture."""
    session = Session(hc.constant_cut(dt=1e-3), stiffness=10.0, every=4)
    for recording, y in ((False, 0.0), (True, 0.0), (False, 0.05), (False, 0.0), (True, 0.0)):
        session.recording = recording
        drag(session, 1.5, lambda t, y=y: (0.02 + 0.015 * t, y))
    stage = Stage(session.scenario, session.tool)
    stage.carve([f[1] for f in session.frames])
    record = session.record()
    assert np.diff(record.t).max() == pytest.approx(3.0, abs=2 * FRAME_TIME)
    assert stage.removal.volume == pytest.approx(record.extra["removed"][-1], rel=5e-3)
    straight_on = hc.studies.removed(record)[0][-1]
    assert record.extra["removed"][-1] > 1.1 * straight_on


@pytest.mark.parametrize("every", [0, -1, 1.5])
def test_bad_every_is_refused(every):
    with pytest.raises(hc.ParameterError, match="every"):
        Session(hc.constant_cut(), every=every)


def test_records_of_headless_runs_have_none(tmp_path):
    record = hc.simulate(hc.constant_cut(t_max=0.1))
    assert record.extra == {} and "notes" not in record.summary()
    assert hc.Record.load(record.save(tmp_path)).extra == {}


def test_out_of_reach_ends_it_with_a_reason():
    session = Session(hc.free(), stiffness=1.0)
    session.push((30.0, 0.0))
    for _ in range(600):
        session.advance(FRAME_TIME)
    assert "stretched" in session.ended and session.record().outcome.code == "out of reach"


@pytest.mark.parametrize(
    "arm,low,high",
    [
        (hc.Arm(), 0.16, 0.57),
        (hc.Arm(0.3, 0.45, 0.1, 0.9), 0.2, 0.73),
        (hc.Arm(0.3, 0.06, 0.1, 0.01), 0.27, 0.34),  # a quarter of the reach where 5 cm is more
    ],
    ids=["paper", "longer", "short link"],
)
def test_point_stays_within_reach(arm, low, high):
    cut = hc.constant_cut(length=0.03, clay=(0.01, 0.02))
    session = Session(dataclasses.replace(cut, arm=arm, origin=(0.22, 0.2)))
    for far, r in (((5.0, 0.0), high), ((-0.22, -0.2), low)):
        session.pull(far)
        x, y = np.add(session.point, session.scenario.origin)
        assert np.hypot(x, y) == pytest.approx(r, rel=1e-12)


@pytest.mark.parametrize("field,value", [("control", "sampled"), ("integrator", "accurate")])
def test_other_ways_to_step_are_refused(field, value):
    with pytest.raises(hc.ParameterError, match=field):
        Session(hc.constant_cut(**{field: value}))


def test_clock_keeps_real_time_whatever_the_frames():
    clock, now, made = Clock(), 100.0, 0.0
    rng = np.random.default_rng(0)
    for _ in range(2000):
        made += clock.due(now)
        now += rng.uniform(0.005, 0.04)
    assert made == pytest.approx(now - 100.0, abs=0.06) and not clock.slow
    assert clock.factor == pytest.approx(1.0, abs=0.02)
    assert clock.late.sum() == clock.frames == 2000


def test_slow_machine_slows_the_clock_evenly():
    """Frames of 0.2 s: each makes MOST, the factor is 1/4, and it says so."""
    clock, made = Clock(), []
    for k in range(100):
        made.append(clock.due(0.2 * k))
    assert clock.slow and set(np.round(made[1:], 12)) == {LONGEST_SLICE}
    assert clock.factor == pytest.approx(0.25, rel=0.02)
    clock.rest()
    assert clock.due(1000.0) <= LONGEST_SLICE  # a pause is not made good


def test_player_plays_and_stops():
    session = Session(hc.constant_cut(), stiffness=10.0)
    player = Player(session)
    player.start()
    until(lambda: session.t >= 0.3)
    player.stop()
    assert not player.is_alive()


def test_player_hands_on_what_it_died_of(monkeypatch):
    session = Session(hc.constant_cut())
    monkeypatch.setattr(session, "advance", lambda s: 1 / 0)
    player = Player(session)
    player.start()
    until(lambda: not player.is_alive())
    with pytest.raises(ZeroDivisionError):
        player.stop()


def test_replay_follows_the_record():
    record = hc.simulate(hc.constant_cut(dt=1e-3), every=4)
    replay, went = Replay(record), [record.p[:1]]
    while not replay.ended:
        went.append(replay.advance(FRAME_TIME))
    assert replay.ended == record.status
    np.testing.assert_array_equal(np.concatenate(went)[-1], record.p[-1])


def test_verdict_follows_the_monitor_and_the_gain():
    """K_y below its limit, above it, and below again: the verdict names each."""
    session = Session(hc.constant_cut(dt=1e-3), stiffness=10.0)
    assert session.verdict().text == "stable; no limit of K here"
    session.push((0.0, 0.2))
    drag(session, 3.0, lambda t: (0.1, 0.0))
    assert session.b == (90.0, 90.0)
    limit = hc.theory.gain_limit("y", 90.0, operator=session.scenario.operator)
    assert session.verdict().text.startswith("stable; limit of K here: ")
    assert session.verdict().text.endswith(f"{limit:.3g}") and not session.verdict().unstable
    session.change(gain=(1.0, 3.0 * limit))
    assert (
        session.verdict().text == f"beyond the limit of K; here Ky {3.0 * limit:.3g} > {limit:.3g}"
    )
    drag(session, 6.0, lambda t: (0.1, 0.0))
    onset = session.run.watch.onset
    said = session.verdict()
    assert said.unstable and onset.axis == "y"
    assert said.text.startswith(
        f"UNSTABLE since {onset.time:.1f} s: growing oscillation of y; here Ky"
    )
    swing = np.ptp([f[2][1] for f in session.frames[-30:]])
    session.change(gain=(1.0, 0.5 * limit))
    drag(session, 6.0, lambda t: (0.1, 0.0))
    assert np.ptp([f[2][1] for f in session.frames[-30:]]) < 0.02 * swing  # it did calm down
    assert not session.verdict().unstable and session.verdict().text.startswith(
        "calm again, was unstable"
    )


@pytest.mark.parametrize("gain,axis", [(1.0, ""), (6.0, "x")])
def test_verdict_of_a_replay_is_that_of_its_record(gain, axis):
    record = hc.simulate(hc.stability_test(gain=gain, dt=1e-3, t_max=4.0), every=4)
    assert record.outcome.axis == axis
    replay, said = Replay(record), []
    while not replay.ended:
        said.append((replay.t, replay.verdict()))
        near = abs(replay.t - record.outcome.time) < 0.16  # each frame there, a few elsewhere
        replay.advance(FRAME_TIME if near else 0.15)
    said.append((replay.t, replay.verdict()))
    assert all(v.unstable == (bool(axis) and t >= record.outcome.time) for t, v in said)
    assert said[-1][1].unstable == bool(axis)


@pytest.mark.skipif(not native.is_there(), reason="needs the compiled kernel")
def test_a_session_is_compiled_where_there_is_a_kernel_to_the_same_bits(monkeypatch):
    fine, ends = hc.constant_cut(dt=5e-5), []
    for engine in ("native", "python"):
        live = drag(Session(fine, stiffness=10.0), 0.3)
        assert live.run.row.engine == engine
        ends.append(live.record())
        monkeypatch.setattr(native, "why_not", lambda: "it is not built")
    np.testing.assert_array_equal(ends[0].p, ends[1].p)


@pytest.mark.parametrize(
    "limit,told",
    [
        ((math.inf, math.inf), "stable; no limit of K here"),
        ((3.0, 0.8), "stable; limit of K here: 3, 0.8"),
        ((math.inf, 0.8), "stable; limit of Ky here: 0.8"),
        ((3.0, math.inf), "stable; limit of Kx here: 3"),
        (None, "stable"),
    ],
)
def test_a_verdict_names_the_limits_that_there_are(limit, told):
    assert live_verdict((0.5, 0.5), limit, None, False).text == told


def test_an_oscillation_has_no_word_of_a_limit_that_is_not_there():
    onset = hc.Outcome("diverged", 1.0, 1, "y", "growing oscillation")
    text = live_verdict((0.5, 0.5), (math.inf, math.inf), onset, True).text
    assert text == "UNSTABLE since 1.0 s: growing oscillation of y"
