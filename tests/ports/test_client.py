"""The client: what it sends a device, what it does without one, and what its data tell."""

import json
import math
import sys
import threading
from contextlib import contextmanager

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve as listen

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.errors import ParameterError
from hapticclay.model.constants import NOMINAL
from hapticclay.ports import Coupled, DeviceClient, Limits, Trajectory, connect, render, serve
from hapticclay.ports.client import MOST_MISSED
from hapticclay.ports.client_log import ClientLog, Exchanged
from hapticclay.ports.coupled import SETTLING, DeviceHand
from hapticclay.ports.inverse import Cursor, Frame, frame_text
from hapticclay.ports.limits import ForceLimiter, allowed
from hapticclay.ports.rows import Rows
from hapticclay.ports.service import REST
from tests.ports.conftest import SCENE

PERIOD = 0.005
BY_MESSAGE = Limits(period=PERIOD, ramp=0.0, patience=1.0)  # answers are late on a busy computer


@contextmanager
def device(answer):
    """A device that answers the k-th message with answer(k, force): a text, several, or None."""
    sent, threads = [], []

    def talk(socket):
        socket.send(frame_text(Frame("04EA", Cursor(REST), full=True)))
        for data in socket:
            force = json.loads(data)["inverse3"][0]["commands"]["set_cursor_force"]["values"]
            sent.append((force["x"], force["y"], force["z"]))
            text = answer(len(sent), sent[-1])
            for each in [text] if isinstance(text, str) else text or ():
                socket.send(each)

    def run(socket):
        threads.append(threading.current_thread())
        try:
            talk(socket)
        except ConnectionClosed:
            pass

    with listen(run, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}", sent
        server.shutdown()
        for each in (thread, *threads):  # all messages have been read
            each.join()


STILL = frame_text(Frame("04EA", Cursor(REST)))


def at(x, v=0.0):
    """The frame of a device at a place [m], with a velocity [m/s]."""
    return frame_text(Frame("04EA", Cursor((float(x), 0.0, 0.0), (float(v), 0.0, 0.0))))


def test_a_force_is_shortened_and_grows():
    assert allowed((3.0, 4.0, 0.0), 1.0, 1.0) == pytest.approx((0.6, 0.8, 0.0), rel=1e-15)
    assert allowed((3.0, 4.0, 0.0), 10.0, 0.25) == (0.75, 1.0, 0.0)
    for bad in (math.nan, math.inf):
        assert allowed((bad, 0.0, 0.0), 10.0, 1.0) == (0.0, 0.0, 0.0)
    huge = 1.7e308  # the length overflows, the direction is known
    assert allowed((huge, -huge, 0.0), 2.0, 1.0) == pytest.approx((2**0.5, -(2**0.5), 0.0))


def test_exchanges_with_our_own_device():
    with serve(SCENE, period=PERIOD) as server, connect(server.url, BY_MESSAGE) as client:
        assert client.device_id == "04EA" and client.first.position == REST
        samples = [client.exchange((1.0, 0.0, 0.0)) for _ in range(8)]
        assert server.service.device.force == (1.0, 0.0)
        xs = [s.position[0] for s in samples]
        assert xs == sorted(xs) and samples[-1].velocity[0] > 0.0
        assert [s.t for s in samples] == pytest.approx([PERIOD * (k + 1) for k in range(8)])


def test_the_force_grows_over_the_ramp():
    """In even steps from nothing, at exchanges that each count for a period."""
    limits = Limits(period=0.01, ramp=0.1, largest_force=2.0, patience=1.0)
    with device(lambda k, f: STILL) as (url, sent), connect(url, limits) as client:
        for _ in range(15):
            client.exchange((8.0, 0.0, 0.0))
    expected = [min(1.0, 0.1 * k) * 2.0 for k in range(15)]
    assert [f[0] for f in sent[:15]] == pytest.approx(expected, abs=1e-12)
    assert sent[15] == (0.0, 0.0, 0.0)  # at the end


