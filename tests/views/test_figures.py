"""Every figure of the package at the width of one printed column: nothing clipped, small or over
another text; and what its files hold."""

import dataclasses
import functools
import math
import re

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import hapticclay as hc
from benchmarks import fit_coverage
from hapticclay.studies import comparison, passivity_runs
from hapticclay.studies.accuracy_ladder import Ladder, Setting
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.impedance import MeasuredImpedance, computed_impedance
from hapticclay.studies.mbk import ArmMBK, Border, DeviceMBK, arm_mbk, device_mbk
from hapticclay.studies.population import Draw, gain_band
from hapticclay.studies.robustness import Instability
from hapticclay.studies.sampling import Range
from hapticclay.studies.stability_map import MapCell, StabilityMap
from hapticclay.studies.wall_lines import Limit
from hapticclay.studies.workspace import Drift
from hapticclay.studies.yield_map import YieldCell, YieldMap
from hapticclay.studies.zwidth import BY_GROWTH, BY_REST, ZRegion, ZWidth
from hapticclay.theory.hand_boxes import Box
from hapticclay.theory.loops import Loop
from hapticclay.views import (
    accuracy_plots,
    compare_plots,
    fit_plots,
    identification_plots,
    impedance_plots,
    passivity_plots,
    path_plots,
    record_plots,
    robustness_plots,
    run_figures,
    run_plots,
    stability_map_plots,
    sweep_plots,
    theory_plots,
    wall_plots,
    workspace_plots,
)
from hapticclay.views.style import LEAST_TEXT
from tests.hunt import HUNTS, some

HAND = hc.Operator()
LOOP = Loop("x", b=90.0, K=1.0, operator=HAND)
BLOCK = hc.Groove(x=(0.02, 0.08), y=(-0.02, 0.02), pressure=20e3)


@functools.cache
def record(name):
    """A run of each kind."""
    yields = hc.slab(hc.Flow(Fy=3.0, b=30.0), 0.05, 0.15)
    across = hc.Clay.of_groove(BLOCK)
    return hc.simulate(
        {
            "constant": hc.constant_cut(t_max=4.0, dt=1e-3),
            "variable": hc.variable_cut(operator=HAND, inertia_shaping=True, t_max=3.0, dt=1e-3),
            "driven": hc.stability_test(25.0, t_max=3.0, dt=1e-3),
            "yields": hc.Scenario(clay=yields, force=(5.0, 0.0), t_max=3.0, dt=1e-3),
            "ground": hc.Scenario(clay=across, force=(5.0, 0.0), t_max=2.0, dt=1e-3),
        }[name]
    )


@functools.cache
def fitted():
    return hc.studies.fit_flow(fit_coverage.measured("Bingham", 3, fit_coverage.SENSORS["fine"]))


def stability_chart(kind):
    """A map with every mark and as many lines as there are in a map."""
    x_names = {
        "gain-damping": "damping of the clay b [N.s/m]",
        "delay-damping": "delay [s]",
        "gain-pose": "place along the path [m]",
    }
    x = np.linspace(-0.1, 0.1, 5) if kind == "gain-pose" else np.geomspace(1e-3, 1.0, 5)
    x = x * 1e3 if kind == "gain-damping" else x
    rows = [(a, y) for a in x.tolist() for y in (0.5, 2.0, 8.0)]
    names = (
        "exact, continuous time",
        "exact, sampled with its delay",
        "inequality (13), sufficient",
        "passivity (Colgate, Schenkel)",
    )
    lines = {n: (x.tolist(), [1.0 + i] * 5) for i, n in enumerate(names)}
    found = {
        "runs": (x.tolist(), [1.1] * 5),
        "runs, sampled": (x.tolist(), [1.6, math.inf, 2.0, 30.0, 1.0]),
    }
    marks = ("stable", "limit cycle", "diverges")
    cells = tuple(
        MapCell(a, y, True, marks[i % 3], "sampling" * (i % 4 == 0))
        for i, (a, y) in enumerate(rows)
    )
    loop = PushedLoop("x", b=90.0, operator=HAND, Ts=1e-3, delay=2e-3)
    y_name = "damping of the clay b [N.s/m]" if kind == "delay-damping" else "gain K [1/kg]"
    return StabilityMap(kind, loop, x_names[kind], y_name, lines, found, {}, cells)


