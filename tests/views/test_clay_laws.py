"""Each law of clay answers for itself: words, columns, holds and shades, wherever it is shown."""

import dataclasses
import functools
import re

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.run import run_table
from hapticclay.live.status import clay_here
from hapticclay.model import clay as clay_module
from hapticclay.model.clay import LAWS
from hapticclay.model.traits import Column, Hold, Law, Quantity
from hapticclay.scene.text import clay_text
from hapticclay.views import palette, run_figures
from hapticclay.views.captions import scenario_parts

PLAIN = hc.Profile((0.02, 0.06), (0.0, 20.0, 0.0))
WALL = hc.Profile(
    (0.02, 0.06), (0.0, 20.0, 0.0), springs=(hc.Spring(), hc.Spring(30.0, 2.0), hc.Spring())
)
GRID = hc.Grid((0.02, 0.06), (0.0,), ((0.0, 0.0), (20.0, 40.0), (0.0, 0.0)))
INSIDE = (0.04, 0.001)


def slab(flow, **kw):
    return dataclasses.replace(hc.slab(flow, 0.02, 0.06), **kw)


CLAYS = {
    "viscous": hc.Clay(PLAIN, PLAIN),
    "growth": hc.Clay(dataclasses.replace(PLAIN, growth=(0.0, 30.0, 0.0)), PLAIN),
    "cells": hc.Clay(GRID, GRID),
    "smooth": hc.Clay(hc.Smooth((0.0, 0.06), (0.0, 0.1), ((20.0,), (40.0,))), PLAIN),
    "rotated axes": hc.Clay(PLAIN, dataclasses.replace(PLAIN, values=(0.0, 60.0, 0.0)), 0.5),
    "yield by axis": slab(hc.Flow(Fy=1.0, K=4.0, n=0.5, b=10.0), isotropic=False),
    "yield along the motion": slab(hc.Flow(Fy=6.0, b=10.0)),
    "springs": hc.Clay(WALL, PLAIN),
    "groove": hc.Clay.of_groove(hc.Groove((0.02, 0.06), (-0.02, 0.02), 4e4, damping=1e5)),
}
WORDS = {  # over the scene, and at INSIDE
    "viscous": ("b = 20 N.s/m", "b = 20 N.s/m"),
    "growth": ("b = 20 N.s/m, grows by 30 N.s/m per s", "b = 20 N.s/m"),
    "cells": ("b = 20 to 40 N.s/m", "b = 40 N.s/m"),
    "rotated axes": ("b = 20 to 60 N.s/m, axes rotated by 28.65 degrees", "b = (20, 60) N.s/m"),
    "yield by axis": 2 * ("Fy = 1 N, K = 4 N/(m/s)^n, n = 0.5, b = 10 N.s/m",),
    "yield along the motion": 2 * ("Fy = 6 N, b = 10 N.s/m",),
    "springs": (
        "b = 20 N.s/m, spring k = 30 N/m, yielding at 2 N",
        "spring k = (30, 0) N/m, yielding at (2, 0) N, b = 20 N.s/m",
    ),
    "groove": ("permanent cut, up to 2 N", "holds with up to 2 N"),
}


def scene(name, **kw):
    force = (5.0, 1.0) if CLAYS[name].holding else (1.0, 0.0)
    own = {"clay": CLAYS[name], "force": force, "t_max": 1.5, **kw}
    return dataclasses.replace(hc.constant_cut(), **own)


@functools.cache
def ran(name):
    return hc.simulate(scene(name, dt=1e-3), every=2)


def test_there_is_a_clay_of_every_law():
    assert set(CLAYS) == {law.name for law in LAWS}
    for name, clay in CLAYS.items():
        assert name in {law.name for law in clay.kinds}


@pytest.mark.parametrize("name", WORDS)
def test_words(name):
    whole, inside = WORDS[name]
    clay = CLAYS[name]
    assert clay_text(clay) == whole
    assert ", ".join(x.text() for x in clay.here(INSIDE)) == inside
    assert clay_here(scene(name), INSIDE, tuple(clay.at(*INSIDE))) == f"{inside} here"
    title = " ".join(scenario_parts(scene(name)))
    for number in re.findall(r"(?<![\w.])\d+\.?\d*", whole):
        assert number in title  # each in its title too, which lists values up to eight


@pytest.mark.parametrize("name", CLAYS)
def test_the_table_shows_its_columns_and_the_figures_are_drawn(name):
    record, clay = ran(name), CLAYS[name]
    head = run_table(record)
    for column in clay.columns:
        assert column.name in head and column.unit in head
    assert ("held" in head) == clay.holding and ("fe/v" in head) != clay.holding
    for stretch in record.regions("x"):
        assert {c.name for c in clay.columns} <= set(stretch["x"])
    drawn = run_figures.figures(record)
    assert {"velocity", "path" if name == "cells" else "force"} <= set(drawn)
    assert ("force_velocity" in drawn) == (clay.of_velocity and not clay.viscous)
    assert ("ground" in drawn) == bool(clay.blocks)


