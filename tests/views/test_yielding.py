"""What is seen of clay that yields: its force over the velocity, and when it holds the handle."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import hapticclay as hc
from hapticclay.cli.run import run_table
from hapticclay.live.clock import FRAME_TIME
from hapticclay.live.frame import Frame
from hapticclay.live.replay import Replay
from hapticclay.live.session import Session
from hapticclay.live.status import held_words
from hapticclay.theory import linear_loop
from hapticclay.views import (
    captions,
    flow_plots,
    palette,
    path_plots,
    run_figures,
    run_plots,
    running_plots,
)
from hapticclay.views.stage import Stage
from hapticclay.views.viewer import _law_point
from hapticclay.views.window import Window

FREE = (0.0, 0.0)
LAYERS = hc.Profile(
    (0.05, 0.1, 0.15),
    (0.0, 20.0, 0.0, 0.0),
    Fy=(0.0, 1.0, 3.0, 0.0),
    K=(0.0, 0.0, 4.0, 0.0),
    n=(1.0, 1.0, 0.4, 1.0),
)


def cut(flow, force, isotropic=False, **more):
    clay = dataclasses.replace(hc.slab(flow, 0.05, 0.15), isotropic=isotropic)
    return dataclasses.replace(hc.constant_cut(**more), clay=clay, force=force)


@pytest.fixture(scope="module")
def held():
    """Held in the clay by less than its yield force, after some stick and slip."""
    return hc.simulate(cut(hc.Flow(Fy=2.0, b=40.0), (1.0, 0.0), t_max=3.0))


@pytest.fixture(scope="module")
def layers():
    clay = hc.Clay(LAYERS, LAYERS)
    return hc.simulate(dataclasses.replace(hc.constant_cut(), clay=clay, force=(5.0, 0.0)))


def found(ax, label):
    return [line for line in ax.lines if line.get_label() == label]


def test_force_over_velocity_shows_measured_held_and_law(held):
    figure = run_figures.figures(held)["force_velocity"]
    ax = figure.axes[0]
    assert "v$_x$" in ax.get_xlabel() and "[m/s]" in ax.get_xlabel() and "[N]" in ax.get_ylabel()
    dots = [x for x in ax.lines if x.get_marker() == "." and len(x.get_xdata())]
    inside = (held.p[:, 0] >= 0.05) & ~held.held()[:, 0]
    np.testing.assert_array_equal(dots[0].get_xdata(), held.v[inside, 0])
    np.testing.assert_array_equal(dots[0].get_ydata(), held.fe[inside, 0])
    ticks = [x for x in ax.lines if x.get_marker() == "_" and len(x.get_xdata())]
    assert not np.any(ticks[0].get_xdata()) and np.abs(ticks[0].get_ydata()).max() <= 2.0
    (law,) = found(ax, "law of the clay")
    v, f = law.get_data()
    moving = v != 0.0
    assert moving.sum() > 100
    np.testing.assert_allclose(f[moving], 2.0 * np.sign(v[moving]) + 40.0 * v[moving], rtol=1e-14)
    assert f[~moving].tolist() == [-2.0, 2.0]  # the clay pushed back as well
    told = figure.legends[0].get_texts()
    assert any("F$_y$ = 2 N, b = 40 N·s/m" in x.get_text() for x in told)


def test_measured_forces_lie_on_the_laws_of_their_regions(layers):
    """Away from borders, to the coupling of the axes where one of them stops within a kick."""
    met = flow_plots.flows_met(layers, 0)
    assert set(met) == {hc.Flow(1.0, 0.0, 1.0, 20.0), hc.Flow(3.0, 4.0, 0.4, 0.0)}
    for flow, where in met.items():
        some = where[5:-5]
        some = some[~layers.held()[some, 0]]
        np.testing.assert_allclose(layers.fe[some, 0], flow.force(layers.v[some, 0]), rtol=1e-4)
        away = np.abs(layers.fe[some, 0] - flow.force(layers.v[some, 0]))
        assert np.median(away) < 1e-12  # [N], rounding of a few sums
    figure = flow_plots.force_velocity_plot(layers)
    laws = [x for x in figure.axes[0].lines if x.get_linestyle() == "--"]
    assert len(laws) == 2
    dots = [x for x in figure.axes[0].lines if x.get_marker() == "." and len(x.get_xdata())]
    assert len({x.get_color() for x in dots}) == 2


def test_clay_that_resists_along_the_motion_has_one_panel():
    run = hc.simulate(cut(hc.Flow(0.4, 2.0, 0.3, 10.0), (1.0, 0.2), isotropic=True, t_max=4.0))
    (ax,) = flow_plots.force_velocity_plot(run).axes
    assert "along the motion" in ax.get_xlabel()
    (dots,) = [x for x in ax.lines if x.get_marker() == "." and len(x.get_xdata())]
    v, f = dots.get_data()
    expected = np.sign(v) * (0.4 + 2.0 * np.abs(v) ** 0.3) + 10.0 * v
    # of the force of a kick; at a border the kick has two clays
    np.testing.assert_allclose(f[3:], expected[3:], rtol=1e-6)


def test_b_that_is_not_one_number_is_left_out_of_forces_and_laws():
    growing = dataclasses.replace(LAYERS, growth=(0.0, 30.0, 0.0, 0.0))
    clay = hc.Clay(growing, growing)
    s = dataclasses.replace(hc.constant_cut(t_max=1.0), clay=clay, force=(5.0, 0.0))
    figure = flow_plots.force_velocity_plot(hc.simulate(s))
    assert "less b v" in figure.axes[0].get_ylabel()
    assert not any("b =" in x.get_text() for x in figure.legends[0].get_texts())


def test_held_time_is_shaded_and_marked(held):
    assert len(held.stops) > 3 and held.stops[-1].end is None
    (ax,) = run_figures.figures(held)["force"].axes
    (bars,) = [c for c in ax.collections if c.get_label() == "held still"]
    spans = sorted((p.vertices[:, 0].min(), p.vertices[:, 0].max()) for p in bars.get_paths())
    stops = [x for x in held.stops if x.axis == "x"]
    ends = [held.t[-1] if x.end is None else x.end for x in stops]
    np.testing.assert_allclose(spans, list(zip([x.start for x in stops], ends, strict=True)))
    (marks,) = found(run_plots.velocity_plot(held).axes[0], "held still")
    assert not np.any(marks.get_ydata()) and len(marks.get_ydata()) == held.held()[:, 0].sum()


def test_held_samples_have_no_velocity_and_lie_within_the_stops(held):
    mask = held.held()
    assert mask.any() and not held.v[mask].any()
    first = held.stops[1]
    assert first.axis == "x"
    during = (held.t >= first.start) & (held.t < first.end)
    assert mask[during, 0].all() and during.sum() > 50


@pytest.mark.parametrize("f,damper,Fy,K,n", [
    ((1.0,), (50.0,), 0.5, 0.0, 1.0), ((-3.0,), (50.0,), 0.5, 2.0, 0.3),
    ((4.0,), (10.0,), 0.0, 5.0, 1.7), ((1.0, 0.4), (20.0, 40.0), 0.5, 2.0, 0.4),
    ((3.0, -2.0), (0.0, 30.0), 0.2, 1.0, 2.5),
])  # fmt: skip
def test_steady_velocity_is_where_the_forces_balance(f, damper, Fy, K, n):
    """Against SciPy's root finders, to their tolerance."""

    def rest(v):
        m = np.hypot.reduce(np.atleast_1d(v))
        return np.asarray(f) - np.asarray(damper) * v - (Fy + K * m**n) * np.asarray(v) / m

    v = linear_loop.steady_velocity(f, damper, Fy, K, n)
    if len(f) == 1:
        sign = math.copysign(1.0, f[0])
        assert v[0] == pytest.approx(sign * brentq(lambda m: sign * rest(sign * m)[0], 1e-12, 1e3))
    else:
        np.testing.assert_allclose(v, fsolve(rest, 0.5 * v + 1e-6, xtol=1e-13), rtol=1e-9)


