"""The palette is converted exactly, what draws without matplotlib does not load it, and ticks."""

import re
import subprocess
import sys

import matplotlib.colors
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.views import palette, panels

PALETTE = {
    name: value for name, value in vars(palette).items() if re.fullmatch("#.{6}", str(value))
}


@pytest.mark.parametrize("name", PALETTE)
def test_conversions_are_those_of_matplotlib(name):
    assert palette.rgb(PALETTE[name]) == pytest.approx(matplotlib.colors.to_rgb(PALETTE[name]))
    assert palette.rgb_bytes(PALETTE[name]) == tuple(
        round(255 * x) for x in matplotlib.colors.to_rgb(PALETTE[name])
    )


@given(low=st.floats(1e-6, 1e6), ratio=st.floats(1.02, 1e5))
def test_a_logarithmic_axis_has_two_numbers(low, ratio):
    from matplotlib.figure import Figure

    ax = Figure().add_subplot()
    ax.set(yscale="log", ylim=(low, low * ratio))
    panels.plain_ticks(ax)
    ticks = [x for x in ax.get_yticks() if low <= x <= low * ratio]
    assert len({f"{x:g}" for x in ticks}) >= 2


def test_what_draws_without_matplotlib_does_not_load_it():
    modules = (
        "live.session",
        *(f"views.{x}" for x in "palette style stage page viewer window film".split()),
    )
    code = (
        f"import importlib, sys\nfor name in {modules}:\n"
        "    importlib.import_module(f'hapticclay.{name}')\n"
        "    print(name, 'matplotlib' in sys.modules)\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines() == [f"{name} False" for name in modules]


def test_clay_is_darker_where_it_damps_more():
    colors = palette.clay_color(np.linspace(0.0, 1.0, 11))
    assert colors.shape == (11, 3) and (np.diff(colors, axis=0) < 0.0).all()
    np.testing.assert_allclose(
        colors[[0, -1]], [palette.rgb(c) for c in (palette.CLAY_PALE, palette.CLAY_DEEP)]
    )