def test_the_force_of_a_hand_grows_once_its_period_is_known():
    """K times 10 mm, in even steps from nothing, however long the period was measured."""
    limits = Limits(period=0.01, ramp=0.1, patience=1.0)
    with device(lambda k, f: STILL) as (url, sent), connect(url, limits) as client:
        hand = DeviceHand(client, Coupled(K=200.0), (0.0, 0.0))
        before = len(sent)
        for _ in range(12):
            hand.exchange((0.01, 0.0), (0.0, 0.0))
    assert sent[:before] == [(0.0, 0.0, 0.0)] * (SETTLING + 1)
    expected = [min(1.0, 0.1 * k) * 2.0 for k in range(12)]
    assert [f[0] for f in sent[before : before + 12]] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("answer", [None, "rubbish", '{"inverse3":[]}'])
def test_no_force_after_a_lost_sample(answer):
    """The message after it has no force, and those behind it grow from nothing again."""
    limits = Limits(period=0.01, ramp=0.05, patience=0.03)
    reply = {6: answer}
    with device(lambda k, f: reply.get(k, STILL)) as (url, sent), connect(url, limits) as client:
        seen = [client.exchange((1.0, 0.0, 0.0)) for _ in range(6)]
        assert seen[4] is not None and seen[5] is None and client.log.missed == 1
        for _ in range(8):
            client.exchange((1.0, 0.0, 0.0))
    assert sent[5][0] > 0.9 and sent[6] == (0.0, 0.0, 0.0)
    assert [f[0] for f in sent[7:13]] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], abs=1e-9)


