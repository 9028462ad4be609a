"""Every figure of the package at the width of one printed column: nothing clipped, small or over
another text; and what its files hold."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import hapticclay as hc
from benchmarks import fit_coverage
from hapticclay.studies import passivity_runs
from hapticclay.studies.accuracy import Ladder, Setting
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.stability_map import MapCell, StabilityMap
from hapticclay.studies.workspace import Drift
from hapticclay.studies.yield_map import YieldCell, YieldMap
from hapticclay.theory.linear_loop import Loop
from hapticclay.views import fit_plots, passivity_plots, run_plots, study_plots, theory_plots
from hapticclay.views.style import LEAST_TEXT

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
            "constant": hc.constant_cut(t_max=4.0),
            "variable": hc.variable_cut(operator=HAND, shaping=True, t_max=3.0),
            "driven": hc.stability_test(25.0, t_max=3.0),
            "yields": hc.Scenario(clay=yields, force=(5.0, 0.0), t_max=3.0),
            "ground": hc.Scenario(clay=across, force=(5.0, 0.0), t_max=2.0),
        }[name]
    )


@functools.cache
def fitted():
    return hc.fit_flow(fit_coverage.measured("Bingham", 3, fit_coverage.SENSORS["fine"]))


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
        for series in study_plots.SERIES_LOOKS
        for dt in (1e-2, 1e-3, 1e-4, 3.6e-4)
    )
    scenario = hc.constant_cut()
    return Ladder(scenario, "native", settings, "reference", {"s": 1e-6, "m": 1e-8}, 11.13)


@functools.cache
def identified(what, axis):
    return hc.identify(axis, what, periods=1, lines=12, period=2.5, band=(0.5, 20.0))


def swept():
    """A sweep with every status and every reason for no figure."""
    pa = pytest.importorskip("pyarrow")
    kinds = list(study_plots.OUTCOME_COLORS)
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
        return passivity_runs.energy_over_time(dataclasses.replace(stiff, stop=False))
    if what == "index":
        omega = np.geomspace(3.0, 3000.0, 50)
        index, some = hc.passivity_index(wall, omega), omega[::9]
        return passivity_runs.IndexOverFrequency(
            "wall of K = 500 N/m, B = 0.2 N.s/m", omega, index + 0.1, index, some,
            index[::9] + 0.1, some, index[::9],
        )  # fmt: skip
    Ts, delays = np.geomspace(1e-4, 1e-2, 20), (0.0, 0.5, 1.0, 2.0)
    limits = np.array([2.0 / (Ts * (1.0 + 2.0 * d)) for d in delays])
    return passivity_runs.PassiveRegion(wall, delays, Ts, limits, Ts[::6], limits[:, ::6])


def run_case(name, figure):
    return lambda: run_plots.FIGURES[figure](record(name))


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
    "path of the cut": lambda: run_plots.path_plot(record("constant")),
    "fit": lambda: fit_plots.fit_plot(fitted()),
    **{
        f"map {kind}": lambda kind=kind: study_plots.stability_map_plot(stability_chart(kind))
        for kind in ("gain-damping", "delay-damping", "gain-pose")
    },
    "map gain-yield": lambda: study_plots.yield_map_plot(yield_chart()),
    "accuracy": lambda: study_plots.accuracy_plot(ladder()),
    "identified G": lambda: study_plots.identification_plot(
        [identified("G", "x"), identified("G", "y")]
    ),
    "identified Th": lambda: study_plots.identification_plot([identified("Th", "x")]),
    "workspace": lambda: study_plots.workspace_plot(drift()),
    "sweep status": lambda: study_plots.sweep_plot(swept()),
    "sweep speed": lambda: study_plots.sweep_plot(swept(), "speed_x"),
    "bode": lambda: theory_plots.bode_plot(LOOP),
    "bode unstable": lambda: theory_plots.bode_plot(Loop("y", b=90.0, K=10.0), at="force"),
    "nyquist": lambda: theory_plots.nyquist_plot(LOOP, (0.5, 1.0, 3.0, 10.0, 30.0)),
    "small gain": lambda: theory_plots.small_gain_plot(LOOP),
    "passivity index": lambda: passivity_plots.index_plot(passive("index")),
    "passivity energy": lambda: passivity_plots.port_energy_plot(passive("energy")),
    "passivity region": lambda: passivity_plots.region_plot(passive("region")),
    "transparency": lambda: theory_plots.transparency_plot(
        LOOP, [("as printed", 1.0, hc.Compensator()), ("designed", 2.0, hc.Compensator())]
    ),
}


@functools.cache
def drift():
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-0.4, 0.5, 0.2), np.arange(0.1, 0.5, 0.2)))
    gains = np.random.default_rng(1).uniform(0.2, 2.0, (len(x), 2, 2, 2, 3))
    return Drift(x, y, 0.2, gains, np.ones((len(x), 2)))


def texts(figure, monkeypatch):
    """The texts of a figure that are drawn, with their places [pixels]."""
    drawn, draw = [], Text.draw

    def noted(self, renderer):
        drawn.append(self)
        draw(self, renderer)

    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        figure.canvas.draw()
    found = {t: Text.get_window_extent(t) for t in drawn if t.get_visible() and t.get_text()}
    return [(t, box) for t, box in found.items() if box.width]


@pytest.mark.parametrize("style", ["print", "print-wide"])
@pytest.mark.parametrize("name", CASES)
def test_text_can_be_read_in_print(name, style, monkeypatch):
    """No text is clipped, smaller than 6 pt, or over a legend or a title."""
    figure = hc.Figure(CASES[name]).draw(style)
    FigureCanvasAgg(figure)
    width = {"print": 8.5, "print-wide": 17.5}[style]
    assert figure.get_figwidth() == pytest.approx(width / 2.54)
    whole, found = figure.bbox, texts(figure, monkeypatch)
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


def test_the_check_sees_what_is_clipped(monkeypatch):
    figure = Figure(figsize=(2.0, 2.0))
    figure.text(0.9, 0.5, "clipped at the right")
    FigureCanvasAgg(figure)
    ((_, box),) = texts(figure, monkeypatch)
    assert box.x1 > figure.bbox.x1
