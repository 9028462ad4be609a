"""Figures are the same whatever matplotlib is set to on the machine that draws them."""

import matplotlib
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.views import run_figures, running_plots
from hapticclay.views.plan_picture import Plan, PlanPicture

SMALL = "savefig.bbox: tight\naxes.labelsize: 30\nfont.family: serif\naxes.unicode_minus: False\n"


@pytest.fixture(scope="module")
def record():
    return hc.simulate(hc.constant_cut(t_max=0.05))


def others(name, value):
    """Values of a setting that are not this one, whether matplotlib takes them or not."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float):
        return [2.0 * value + 1.0, 0.5 * value]
    if isinstance(value, list):
        return [[0.3 * x + 1.0 for x in value] if value and "limits" in name else ["serif"]]
    words = ["red", "tight", "30", "in", "left", "serif", "cm", ":", "gray", "none", "0.7"]
    return [w for w in words if w != value]


def hostile():
    """Each setting of matplotlib's defaults that can be changed, changed: some 250."""
    changed = {}
    for name, value in matplotlib.rcParamsDefault.items():
        if name.startswith(("backend", "date", "webagg", "toolbar", "timezone", "_", "docstring")):
            continue
        for other in others(name, value):
            try:
                matplotlib.rcParams.validate[name](other)
            except (ValueError, TypeError, KeyError, RuntimeError):
                continue
            changed[name] = other
            break
    return changed


def pictures(record):
    """Each way in which the package draws by matplotlib: files, a notebook's, a film's, a gym's."""
    figures = run_figures.record_figures(record)
    yield "velocity", figures["velocity"].png("print")
    yield "path", figures["force"].svg()
    film = running_plots.RunningPlots(record, 320, 360)
    yield "film", film.draw(len(record.t)).tobytes()
    yield "notebook", record.plot.velocity()._repr_png_()
    plan = Plan(np.array([(-0.1, -0.2), (0.0, -0.1), (0.0, 0.0)]), np.zeros((2, 2)),
                np.array([(0.0, 0.0), (0.05, 0.02)]), ((0.02, -0.02, 0.03, 0.05),), 0.002,
                (0.0, 0.0, 0.01), "0.1 s")  # fmt: skip
    drawn = PlanPicture(False).draw(plan)
    assert drawn is not None
    yield "plan", drawn.tobytes()


@pytest.mark.filterwarnings("ignore::matplotlib.MatplotlibDeprecationWarning")
@pytest.mark.layout
def test_no_setting_of_the_user_changes_a_picture(record):
    changed = hostile()
    assert len(changed) > 200 and {"text.usetex", "savefig.bbox", "axes.labelsize"} <= {*changed}
    plain = dict(pictures(record))
    with matplotlib.rc_context(changed):
        for name, picture in pictures(record):
            assert picture == plain[name], name


def test_the_settings_of_the_user_are_as_before(record):
    with matplotlib.rc_context({"axes.labelsize": 30.0, "lines.linewidth": 5.0}):
        before = dict(matplotlib.rcParams)
        record.plot.velocity()
        run_figures.record_figures(record)["force"].png("print")
        assert dict(matplotlib.rcParams) == before


@pytest.mark.layout
def test_a_settings_file_leaves_the_width_in_print(tmp_path, capsys):
    """The width is that of one column of a journal, 8.5 cm, whatever the settings crop."""
    (tmp_path / "matplotlibrc").write_text(SMALL)
    words = ["run", "constant", "--t-max", "0.05", "--style", "print", "--out"]
    assert app.main([*words, str(tmp_path / "plain")]) == 0
    with matplotlib.rc_context(fname=tmp_path / "matplotlibrc"):
        assert app.main([*words, str(tmp_path / "set")]) == 0
    capsys.readouterr()
    plain, other = ((tmp_path / x / "velocity.png").read_bytes() for x in ("plain", "set"))
    assert plain == other
    assert int.from_bytes(other[16:20], "big") == int(300 * 8.5 / 2.54)
