"""Clay that stays cut, against the geometry of a disc on its path."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import groove
from tests.hunt import some
from tests.oracles.raster import raster

FIELDS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta", "ground")
TOOL = hc.Tool(0.01, 0.005)
WIDTH, DEPTH, RADIUS = TOOL.width, TOOL.depth, 0.5 * TOOL.width
PRESSURE = 20e3  # 1 N on the whole tool
BLOCK = hc.Groove(x=(-0.03, 0.07), y=(-0.03, 0.03), pressure=PRESSURE)
EVERYWHERE = (hc.Profile((), (1.0,)),) * 2  # clay, for the oracle


def grooved(block, **more):
    """A push without a hand along x, in a block of clay and free space."""
    clay = hc.Clay.of_groove(block)
    return dataclasses.replace(hc.free(force=(2.0, 0.0)), **{"clay": clay, "length": 0.06, **more})


def led(block, stops, speed=0.05, **more):
    """The handle led from place to place by the command; its servo gives way by 1 mm or so."""
    ways = np.hypot(*np.diff(stops, axis=0).T)
    t = np.concatenate(((0.0,), np.cumsum(ways))) / speed
    command = hc.Samples(tuple(t), tuple(stops))
    t_max = float(t[-1]) + 0.1
    still = dict(force=(0, 0), gain=(0, 0), length=None, inertia_shaping=True)
    return grooved(block, command=command, t_max=t_max, **still, **more)


class Cutter:
    """The laws alone: a tool put from place to place."""

    def __init__(self, block):
        self.block = block
        self.left, self.rim = block.shares.ravel().copy(), np.zeros(groove.RIM)
        self.sums = np.zeros(2)
        self.arrays = memoryview(self.left), memoryview(np.ravel(block.relief))
        self.whole = 1

    def put(self, x, y):
        groove.cut(self.block.numbers, *self.arrays, x, y, self.whole, self.rim, self.sums)
        self.whole = 0
        return self

    def force(self, x, y):
        return groove.resistance(self.rim, x, y)[0]

    @property
    def removed(self):
        return float(self.sums.sum())


def same(a, b):
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field), err_msg=field)
    np.testing.assert_array_equal(a.extra["removed"], b.extra["removed"])
    assert a.outcome == b.outcome and a.energy == b.energy and a.stops == b.stops
    assert a.crossings == b.crossings


@pytest.mark.parametrize("angle", some([0.3, 0.0, 1.9, math.pi / 4], 2))
def test_a_straight_cut_presses_with_its_cross_section(angle):
    """Width x depth x pressure, whatever the direction and the place among the cells."""
    c, s = math.cos(angle), math.sin(angle)
    most = {8: 4e-3, 16: 2e-3, 32: 1.5e-3}
    for n, limit in most.items():
        block = dataclasses.replace(BLOCK, y=(-0.05, 0.05), cells=(10 * n, 10 * n))
        tool, errors = Cutter(block), []
        begin = np.arange(-1.1 * RADIUS, 0.0, 0.5 * WIDTH / n)
        for way in (*begin, *np.arange(0.0, 0.008, 0.13 * WIDTH / n)):
            tool.put(0.02 + way * c, way * s)
            if way > 0.0:
                errors.append(tool.force(c, s) / block.hardest - 1.0)
                assert tool.force(-c, -s) < 5e-3 * block.hardest  # of sectors that look sideways
        assert np.abs(errors).max() < limit and abs(np.mean(errors)) < 0.5 * limit


def test_the_volume_is_that_of_the_disc_on_its_path():
    """Second order in the cell, from a straight path with round ends, on the skew."""
    length, errors, cells = 0.03, [], np.array([8, 16, 32])
    exact = (WIDTH * length + math.pi * RADIUS**2) * DEPTH
    for n in cells:
        block = dataclasses.replace(BLOCK, y=(-0.05, 0.05), cells=(10 * n, 10 * n))
        tool = Cutter(block)
        for way in np.arange(0.0, 1.0 + 1e-9, 0.25 * WIDTH / n / length):
            tool.put(way * 0.8 * length, way * 0.6 * length)
        errors.append(abs(tool.removed / exact - 1.0))
    order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert 1.7 < order < 2.6 and errors[-1] < 4e-4, errors


@pytest.mark.parametrize("offset", [0.25, 0.5, 0.75])
def test_a_cut_beside_meets_what_is_left(offset):
    """Of a groove as wide as the tool, the part beyond its edge: offset over width."""
    tool = Cutter(dataclasses.replace(BLOCK, cells=(240, 144)))
    for x in np.arange(-0.01, 0.06, 4e-4):
        tool.put(x, 0.0)
    tool.whole = 1
    places = np.arange(0.01, 0.05, 1.3e-4)
    forces = [tool.put(x, offset * WIDTH).force(1.0, 0.0) for x in places][80:]
    forces = np.array(forces) / BLOCK.hardest
    assert np.mean(forces) == pytest.approx(offset, rel=3e-3)
    # where it meets the wall, a cell either resists or does not
    assert np.abs(forces - offset).max() < 0.75 / 24


def test_what_was_cut_stays_cut():
    """Along a groove, back, along it again, and half a width beside it."""
    y = 0.5 * WIDTH
    stops = [(0, 0), (0.04, 0), (0, 0), (0.04, 0), (0.04, y), (0, y)]
    r = hc.simulate(led(BLOCK, stops))
    assert r.status.startswith("time limit")
    x, fx = r.p[:, 0], r.fe[:, 0]
    middle = (x > 0.012) & (x < 0.03)

    def passing(begin, end):  # by the times of the command at those stops
        t = np.array([0.0, *np.cumsum(np.hypot(*np.diff(stops, axis=0).T))]) / 0.05
        return middle & (r.t > t[begin] + 0.01) & (r.t < t[end])

    np.testing.assert_allclose(fx[passing(0, 1)], 1.0, atol=5e-3)
    for along in (passing(1, 2), passing(2, 3)):
        assert along.any() and np.abs(fx[along]).max() < 0.01  # 1 % of the first
    beside = passing(4, 5)
    left = r.p[beside, 1] / WIDTH  # the handle lags behind the command by some 0.1 mm
    np.testing.assert_allclose(left, 0.5, atol=0.04)
    np.testing.assert_allclose(fx[beside], -left, atol=0.75 / 20)  # a cell of 20, as above
    assert np.mean(fx[beside] + left) == pytest.approx(0.0, abs=5e-3)
    exact = raster(EVERYWHERE, r.p, WIDTH, DEPTH)
    assert r.extra["removed"][-1] == pytest.approx(exact, rel=2e-3)  # of cells and raster


@pytest.mark.parametrize("seed", some(range(3), 2))
def test_the_removed_volume_is_that_of_the_oracle(seed):
    """Of a random path that crosses itself."""
    rng = np.random.default_rng(seed)
    stops = np.concatenate((np.zeros((1, 2)), rng.uniform(-0.02, 0.02, (5, 2))))
    r = hc.simulate(led(BLOCK, stops.tolist(), speed=0.4))
    exact = raster(EVERYWHERE, r.p, WIDTH, DEPTH)
    assert r.extra["removed"][-1] == pytest.approx(exact, rel=3e-3)
    assert (np.diff(r.extra["removed"]) >= 0.0).all()


ways = st.lists(
    st.tuples(*[st.floats(-0.004, 0.004, allow_nan=False)] * 2), min_size=1, max_size=30
)


@given(ways, st.floats(0.0, 1e6), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_removed_and_left_are_the_whole(steps, gradient, seed):
    """To rounding, in a block of any heights that the tool enters and leaves anywhere."""
    heights = np.random.default_rng(seed).uniform(0.0, 0.01, (20, 16))
    block = hc.Groove(
        (-0.01, 0.0133), (-0.008, 0.009), 1e4, gradient, cells=(20, 16), heights=heights,
        tool=hc.Tool(0.0123, 0.005),
    )  # fmt: skip
    tool, x, y, before = Cutter(block), 0.0, 0.0, block.shares.ravel()
    for dx, dy in [(0.0, 0.0), *steps]:
        x, y = x + dx, y + dy
        tool.put(x, y)
        assert tool.force(dx, dy) >= 0.0 and (tool.left <= before).all()
        assert tool.force(dx, dy) <= 1.01 * block.hardest
        before = tool.left.copy()
    ground = tool.left.reshape(block.relief.shape) * block.relief
    total = math.fsum([tool.removed, block.volume(ground)])
    assert abs(total - block.volume()) <= 4e-16 * 320 * block.volume()  # a rounding a cell
    assert abs(total - block.volume()) <= 1e-15 * block.volume()  # they cancel but for a few


def test_a_run_conserves_the_volume():
    r = hc.simulate(grooved(BLOCK))
    total = math.fsum([r.extra["removed"][-1], BLOCK.volume(r.ground)])
    assert abs(total - BLOCK.volume()) <= 1e-15 * BLOCK.volume()
    assert BLOCK.volume() == pytest.approx(0.1 * 0.06 * DEPTH, rel=1e-15)


def test_the_work_is_that_of_the_volume():
    """Pressure x volume: of second order in the step, whatever the cell."""
    for cells in (None, (80, 48)):
        block, errors, steps = dataclasses.replace(BLOCK, cells=cells), [], (4e-4, 2e-4, 1e-4)
        for dt in steps:
            r = hc.simulate(grooved(block, dt=dt))
            volume = np.ptp(r.extra["removed"])  # without the hole of the tool at the start
            errors.append(abs(r.energy["clay"] / (PRESSURE * volume) - 1.0))
            assert abs(r.energy["residual"]) < 1e-14
        # sectors of the tool's front, and clay let go of at its sides: 3e-4 at any step
        assert max(errors) < 1e-3, errors


def test_sampled_control_tends_to_the_continuous():
    """Of first order in the sample; what is removed, too, whoever renders the clay."""
    more = dict(force=(2.5, 0.5), t_max=0.1)
    first = hc.simulate(grooved(BLOCK, dt=1e-4, **more))
    assert first.p[-1, 0] > 2e-3
    for render in ("held", "physical"):
        errors = []
        for dt in (4e-4, 2e-4):
            r = hc.simulate(grooved(BLOCK, dt=dt, control="sampled", render=render, **more))
            errors.append(np.abs(r.p[-1] - first.p[-1]).max())
            total = math.fsum([r.extra["removed"][-1], BLOCK.volume(r.ground)])
            assert abs(total - BLOCK.volume()) <= 1e-15 * BLOCK.volume()
        assert errors[0] < 1e-4 and errors[1] < 0.6 * errors[0], errors


@pytest.mark.parametrize("control", [{}, dict(control="sampled", render="physical")])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_it_holds_the_tool_below_its_strength(angle, control):
    """Not a bit of motion below, from rest in fresh clay; and motion above."""
    for share, moves in ((0.99, False), (1.01, True)):
        force = share * BLOCK.hardest * math.cos(angle), share * BLOCK.hardest * math.sin(angle)
        t_max = 0.12 if moves else 0.05
        r = hc.simulate(grooved(BLOCK, force=force, t_max=t_max, length=None, **control))
        assert (np.ptp(r.p, axis=0).max() > 1e-5) == moves
        if not moves:
            assert np.ptp(r.p) == np.ptp(r.p[0]) and (r.v == 0.0).all()
            held = np.broadcast_to(force, r.fe.shape)
            np.testing.assert_allclose(r.fe, held, atol=1e-12)  # rounding of the servo's law
            assert r.stops and r.stops[-1].axis == "xy" and r.stops[-1].end is None


def test_it_lets_the_tool_go_back():
    """Pushed into the clay and held there, it is free to leave by its groove."""
    pulse = hc.Samples((0.0, 0.2, 0.21, 0.7), ((1.5, 0), (1.5, 0), (-0.3, 0), (-0.3, 0)))
    own = dict(force=(0, 0), muscle=pulse, length=None, inertia_shaping=True)
    r = hc.simulate(grooved(BLOCK, t_max=0.7, dt=1e-3, **own))
    far = r.p[:, 0].max()
    back = (r.t > 0.35) & (r.p[:, 0] > 1e-3) & (r.p[:, 0] < far - 1e-3)
    assert far > 5e-3 and back.any() and np.abs(r.fe[back]).max() < 0.01


def test_it_hardens_with_depth_and_follows_the_ground():
    n, m = BLOCK.shape
    slope = np.repeat(np.linspace(0.0, DEPTH, n)[:, None], m, axis=1)
    block = dataclasses.replace(BLOCK, pressure=1e4, gradient=4e6, heights=slope)
    r = hc.simulate(led(block, [(0.0, 0.0), (0.04, 0.0)], speed=0.02))
    i = (r.p[:, 0] > 0.005) & (r.v[:, 0] > 0.01)
    front = r.p[i, 0] + 0.25 * math.pi * RADIUS  # mean over a half circle, of a linear ground
    h = DEPTH * (front - block.x[0]) / 0.1
    expected = WIDTH * (1e4 * h + 0.5 * 4e6 * h * h)
    np.testing.assert_allclose(r.fe[i, 0], expected, rtol=2e-2)


def test_it_damps_by_the_volume_rate():
    """b = damping x cross-section, gone where the clay is."""
    block = dataclasses.replace(BLOCK, pressure=0.0, damping=1e6)
    b = 1e6 * WIDTH * DEPTH
    s = grooved(block, force=(0.5, 0.0), inertia_shaping=True)
    r = hc.simulate(s)
    late = (r.p[:, 0] > 0.01) & (r.p[:, 0] < 0.055)
    np.testing.assert_allclose(r.b[late], b, rtol=3e-3)
    np.testing.assert_allclose(r.fe, r.b * r.v, rtol=1e-12, atol=1e-15)
    steady = 0.5 / (b + 10.0)  # K f/(10 + K b)
    assert r.v[late, 0][-1] == pytest.approx(steady, rel=5e-3)
    again = hc.simulate(dataclasses.replace(s, clay=hc.Clay.of_groove(block.after(r.ground))))
    assert again.b[:-1].max() < 0.01 * b  # at its very end the wall
    assert again.extra["removed"][-1] < 1e-3 * r.extra["removed"][-1]


VARIANTS = {
    "plain": (BLOCK, {}),
    "hand": (
        BLOCK,
        dict(
            operator=hc.Operator(),
            inertia_shaping=True,
            force=(4.0, 1.0),
            muscle=hc.Multisine(rms=(2.0, 2.0), high=4.0),
            length=None,
        ),
    ),
    "limit": (BLOCK, dict(torque_limit=(0.3, 0.2), force=(2.5, 1.5))),
    "layers": (dataclasses.replace(BLOCK, damping=1e5, gradient=1e6), dict(force=(3.0, 1.0))),
    "long": (BLOCK, dict(dt=1.5e-3, force=(3.0, 1.0))),
    "held": (BLOCK, dict(control="sampled", force=(2.5, 0.5))),
    "late": (
        dataclasses.replace(BLOCK, damping=2e5),
        dict(
            control="sampled",
            render="physical",
            hardware=hc.Hardware(delay=2e-4, encoder=8192),
            force=(2.5, 0.5),
        ),
    ),
}


def variant(name):
    block, more = VARIANTS[name]
    s = grooved(block, **{"t_max": 0.12, **more})
    if name == "layers":
        law = hc.Profile((0.005, 0.02), (0.0, 40.0, 10.0))
        s = dataclasses.replace(s, clay=hc.Clay(law, law, angle=0.3, groove=block))
    return s


@pytest.mark.parametrize("name", VARIANTS)
def test_it_never_gives_energy(name):
    r = hc.simulate(variant(name))
    assert np.ptp(r.extra["removed"]) > 0.0
    assert (np.einsum("ij,ij->i", r.fe, r.v) >= 0.0).all()
    assert r.energy["clay"] > 0.0 or name == "held"  # the work of held clay is the motors'
    # a hand is no part of the balance of a kick but for its order
    assert abs(r.energy["residual"]) < (1e-6 if name == "hand" else 1e-13)


def test_step_by_step_with_a_look_at_each():
    """What a look works out, the clay forgets."""
    s = grooved(BLOCK, t_max=0.1, force=(3.0, 0.5))
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            _ = sim.state.v
            sim.step()
    same(sim.record(), hc.simulate(s, engine="python"))


def test_a_record_keeps_it(tmp_path):
    r = hc.simulate(grooved(BLOCK, t_max=0.1), every=7)
    read = hc.Record.load(r.save(tmp_path))
    same(read, r)
    assert read.scenario == r.scenario == hc.Scenario.load(tmp_path / "scenario.toml")
    assert [len(e) for e in BLOCK.edges] == [n + 1 for n in read.ground.shape]


def test_its_numbers_take_units_and_names():
    s = hc.with_fields(grooved(BLOCK), {"clay.groove.pressure": "30 kPa"})
    assert s.clay.groove == dataclasses.replace(BLOCK, pressure=30e3)
    s = hc.with_fields(grooved(BLOCK), {"clay.groove.tool.depth": "2 mm"})
    assert s.clay.groove.tool == hc.Tool(WIDTH, 2e-3)
    assert hc.with_fields(s, {"clay.groove": "none"}).clay.groove is None


def test_a_block_of_a_material_presses_as_its_flow():
    block = hc.Groove.of_material("stiff clay", (0.0, 0.1), (-0.02, 0.02), TOOL)
    assert block.hardest == pytest.approx(hc.materials.material("stiff clay", TOOL).Fy, rel=1e-14)
    with pytest.raises(ParameterError, match="without K"):
        hc.Groove.of_material("printable paste", (0.0, 0.1), (-0.02, 0.02), TOOL)


@pytest.mark.parametrize(
    "change, match",
    [
        (dict(x=(0.1, 0.0)), r"groove.x"),
        (dict(cells=(10, 10)), r"must be 80 by 48 or more"),
        (dict(cells=(100.5, 100)), r"cells\[x\].*whole"),
        (dict(cells=(3000, 3000)), r"4000000"),
        (dict(heights=np.ones((3, 3)) * 1e-3), r"groove.heights.*shape \(200, 120\)"),
        (dict(left=np.ones((200, 120)) * 2.0), r"groove.left\[0, 0\]"),
        (dict(pressure=-1.0), r"groove.pressure"),
        (dict(pressure=0.0), r"groove.pressure.*would not resist"),
        (
            dict(
                pressure=1e8, gradient=1e9, heights=np.full((20, 12), 0.1), tool=hc.Tool(0.1, 0.025)
            ),
            r"groove.pressure.*1e\+06 N",
        ),
        (dict(damping=1e12, tool=hc.Tool(0.1, 0.025)), r"groove.damping.*1e\+09 N.s/m"),
    ],
)
def test_a_block_that_is_none_is_refused(change, match):
    with pytest.raises(ParameterError, match=match):
        dataclasses.replace(BLOCK, **change)


def test_what_it_does_not_go_with_is_refused():
    soft = hc.Profile((), (10.0,))
    for law in (
        hc.Profile((), (0.0,), Fy=(1.0,)),
        hc.Profile((), (0.0,), growth=(1.0,)),
        hc.Smooth((0.0, 0.1), (0.0, 0.1), [[10.0]]),
    ):
        with pytest.raises(ParameterError, match=r"clay.groove.*with laws"):
            hc.Clay(law, soft, groove=BLOCK)
    with pytest.raises(ParameterError, match="integrator .* 'fast' in clay that stays cut"):
        grooved(BLOCK, integrator="accurate")
    for device in (hc.Hardware(passivity=True), hc.Hardware(coupling=hc.Coupling(1e3, 10.0))):
        with pytest.raises(ParameterError, match="hardware .* in clay that stays cut"):
            grooved(BLOCK, control="sampled", hardware=device)
    with pytest.raises(ParameterError, match="dt .* in clay that stays cut where b reaches"):
        grooved(dataclasses.replace(BLOCK, damping=1e9))
    with pytest.raises(ParameterError, match="ground"):
        BLOCK.after(np.zeros((3, 3)))
