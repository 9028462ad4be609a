import bisect
import math
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.errors import ParameterError
from hapticclay.formulas import damping
from hapticclay.formulas.regions import END, enter_region, is_identical, region_of, smooth_clay
from hapticclay.model import clay
from hapticclay.model.cells import Grid, Profile
from hapticclay.model.clay import Clay
from hapticclay.model.regions import keep_entries, region_table
from hapticclay.model.smooth import Smooth
from tests.oracles.spline import even_spline

SLAB = Profile((0.05, 0.15), (0.0, 90.0, 0.0))


places = st.floats(-1.0, 1.0) | st.sampled_from([-0.5, 0.0, 0.05, 0.15, 0.5])


@given(st.lists(places, max_size=9, unique=True).map(sorted), places, places)
def test_a_place_is_in_the_region_between_the_borders_around_it(edges, x, y):
    grid = Profile(tuple(edges), (1.0,) * (len(edges) + 1))
    table = region_table(Clay(grid, Profile((0.05,), (1.0, 2.0), "y")), None)
    assert region_of(table, (x, y)) == (bisect.bisect_right(edges, x), int(y >= 0.05))


def regions(damping, length, x=0.0, y=0.0):
    """The region around a place: the table, its indices, and a function that enters a region."""
    table = region_table(damping, length)
    return table, region_of(table, (x, y)), lambda ix, iy, t=0.0: enter_region(table, ix, iy, t)


def test_regions_of_the_slab():
    table, at, enter = regions(clay.slab(90.0, 0.05, 0.15), 0.20)
    assert at == (0, 0) and table[END] == 0.20
    ways = [(low[0], high[0], b) for low, high, b, _ in (enter(i, 0) for i in range(3))]
    assert ways == [
        (-np.inf, 0.05, (0.0, 0.0)),
        (0.05, 0.15, (90.0, 90.0)),
        (0.15, 0.20, (0.0, 0.0)),
    ]


@pytest.mark.parametrize(
    "p,b", [((0.05, 0.0), 90.0), ((0.049, 0.0), 0.0), ((0.1, 0.3), 90.0), ((0.15, 0.0), 0.0)]
)
def test_regions_from_any_start(p, b):
    _, at, enter = regions(clay.slab(90.0, 0.05, 0.15), 0.2, *p)
    assert enter(*at)[2] == (b, b)


def test_each_axis_follows_its_own_coordinate():
    both = Clay(Profile((0.05,), (50.0, 100.0), "x"), Profile((0.05,), (50.0, 200.0), "y"))
    _, at, enter = regions(both, None)
    assert at == (0, 0)
    assert [enter(*i)[2] for i in ((0, 0), (0, 1), (1, 1))] == [
        (50.0, 50.0),
        (50.0, 200.0),
        (100.0, 200.0),
    ]


def test_clay_grows_from_its_first_entry():
    both = Profile((0.05,), (10.0, 20.0), "x", growth=(1.0, 3.0))
    _, _, enter = regions(Clay(both, both), None)
    for t in (2.0, 5.0):  # the second time, it has grown since the first
        _, _, base, rate = enter(1, 0, t)
        assert damping.damping_at(base, rate, 6.0) == (20.0 + 3.0 * 4.0,) * 2


@pytest.mark.parametrize(
    "edges,values,along",
    [
        ((0.1, 0.05), (0, 1, 0), "x"),
        ((0.1,), (1.0,), "x"),
        ((0.1,), (0.0, -1.0), "x"),
        ((0.1,), (0.0, 1.0), "z"),
        ((float("nan"),), (0.0, 1.0), "x"),
        (None, (0.0,), "x"),
        ((0.1,), (0.0, 1e12), "x"),
    ],
)
def test_bad_profiles_are_refused(edges, values, along):
    with pytest.raises(ParameterError, match="clay"):
        Profile(edges, values, along)


