"""The block of finite elements: it keeps its dent, and no run or picture opens a file of it."""

import subprocess
import sys

import pytest

import hapticclay as hc
from benchmarks import flex_block
from hapticclay.kernel import engine
from hapticclay.views.stage import Stage


def test_models_that_are_stepped_or_drawn_have_no_flex():
    for scenario in (hc.constant_cut(), hc.free(), hc.constant_cut(clay=(0.01, 0.1))):
        assert engine.build(scenario).nflex == Stage(scenario).model.nflex == 0


def test_a_run_and_a_picture_open_no_file_of_it():
    code = (
        "import sys\nseen = []\n"
        "sys.addaudithook(lambda e, a: seen.append(str(a[0])) if e == 'open' else None)\n"
        "import hapticclay as hc\nfrom hapticclay.views.stage import Stage\n"
        "hc.simulate(hc.constant_cut(t_max=0.01))\nStage(hc.constant_cut())\n"
        "assert any('arm.xml' in x for x in seen)\n"
        "print([x for x in seen if 'flex' in x], [m for m in sys.modules if 'flex' in m])\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout == "[] []\n"


@pytest.mark.parametrize("yields", [True, False])
def test_the_dent_stays_because_the_block_yields(yields):
    """20 mm deep; without a yield strain the same block springs back."""
    scene = flex_block.Scene(yields)
    while scene.data.time < 1.1:
        scene.step()
    assert (0.012 if yields else 0.005) < scene.dent() < 0.021
    end = flex_block.PATH[-1 if yields else -2, 0]  # it is whole again once the tool has left
    while scene.data.time < end:
        scene.step()
    assert 0.008 < scene.dent() < 0.015 if yields else scene.dent() < 0.001
    assert scene.model.nv == 2 + 3 * 7 * 7 * 2  # the lowest layer of nodes is pinned
