"""The client: what it sends a device, what it does without one, and what its data tell."""

import json
import math
import threading
from contextlib import contextmanager

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve as listen

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.errors import ParameterError
from hapticclay.model.constants import NOMINAL
from hapticclay.ports import Coupled, Limits, Trajectory, connect, render, serve
from hapticclay.ports.client import MOST_MISSED, allowed
from hapticclay.ports.client_log import ClientLog, Exchanged
from hapticclay.ports.coupled import SETTLING, DeviceHand
from hapticclay.ports.inverse import Cursor, Frame, frame_text
from hapticclay.ports.service import REST
from tests.ports.conftest import SCENE

PERIOD = 0.005
BY_MESSAGE = Limits(period=PERIOD, ramp=0.0)


@contextmanager
def device(answer):
    """A device that answers the k-th message with answer(k, force): a text, or None for none."""
    sent, threads = [], []

    def talk(socket):
        socket.send(frame_text(Frame("04EA", Cursor(REST), full=True)))
        for data in socket:
            force = json.loads(data)["inverse3"][0]["commands"]["set_cursor_force"]["values"]
            sent.append((force["x"], force["y"], force["z"]))
            text = answer(len(sent), sent[-1])
            if text is not None:
                socket.send(text)

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


def test_a_force_is_shortened_and_grows():
    assert allowed((3.0, 4.0, 0.0), 1.0, 1.0) == pytest.approx((0.6, 0.8, 0.0), rel=1e-15)
    assert allowed((3.0, 4.0, 0.0), 10.0, 0.25) == (0.75, 1.0, 0.0)
    for bad in (math.nan, math.inf):
        assert allowed((bad, 0.0, 0.0), 10.0, 1.0) == (0.0, 0.0, 0.0)


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
    limits = Limits(period=0.01, ramp=0.1, largest_force=2.0)
    with device(lambda k, f: STILL) as (url, sent), connect(url, limits) as client:
        for _ in range(15):
            client.exchange((8.0, 0.0, 0.0))
    expected = [min(1.0, 0.1 * k) * 2.0 for k in range(15)]
    assert [f[0] for f in sent[:15]] == pytest.approx(expected, abs=1e-12)
    assert sent[15] == (0.0, 0.0, 0.0)  # at the end


def test_the_force_of_a_hand_grows_once_its_period_is_known():
    """K times 10 mm, in even steps from nothing, however long the period was measured."""
    limits = Limits(period=0.01, ramp=0.1)
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
        if answer is None:  # it comes after all, and must not shift those behind it
            client._waiting -= 1
        for _ in range(8):
            client.exchange((1.0, 0.0, 0.0))
    assert sent[5][0] > 0.9 and sent[6] == (0.0, 0.0, 0.0)
    assert [f[0] for f in sent[7:13]] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], abs=1e-9)


def test_an_answer_that_comes_late_shifts_nothing():
    """Both answers are read before the next exchange: none is one behind for ever."""
    places = {k: frame_text(Frame("04EA", Cursor((float(k), 0.0, 0.0)))) for k in range(1, 9)}
    held = []

    def answer(k, force):
        if k == 3:
            return held.append(places[3])
        return places[k]

    limits = Limits(period=0.01, patience=0.03)
    with device(answer) as (url, _), connect(url, limits) as client:
        seen = [client.exchange() for _ in range(3)]
        assert seen[2] is None
        client._waiting -= 1  # that answer never comes
        assert client.exchange().position[0] == 4.0


def test_a_device_that_is_gone_is_an_outcome():
    with serve(SCENE, clock="wall") as server, connect(server.url) as client:
        assert client.exchange() is not None
        server.close()
        found = [client.exchange((1.0, 0.0, 0.0)) for _ in range(3)]
        assert found == [None] * 3 and client.lost


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
    with serve(scene, period=PERIOD) as server, connect(server.url, BY_MESSAGE) as client:
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