def test_a_grid_has_its_cells_where_they_belong():
    grid = Grid((0.0, 1.0), (0.5,), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    both = Clay(grid, Profile((0.5,), (7.0, 8.0)))
    assert both.along == "xy" and both.edges == ((0.0, 0.5, 1.0), (0.5,)) and both.largest == 8.0
    x, y = np.array([-1.0, 0.2, 0.7, 2.0]), np.array([[0.0], [1.0]])
    first = [[1.0, 3.0, 3.0, 5.0], [2.0, 4.0, 4.0, 6.0]]
    np.testing.assert_array_equal(both.at(x, y), [first, [[7.0, 7.0, 8.0, 8.0]] * 2])
    for i, at in enumerate(x):
        for j, across in enumerate(y[:, 0]):
            _, here, enter = regions(both, None, at, across)
            assert enter(*here)[2] == (first[j][i], (7.0, 7.0, 8.0, 8.0)[i])
    assert grid.within((-1.0, 0.0), (0.5, 0.2)) == [1.0, 3.0]
    inf = np.inf
    assert grid.within((-inf, -inf), (inf, inf)) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_borders_between_cells_alike_are_none():
    grid = Grid((0.0, 1.0), (0.5,), [[1.0, 2.0], [1.0, 2.0], [1.0, 3.0]])
    table = region_table(Clay(grid, grid), 2.0)
    assert is_identical(table, 0, 0, 0, 1) and is_identical(table, 1, 0, 0, -1)
    assert is_identical(table, 1, 0, 0, 1) and not is_identical(table, 1, 1, 0, 1)
    assert not is_identical(table, 0, 0, 1, 1)  # other clay
    assert not is_identical(table, 0, 0, 0, -1) and not is_identical(table, 0, 1, 1, 1)  # no end
    assert not is_identical(table, 2, 0, 0, 1)  # the end of the path
    growing = Grid((0.0,), (), [[1.0], [1.0]], [[2.0], [2.0]])
    assert not is_identical(region_table(Clay(growing, growing), None), 0, 0, 0, 1)
    layers = Profile((0.0,), (1.0, 1.0))  # whose borders are all reported
    assert not is_identical(region_table(Clay(layers, layers), None), 0, 0, 0, 1)


def test_growth_is_kept_where_the_damping_alone_changes():
    clay = lambda b: Clay(Profile((0.05,), (b, b), growth=(1.0, 3.0)), Profile((), (b,)))  # noqa: E731
    before, after = (region_table(clay(b), None) for b in (10.0, 20.0))
    enter_region(before, 1, 0, 2.0)
    keep_entries(after, before)
    assert enter_region(after, 1, 0, 9.0)[2] == (20.0 - 2.0 * 3.0, 20.0)


def test_a_function_is_taken_at_the_centres_of_the_cells():
    grid = Grid.of_function(lambda x, y: 100.0 * x + y, (0.0, 0.2, 0.6), (1.0, 2.0), outside=5.0)
    assert grid.x_edges == (0.0, 0.2, 0.6) and grid.y_edges == (1.0, 2.0)
    assert grid.values[0] == grid.values[3] == (5.0, 5.0, 5.0)
    assert grid.values[1] == (5.0, pytest.approx(11.5), 5.0)
    assert grid.values[2] == (5.0, pytest.approx(41.5), 5.0)


def test_the_top_row_of_an_image_lies_at_the_largest_y():
    grid = Grid.of_image([[0.0, 0.25, 0.5], [1.0, 0.0, 0.0]], (0.0, 0.3), (-1.0, 1.0), (10.0, 90.0))
    both = Clay(grid, grid)
    at = lambda x, y: both.at(x, y)[0].item()  # noqa: E731
    assert at(0.05, 0.5) == 10.0 and at(0.15, 0.5) == 30.0 and at(0.25, 0.5) == 50.0
    assert at(0.05, -0.5) == 90.0 and at(0.15, -0.5) == 10.0
    assert at(-0.05, 0.5) == at(0.35, 0.5) == at(0.05, 1.5) == at(0.05, -1.5) == 0.0


@given(st.integers(0, 3), st.integers(0, 3), st.integers(0, 10**6))
def test_regions_of_random_clay_are_those_of_the_place(n, m, seed):
    """What the table says of a place is what the laws say, whatever borders the axes have."""
    random = Random(seed)
    draw = lambda k: sorted(random.uniform(-1.0, 1.0) for _ in range(k))  # noqa: E731
    values = [[random.uniform(0.0, 9.0) for _ in range(m + 1)] for _ in range(n + 1)]
    grid, way = Grid(draw(n), draw(m), values), random.choice("xy")
    layers = Profile(draw(m), [random.uniform(0.0, 9.0) for _ in range(m + 1)], way)
    both = Clay(*random.sample([grid, layers], 2))
    for _ in range(9):
        p = random.uniform(-1.2, 1.2), random.uniform(-1.2, 1.2)
        _, here, enter = regions(both, None, *p)
        low, high, base, _ = enter(*here)
        assert base == tuple(both.at(*p).tolist())
        assert all(a <= x < b for a, x, b in zip(low, p, high, strict=True))


@pytest.mark.parametrize(
    "make,said",
    [
        (
            lambda: Grid((1.0, 0.0), (), [[1.0]] * 3),
            r"clay.x_edges = \(1.0, 0.0\): must be strictl",
        ),
        (lambda: Grid((), (0.0, 0.0), [[1.0] * 3]), "clay.y_edges = .*: must be strictly ascend"),
        (lambda: Grid((0.0,), (), [[1.0, 2.0]]), r"clay.values = .*: must have shape \(2, 1\), on"),
        (lambda: Grid((0.0,), (), []), r"clay.values = .*: must have shape \(2, 1\)"),
        (
            lambda: Grid((0.0,), (), [[1.0], [-2.0]]),
            r"clay.values\[1, 0\] = -2.0: .* >= 0 and <= 1",
        ),
        (lambda: Grid((0.0,), (), [[1.0], [np.nan]]), r"clay.values\[1, 0\] = nan: .* N.s/m"),
        (lambda: Grid((0.0,), (), [[1.0], [2.0, 3.0]]), "clay.values = .*: must be rows of num"),
        (lambda: Grid((0.0,), (), [["a"], ["b"]]), "clay.values = .*: must be rows of numbers"),
        (lambda: Grid((0.0,), (), [1.0, 2.0]), "clay.values = .*: must be rows of numbers"),
        (lambda: Grid((), (), [[1.0]], [[1.0, 2.0]]), r"clay.growth = .*: must have shape \(1, 1"),
        (lambda: Grid((), (), [[1.0]], [[2e9]]), r"clay.growth\[0, 0\] = 2000000000.0: .* per s"),
        (lambda: Clay(1, 2), "clay.x = 1: must be a Profile or a Grid"),
        (lambda: Clay(SLAB, SLAB, 4.0), "clay.angle = 4.0: .*3.14159 rad"),
        (
            lambda: Grid.of_function(max, (0.0,), (0.0, 1.0)),
            "clay.x_edges = .*: must have at least two edges",
        ),
        (
            lambda: Grid.of_function(lambda x, y: -1.0, (0, 1), (0, 1)),
            r"clay.values\[1, 1\] = -1.0",
        ),
        (lambda: Grid.of_image([[2.0]], (0, 1), (0, 1), (0, 1)), r"image\[0, 0\] = 2.0: .* <= 1"),
        (
            lambda: Grid.of_image(np.zeros((0, 2)), (0, 1), (0, 1), (0, 1)),
            "image = .*: must have pi",
        ),
        (lambda: Grid.of_image([[1.0]], (1, 0), (0, 1), (0, 1)), "x = .*: must be strictly ascend"),
        (lambda: Grid.of_image([[1.0]], (0, 1), (0, 1), (0, -1)), r"b\[white\] = -1: .* N.s/m"),
        (lambda: Grid.of_image([[1.0]], (0, 1), (0, 1), (0, 1), -1), "outside = -1: .* N.s/m"),
    ],
)
def test_bad_grids_are_refused_by_name(make, said):
    with pytest.raises(ParameterError, match=said):
        make()


@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 99), st.floats(-0.3, 0.4))
def test_smooth_clay_is_the_b_spline_of_its_control_points(n, m, seed, y):
    """In the table of a run too; within the control points, beyond the outline as well."""
    rng = np.random.default_rng(seed)
    spans, other = ((-0.1, 0.2), (0.0, 0.3)), ((0.0, 0.1), (-0.1, 0.1))
    values = rng.uniform(0.0, 90.0, (n, m)), rng.uniform(10.0, 1e6, (m, n))
    laws, b = Smooth(*spans, values[0]), even_spline(*spans, values[0])
    second = Smooth(*other, values[1])
    table = region_table(Clay(laws, second), 0.2)
    for x in rng.uniform(-0.3, 0.5, 5):
        bx, by = smooth_clay(memoryview(table), 3, x, y, 0.0, 0.0)
        assert bx == pytest.approx(b((x, y)), rel=1e-11, abs=1e-11)
        assert by == pytest.approx(even_spline(*other, values[1])((x, y)), rel=1e-11)
        assert values[0].min() * (1.0 - 1e-15) <= bx <= values[0].max() * (1.0 + 1e-15)
        np.testing.assert_array_equal(Clay(laws, second).at(x, y), (bx, by))
        near = laws.within((x, y), (x, y))
        assert min(near) * (1.0 - 1e-15) <= bx <= max(near) * (1.0 + 1e-15)
        assert bool(laws.some[laws.index(x, y)]) == (bx > 0.0)