def yield_chart():
    K = np.geomspace(1.0, 30.0, 12)
    kinds = ("sticks", "limit cycle", "grows")
    cells = tuple(
        YieldCell(Fy, k, kinds[i % 3], 0.1, 0.1, kinds[(i + j // 2) % 3], 0.02)
        for i, Fy in enumerate((0.5, 1.0, 2.0, 5.0))
        for j, k in enumerate((2.0, 5.0, 20.0))
    )
    critical, speed = (0.02 / K).tolist(), (0.01 * K).tolist()
    return YieldMap(
        PushedLoop("x", b=30.0), 1.5, 15.0, tuple(K), tuple(critical), tuple(speed), cells
    )


def ladder():
    settings = tuple(
        Setting(series, dt, 1e2 * dt**2, dt**2, 1e-5 / dt, "finished")
        for series in accuracy_plots.SERIES_LOOKS
        for dt in (1e-2, 1e-3, 1e-4, 3.6e-4)
    )
    scenario = hc.constant_cut()
    return Ladder(scenario, "native", settings, "reference", {"s": 1e-6, "m": 1e-8}, 11.13)


@functools.cache
def identified(what, axis):
    return hc.studies.identify(axis, what, periods=1, lines=6, period=2.5, band=(0.5, 20.0))


def swept():
    """A sweep with every status and every reason for no figure."""
    pa = pytest.importorskip("pyarrow")
    kinds = list(sweep_plots.OUTCOME_COLORS)
    b, K = (x.ravel() for x in np.meshgrid(np.geomspace(10, 1000, 9), np.geomspace(0.1, 10, 9)))
    status = [kinds[i % len(kinds)] for i in range(len(b))]
    speed = np.where(np.arange(len(b)) % 5, b / 1e4, np.nan)
    met = np.where(np.arange(len(b)) % 7, b, 0.0)
    return pa.table(
        {"run": np.arange(len(b)), "b": b, "gain.x": K, "status": status, "speed_x": speed,
         "b_x": met}
    )  # fmt: skip


@functools.cache
def passive(what):
    """Of a damped, late wall; the numbers by runs are made up."""
    wall = hc.VirtualWall(K=500.0, B=0.2, device=hc.Device(0.1, 1.0), delay=5e-4)
    if what == "energy":
        stiff = hc.constant_cut(control="sampled", b=8000.0, start=(0.06, 0.0), t_max=0.012)
        return passivity_runs.energy_over_time(dataclasses.replace(stiff, stop_when_unstable=False))
    if what == "index":
        omega = np.geomspace(3.0, 3000.0, 50)
        index, some = hc.walls.passivity_index(wall, omega), omega[::9]
        return passivity_runs.IndexOverFrequency(
            "wall of K = 500 N/m, B = 0.2 N.s/m", omega, index + 0.1, index, some,
            index[::9] + 0.1, some, index[::9],
        )  # fmt: skip
    Ts, delays = np.geomspace(1e-4, 1e-2, 20), (0.0, 0.5, 1.0, 2.0)
    limits = np.array([2.0 / (Ts * (1.0 + 2.0 * d)) for d in delays])
    return passivity_runs.PassiveRegion(wall, delays, Ts, limits, Ts[::6], limits[:, ::6])


def z_region(name, wall, rest=False, box=False):
    """A region with every line that a region may have; its runs are made up."""
    b, Ts = wall.device.damper, wall.Ts
    B = (0.0, *np.geomspace(0.25, 100.0, 8).tolist(), 144.0, 176.0, 194.0)
    exact = [hc.walls.stiffness_band(dataclasses.replace(wall, B=x))[1] for x in B]
    K = [1.004 * x * (0.6 if rest and x > 1e4 else 1.0) for x in exact]
    boxed = (Box((0.0, 1.0), (0.0, 5.0), (0.0, 300.0)), tuple(K), tuple(exact)) if box else ()
    passive = tuple(max(0.0, 2.0 * (b - x) / Ts) for x in B)
    limits = [
        Limit("exact, linear loop", "exact", B, tuple(exact)),
        Limit("Colgate, Schenkel 1997", "sufficient", B, passive),
        Limit("Hulin et al. 2006", "rule", B, tuple(2.0 * (b + x) / Ts for x in B)),
        Limit("Abbott, Okamura 2005", "sufficient", (0.0,), (2.0 * b / Ts,)),
        Limit("worst hand tried of the box", "exact", B, tuple(exact)),
    ]
    verdict = BY_REST if rest else BY_GROWTH
    numbers = (verdict, B, tuple(K), tuple(exact), 200.0, tuple(limits))
    return ZRegion(name, wall, *numbers, *boxed)


@functools.cache
def z_width(kind):
    """The regions of one device, of one with friction, encoder and a surface, and of a family."""
    wall = hc.VirtualWall(device=hc.Device(0.1, 0.5))
    if kind == "region":
        return ZWidth((z_region("", wall, box=True),))
    if kind == "rest":
        device = hc.Device(0.1, 0.5, friction=0.02, quantum=2e-5)
        wall = dataclasses.replace(
            wall, device=device, unilateral=True, operator=HAND, velocity_window=4
        )
        return ZWidth((z_region("", wall, rest=True, box=True),))
    dampers = (0.2, 0.5, 1.0, 2.0, 4.0, 8.0)
    walls = [dataclasses.replace(wall, device=hc.Device(0.1, b)) for b in dampers]
    named = [z_region(f"b = {w.device.damper:g} N.s/m", w) for w in walls]
    return ZWidth(tuple(named), "damper")


@functools.cache
def measured(kind):
    """Impedances of the arm, and of a wall, as if measured with an error."""
    wall = hc.VirtualWall(300.0, 2.0, 0.05, hc.Device(0.1, 0.5), HAND, delay=5e-4)
    subject = wall if kind == "wall" else PushedLoop("x", b=90.0, k=40.0, operator=HAND, Ts=1e-3)
    there = computed_impedance(subject, 2.0 * math.pi * np.geomspace(0.5, 30.0, 24))
    off = np.linspace(0.99, 1.01, 24)
    seen = dataclasses.replace(there, Z=off * there.Z, transparency=off * there.transparency)
    return MeasuredImpedance(subject, seen, there, np.zeros(24), hc.constant_cut())


@functools.cache
def parts_rendered():
    """Of a device, with runs that are made up."""
    wall = hc.VirtualWall(1000.0, 2.0, device=hc.Device(0.1, 0.5))
    found = device_mbk(wall, columns=0, points=13)
    runs = {
        plane: tuple(
            Border(float(r.x[i]), float(r.high[i]), float(r.high[i]), "high") for i in (2, 6, 10)
        )
        for plane, r in found.regions.items()
    }
    return DeviceMBK(found.wall, found.regions, runs, found.range)


@functools.cache
def least_masses():
    loop = PushedLoop(b=0.0, operator=HAND, Ts=3.6e-4)
    found = arm_mbk(loop, columns=0, points=3, samples=0)
    (M, B), runs = found.nominal, []
    runs = [Border(float(B[i]), float(M[i]), float(M[i]), "low") for i in range(3)]
    return ArmMBK(loop, found.box, found.nominal, found.worst, tuple(runs))


@functools.cache
def hands_band():
    hands = hc.studies.POPULATIONS["published range"]
    return gain_band(Loop("x"), hands, np.geomspace(1.0, 3000.0, 5).tolist(), Draw(10))


@functools.cache
def risk(kind):
    """Runs that are unstable by chance where K, and the clay's b, are large."""
    K, b = Range(1.0, 8.0, 15), Range(10.0, 1000.0, 11, log=True)
    given = {
        "map": dict(grid={"K": K, "b": b}, runs=100),
        "line": dict(grid={"K": K}, runs=100),
        "parameters": dict(vary={"K": hc.studies.Distribution("log-normal", 4.0, 1.0)}, runs=2000),
    }
    trials = hc.studies.Trials(PushedLoop("x", b=90.0, operator=None), hands="published range",
                       **given[kind])  # fmt: skip
    points = np.concatenate([trials.points(n) for n in range(trials.chunks)])
    gain = points[:, trials.names.index("K")]
    odds = np.random.default_rng(0).normal(size=len(gain))
    return Instability(trials, points, (gain + odds > 4.0).astype(int), np.zeros(len(gain), bool))


@functools.cache
def compared(kind):
    """As many files as there may be, of long names, and without what the figures do not show."""
    names = ("as printed", "half the gain", "controller of 2007", "no_shaping_at_all", "slow, late")
    looks = list(enumerate(names))
    if kind == "walls":
        walls = [
            hc.VirtualWall(300.0 + 200.0 * i, 0.2 * i, device=hc.Device(0.1, 1.0)) for i, _ in looks
        ]
        runs = [hc.simulate(w.scenario(0.05, push=0.01)) for w in walls]
        found = zip(names, walls, [None] * 5, runs, strict=True)
    else:
        gains = [(1.0 - 0.15 * i, 0.5) for i, _ in looks]
        scenes = [hc.constant_cut(gain=k, operator=HAND, t_max=4.0, dt=1e-3) for k in gains]
        loops = [Loop.of(x, "x") for x in scenes]
        found = zip(names, scenes, loops, [hc.simulate(x) for x in scenes], strict=True)
    region = z_region("", hc.VirtualWall(device=hc.Device(0.1, 1.0)))
    files = (comparison.Compared(n, w, o, {}, {}, r, None if o else region) for n, w, o, r in found)
    return comparison.Comparison(tuple(files))


def run_case(name, figure):
    return lambda: run_figures.FIGURES[figure].draw(record(name))


@pytest.fixture(autouse=True, scope="module")
def fewer_clays():
    """Every fifth damping of the lines over it, from the first to the last."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compare_plots, "CLAY_DAMPINGS", compare_plots.CLAY_DAMPINGS[::5])
        yield


CASES = {
    **{
        f"{name} {figure}": run_case(name, figure)
        for name, figures in {
            "constant": ("velocity", "force"),
            "variable": ("velocity", "path"),
            "driven": ("force", "force_position"),
            "yields": ("velocity", "force", "force_velocity"),
            "ground": ("velocity", "force", "force_position", "ground"),
        }.items()
        for figure in figures
    },
    "maneuvers": lambda: run_plots.maneuver_plot([record("driven")] * 3),
    "readings": lambda: run_plots.readings_plot(
        {n: record("variable") for n in ("none", "0.15/s", "30/s", "0.15/sample")}
    ),
    "path of the cut": lambda: path_plots.path_plot(record("constant")),
    "fit": lambda: fit_plots.fit_plot(fitted()),
    **{
        f"map {kind}": lambda kind=kind: stability_map_plots.stability_map_plot(
            stability_chart(kind)
        )
        for kind in ("gain-damping", "delay-damping", "gain-pose")
    },
    "map gain-yield": lambda: stability_map_plots.yield_map_plot(yield_chart()),
    "accuracy": lambda: accuracy_plots.accuracy_plot(ladder()),
    "identified G": lambda: identification_plots.identification_plot(
        [identified("G", "x"), identified("G", "y")]
    ),
    "identified Th": lambda: identification_plots.identification_plot([identified("Th", "x")]),
    "workspace": lambda: workspace_plots.workspace_plot(drift()),
    "sweep status": lambda: sweep_plots.sweep_plot(swept()),
    "sweep speed": lambda: sweep_plots.sweep_plot(swept(), "speed_x"),
    "bode": lambda: theory_plots.bode_plot(LOOP),
    "bode unstable": lambda: theory_plots.bode_plot(Loop("y", b=90.0, K=10.0), at="force"),
    "nyquist": lambda: theory_plots.nyquist_plot(LOOP, (0.5, 1.0, 3.0, 10.0, 30.0)),
    "small gain": lambda: theory_plots.small_gain_plot(LOOP),
    "passivity index": lambda: passivity_plots.index_plot(passive("index")),
    "passivity energy": lambda: passivity_plots.port_energy_plot(passive("energy")),
    "passivity region": lambda: passivity_plots.region_plot(passive("region")),
    **{
        f"zwidth {kind}": lambda kind=kind: wall_plots.zwidth_plot(z_width(kind))
        for kind in ("region", "rest", "family")
    },
    **{
        f"{name} of {kind}": lambda kind=kind, plot=plot: plot(measured(kind))
        for kind in ("arm", "wall")
        for name, plot in {
            "impedance": impedance_plots.impedance_plot,
            "transparency": impedance_plots.transparency_bode_plot,
        }.items()
    },
    "mbk": lambda: impedance_plots.mbk_plot(parts_rendered()),
    "dynamic range": lambda: impedance_plots.dynamic_range_plot(parts_rendered()),
    "least mass": lambda: impedance_plots.least_mass_plot(least_masses()),
    "gain band": lambda: robustness_plots.band_plot(hands_band()),
    **{
        f"instability {kind}": lambda kind=kind: robustness_plots.instability_plot(risk(kind))
        for kind in ("map", "line", "parameters")
    },
    **{
        f"compared {kind}: {plot.__name__}": lambda kind=kind, plot=plot: plot(compared(kind))
        for kind, plots in {
            "controllers": (
                compare_plots.velocity_overlay,
                compare_plots.gain_overlay,
                compare_plots.transparency_overlay,
            ),
            "walls": (compare_plots.wall_region_plot, compare_plots.push_plot),
        }.items()
        for plot in (
            *plots,
            compare_plots.spare_plot,
            compare_plots.impedance_overlay,
            compare_plots.parts_overlay,
        )
    },
    "energy": lambda: record_plots.energy_plot(record("driven")),
    "transparency": lambda: theory_plots.transparency_plot(
        LOOP, [("as printed", 1.0, hc.Compensator()), ("designed", 2.0, hc.Compensator())]
    ),
}


@functools.cache
def drift():
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-0.4, 0.5, 0.2), np.arange(0.1, 0.5, 0.2)))
    gains = np.random.default_rng(1).uniform(0.2, 2.0, (len(x), 2, 2, 2, 3))
    return Drift(x, y, 0.2, gains, np.ones((len(x), 2)))


def texts(draw, monkeypatch):
    """A figure, and the texts that it draws, with their places [pixels]."""
    drawn, draw_text = [], Text.draw

    def noted(self, renderer):
        drawn.append(self)
        draw_text(self, renderer)

    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        figure = draw()
    found = {t: Text.get_window_extent(t) for t in drawn if t.get_visible() and t.get_text()}
    return figure, [(t, box) for t, box in found.items() if box.width]


def narrow_family():
    """A family whose stiffnesses lie within one decade, and one of whose edges tops at B = 0."""
    family = z_width("family")
    edges = [(3000.0, 2500.0), (1800.0, 2200.0)]
    regions = [
        dataclasses.replace(r, verdict=BY_REST, K=(k0, *[k] * (len(r.B) - 1)))
        for r, (k0, k) in zip(family.regions, edges, strict=False)
    ]
    return wall_plots.zwidth_plot(ZWidth(tuple(regions), "damper"))


LABELLED = {
    "narrow family": narrow_family,
    **{n: f for n, f in CASES.items() if n.startswith(("zwidth", "mbk", "compared"))},
    **{n: CASES[n] for n in ("dynamic range", "least mass")},
}


def assert_two_numbers(figure):
    """Each axis has two numbers, but those that share the numbers of one below."""
    for ax in figure.axes:
        shared = ax.get_subplotspec() and not ax.get_subplotspec().is_last_row()
        for axis in [ax.yaxis] if shared else [ax.xaxis, ax.yaxis]:
            low, high = sorted(axis.get_view_interval())
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            some = {
                t.label1.get_text()
                for t in ticks
                if t.label1.get_visible() and t.label1.get_text() and low <= t.get_loc() <= high
            }
            assert len(some) >= 2, (ax, axis, some)


AGAIN = {  # drawn by the function of another case, of a run or result of the same kind
    "variable velocity", "ground velocity", "constant force", "driven force_position",
    "map delay-damping", "identified Th", "sweep speed", "bode", "zwidth region",
    "impedance of wall", "transparency of wall", "instability line",
    *(n for n in CASES if re.match("compared walls: (spare|impedance|parts)", n)),
}  # fmt: skip
ALIKE = {  # of these also the words are those of the other case, or fewer
    "variable velocity", "ground velocity", "constant force", "driven force_position",
    "sweep speed", "bode", "instability line",
}  # fmt: skip
# in one column text has the least room
WIDE = CASES if HUNTS else some((n for n in CASES if n not in AGAIN), 4)
NARROW = CASES if HUNTS else [n for n in CASES if n not in ALIKE]
PRINTED = [(n, "print") for n in NARROW] + [(n, "print-wide") for n in WIDE]


def test_figures_drawn_again_are_cases():
    assert set(CASES) > AGAIN > ALIKE


@pytest.mark.parametrize("name, style", PRINTED)
@pytest.mark.layout
def test_text_can_be_read_in_print(name, style, monkeypatch):
    """No text is clipped, smaller than 6 pt, or over a legend or a title."""
    figure, found = texts(lambda: hc.Figure(CASES[name]).draw(style), monkeypatch)
    width = {"print": 8.5, "print-wide": 17.5}[style]
    assert figure.get_figwidth() == pytest.approx(width / 2.54)
    whole = figure.bbox
    assert found
    for text, box in found:
        assert text.get_fontsize() >= LEAST_TEXT, text
        assert whole.x0 - 0.5 <= box.x0 and box.x1 <= whole.x1 + 0.5, (text, box)
        assert whole.y0 - 0.5 <= box.y0 and box.y1 <= whole.y1 + 0.5, (text, box)
    titles = [(t, b) for t, b in found if t.axes and t in (t.axes._left_title, t.axes.title)]
    keys = [legend.get_window_extent() for legend in figure.legends]
    for title, box in titles:
        assert not any(box.overlaps(key) for key in keys), title
        assert not any(box.overlaps(b) for t, b in titles if t is not title), title
    if name in LABELLED and style == "print":
        assert_two_numbers(figure)


# CASES are printed above
SHOWN = [(n, "screen") for n in some(LABELLED, 2)] + [("narrow family", "print")]


@pytest.mark.parametrize("name, style", SHOWN)
@pytest.mark.layout
def test_each_axis_has_two_numbers(name, style):
    assert_two_numbers(hc.Figure(LABELLED[name]).draw(style))


@pytest.mark.layout
def test_names_of_regions_lie_beside_the_axis():
    figure = narrow_family()
    FigureCanvasAgg(figure).draw()
    ax = figure.axes[0]
    assert len(ax.texts) == 2
    for text in ax.texts:
        assert text.get_window_extent().x0 >= ax.bbox.x0


@pytest.mark.layout
def test_walls_that_are_compared_lie_apart():
    """Also where their devices' regions would be shown on linear axes."""
    soft, stiff = (hc.VirtualWall(K, B) for K, B in ((300.0, 1.0), (900.0, 4.0)))
    B = (0.0, 50.0, 100.0)
    region = ZRegion("a device", soft, BY_GROWTH, B, (1e4, 8e4, 1e4), (1e4, 8e4, 1e4), 120.0,
                     (Limit("exact, linear loop", "exact", B, (1e4, 8e4, 1e4)),))  # fmt: skip
    figure = wall_plots.regions_plot([region, region], [soft, stiff])
    FigureCanvasAgg(figure).draw()
    ax = figure.axes[0]
    a, b = (
        ax.transAxes.inverted().transform(ax.transData.transform((w.B, w.K))) for w in (soft, stiff)
    )
    assert np.all(np.abs(a - b) > 0.05) and min(*a, *b) > 0.05


def test_the_check_sees_what_is_clipped(monkeypatch):
    figure = Figure(figsize=(2.0, 2.0))
    figure.text(0.9, 0.5, "clipped at the right")

    def draw():
        figure.draw_without_rendering()
        return figure

    _, ((_, box),) = texts(draw, monkeypatch)
    assert box.x1 > figure.bbox.x1