def test_an_answer_that_comes_late_shifts_nothing():
    """Both answers are read before the next exchange: none is one behind for ever."""

    def answer(k, force):
        return {3: None, 4: [at(3), at(4)]}.get(k, at(k))

    limits = Limits(period=0.01, patience=0.1)
    with device(answer) as (url, _), connect(url, limits) as client:
        seen = [client.exchange() for _ in range(9)]
        assert seen[2] is None
        assert [s.position[0] for s in seen[3:]] == [4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
        assert client.log.missed == client.log.skipped == 1


@pytest.mark.parametrize("silent", [{1}, {3}, {3, 4, 5}, {2, 4, 6}])
def test_a_message_that_is_never_answered_is_one_lost_sample(silent):
    limits = Limits(period=0.01, patience=0.05)
    with (
        device(lambda k, f: None if k in silent else at(k)) as (url, _),
        connect(url, limits) as client,
    ):
        seen = [client.exchange() for _ in range(10)]
        lost = [k for k, sample in enumerate(seen, 1) if sample is None]
        assert set(lost) == silent and client.log.missed == len(silent) and not client.lost
        assert all(s.position[0] == k for k, s in enumerate(seen, 1) if s is not None)


class Stream:
    """A device that sends its places on its own, 0, 1, 2, ..., and answers nothing."""

    def __init__(self):
        self.sent, self.stop = 0, threading.Event()

    def talk(self, socket):
        try:
            socket.send(frame_text(Frame("04EA", Cursor(REST), full=True)))
            while not self.stop.wait(5e-4):
                self.sent += 1
                socket.send(at(1e-3 * self.sent))
        except ConnectionClosed:
            pass

    @contextmanager
    def served(self):
        with listen(self.talk, "127.0.0.1", 0) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
            self.stop.set()
            server.shutdown()
            thread.join()


def test_a_stream_is_read_at_its_newest_frame():
    """Far faster than the exchanges: each sample left the device after the exchange began."""
    stream = Stream()
    with stream.served() as url:
        client = DeviceClient(url, Limits(rate=25.0, patience=1.0))
        for _ in range(25):
            before = stream.sent
            sample = client.exchange()
            assert round(1e3 * sample.position[0]) >= before - 1  # one may be on its way
        used, total = len(client.log), stream.sent
        assert client.log.missed == 0 and total > 5 * used
        # all frames are counted, but for those on their way at the last exchange
        assert 0 <= total - used - client.log.skipped < 50
        assert client.log.timing().skipped == client.log.skipped
        client.close()  # waits for nothing that was sent before
        assert stream.sent - total < 5000


def test_a_device_that_is_gone_is_an_outcome():
    with serve(SCENE, clock="wall") as server, connect(server.url) as client:
        assert client.exchange() is not None
        server.close()
        found = [client.exchange((1.0, 0.0, 0.0)) for _ in range(3)]
        assert found == [None] * 3 and client.lost


# ---- what protects the hand ----------------------------------------------------------------------


def test_a_jump_turns_the_force_within_its_rate_of_change():
    """From -3 N to 3 N in even steps of slew_rate Ts = 0.5 N: the place jumps by 1 m."""
    limits = Limits(period=1e-3, ramp=0.0, patience=1.0)
    places = [at(0.05 + 1e-6 * k if k < 70 else -0.95 + 1e-6 * k) for k in range(200)]
    with device(lambda k, f: places[k]) as (url, sent), connect(url, limits) as client:
        hand = DeviceHand(client, Coupled(), (0.0, 0.0))
        for _ in range(60):
            hand.exchange((-0.05, 0.0), (0.0, 0.0))
    x = [f[0] for f in sent[:-1]]
    (turn,) = [k for k in range(1, len(x)) if x[k - 1] == pytest.approx(-3.0) and x[k] > -2.9]
    assert x[turn : turn + 14] == pytest.approx([min(3.0, -2.5 + 0.5 * k) for k in range(14)])


FORCES = st.tuples(*[st.floats(-8.0, 8.0) | st.sampled_from([0.0, math.nan, 1e308])] * 3)
STEPS = st.tuples(FORCES, st.floats(0.0, 0.1), st.booleans(), st.floats(0.0, 1e-3))


@given(st.lists(STEPS, max_size=12), st.floats(0.0, 0.2), st.floats(1.0, 1e4))
def test_no_force_leaves_its_limits(steps, ramp, slew_rate):
    """Whatever is asked at whatever times: length, rate of change, and zero after each gap."""
    limits = Limits(2.0, ramp, slew_rate=slew_rate, frozen=None)
    limiter, t, before = ForceLimiter(limits), 0.0, (0.0, 0.0, 0.0)
    for force, passed, lost, x in steps:
        t += passed
        sent = limiter.apply(force, t, lost)
        limiter.see((x, 0.0, 0.0), t)
        assert math.hypot(*sent) <= 2.0 * (1 + 1e-12)
        if any(sent):
            change = math.dist(sent, before)
            first = limits.Ts if before == (0.0, 0.0, 0.0) else 0.0  # of the first message
            assert change <= min(2.0, slew_rate * (passed + first)) + 1e-12
        if lost or (ramp and passed > limits.Ts + limits.patience):
            assert sent == (0.0, 0.0, 0.0)
        before = sent


def test_the_force_grows_from_nothing_after_a_pause():
    """A pause of the program, in which the device lets go: forces count up from zero again."""
    limits = Limits(rate=100.0, ramp=0.2, slew_rate=1e6)
    limiter, sent = ForceLimiter(limits), []
    times = [0.01 * k for k in range(41)] + [1.0 + 0.01 * k for k in range(31)]
    for k, t in enumerate(times):
        limiter.see((1e-6 * k, 0.0, 0.0), t)
        sent.append(limiter.apply((9.0, 0.0, 0.0), t)[0])
    grown = [3.0 * min(1.0, 0.05 * k) for k in range(41)]
    assert sent[:41] == pytest.approx(grown, abs=1e-12)
    assert sent[41:] == pytest.approx(grown[:31], abs=1e-12)


def test_a_client_that_pauses_sends_nothing_at_first():
    limits = Limits(rate=200.0, ramp=0.02, patience=0.05)
    with device(lambda k, f: at(1e-6 * k)) as (url, sent), connect(url, limits) as client:
        for _ in range(20):
            client.exchange((1.0, 0.0, 0.0))
        before = len(sent)
        threading.Event().wait(0.3)
        client.exchange((1.0, 0.0, 0.0))
        assert sent[before - 1][0] == 1.0 and sent[before] == (0.0, 0.0, 0.0)


def test_a_frozen_position_gets_no_force():
    """The place stays from message 20 on: after 0.1 s of force there is none, until it moves."""
    limits = Limits(period=0.01, ramp=0.05, frozen=0.1)
    with (
        device(lambda k, f: at(1e-5 * (k if k < 20 else 20 if k < 50 else k))) as (url, sent),
        connect(url, limits) as client,
    ):
        for _ in range(70):
            client.exchange((1.0, 0.0, 0.0))
        x = np.array([f[0] for f in sent[:70]])
        withheld = client.log.withheld
    assert np.all(x[6:30] == 1.0)
    assert np.all(x[30:50] == 0.0) and withheld == 20  # ten messages at that place had a force
    assert x[50:57] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.0], abs=1e-9)


