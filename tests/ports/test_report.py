"""The loop report: walls that are known, and walls that a client renders through the server."""

import dataclasses
import json
import math

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.ports import Exchanges, LoopReport, loop_report
from hapticclay.ports.device import SimulatedDevice
from hapticclay.ports.report import fit_wall
from hapticclay.ports.service import REST, Service
from hapticclay.theory.client_loop import Handle, rendered_stiffness_limit
from hapticclay.views.loop_plots import loop_plot
from tests.hunt import HUNTS, some
from tests.ports.conftest import tick

SCENE = hc.Scenario(operator=hc.Operator(0.25, 2.0, 60.0), force=(0.0, 0.0), length=None)
PERIOD = 0.005


def swinging(K, B, back, normal=(0.6, 0.8), n=120, noise=0.0):
    """Exchanges of a client whose wall, and whose state, are known."""
    rng = np.random.default_rng(1)
    t = PERIOD * np.arange(n)
    way = np.array(normal)
    depth = 2e-3 * np.sin(40.0 * t) + 1e-3 * np.sin(93.0 * t)
    speed = 80e-3 * np.cos(40.0 * t) + 93e-3 * np.cos(93.0 * t)
    across = np.outer(3e-3 * np.cos(11.0 * t), [-way[1], way[0]])
    force = np.zeros(n)
    force[back:] = -(K * depth + B * speed)[:-back]
    force = np.where(force > 0.0, force, 0.0)  # it pushes, and does not pull
    force[force > 0.0] += noise * rng.standard_normal((force > 0.0).sum())
    plane = np.outer(force, way)
    return Exchanges(
        0.1 + 1.01 * t,
        t,
        t + PERIOD - 3e-4,
        np.outer(depth, way) + across,
        np.outer(speed, way),
        np.column_stack([plane, np.zeros(n)]),
        plane,
    )


WALLS = [  # each delay and each damping, in a hunt each two
    (back, B)
    for i, back in enumerate((1, 2, 3, 4, 6, 11))
    for j, B in enumerate((0.0, 6.0))
    if HUNTS or (i + j) % 2 == 0
]


@pytest.mark.parametrize("back, B", WALLS)
def test_a_known_wall_is_found(back, B):
    r = loop_report(swinging(640.0, B, back), SCENE)
    assert pytest.approx(640.0, rel=1e-9) == r.K
    assert pytest.approx(B, abs=1e-6) == r.B
    # the state was measured 0.3 ms before it was answered
    assert r.delay == pytest.approx((back - 1) * PERIOD + 3e-4, abs=1e-9)
    assert r.rate == pytest.approx(1.0 / (1.01 * PERIOD), rel=1e-6)
    assert r.normal == pytest.approx((0.6, 0.8), abs=1e-9)
    assert r.explained == pytest.approx(1.0, abs=1e-9)


def test_a_delay_beyond_those_tried_is_said_to_be_longer():
    """Of 120 messages the search goes back over 30; a wall that is 35 late is not told exactly."""
    r = loop_report(swinging(640.0, 6.0, 35), SCENE)
    assert r.verdict == "not told" or r.longest_delay == math.inf, r
    n = 400  # a spring alone, of a swing so slow that many ages explain it
    t = PERIOD * np.arange(n)
    e = swinging(640.0, 0.0, 4, n=n)
    depth, speed = 2e-3 * np.sin(2.0 * t), 4e-3 * np.cos(2.0 * t)
    rng = np.random.default_rng(2)
    force = np.where(t < 4 * PERIOD, 0.0, -640.0 * np.roll(depth, 4))
    plane = np.outer(force + 0.01 * rng.standard_normal(n), (0.6, 0.8))
    e = dataclasses.replace(
        e,
        position=np.outer(depth, (0.6, 0.8)),
        velocity=np.outer(speed, (0.6, 0.8)),
        asked=np.column_stack([plane, np.zeros(n)]),
        applied=plane,
    )
    slow = loop_report(e, SCENE)
    assert slow.delay < 3 * PERIOD + 3e-4 + 1e-9 < slow.longest_delay
    assert "samples late" in slow.headline()
    assert "or more" in slow.headline() or "do not tell which" in slow.headline()


