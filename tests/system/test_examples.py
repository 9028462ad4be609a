"""Each example and each tutorial runs without a warning, and draws figures with labels."""

import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

from hapticclay.views import palette, style
from tests.hunt import HUNTS

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "examples" / "tutorials").glob("*.py"))
LEARNING = {*(ROOT / "examples" / "learning").glob("*.py")}  # need torch, and minutes
EXAMPLES = sorted({*(ROOT / "examples").rglob("*.py")} - {*TUTORIALS} - LEARNING)
PAGES = EXAMPLES + TUTORIALS
IDS = [f"{page.parent.name}/{page.stem}" for page in PAGES]
RUN = [pytest.param(page, id=name) for page, name in zip(PAGES, IDS, strict=True)]
# words of a program, and what they are in the suite: fewer, shorter or coarser runs, or in Python
FEWER = {
    "clay/dent": {"    t_max=2.0,": "    t_max=2.0,\n    dt=2e-3,"},
    "clay/sticking": {"t_max=4.0": "t_max=3.0, dt=1e-3"},
    "parts/compensator": {"300.0, 400)": "300.0, 100)"},
    "hardware/sampled": {"length=0.08": "length=0.056"},
    "parts/chirp": {"30.0": "3.0"},
    "parts/controller": {"t_max=3.0": "t_max=1.0", "(scenario)": "(scenario, engine='python')"},
    "parts/hand": {"1e4, 60)": "1e4, 6)"},
    "parts/signals": {"4.0, 2001)": "4.0, 501)"},
    "robustness/gain_band": {"hands=60": "hands=20", "500.0, 13)": "500.0, 4)"},
    "robustness/monte_carlo": {"runs=30": "runs=8"},
    "runs/batch": {"1000.0, 25)": "100.0, 4)"},
    "runs/columns": {"0.8, 120)": "0.8, 30)", "200.0, 120)": "200.0, 30)"},
    "runs/energy": {"1e-3, 5e-4, 2.5e-4]": "1e-3]"},
    "runs/many_step_by_step": {"t_max=8.0": "t_max=1.0"},
    "runs/pair_at_a_wall": {"t_max=1.0": "t_max=0.3"},
    "runs/pair_run": {"t_max=6.0": "t_max=1.5"},
    "runs/maneuver": {"stability_test(K)": "stability_test(K, t_max=5.0)"},
    "studies/fit_law": {"t_max=8.0": "t_max=4.0"},
    "studies/identify": {"Noise())": "Noise(), realisations=3, lines=10)"},
    "studies/measured_columns": {"    t_max=30.996": "    dt=1e-3,\n    t_max=30.996"},
    "studies/pair_log": {"arange(8000)": "arange(3000)", "[Ts / 20] * 20": "[Ts / 5] * 5"},
    "studies/stored_columns": {"0.5, 120)": "0.5, 30)", "0.7, 120)": "0.7, 30)"},
    "studies/sweep": {
        "1000:7log gain.y=0.1,0.2,0.4,0.8,1.6": "1000:2log gain.y=0.1,1.6",
        "1000.0, 80)": "1000.0, 8)",
    },
    "symptoms/arm_vibrates": {
        "((2e-3, 2e-3), (1e-3, 1e-3), (1e-3, 0.0))": "((1e-3, 0.0),)",
        "poses=20": "poses=2",
        "(None, 4000)": "(4000,)",
    },
    "symptoms/device_from_data": {"12.0, muscle": "8.0, muscle"},
    "symptoms/fast_enough": {"5000.0, 60)": "5000.0, 3)"},
    "symptoms/pair_oscillates": {  # with arms of two joints in place of seven
        "leader_7": "planar_2r",
        "(240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2)": "(24, 24), (0.3, 0.3)",
        "(0.93, 0.93, 1.77, 2.97, 0.79, 2.08, 0.22)": "(0.1, 0.1)",
        'axis="z"': 'axis="x"',
        "gains=12": "gains=2",
        "1.0, 9)": "1.0, 2)",
        ', ("Kp/2, 1.5 Kd", softer)': ",",
    },
    "symptoms/sticks_and_jumps": {"dt=1e-3": "dt=2e-3"},
    "symptoms/wall_vibrates": {"scenario(0.6,": "scenario(0.3,", "t > 0.5": "t > 0.2"},
    "theory/controller_stability": {"(0.0, 1e-3, 2.5e-3)": "(1e-3,)"},
    "theory/gain_limit": {"3e4, 13)": "3e4, 4)"},
    "theory/pair_transparency": {
        "samples=20": "samples=4",
        "(0.0, 5.0)": "(0.0, 0.0)",
        "(1.0, 10.0)": "(2.0, 2.0)",
    },
    "theory/small_gain": {"5.0, 60)": "5.0, 10)"},
    "theory/stiffness_limit": {"1000.0, 60)": "1000.0, 8)"},
    "theory/worst_case": {"sample(200,": "sample(20,"},
    "tutorials/t2_stability": {"3e4, 60)": "3e4, 12)", "t_max=3.0": "t_max=1.0"},
    "tutorials/t3_own_controller": {
        "t_max=3.0": "t_max=1.2",
        "record = hc.simulate(scenario)": "record = hc.simulate(scenario, engine='python')",
        '{"hardware": hardware}))': '{"hardware": hardware}), engine="python")',
    },
    "tutorials/t4_sweep": {
        "2000:7log gain.y=0.1,0.3,0.5,0.7,0.9,1.2": "2000:2log gain.y=0.1,0.5,1.2",
        "2000.0, 100)": "2000.0, 8)",
    },
    "walls/arm_as_device": {"range(240)": "range(30)"},
    "walls/client": {"range(300)": "range(30)"},
    "walls/device_hand": {"(0.0, 3.0), ((0.0": "(0.0, 0.6), ((0.0", "url, 3.0,": "url, 0.6,"},
    "walls/impedance": {"measure_impedance(wall)": "measure_impedance(wall, lines=3)"},
    "walls/least_mass": {"points=7": "points=3"},
    "walls/limits": {"5e-3, 101)": "5e-3, 4)"},
    "walls/pair_ends": {"range(200)": "range(40)"},
    "walls/press": {
        "(20e-6, 80e-6)": "(80e-6,)",
        '"os"': '"o"',
        "B=(0.0, 10.0), press": "B=(0.0,), press",
        "10.0, 21)": "10.0, 3)",
    },
    "walls/zwidth": {"B=(0.0, 10.0, 120.0)": "B=(0.0, 120.0)"},
}


