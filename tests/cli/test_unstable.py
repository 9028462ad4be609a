"""What is said, before and after a run, of a linear loop that is unstable."""

import functools

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.run import unstable_axes
from hapticclay.theory import linear_loop, loops

HAND = hc.Operator(mass=0.25, damper=2.0, spring=6.0)


@pytest.mark.parametrize("operator,low,high", [(None, 219.0, 1043.0), (HAND, 251.0, 1004.0)])
def test_the_default_gain_is_unstable_where_the_docs_say(operator, low, high):
    """The printed bounds, rounded to 1 N.s/m, so told 0.5 % within them and silent outside.

    They are those of the nominal pose, and with inertia shaping those of every pose.
    """
    cut = functools.partial(hc.constant_cut, operator=operator, inertia_shaping=True)
    for b in (30.0, 0.995 * low, 1.005 * high, 1e5):
        assert unstable_axes(cut(b=b)) == []
    for b in (1.005 * low, 300.0, 400.0, 600.0, 0.995 * high):
        (said,) = unstable_axes(cut(b=b))
        assert "gain[y] = 0.5 >" in said and f"b = {b:g} N.s/m" in said and "gain[x]" not in said


@pytest.mark.parametrize("b", [150.0, 300.0, 600.0, 1100.0])
def test_what_is_said_agrees_with_the_poles(b):
    """Poles of the closed loop: numpy's roots, of the characteristic polynomial at K itself."""
    s = hc.constant_cut(b=b, inertia_shaping=True)
    unstable = []
    for axis in "xy":
        found = linear_loop.characteristic(loops.Loop.of(s, axis, b))
        unstable.append(np.roots(found.coef[::-1]).real.max() > 0.0)
    assert any(unstable) == bool(unstable_axes(s))


def test_what_is_said_of_a_path_agrees_with_its_run():
    """Without shaping both axes are one loop, which along the cut is unstable from 199 N.s/m on."""
    for b, unstable in ((190.0, False), (210.0, True)):
        s = hc.constant_cut(b=b)
        assert bool(unstable_axes(s)) == unstable
        assert (hc.simulate(s).outcome.code == "diverged") == unstable


def test_a_map_of_a_sweep_hatches_margins_below_1(tmp_path):
    from hapticclay.studies import sampling, store, sweep
    from hapticclay.views import sweep_plots

    grid = sampling.parse_grid("b=90,150,300,600 gain.y=0.3,0.5,0.8")
    plan = sweep.Sweep("constant", grid, {"t_max": 0.1, "start": (0.06, 0.0)})
    sweep.run_sweep(plan, tmp_path, workers=1)
    table = store.read_sweep(tmp_path)
    below = sum(m < 1.0 for m in table["gain_margin_y"].to_pylist())
    for value in ("status", "end_time"):
        ax = sweep_plots.sweep_plot(table, value).axes[0]
        (hatched,) = (p for p in ax.patches if p.get_label() == "gain margin of y < 1")
        cells = list(hatched.get_path().to_polygons())
        assert hatched.get_hatch() and 0 < len(cells) == below < len(table)
    ax = sweep_plots.sweep_plot(table, "speed_x").axes[0]  # x is stable in each of the runs
    assert not [p for p in ax.patches if "gain margin" in str(p.get_label())]