def test_steady_velocity_is_none_below_the_yield_force_and_endless_where_nothing_else_resists():
    steady = linear_loop.steady_velocity
    assert steady((0.6, 0.8), (1.0, 1.0), 1.0, 0.0, 1.0).tolist() == [0.0, 0.0]
    assert steady((2.0,), (0.0,), 1.0, 0.0, 1.0).tolist() == [math.inf]
    assert steady((2.0,), (math.inf,), 1.0, 0.0, 1.0).tolist() == [0.0]


@pytest.mark.parametrize("flow,force,isotropic", [
    (hc.Flow(Fy=0.5, b=40.0), (1.0, 0.0), True),
    (hc.Flow(Fy=4.8, b=40.0), (6.0, 0.0), False),
    (hc.Flow(0.4, 2.0, 0.3, 10.0), (1.0, 0.2), True),
])  # fmt: skip
def test_expected_speed_is_that_of_the_run(flow, force, isotropic):
    """To 1e-3: away from the nominal pose the servo follows the compensator less exactly."""
    run = hc.simulate(cut(flow, force, isotropic))
    before, within, after = run.regions()
    for name, i in (("x", 0), ("y", 1)):
        assert before[name]["expected_speed"] == after[name]["expected_speed"]
        assert before[name]["expected_speed"] == pytest.approx(
            hc.Scenario().gain[i] * force[i] / 10
        )
    at = within["x"]
    assert at["steady_speed"] == pytest.approx(at["expected_speed"], rel=1e-3)
    assert (at["Fy"], at["K"], at["n"], at["b"]) == (flow.Fy, flow.K, flow.n, flow.b)
    lines = [x for x in run_plots.velocity_plot(run).axes[0].lines if x.get_linestyle() == "--"]
    drawn = [x.get_ydata()[0] for x in lines]
    assert drawn == [r["x"]["expected_speed"] for r in (before, within, after)]
    assert not any("K f/(10 + K b)" in str(x.get_label()) for x in lines)