@pytest.fixture(autouse=True)
def clean_figures(monkeypatch):
    """Starts and leaves without figures, in matplotlib's own style."""
    monkeypatch.setattr(plt, "show", lambda: None)  # agg warns that it shows nothing
    with matplotlib.rc_context():
        yield
    plt.close("all")


def run(page):
    """Runs a program as it stands, or in the suite with FEWER steps."""
    fewer = FEWER.get(f"{page.parent.name}/{page.stem}")
    if not fewer or HUNTS:
        runpy.run_path(str(page), run_name="__main__")
        return
    text = page.read_text()
    for words, less in fewer.items():
        assert words in text
        text = text.replace(words, less)
    exec(compile(text, str(page), "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("page", RUN)
def test_runs_and_shows_a_figure(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(page)
    assert plt.get_fignums()
    for number in plt.get_fignums():
        for ax in plt.figure(number).axes:
            labels = ax.get_xlabel() + ax.get_ylabel()
            shared = ax.get_shared_x_axes().get_siblings(ax)
            assert labels or len(shared) > 1, f"{page.name}: axes without a label"


@pytest.mark.layout
def test_the_style_sheet_is_the_style_of_the_figures():
    """hapticclay/views/figure.mplstyle, for figures of one's own, repeats style.STYLE."""
    sheet = matplotlib.rc_params_from_file(
        Path(style.__file__).with_name("figure.mplstyle"), use_default_template=False
    )
    assert all(sheet[name] == value for name, value in style.STYLE.items())
    colors = [x["color"] for x in sheet["axes.prop_cycle"]]
    names = "BLUE", "VERMILION", "GREEN", "PURPLE", "ORANGE", "SKY_BLUE"
    assert colors == [getattr(palette, name) for name in names]