@pytest.mark.parametrize("name", CLAYS)
def test_what_it_says_is_what_a_run_shows(name):
    """Viscous clay has fe = B v to rounding, other clay has not; only clay that holds holds."""
    record, clay = ran(name), CLAYS[name]
    B = np.zeros((len(record.t), 2, 2))
    c, s = np.cos(clay.angle), np.sin(clay.angle)
    R = np.array(((c, -s), (s, c)))
    for k, b in enumerate(record.b):
        B[k] = R @ np.diag(b) @ R.T
    viscous = np.einsum("kij,kj->ki", B, record.v)
    # samples on a border have the mean of both sides; past it, rounding of a few sums
    off = np.abs(record.fe - viscous).max(axis=1) > 1e-9 * np.abs(record.fe).max()
    assert (off.sum() <= 2 * len(record.crossings)) == clay.viscous
    if not clay.holding:
        assert not record.held().any()
    inside = clay.here(INSIDE)
    assert inside and not clay.here((-0.5, 5.0)) or name == "smooth"


def test_clay_that_holds_says_with_how_much():
    """Pushed by less than it says, it holds for good; by more, it lets go."""
    for name in ("yield by axis", "yield along the motion", "groove"):
        hold = CLAYS[name].hold(0)
        for share, stays in ((0.9, True), (1.2, False)):
            push = (share * hold.force, 0.0)
            s = scene(name, force=push, start=(0.04, 0.0), t_max=0.3, length=None)
            assert hc.simulate(s).held()[-1].all() == stays, (name, share)


@pytest.mark.parametrize("name", CLAYS)
def test_the_hardest_clay_has_the_darkest_shade(name):
    clay = CLAYS[name]
    x, y = np.meshgrid(np.linspace(-0.01, 0.1, 45), np.linspace(-0.03, 0.03, 13))
    share = palette.clay_share(clay, x, y)
    assert share.min() >= 0.0 and share.max() == pytest.approx(1.0, abs=0.2 * bool(clay.smooth))
    some = np.vectorize(lambda x, y: bool(clay.here((x, y))))(x, y)
    if name != "groove":  # whose tool touches it from outside
        np.testing.assert_array_equal(share > 0.0, some)


def test_a_law_added_is_shown_everywhere(monkeypatch):
    """Words, column, hold, shade: nothing but the law's own answers has to be written."""
    stick = Law(
        "stick", "clay", lambda c: True, viscous=False, of_velocity=False, seen_in_b=False,
        columns=(Column("grip", "N/mm"),), words=lambda c: (Quantity("grip = {}", (7.0,), "N/mm"),),
        here=lambda c, place: (Quantity("grip = {}", (7.0,), "N/mm"),) * (0.02 < place[0] < 0.06),
        at=lambda law, place: (7.0,), force=lambda law, speed, dent: 500.0 * (law.damping > 0.0),
        holds=lambda c, i: Hold(7.0, "grip"),
    )  # fmt: skip
    monkeypatch.setattr(clay_module, "LAWS", (*LAWS, stick))
    clay = hc.Clay(PLAIN, PLAIN)
    s = dataclasses.replace(hc.constant_cut(t_max=0.6), clay=clay)
    record = hc.simulate(s)
    assert "grip = 7 N/mm" in clay_text(clay) and "grip = 7 N/mm" in " ".join(scenario_parts(s))
    assert clay_here(s, INSIDE, (20.0, 20.0)) == "grip = 7 N/mm, b = 20 N.s/m here"
    head, _, row = run_table(record).partition("\n---")
    assert "grip" in head and "[N/mm]" in head and "held" in head and " 7 " in row
    assert record.regions("x")[0]["x"]["grip"] == 7.0
    assert record.expected_speed("x", np.arange(3)) is None
    assert not clay.viscous_at(INSIDE) and clay.viscous_at((0.0, 0.0)) and clay.hold(0).force == 7.0
    assert palette.cutting_force(clay) == 500.0 + 20.0 * palette.SHADED[0]
    assert set(run_figures.figures(record)) == {"velocity", "force"}


@pytest.mark.parametrize("name", CLAYS)
def test_a_law_says_how_it_is_scaled(name):
    """Half the clay resists half as much where its law is a multiple of its numbers."""
    clay = CLAYS[name]
    half = clay.scaled(0.5)
    assert [x.name for x in half.kinds] == [x.name for x in clay.kinds]
    assert half.at(*INSIDE).tolist() == (0.5 * clay.at(*INSIDE)).tolist()
    assert half.fastest == 0.5 * clay.fastest
    for i in (0, 1):
        assert half.hold(i).force == pytest.approx(0.5 * clay.hold(i).force, rel=1e-12)
    if name != "springs":  # their stiffness stays
        rest, halved = (c.laws[0].forces(c.kinds, 0.3, 0.01) for c in (clay, half))
        np.testing.assert_allclose(halved, 0.5 * rest, rtol=1e-12)