def test_film_and_window_show_isotropic_clay_on_its_law():
    """Along the motion, and nothing of free air, from which no line leads into the clay."""
    scenario = dataclasses.replace(
        hc.constant_cut(t_max=1.5), clay=hc.slab(hc.materials.material("stiff clay"), 0.05, 0.15)
    )
    run = hc.simulate(scenario)
    figure, curves = running_plots.running_figure(run, 480, 720)
    ax = figure.axes[1]
    (x, y) = next((x, y) for at, x, y, _ in curves if at is ax)
    inside = (run.p[:, 0] > 0.05) & ~run.held()[:, 0]
    np.testing.assert_array_equal(np.isfinite(x), run.p[:, 0] >= 0.05)
    flow = hc.materials.material("stiff clay")
    # but for the kick that begins in free air, and the one in which it stops
    np.testing.assert_allclose(y[inside][1:-1], flow.force(x[inside])[1:-1], rtol=1e-6)
    assert "along the motion" in ax.get_xlabel()

    def frame(p, v, fe):
        return Frame(0.0, p, v, fe, FREE)

    along, each = (hc.Clay(LAYERS, LAYERS, isotropic=x) for x in (True, False))
    points = [
        _law_point(frame((0.0, 0.0), (0.1, 0.1), FREE), 0, along),
        _law_point(frame((0.06, 0.0), (-0.03, 0.04), (-3.0, 4.0)), 0, along),
        _law_point(frame((0.06, 0.0), (-0.03, 0.04), (-3.0, 4.0)), 1, each),
    ]
    np.testing.assert_allclose(points, [(np.nan, np.nan), (-5.0, -5.0), (4.0, 4.0)])


def test_table_advises_physical_clay_where_motors_would_have_to_hold_the_handle():
    clay = hc.slab(hc.materials.material("soft clay"), 0.05, 0.15)
    s = dataclasses.replace(
        hc.constant_cut(start=(0.045, 0.0), t_max=0.4), clay=clay, control="sampled"
    )
    assert "advice: --render physical" in run_table(hc.simulate(s))
    for other in (
        dataclasses.replace(s, render="physical"),
        dataclasses.replace(s, clay=hc.slab(hc.Flow(Fy=0.5, b=40.0), 0.05, 0.15)),
    ):
        assert "advice" not in run_table(hc.simulate(other))


def test_table_of_a_run_names_the_law_and_the_stops(held):
    told = run_table(held)
    assert "Fy" in told and "held still from" in told and "to the end" in told
    assert "fe/v" not in told
    assert "fe/v" in run_table(hc.simulate(hc.constant_cut(t_max=0.1)))


def test_title_and_map_name_the_flow(layers):
    figure = run_plots.velocity_plot(layers)
    said = " ".join(figure.axes[0].get_title(loc="left").split())
    for part in ("F$_y$ = 1, 3 N", "K$_c$ = 4 N/(m/s)ⁿ", "n = 0.4", "b = 20 N"):
        assert part in said
    texts = [t.get_text() for t in path_plots.path_plot(layers).axes[0].texts]
    assert texts == [
        "F$_y$ = 1 N\nb = 20 N·s/m",
        "F$_y$ = 3 N\nK$_c$ = 4 N/(m/s)ⁿ\nn = 0.4",
    ]
    only = dataclasses.replace(hc.constant_cut(), clay=hc.slab(hc.Flow(Fy=3.0), 0.05, 0.15))
    assert not any(x.startswith("b =") for x in captions.scenario_parts(only))