def test_smooth_clay_of_both_axes_is_tabulated_once():
    law = Smooth((0.0, 1.0), (0.0, 1.0), np.ones((50, 40)))
    both, one = Clay(law, law), Clay(law, Profile((), (1.0,)))
    assert len(region_table(both, None)) < len(region_table(one, None)) < 55 * 45 + 50
    assert both.smooth == 3 and one.smooth == 1 and Clay(one.y, law).smooth == 2
    table = region_table(one, None)
    assert smooth_clay(table, 1, 0.5, 0.5, 7.0, 8.0) == (1.0, 8.0)
    for x, y in ((math.nan, 0.0), (0.0, math.nan), (math.inf, -math.inf)):
        assert smooth_clay(table, 1, x, y, 7.0, 8.0) == (pytest.approx(1.0), 8.0)


def test_a_function_is_taken_at_the_nodes_and_smoothed():
    """A cubic B-spline of samples is b + h^2/6 (b_xx + b_yy) of a quadratic, exactly."""
    law = Smooth.of_function(
        lambda x, y: 5.0 + x * x + 3.0 * y + y * y, (0.0, 2.0), (-1.0, 1.0), (11, 5)
    )
    assert law.values[5][2] == 6.0 and law.damping.shape == (11, 5)
    assert law.at(1.1, 0.2) == pytest.approx(6.21 + 0.64 + (0.04 + 0.25) / 3.0, rel=1e-12)


