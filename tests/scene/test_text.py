"""One line and a small table of scenarios, records and verdicts."""

import dataclasses
import html.parser

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.display import html_table, one_line
from hapticclay.scene.text import scenario_rows


class Page(html.parser.HTMLParser):
    """Tags, attributes and text of a page; every tag must be closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words, self.attributes = [], set(), [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.add(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


EVIL = '<script>alert("1")</script>\n&amp; "q" \' <img src=x onerror=y>'


@pytest.fixture(scope="module")
def record():
    return hc.simulate(hc.constant_cut(t_max=0.2))


def objects(record):
    grid = hc.Grid((0.0, 0.1), (0.0,), np.array(((0.0, 5.0), (70.0, 1.0), (0.0, 9.0))))
    push = dataclasses.replace(
        hc.constant_cut(),
        clay=hc.Clay(grid, grid),
        operator=(hc.Operator(), None),
        muscle=hc.Step((0.5, 0.0), 0.1),
        control="sampled",
        hardware=hc.Hardware(delay=1e-4),
        arm=hc.Arm(l1=0.3),
    )
    law = hc.Profile((), (0.0,), springs=(hc.Spring(k=1e3),))
    springs = dataclasses.replace(hc.constant_cut(), clay=hc.Clay(law, law))
    yields = dataclasses.replace(
        hc.constant_cut(), clay=hc.slab(hc.Flow(Fy=5.0, K=2.0, n=0.5, b=20.0))
    )
    block = hc.Groove((0.01, 0.06), (-0.02, 0.02), 2e4, tool=hc.Tool(0.01, 0.004))
    groove = dataclasses.replace(hc.constant_cut(force=(6.0, 0.0)), clay=hc.Clay.of_groove(block))
    own = dataclasses.replace(
        hc.constant_cut(), control="sampled", controller=hc.Controller(lambda *a: ((0.0, 0.0), a))
    )
    evil = dataclasses.replace(record, scenario=dataclasses.replace(record.scenario, name=EVIL))
    none = {f: getattr(record, f)[:0] for f in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau")}
    return {
        "record": record,
        "empty": dataclasses.replace(record, **none, delta=record.delta[:0]),
        "evil record": evil,
        "evil scenario": evil.scenario,
        "free": hc.free(),
        "variable": hc.variable_cut(),
        "stability": hc.stability_test(),
        "parts": push,
        "springs": springs,
        "yields": yields,
        "groove": groove,
        "own controller": own,
        "passive": hc.theory.passivity("x", 1.0, 90.0),
        "not passive": hc.theory.passivity("y", 0.5, 90.0),
        "coupled": hc.theory.coupled_stability("y", 1.0, 90.0, hc.Operator()),
        "observed": hc.observed_passivity(record),
    }


def test_each_is_one_line_and_one_table(record):
    for name, x in objects(record).items():
        line = repr(x)
        assert "\n" not in line and 20 < len(line) < 400, name
        page = Page(x._repr_html_())
        assert page.tags == {"table", "caption", "tr", "th", "td"}, name
        assert {a for a, _ in page.attributes} == {"style"}
        for _, style in page.attributes:  # the page's own colours, dark or light
            assert "#" not in style and style.count("color:inherit") == style.count("color:")
        assert len(x._repr_html_()) < 6000


def test_what_the_lines_say(record):
    every = objects(record)
    assert repr(record).startswith("<Record constant: time limit at 0.2000 s; 557 samples, 0 to ")
    assert "no samples" in repr(every["empty"])
    assert "clay: b = 90 N.s/m, control: continuous, fast" in repr(record.scenario)
    assert "b = 1 to 70 N.s/m" in repr(every["parts"])
    assert "muscle: Step" in repr(every["parts"]) and "y: none" in repr(every["parts"])
    assert "replaced: arm" in repr(every["parts"])
    assert "hardware: delay 0.0001 s" in repr(every["parts"])
    assert "Fy = 5 N, K = 2 N/(m/s)^n, n = 0.5, b = 20 N.s/m" in repr(every["yields"])
    assert "permanent cut, up to" in repr(every["groove"])
    assert "spring k = 1000 N/m" in repr(every["springs"])
    assert "controller: <lambda>" in repr(every["own controller"])
    assert "clay: none" in repr(every["free"])
    verdict = every["not passive"]
    assert repr(verdict) == (
        f"<Verdict False: {verdict.measures} {verdict.margin:.4g} at {verdict.omega:.4g} rad/s>"
    )
    assert " at " not in repr(every["observed"])  # no limiting frequency
    words = Page(verdict._repr_html_()).words
    assert words[0] == "Verdict: it fails" and verdict.method in words


def test_texts_of_users_are_escaped(record):
    for name in ("evil record", "evil scenario"):
        text = objects(record)[name]._repr_html_()
        assert "<script" not in text and "<img" not in text
        assert any(EVIL in word for word in Page(text).words)
    page = Page(html_table(EVIL, [(EVIL, EVIL)]))
    assert page.words.count(EVIL) == 3


def test_one_line_cuts_long_texts():
    assert one_line(" a\n b\tc ") == "a b c"
    assert one_line("x" * 61) == "x" * 57 + "..." and one_line("x" * 60) == "x" * 60


@pytest.mark.parametrize(
    "hardware,words",
    [
        (hc.Hardware(), "ideal"),
        (hc.Hardware(encoder=8192, delay=3.6e-4), "encoder 8192 counts per turn, delay 0.00036 s"),
        (
            hc.Hardware(velocity="difference", velocity_window=4, velocity_filter=200.0),
            "velocity by difference, over 4 samples, low-pass 200 Hz",
        ),
        (hc.Hardware(adc_bits=12, dac_bits=16), "A/D 12 bits, D/A 16 bits"),
        (hc.Hardware(friction=(0.1, 0.02)), "joint friction (0.1, 0.02) N.m"),
        (hc.Hardware(coupling=hc.Coupling(800.0, 5.0)), "virtual coupling 800 N/m, 5 N.s/m"),
        (hc.Hardware(passivity=True, jitter=1e-5), "jitter 1e-05 s rms, passivity controller"),
    ],
)
def test_hardware_says_its_quantities(hardware, words):
    scenario = hc.with_fields(hc.constant_cut(control="sampled"), {"hardware": hardware})
    assert dict(scenario_rows(scenario))["hardware"] == words