def test_clay_is_shaded_by_what_it_takes_to_cut_it(layers):
    """By b where no clay yields; else by the force at 1 cm/s."""
    viscous = hc.variable_cut().clay
    x = np.linspace(0.0, 0.2, 41)
    share = palette.clay_share(viscous, x, 0.03)
    np.testing.assert_array_equal(share, viscous.at(x, 0.03).max(axis=0) / viscous.largest)
    clay = hc.Clay(LAYERS, LAYERS)
    soft, hard = 1.0 + 20.0 * 0.01, 3.0 + 4.0 * 0.01**0.4
    got = palette.clay_share(clay, np.array([0.0, 0.07, 0.12, 0.2]), 0.0)
    np.testing.assert_allclose(got, [0.0, soft / hard, 1.0, 0.0], rtol=1e-15)
    patches = run_plots.velocity_plot(layers).axes[0].patches
    shown = [p for p in patches if p.get_label() in ("clay", "_")]
    assert [round(p.get_x(), 9) for p in shown] == [5.0, 10.0]


def test_picture_of_clay_that_only_yields_is_as_dark_as_it_is_hard():
    only = dataclasses.replace(LAYERS, values=(0.0,) * 4)
    stage = Stage(dataclasses.replace(hc.constant_cut(), clay=hc.Clay(only, only)))
    colors = stage._colors()
    left, right = colors[:, : colors.shape[1] // 2 - 1], colors[:, colors.shape[1] // 2 + 1 :]
    assert right.mean() < left.mean() - 20.0  # bytes; the grain has an rms of 6


def test_arrow_is_the_force_of_the_clay_on_the_handle():
    stage = Stage(cut(hc.Flow(Fy=5.0), (1.0, 0.0)))
    stage.pose((1.5, -1.5))
    stage.push((3.0, -4.0), True)
    begin, end, still = stage.arrow
    assert still and stage.arrow.color == palette.SKY_BLUE
    np.testing.assert_allclose((end - begin) / 0.08, (-0.6, 0.8, 0.0), atol=1e-12)
    stage.push((1.0, 0.0), False)
    assert stage.arrow.color == palette.BLUE
    stage.push((1e6, 0.0), False)  # at a border: no arrow across the room
    assert np.linalg.norm(stage.arrow.end - stage.arrow.begin) == pytest.approx(0.16)
    stage.push(FREE, False)
    assert stage.arrow is None
    viscous = Stage(hc.constant_cut())
    viscous.push((3.0, 0.0), False)
    assert viscous.arrow is None


def push(session, force, seconds):
    session.push(force)
    end = session.t + seconds
    while session.t < end - 1e-9:
        session.advance(FRAME_TIME)


def test_session_holds_and_lets_go():
    scenario = cut(hc.Flow(Fy=4.0), (0.0, 0.0), start=(0.07, 0.0))
    session = Session(scenario)
    push(session, (3.0, 0.0), 0.5)
    frame = session.frames[-1]
    assert frame.held == (True, True) and frame.v == pytest.approx(FREE, abs=1e-15)
    assert frame.fe == pytest.approx((3.0, 0.0), abs=1e-6)  # it holds what pulls
    assert session.verdict().text == "stable"  # the linear loop knows no limit here
    window = Window(session)
    rows = dict(window.look([], None).writing.rows)
    assert (
        rows["state"] == "recording, held" and rows["clay"] == "Fy = 4 N here" and "b" not in rows
    )
    session.change(b=0.5)  # all of the clay's force
    assert session.scenario.clay.x.Fy == (0.0, 2.0, 0.0)
    push(session, (3.0, 0.0), 0.2)
    assert not session.frames[-1].held[0] and session.frames[-1].p[0] > 0.071
    session.change(b=0.0)
    push(session, (0.1, 0.0), 0.2)
    assert session.scenario.clay.yields and abs(session.frames[-1].fe[0]) < 1e-8
    record = session.record()
    assert record.stops[0].axis == "x" and record.stops[0].end is not None
    assert {s.axis for s in record.stops} <= {"x", "y"}  # each axis yields by itself
    replay = Replay(record)
    replay.advance(0.4)
    assert replay.frames[-1].held == (True, True) and replay.verdict().text == "stable"


def test_scaling_keeps_to_the_bounds():
    clay = hc.Clay(LAYERS, LAYERS)
    for factor in (0.0, 0.3, 1.0, 1e6):
        law = clay.scaled(factor).x
        np.testing.assert_allclose(law.values, np.multiply(LAYERS.values, factor))
        np.testing.assert_allclose(
            law.Fy, np.clip(np.multiply(LAYERS.Fy, factor), 0, 1e6), atol=1e-9
        )
        assert law.n == LAYERS.n
    block = hc.Clay.of_groove(BLOCK).scaled(0.0)
    assert block.groove is not None
    assert 0.0 < block.groove.hardest < 1e-8  # a block that does not resist is refused


@pytest.mark.parametrize("held,words", [
    ((False, False), ""), ((True, False), "held along x"), ((True, True), "held"),
])  # fmt: skip
def test_words(held, words):
    assert held_words(held) == words


BLOCK = hc.Groove(x=(0.02, 0.08), y=(-0.02, 0.02), pressure=20e3)  # a tool of 10 x 5 mm: 1 N


def led(stops, speed=0.2):
    """The handle led from place to place by the command."""
    ways = np.hypot(*np.diff(stops, axis=0).T)
    t = np.concatenate(((0.0,), np.cumsum(ways))) / speed
    return dataclasses.replace(
        hc.free(force=FREE, t_max=float(t[-1]) + 0.1),
        gain=FREE,
        clay=hc.Clay.of_groove(BLOCK),
        length=None,
        inertia_shaping=True,
        command=hc.Samples(tuple(t), tuple(stops)),
    )


@pytest.fixture(scope="module")
def twice():
    """Along a groove, back, and half a width beside it."""
    return hc.simulate(led([(0.0, 0.0), (0.1, 0.0), (0.0, 0.0), (0.0, 0.005), (0.1, 0.005)]))


def test_ground_of_a_groove_is_drawn_with_the_path(twice):
    drawn = run_figures.figures(twice)
    assert set(drawn) == {"velocity", "force", "force_position", "ground"}
    ax = drawn["ground"].axes[0]
    (image,) = [c for c in ax.collections if c.get_array() is not None]
    np.testing.assert_array_equal(
        image.get_array().reshape(twice.ground.T.shape), 1e3 * twice.ground.T
    )
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), 100.0 * twice.p[:, 0])
    drawn["ground"].draw_without_rendering()
    low, high = ax.get_xlim()
    assert low < 0.0 and high > 10.0
    assert "permanent cut, up to 1 N" in " ".join(ax.get_title(loc="left").split())
    patches = drawn["velocity"].axes[0].patches
    assert [p.get_label() for p in patches] == ["clay"]
    assert patches[0].get_x() == pytest.approx(2.0)
    assert "K f/(10 + K b)" not in str([x.get_label() for x in drawn["velocity"].axes[0].lines])
    assert "held still" not in run_table(twice)


