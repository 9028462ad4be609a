"""Figures of robustness draw what they are given, in every style, with every text in the figure."""

import numpy as np
import pytest
from matplotlib.text import Text

import hapticclay as hc
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.robustness import Instability
from hapticclay.studies.sampling import Range
from hapticclay.theory.loops import Loop
from hapticclay.views.figure import Figure
from hapticclay.views.robustness_plots import band_plot, instability_plot
from tests.hunt import HUNTS

HANDS = hc.studies.Hands.around(hc.Operator(0.4, 5.0, 80.0), 0.5)
GAIN = hc.studies.Distribution("log-normal", 4.0, 1.0)


def judged(**kw):
    """Runs with made-up verdicts: unstable where K is large, or by chance."""
    trials = hc.studies.Trials(PushedLoop("x"), **{"hands": HANDS, **kw})
    points = np.concatenate([trials.points(n) for n in range(trials.chunks)])
    rng = np.random.default_rng(0)
    K = points[:, trials.names.index("K")]
    unstable = (K + rng.normal(size=len(K)) > 4.0).astype(int)
    return Instability(trials, points, unstable, np.zeros(len(points), dtype=bool))


PLANE = {"K": Range(1.0, 8.0, 9), "b": Range(10.0, 1000.0, 5, log=True)}
CASES = {
    "band": lambda: band_plot(
        hc.studies.gain_band(
            Loop("x"), HANDS, np.geomspace(1.0, 3000.0, 7).tolist(), hc.studies.Draw(20)
        )
    ),
    "plane": lambda: instability_plot(judged(grid=PLANE, runs=250)),
    "turned plane": lambda: instability_plot(judged(grid=dict(reversed(PLANE.items())), runs=20)),
    "line": lambda: instability_plot(judged(grid={"K": Range(1.0, 8.0, 9)}, runs=30)),
    "parameters": lambda: instability_plot(judged(vary={"K": GAIN}, runs=400)),
}


# the others stand among all figures that are printed
PRINTED = CASES if HUNTS else ["turned plane"]
DRAWN = [(name, "screen") for name in CASES] + [(name, "print") for name in PRINTED]


@pytest.mark.parametrize("name, style", DRAWN)
@pytest.mark.layout
def test_every_text_lies_in_the_figure(name, style, monkeypatch):
    drawn, draw = [], Text.draw

    def noted(self, renderer):
        drawn.append(self)
        draw(self, renderer)

    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        figure = Figure(CASES[name]).draw(style)
    boxes = [(t, t.get_window_extent()) for t in drawn if t.get_visible() and t.get_text()]
    whole = figure.bbox
    assert boxes
    for text, box in boxes:
        if box.width:
            assert whole.x0 - 0.5 <= box.x0 and box.x1 <= whole.x1 + 0.5, text
            assert whole.y0 - 0.5 <= box.y0 and box.y1 <= whole.y1 + 0.5, text