@pytest.mark.parametrize("back", [1, 4, 9])
def test_the_delay_of_noisy_forces_is_found(back):
    """Noise of 0.05 N beside forces of 2 N; ages differ by 5 ms of a swing at 15 Hz, or 0.5 N."""
    r = loop_report(swinging(640.0, 4.0, back, n=400, noise=0.05), SCENE)
    assert r.delay == pytest.approx((back - 1) * PERIOD + 3e-4, abs=1e-9) == r.longest_delay
    assert pytest.approx(640.0, rel=0.02) == r.K


def test_the_rate_needed_is_the_lowest_one():
    """A wall that holds is told how slow its program may be, and that one is at the border."""
    r = loop_report(swinging(60.0, 0.0, 1), SCENE)
    assert r.verdict == "holds" and 0.0 < r.rate_needed < 1.0 / r.period
    handle = Handle.of(SCENE, normal=r.normal)
    at = 1.0 / r.rate_needed
    # the pose is that of the mean place, within 3 mm of the start: (p/l1)^2, 2e-4
    assert rendered_stiffness_limit(handle, 0.0, at, r.age * at) == pytest.approx(r.K, rel=0.01)
    assert "would do" in r.headline()
    soft = loop_report(swinging(5.0, 0.0, 1), SCENE)
    assert soft.rate_needed == 0.0 and "at any rate" in soft.headline()


@pytest.mark.parametrize(
    ("moved", "words"), [(0.3, ("skipped control samples", "--clock tick")), (1.0, ("faster",))]
)
def test_messages_without_simulated_time_between_them_are_explained(moved, words):
    """Three of four messages find the arm where it was: late computer, or hasty program."""
    e = swinging(640.0, 0.0, 1, n=400)
    began = 4.0 * PERIOD * np.floor(np.arange(400) / 4.0)
    r = loop_report(
        dataclasses.replace(
            e, began=moved * began, sampled=moved * began, received=PERIOD * np.arange(400.0)
        ),
        SCENE,
    )
    assert r.verdict == "not told" and r.period == 0.0
    assert all(x in r.headline() for x in words) and "200 Hz" in r.headline()


def test_a_report_prints_as_a_line():
    r = loop_report(swinging(640.0, 4.0, 2), SCENE)
    text = str(r)
    assert text.startswith("<LoopReport: rendered 640 N/m") and "\n" not in text
    assert len(text) < 250 and "limit for this hand" in text


def test_the_standard_error_holds():
    """Noise of 0.05 N: of 3 standard errors, one K in 370 lies outside."""
    fit, note = fit_wall(swinging(640.0, 4.0, 1, noise=0.05))
    assert fit is not None and not note
    assert 0.0 < fit.K_error < 20.0 and abs(fit.K - 640.0) < 3.0 * fit.K_error


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (lambda e: dataclasses.replace(e, asked=0.0 * e.asked), "0 messages had a force"),
        (lambda e: dataclasses.replace(e, asked=np.ones_like(e.asked)), "explain 0%"),
        (lambda e: dataclasses.replace(e, asked=-e.asked), "do not determine it"),
    ],
)
def test_what_is_no_wall_is_not_told(change, note):
    r = loop_report(change(swinging(640.0, 0.0, 1)), SCENE)
    assert math.isnan(r.K) and r.verdict == "not told" and note in r.note
    assert r.note in r.headline()


def test_a_report_without_a_wall_has_a_figure_too(tmp_path):
    r = loop_report(dataclasses.replace(e := swinging(640.0, 0.0, 1), asked=0.0 * e.asked), SCENE)
    (axes,) = loop_plot(r).axes
    assert "0 messages had a force" in axes.get_title(loc="left") + axes.get_title()


def test_age_and_z_width():
    """The line of limits at its ends: the limit without damping, and nothing at the largest B."""
    r = loop_report(swinging(640.0, 4.0, 2), SCENE)
    assert r.age == pytest.approx(r.delay / PERIOD)
    handle = Handle.of(SCENE, normal=r.normal)
    K, B, most = r.z_width
    assert rendered_stiffness_limit(handle, B, PERIOD, r.delay) == pytest.approx(K, rel=1e-2)
    assert K > r.limit > r.line_K[0] > 0.0 and r.line_K[-1] == 0.0 and 0.0 < B < most
    assert rendered_stiffness_limit(handle, 1.2 * most, PERIOD, r.delay) == 0.0


def test_too_few_messages_are_refused():
    with pytest.raises(ParameterError, match="two messages"):
        loop_report(Exchanges.of_table(np.zeros((1, 12))), SCENE)