def test_picture_of_a_groove_is_what_the_run_has_left(twice):
    """The same heights, to a cell at the edges of the tool; a second pass removes nothing."""
    stage = Stage(twice.scenario)
    assert stage.tool == BLOCK.tool and stage.removal.volume == 0.0
    first = twice.t < 0.5
    stage.carve(twice.p[first][::20])
    once = stage.removal.volume
    assert once == pytest.approx(10e-3 * 5e-3 * 60e-3, rel=0.01)
    stage.carve(twice.p[(twice.t >= 0.5) & (twice.t < 1.0)][::20])
    assert stage.removal.volume == pytest.approx(once, rel=0.03)  # it swings by 0.1 mm
    stage.carve(twice.p[twice.t >= 1.0][::20])
    assert stage.removal.volume == pytest.approx(twice.extra["removed"][-1], rel=0.01)
    heights = stage.removal.heights(0.03)
    assert heights.max() == pytest.approx(0.03) and heights.min() == pytest.approx(0.025)
    after = Stage(
        dataclasses.replace(twice.scenario, clay=hc.Clay.of_groove(BLOCK.after(twice.ground)))
    )
    gone = after.removal.heights(0.03)
    assert np.mean(np.abs(gone - heights) > 1e-3) < 0.06  # cells of 1 mm, at the edges
    stage.restore()
    assert stage.removal.heights(0.03).min() == pytest.approx(0.03)


def test_session_cuts_a_groove_and_changes_its_pressure():
    clay = hc.Clay.of_groove(BLOCK)
    session = Session(
        dataclasses.replace(hc.constant_cut(), gain=(1.0, 0.0), clay=clay), stiffness=10.0
    )
    push(session, (0.8, 0.0), 1.5)
    frame = session.frames[-1]
    assert frame.held == (True, True) and 0.015 < frame.p[0] < 0.03
    assert frame.fe[0] == pytest.approx(0.8, abs=0.01)
    window = Window(session)
    assert dict(window.look([], None).writing.rows)["clay"] == "holds with up to 1 N here"
    session.change(b=0.5)
    assert session.scenario.clay.groove.pressure == 10e3
    push(session, (0.8, 0.0), 1.5)
    assert session.frames[-1].p[0] > 0.04
    record = session.record()
    assert record.extra["removed"][-1] > 1e-6 and record.ground.min() == 0.0
