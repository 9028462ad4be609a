"""Removed clay against areas known from geometry, and against a raster of points."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.studies.removal import Removal, Tool, removed
from hapticclay.views.stage import Stage
from tests.hunt import HUNTS, some
from tests.oracles import store
from tests.oracles.raster import volumes


@pytest.fixture(scope="module")
def constant():
    return hc.simulate(hc.constant_cut(inertia_shaping=True))


@pytest.mark.parametrize("cell", [0.5e-3, 1e-3, 2e-3, 3.3e-3])
@pytest.mark.parametrize("width,depth", [(0.02, 0.01), (0.033, 0.004)])
def test_straight_cut_removes_width_times_depth_times_length(constant, width, depth, cell):
    volume, rate = removed(constant, width, depth, cell)
    # 1e-3: corners of the round tool on the borders, cut in cells; the path is straight to 1e-6
    assert volume[-1] == pytest.approx(width * depth * 0.10, rel=1e-3)
    inside = (constant.p[:, 0] > 0.08) & (constant.p[:, 0] < 0.12)
    ripple = 5e-3 if 10 * cell <= width else 1e-2  # of the cells
    np.testing.assert_allclose(rate[inside], width * depth * constant.v[inside, 0], rtol=ripple)
    assert np.all(np.diff(volume) >= 0.0)
    assert np.trapezoid(rate, constant.t) == pytest.approx(volume[-1], rel=1e-3)


def test_samples_left_out_change_nothing(constant):
    few = hc.simulate(hc.constant_cut(inertia_shaping=True), every=50)
    assert removed(few)[0][-1] == pytest.approx(removed(constant)[0][-1], rel=1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 1.2])
def test_oblique_stroke_is_a_stadium(angle):
    """Width times length and the round ends, whatever the direction."""
    grid = Removal(hc.variable_cut(), Tool(0.02, 0.01))
    a = np.array([0.03, 0.03])
    b = a + 0.06 * np.array([np.cos(angle), np.sin(angle)])
    area = 0.02 * 0.06 + np.pi * 0.01**2
    assert grid.sweep(a, b) == pytest.approx(0.01 * area, rel=3e-3)  # 45 degrees is the worst
    assert grid.sweep(b, a) == pytest.approx(0.0, abs=1e-12)  # nothing twice


def test_variable_cut_has_the_volume_of_its_path():
    r = hc.simulate(hc.variable_cut())
    length = np.hypot(*np.diff(r.p, axis=0).T).sum()
    volume, rate = removed(r)
    assert volume[-1] == pytest.approx(
        0.01 * (0.02 * length + np.pi * 0.01**2), rel=1e-3
    )  # its bends are gentle
    middle = slice(len(r.t) // 3, len(r.t) // 2)
    np.testing.assert_allclose(
        rate[middle].mean(), 2e-4 * np.hypot(*r.v[middle].T).mean(), rtol=5e-3
    )


def wiggly(n=20_000, amplitude=1e-3, turns=50):
    s = np.linspace(0.0, 1.0, n)
    return np.column_stack((0.2 * s, amplitude * np.sin(2 * np.pi * turns * s)))


def resting(n=3000):
    """At one place for the first half, then on to another, and trembling there by 0.1 mm."""
    rng = np.random.default_rng(4)
    stay, go = np.tile((0.1, 0.0), (n, 1)), np.linspace((0.1, 0.0), (0.105, 0.002), n)
    return np.concatenate((stay, go, go[-1] + 1e-4 * rng.normal(size=(n, 2))))


def diagonal(n=2000):
    return np.linspace((0.02, -0.03), (0.18, 0.11), n)


def curl(n=20_000):
    a = np.linspace(0.0, 6 * np.pi, n)
    return np.column_stack((0.03 + 0.007 * a, np.zeros(n))) + 0.012 * np.column_stack(
        (np.cos(a), np.sin(a))
    )


EVERYWHERE = Clay(Profile((), (90.0,)), Profile((), (90.0,)))
SLAB = Clay(Profile((0.05, 0.15), (0.0, 90.0, 0.0)), Profile((0.05, 0.15), (0.0, 90.0, 0.0)))
# a border that the straight path's tool grazes by a tenth of a millimetre, and thin layers across
BANDS = Clay(
    Profile((0.0213, 0.0337, 0.0612, 0.1401), (0.0, 90.0, 0.0, 90.0, 0.0)),
    Profile((-0.0999, -0.0011, 0.0099), (0.0, 50.0, 0.0, 0.0), along="y"),
)


WIDTHS = 0.004, 0.02, 0.05
CLAYS = {"everywhere": EVERYWHERE, "slab": SLAB, "bands": BANDS}
PATHS = {
    "wiggles": wiggly(),
    "tremor": wiggly(amplitude=0.3e-3, turns=200),
    "straight": wiggly(amplitude=0.0),
    "resting": resting(),
    "still": resting()[:1],
    "diagonal": diagonal(),
    "curl": curl(),
}


CASES = [  # in a hunt each path in each clay with each width
    (path, clay, width)
    for i, path in enumerate(PATHS)
    for j, clay in enumerate(CLAYS)
    for k, width in enumerate(WIDTHS)
    if HUNTS or (i + j + k) % 3 == 0
]


# each path, and each clay with each width
@pytest.mark.parametrize("path, clay, width", some(CASES, 11))
def test_volume_of_any_path_is_that_of_a_raster(constant, path, clay, width):
    """Cells are 1/32 of the width, pieces of the path within 1/2000 of it: 0.15 % at worst.

    The raster errs by 0.05 %.
    """
    scenario = dataclasses.replace(constant.scenario, clay=CLAYS[clay])
    case = [((x.x, x.y), w) for x in CLAYS.values() for w in WIDTHS]
    exact = store.solution(f"raster-{path}", volumes, PATHS[path], case, 0.01).volume
    index, path = list(CLAYS).index(clay) * len(WIDTHS) + WIDTHS.index(width), PATHS[path]
    n = len(path)
    t, zero = 0.36e-3 * np.arange(n), np.zeros((n, 2))
    record = dataclasses.replace(constant, scenario=scenario, t=t, p=path, v=zero)
    volume = removed(record, width)[0]
    assert volume[-1] == pytest.approx(exact[index], rel=3e-3)
    assert np.all(np.diff(volume) >= 0.0)


def test_free_space_has_nothing_to_remove():
    volume, rate = removed(hc.simulate(hc.free(t_max=0.5)))
    assert not volume.any() and not rate.any()


@pytest.mark.parametrize(
    "scenario", [hc.constant_cut(), hc.variable_cut()], ids=["constant", "variable"]
)
def test_the_picture_shows_the_map_that_headless_runs_compute(scenario):
    """Cut frame by frame as a window does (60 a second), against the whole record at once."""
    r = hc.simulate(scenario)
    stage = Stage(scenario)
    n = np.searchsorted(r.t, np.arange(0.0, r.t[-1], 1 / 60.0))
    stage.carve(r.p[np.append(n, len(r.t) - 1)])
    assert stage.removal.volume == pytest.approx(
        removed(r)[0][-1], rel=2e-3
    )  # chords of 1/60 s for arcs
    assert stage.relief() and not stage.relief()
    shown = stage.model.hfield_data.reshape(stage.removal.cut.shape) * 0.03
    cell, full = stage.removal.cell, stage.removal.clay
    np.testing.assert_allclose(
        ((0.03 - shown) * full).sum() * cell**2, stage.removal.volume, rtol=1e-4
    )  # float32


@pytest.mark.parametrize(
    "kw,word", [({"width": 0.0}, "width"), ({"depth": -1.0}, "depth"), ({"cell": 1.0}, "cell")]
)
def test_bad_tool_is_refused(constant, kw, word):
    with pytest.raises(hc.ParameterError, match=word):
        removed(constant, **kw)


def test_build_is_as_bare_as_ever_and_the_picture_weighs_nothing():
    bare, seen = hc.build(hc.constant_cut()), Stage(hc.constant_cut()).model
    assert bare.ngeom == bare.nhfield == bare.nlight == bare.ncam == bare.nmat == 0
    arm = (
        [bare.body(n).id for n in ("link1", "link2")],
        [seen.body(n).id for n in ("link1", "link2")],
    )
    np.testing.assert_array_equal(bare.body_mass[arm[0]], seen.body_mass[arm[1]])
    np.testing.assert_array_equal(bare.body_inertia[arm[0]], seen.body_inertia[arm[1]])