def test_it_is_saved_and_loaded(tmp_path):
    r = loop_report(swinging(640.0, 4.0, 1), SCENE)
    assert LoopReport.load(r.save(tmp_path / "loop.json")) == r
    data = swinging(640.0, 4.0, 2)
    again = Exchanges.load(data.save(tmp_path / "exchanges.csv"))
    assert np.array_equal(again.table(), data.table())
    (tmp_path / "exchanges.csv").write_text("x,y\n1,2\n")
    with pytest.raises(ParameterError, match="other columns"):
        Exchanges.load(tmp_path)


# ---- through the server --------------------------------------------------------------------------


def render(scene, K, normal, late, messages=300):
    """A client that renders a wall of both sides; its exchanges, and the growth of its swing."""
    device = SimulatedDevice(scene, period=PERIOD)
    service = Service(device, clock="tick")
    number, _ = service.connect()
    depths, forces = [], [0.0] * (late + 1)
    for _ in range(messages):
        f = forces[-1 - late]
        (answer,) = service.answer(number, tick(f * normal[0], f * normal[1]))
        state = json.loads(answer)
        place = state["inverse3"][0]["state"]["cursor_position"]
        depth = normal[0] * (place["x"] - REST[0]) + normal[1] * (place["y"] - REST[1])
        depths.append(depth)
        forces.append(-K * depth)
    return service.logs[0].exchanges(), growth(np.array(depths[messages // 10 :]))


def growth(x):
    """Largest growth of a swing's modes in a sample, by a matrix pencil: |z| of sum c z^k.

    T. K. Sarkar, O. Pereira, IEEE Antennas Propag. Mag. 37 (1995) 48. The handle has two modes,
    each a pair z; forces on their way fall within a few samples.
    """
    half = len(x) // 2
    hankel = np.array([x[i : i + half] for i in range(len(x) - half)])
    _, _, modes = np.linalg.svd(hankel, full_matrices=False)
    kept = modes[:4].T
    z = np.linalg.eigvals(np.linalg.pinv(kept[:-1]) @ kept[1:])
    return float(np.abs(z).max())


COARSE = PERIOD / 4  # [s] control sample and step of these devices, so that a run takes 0.1 s


def set_up(seed):
    """A device, a hand, a direction and a delay at random, and the limit of their loop."""
    rng = np.random.default_rng(seed)
    mass, damper, spring = rng.uniform((0.1, 1.0, 20.0), (0.8, 12.0, 200.0)).tolist()
    size, weight = rng.uniform(0.7, 1.3, 2).tolist()
    arm = SCENE.arm
    arm = dataclasses.replace(
        arm, l1=size * arm.l1, l2=size * arm.l2, I1=weight * arm.I1, I2=weight * arm.I2
    )
    turn = rng.uniform(0.0, math.pi)
    normal, late = (math.cos(turn), math.sin(turn)), int(rng.integers(0, 3))
    scene = dataclasses.replace(
        SCENE,
        arm=arm,
        origin=(size * SCENE.origin[0], size * SCENE.origin[1]),
        operator=hc.Operator(mass, damper, spring),
        velocity=(2e-4 * normal[0], 2e-4 * normal[1]),
        control="sampled",
        Ts=COARSE,
        dt=COARSE,
    )
    # a measurement is answered a control sample after it was made
    delay = late * PERIOD + COARSE
    return (
        scene,
        normal,
        late,
        rendered_stiffness_limit(Handle.of(scene, normal=normal), 0.0, PERIOD, delay),
    )


@pytest.mark.parametrize("seed", some(range(20), 5))  # every delay occurs
def test_a_wall_at_200_Hz_holds_below_the_limit_and_buzzes_above(seed):
    """Within 5 % of the limit of the linear loop; a swing of 10 um hardly turns the arm."""
    scene, normal, late, limit = set_up(seed)
    held, below = render(scene, 0.95 * limit, normal, late)
    buzzed, above = render(scene, 1.05 * limit, normal, late)
    assert below < 1.0 < above
    report, other = loop_report(held, scene), loop_report(buzzed, scene)
    assert report.K == pytest.approx(0.95 * limit, rel=2e-3)
    assert report.limit == pytest.approx(limit, rel=0.01)
    assert report.verdict == "holds" and other.verdict == "buzzes"
    assert "it buzzes" in other.headline()