def test_a_device_at_rest_without_force_is_not_frozen():
    """It may rest as long as it likes; a later push reaches it, and one that ends begins anew."""
    limits = Limits(period=0.01, ramp=0.0, frozen=0.1)
    pushes = [0.0] * 40 + [1.0] * 15 + [0.0] + [1.0] * 5
    with device(lambda k, f: STILL) as (url, sent), connect(url, limits) as client:
        for push in pushes:
            client.exchange((push, 0.0, 0.0))
    expected = [0.0] * 40 + [1.0] * 10 + [0.0] * 6 + [1.0] * 5
    assert [f[0] for f in sent[: len(pushes)]] == expected


@pytest.mark.parametrize(
    "bad",
    [
        at(0.08).replace("0.08", "1e308"),
        at(0.08).replace("0.08", "NaN"),
        at(0.08, 0.25).replace("0.25", "1e308"),
        at(0.08, 0.25).replace("0.25", "-2e3"),
        at(0.08, 0.25).replace("0.25", "1" + 400 * "0"),
        at(0.08).replace('"device_id": "04EA"', '"device_id": "%s"' % (300 * "A")),  # noqa: UP031
    ],
)
def test_a_frame_beyond_all_bounds_is_a_lost_sample(bad):
    limits = Limits(period=0.01, ramp=0.0, patience=1.0)
    with (
        device(lambda k, f: bad if k == 4 else at(1e-4 * k)) as (url, sent),
        connect(url, limits) as client,
    ):
        seen = [client.exchange((1.0, 0.0, 0.0)) for _ in range(8)]
    assert [s is None for s in seen] == [k == 4 for k in range(1, 9)]
    assert sent[4] == (0.0, 0.0, 0.0) and sent[3][0] > 0.0


@pytest.mark.parametrize("velocity", ["1e308", "999.0", "-1e3"])
def test_a_session_outlives_any_velocity_that_a_device_reports(velocity):
    """One wild number is a lost sample, or a violent pull: the record is there in either case."""

    def answer(k, force):
        return at(1e-5 * k, 0.25).replace("0.25", velocity if k == 80 else "1e-3")

    with device(answer) as (url, _):
        found = render(hc.constant_cut(b=30.0), url, 1.0, limits=Limits(period=0.01))
    assert len(found.record.t) > 1 and np.isfinite(found.record.p).all()
    assert found.timing.missed == (velocity == "1e308")


def test_a_device_that_says_nothing_any_more_is_given_up():
    limits = Limits(period=0.01, patience=1e-3)
    with device(lambda k, f: None) as (url, sent), connect(url, limits) as client:
        assert [client.exchange((1.0, 0.0, 0.0)) for _ in range(MOST_MISSED)] == [
            None
        ] * MOST_MISSED
        assert client.lost
    assert all(f == (0.0, 0.0, 0.0) for f in sent)


def test_no_device_is_refused():
    with pytest.raises(ParameterError, match="Inverse service"), connect("ws://127.0.0.1:9"):
        pass
    with pytest.raises(ParameterError, match="Inverse service"), connect("not an address"):
        pass
    with serve(SCENE, period=PERIOD) as server:
        url = server.url
    with pytest.raises(ParameterError, match="Inverse service"), connect(url):
        pass


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Limits(largest_force=0.0), "largest_force"),
        (lambda: Limits(rate=0.0), "rate"),
        (lambda: Coupled(K=-1.0), "coupling.K"),
        (lambda: Coupled(plane="yz"), "coupling.plane"),
        (lambda: Coupled(K=1000.0, B=0.4).check(1e-3), "coupling.B"),
        (lambda: render(SCENE, "ws://127.0.0.1:9", coupling=Coupled(K=9e4, B=5.0)), "coupling.B"),
        (lambda: render(SCENE, "ws://127.0.0.1:9", 0.0), "duration"),
    ],
)
def test_bad_limits_are_refused(make, field):
    with pytest.raises(ParameterError) as error:
        make()
    assert error.value.field == field