def test_the_nodes_of_an_image_are_the_centres_of_its_pixels():
    law = Smooth.of_image([[0.0, 1.0], [0.5, 0.25]], (0.0, 0.2), (0.0, 0.4), (10.0, 20.0))
    assert law.x == pytest.approx((0.05, 0.15)) and law.y == pytest.approx((0.1, 0.3))
    assert law.values == ((15.0, 10.0), (12.5, 20.0))  # the top row lies at the largest y
    line = Smooth.of_image([[0.0, 1.0]], (0.0, 0.2), (0.0, 0.4), (10.0, 20.0))
    assert line.values == ((10.0,), (20.0,)) and line.y == (0.0, 0.4) and line.along == "x"


@pytest.mark.parametrize(
    "make,said",
    [
        (lambda: Smooth((0.1, 0.0), (0, 1), [[1.0]]), "clay.x = .*strictly ascending"),
        (lambda: Smooth((0, 1), (1.0, 1.0), [[1.0]]), "clay.y = .*strictly ascending"),
        (lambda: Smooth((0, 1), (0, 1), [[1.0, -2.0]]), r"clay.values\[0, 1\] = -2.0: must"),
        (lambda: Smooth((0, 1), (0, 1), [[1.0, 2.0], [3.0]]), "clay.values"),
        (lambda: Smooth((0, 1), (0, 1), []), "clay.values = .*a node or more each way"),
        (lambda: Smooth((0, 1, 2), (0, 1), [[1.0]]), "clay.x"),
        (lambda: Smooth.of_function(lambda x, y: -x, (0, 1), (0, 1), (2, 2)), "clay.values"),
        (lambda: Smooth.of_function(max, (0, 1), (0, 1), (0, 2)), r"nodes\[x\] = 0"),
        (
            lambda: Smooth.of_function(max, (0, 1), (0, 1), (2, 2.5)),
            r"nodes\[y\] = 2.5",
        ),
        (lambda: Smooth.of_image([[2.0]], (0, 1), (0, 1), (0, 1)), "image"),
        (lambda: Smooth.of_image([[0.5]], (1, 0), (0, 1), (0, 1)), "x = .*strictly ascending"),
        (lambda: Smooth.of_image([[0.5]], (0, 1), (0, 1), (0, -1)), r"b\[white\] = -1"),
    ],
)
def test_bad_smooth_clay_is_refused_by_name(make, said):
    with pytest.raises(ParameterError, match=said):
        make()