def test_the_damper_of_the_coupling_makes_up_for_the_hold_of_slow_motions():
    """A sine through K x and B v, both held for Ts, with B = K Ts/2, by a fine quadrature.

    In closed form the damping is B sin(w)/w - K Ts (1 - cos(w))/w^2, w = omega Ts: none to slow
    motions, negative to fast ones, so that the rule is not passivity.
    """
    K, Ts = 800.0, 0.004
    B = 0.5 * K * Ts
    for w, share in ((0.05, 0.0), (0.3, 0.0), (1.0, -0.04), (2.0, -0.13)):
        t = np.linspace(0.0, 2.0 * math.pi * 40 / (w / Ts), 400_001)
        at = Ts * np.floor(t / Ts)
        v = w / Ts * np.cos(w / Ts * t)
        held = K * np.sin(w / Ts * at) + B * w / Ts * np.cos(w / Ts * at)
        damping = np.trapezoid(held * v, t) / np.trapezoid(v * v, t)
        exact = B * math.sin(w) / w - K * Ts * (1.0 - math.cos(w)) / w**2
        # 40 periods are no whole number of samples: a share of a sample in 40 periods
        assert damping == pytest.approx(exact, abs=2e-2 * K * Ts)
        assert exact / (K * Ts) == pytest.approx(share, abs=6e-3)
    Coupled(K=K, B=0.5 * K * Ts).check(Ts)
    assert Coupled(K=K, B=1.0).at(Ts) == Coupled(K=500.0, B=1.0)


# ---- the clay at the hand of the device ----------------------------------------------------------


SLOW = 0.01  # [s] between two samples of the device
PATIENT = Limits(period=SLOW, largest_force=10.0, ramp=0.2, patience=1.0)  # of a busy computer


@pytest.fixture(scope="module")
def rendered():
    """The clay of a cut, at the hand of a simulated device that follows a line."""
    hand = Trajectory((0.0, 2.0), ((0.0, 0.0), (0.14, 0.0)))
    scene = hc.Scenario(operator=hc.Operator(0.25, 2.0, 300.0), force=(0.0, 0.0))
    with serve(scene, period=SLOW, hand=hand) as server:
        return render(hc.constant_cut(b=30.0), server.url, 2.0, limits=PATIENT), server.exchanges[0]


def test_the_force_of_the_coupling_reaches_the_device(rendered):
    """What the device gets is minus what pulls the simulated handle: K (xd - p) + B (vd - v).

    The force of a message follows from the answer before it, of row k. Place and velocity of the
    record are those of the sample, those of the law half a step older: 1e-3 of the force.
    """
    found, exchanges = rendered
    log = found.log.rows
    sent = np.array([row.force for row in log])[:, :2]
    assert np.array_equal(sent, exchanges.asked[: len(sent), :2])  # nothing was limited, or lost
    k = np.arange(100, len(log) - 1)  # behind the ramp
    begin = log[SETTLING]
    t = np.array([log[i].t for i in k]) - begin.t
    p = np.column_stack([np.interp(t, found.record.t, found.record.p[:, i]) for i in (0, 1)])
    v = np.column_stack([np.interp(t, found.record.t, found.record.v[:, i]) for i in (0, 1)])
    place = np.array([log[i].position for i in k]) - begin.position
    rate = np.array([log[i].velocity for i in k])
    expected = -(300.0 * (place[:, :2] - p) + 5.0 * (rate[:, :2] - v))
    assert np.abs(sent).max() > 1.0
    assert np.abs(sent[k + 1] - expected).max() < 0.01 * np.abs(sent).max()


def test_the_law_of_the_clay_is_found_from_the_record(rendered, tmp_path, capsys):
    """`hapticclay fit` reads the record of a session with a device."""
    found, _ = rendered
    found.record.save(tmp_path / "record")
    words = ["fit", str(tmp_path / "record"), "--axis", "x", "--out", str(tmp_path / "fit")]
    assert main([*words, "--place", "0.07", "0.12"]) == 0
    result = json.loads((tmp_path / "fit" / "fit.json").read_text())
    (b,) = [p["value"] for p in result["parameters"] if p["name"] == "b"]
    assert b == pytest.approx(30.0, rel=1e-3)
    assert "viscous" in capsys.readouterr().out


def test_the_notes_have_rate_latency_and_jitter(rendered):
    found, _ = rendered
    notes = found.record.notes["device"]
    assert notes["device_id"] == "04EA" and notes["missed"] == 0
    assert notes["rate_hz"] > 0.0 and notes["latency_p50_p99_s"][0] > 0.0
    assert found.timing.jitter >= 0.0


def test_a_hand_is_identified_from_what_a_device_exchanged(tmp_path):
    """Steps of force at random: arm and hand as one block, against mobility and hand.

    At this pose x and y do not couple. The gain is off by the change of pose, some 1e-3 at 4 mm.
    """
    hand = hc.Operator(0.25, 8.0, 150.0)
    scene = hc.Scenario(operator=hand, force=(0.0, 0.0), origin=NOMINAL, length=None)
    rng = np.random.default_rng(2)
    # a lost sample would be a step of its own
    patient = Limits(period=PERIOD, ramp=0.0, patience=1.0)
    with serve(scene, period=PERIOD) as server, connect(server.url, patient) as client:
        for push in np.repeat(rng.choice([-0.4, 0.4], 80), 8):
            client.exchange((float(push), 0.0, 0.0))
        client.log.save(tmp_path / "device.csv")
    words = ["identify", "--csv", str(tmp_path / "device.csv"), "--what", "S", "--held"]
    words += ["--columns", "t=t_s", "input=fx_N", "output=x_m", "--band", "0.3", "15"]
    assert main([*words, "--out", str(tmp_path / "found")]) == 0
    (result,) = json.loads((tmp_path / "found" / "identify.json").read_text())["results"]
    found = {c["name"]: c["value"] for c in result["coefficients"]}
    mass = 1.0 / scene.arm.nominal_mobility[0] + hand.mass
    assert found["gain"] == pytest.approx(1.0 / mass, rel=0.01)
    assert found["damping"] == pytest.approx(hand.damper / mass, rel=0.02)
    assert found["stiffness"] == pytest.approx(hand.spring / mass, rel=0.02)


def test_columns_are_even():
    """Places on straight lines between answers, forces held: exact for such a motion."""
    log = ClientLog()
    times = [0.0, 0.01, 0.02, 0.031, 0.04, 0.05]
    for k, t in enumerate(times):
        place, force = (2.0 * t, 0.0, 0.1), (float(k), 0.0, 0.0)
        log.add(Exchanged(t - 0.002, t, t, place, (2.0, 0.0, 0.0), force))
    columns = log.columns()
    assert columns["t_s"] == pytest.approx(0.01 * np.arange(6), abs=1e-12)
    assert columns["x_m"] == pytest.approx(2.0 * columns["t_s"], abs=1e-12)
    assert columns["fx_N"].tolist() == [1.0, 2.0, 3.0, 3.0, 5.0, 5.0]
    timing = log.timing()
    assert timing.rate == pytest.approx(100.0) and timing.latency[0] == pytest.approx(0.002)
    with pytest.raises(ParameterError, match="two exchanges"):
        ClientLog().columns()
    assert math.isnan(ClientLog().timing().rate)


def test_rows_can_be_read_while_they_are_added():
    """Row k holds k alone; 60,000 rows fill 14 chunks and run over the oldest."""
    rows, failed = Rows(3, most=20_000), []

    def read():
        while rows.count < 60_000:
            table = rows.table()
            if len(table) and np.any(np.diff(table[:, 0]) != 1.0):
                failed.append(table)
            if np.any(table != table[:, :1]):
                failed.append(table)

    thread = threading.Thread(target=read)
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        thread.start()
        for k in range(60_000):
            rows.add((k, k, k))
        thread.join()
    finally:
        sys.setswitchinterval(before)
    assert not failed and rows.table()[-1, 0] == 59_999 and len(rows.table()) == 20_000
