"""The region of stable walls by runs against a map of one's own, and what theory promises."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from hapticclay.studies import boundary, published_walls, wall_lines, wall_runs
from hapticclay.studies import zwidth as study
from hapticclay.studies.wall import KINDS, DeviceWall, as_wall
from hapticclay.studies.wall_lines import theoretical_damping, worst_hand
from hapticclay.studies.wall_runs import Press, come_to_rest, growth_rates, stiffest
from hapticclay.studies.zwidth import BY_REST, zwidth
from hapticclay.theory import gain_crossings
from hapticclay.views.captions import unit_text
from hapticclay.views.wall_plots import zwidth_plot
from tests.oracles.sampled_wall import sample_map

BARE = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5))
ROUGH = replace(BARE, device=hc.Device(0.1, 0.5, friction=0.02, quantum=5e-5))


@pytest.fixture
def few_points(monkeypatch):
    """Lines of theory with few points between the dampings that are tried."""
    for module, name in ((wall_lines, "LIMIT_POINTS"), (wall_lines, "TOP_POINTS")):
        monkeypatch.setattr(module, name, 5)
    monkeypatch.setattr(published_walls, "LIMIT_POINTS", 5)


def stable(wall):
    z = np.linalg.eigvals(sample_map(wall))
    return np.all(np.abs(z) < 1.0)


def largest_stiffness(wall):
    """By bisection with the map."""
    low, high = 1.0, 1e9
    assert stable(replace(wall, K=low)) and not stable(replace(wall, K=high))
    while high / low > 1.0 + 1e-6:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(replace(wall, K=middle)) else (low, middle)
    return low


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"delay": 1e-3},
        {"delay": 2.6e-3},
        {"velocity": "exact"},
        {"velocity_filter": 60.0, "velocity_window": 4},
        {"operator": Operator(0.3, 2.0, 40.0), "delay": 0.5e-3},
        {"device": hc.Device(2.0, 1.0), "Ts": 2e-4},
        {"device": hc.Device(0.1, 50.0), "Ts": 1e-2},
    ],
    ids=str,
)
@pytest.mark.usefixtures("few_points")
def test_boundary_of_runs_is_that_of_the_sampled_loop(change):
    wall = replace(BARE, **change)
    top = theoretical_damping(as_wall(wall))
    B = (0.0, 0.1 * top, 0.7 * top)
    r = zwidth(wall, B=B).regions[0]
    expected = [largest_stiffness(replace(wall, B=x)) for x in B]
    # the search ends within 0.2 % (boundary.BRACKET), the step of the engine takes 0.1 %
    assert r.K == pytest.approx(expected, rel=3e-3)
    assert r.exact == pytest.approx(expected, rel=1e-5)  # of the bisection
    assert r.gap() < 3e-3 and r.linear and not r.violations()


def test_the_search_is_not_told_where(monkeypatch):
    for module in (study, wall_lines):
        monkeypatch.setattr(module, "exact_limit", lambda wall: 37.0)
    r = zwidth(BARE, B=(1.0,)).regions[0]
    expected = [largest_stiffness(replace(BARE, B=1.0))]
    assert r.K == pytest.approx(expected, rel=3e-3)


def test_growth_of_a_run_is_that_of_the_map():
    for K in (900.0, 1000.0, 1100.0):
        wall = replace(BARE, K=K)
        z = np.linalg.eigvals(sample_map(wall))
        rate = math.log(np.abs(z[np.abs(z.imag) > 1e-3]).max()) / wall.Ts
        assert growth_rates([wall])[0] == pytest.approx(rate, abs=3e-3)  # (omega dt)^2/12 of b/m


@pytest.mark.usefixtures("few_points")
def test_automatic_dampings_reach_from_zero_to_the_largest():
    r = zwidth(BARE, quick=True).regions[0]
    top = theoretical_damping(as_wall(BARE))
    assert stable(replace(BARE, K=1e-3, B=0.999 * top))
    assert not stable(replace(BARE, K=1e-3, B=1.001 * top))
    assert r.B[0] == 0.0 and 0.9 * top < r.B[-1] < top and len(r.B) == 7
    assert r.most_B == pytest.approx(top, rel=3e-3)
    assert r.K[0] < 0.1 * r.largest_K and r.K[-1] < 0.1 * r.largest_K  # it rises and falls
    fine = np.linspace(0.0, top, 30)
    K = [largest_stiffness(replace(BARE, B=x)) for x in fine[:-1]]
    assert r.area == pytest.approx(np.trapezoid([*K, 0.0], fine), rel=0.25)  # seven points


@pytest.mark.usefixtures("few_points")
def test_every_hand_of_the_box_holds_the_limit_of_the_worst():
    box = hc.theory.Box((0.0, 1.0), (0.0, 5.0), (0.0, 300.0))
    wall = replace(BARE, delay=1.5e-3, velocity_filter=100.0)
    r = zwidth(wall, B=(0.0, 3.0), box=box).regions[0]
    for B, K, found in zip(r.B, r.box_exact, r.box_K, strict=True):
        each = [replace(wall, B=B, operator=hand) for hand in box.corners()]
        limits = [largest_stiffness(w) for w in each]
        assert K == pytest.approx(min(limits), rel=1e-4)  # here the worst is a corner
        assert found == pytest.approx(K, rel=3e-3)
        assert worst_hand(as_wall(replace(wall, B=B)), box) == each[int(np.argmin(limits))].operator


@pytest.mark.usefixtures("few_points")
def test_no_run_is_unstable_below_a_sufficient_line():
    for change in ({}, {"delay": 1e-3}, {"velocity_filter": 60.0, "operator": Operator()}):
        r = zwidth(replace(BARE, **change), B=(0.0, 0.1, 0.4)).regions[0]
        line = next(x for x in r.limits if x.name.startswith("Colgate"))
        assert line.kind == "sufficient" and line.at(0.1) > 0.0 and not r.violations()
        # and it would be told
        soft = replace(r, K=(1.0, *r.K[1:]))
        assert any("Colgate" in x for x in soft.violations())


def test_published_lines_where_they_are_exact():
    r = zwidth(BARE, B=(0.0, 0.2), quick=True).regions[0]
    lines = {x.name: x for x in r.limits}
    assert lines["Colgate, Schenkel 1997"].at(0.2) == pytest.approx(2.0 * (0.5 - 0.2) / 1e-3)
    assert lines["Abbott, Okamura 2005"].at(0.0) == pytest.approx(2.0 * 0.5 / 1e-3)
    # the rule of Hulin et al.: exact for (b + B) Ts << m, here 0.005
    assert lines["Hulin et al. 2006"].at(0.0) == pytest.approx(r.K[0], rel=5e-3)
    assert math.isnan(lines["exact, linear loop"].at(1e3))


def test_friction_outweighs_the_encoder_up_to_the_limit_of_abbott_and_okamura():
    limit = 2.0 * 0.02 / 5e-5
    assert hc.walls.abbott_okamura_limit(ROUGH) == pytest.approx(limit)
    walls = [replace(ROUGH, K=share * limit, B=2.0) for share in (0.3, 0.9, 0.98)]
    assert all(come_to_rest(walls))
    # above it half a quantum of force moves the device: it buzzes, if B is large enough for the
    # motion to exceed 1 um
    above = [replace(ROUGH, K=1.1 * limit, B=2.0)]
    assert come_to_rest(above, Press(still=1e-6)) == [False]
    assert come_to_rest(above, Press(still=1e-4)) == [True]


@pytest.mark.parametrize("quantum, rest", [(0.0, 1e-6), (1e-7, 1e-6), (5e-5, 5e-5)])
def test_by_default_rest_is_what_the_encoder_can_see(quantum, rest):
    """A micrometre, or a count that is larger; a bound that is stated is taken, and said."""
    assert Press().rest(quantum) == rest and Press(still=1e-6).rest(quantum) == 1e-6
    wall = replace(ROUGH, device=replace(ROUGH.device, quantum=quantum), K=440.0, B=2.0)
    by_default, stated = (zwidth(wall, B=(2.0,), press=x) for x in (Press(), Press(still=rest)))
    assert by_default.regions[0].K == stated.regions[0].K
    said = " ".join(by_default.remarks())
    assert f"back and forth by {1e6 * rest:g} um" in said
    assert ("(a count of the encoder)" in said) is (quantum > 1e-6)
    if quantum > 1e-6:
        less = zwidth(wall, B=(2.0,), press=Press(still=1e-6))
        assert less.regions[0].K[0] < by_default.regions[0].K[0]
        assert "(less than a count, 50 um)" in " ".join(less.remarks())


def test_a_buzz_without_friction_is_that_of_a_relay():
    # Half a quantum off, the encoder is a relay of K Delta/2; mass, damper and hold make it swing
    # at the omega where their phases add to half a turn. That is its describing function, with the
    # hold's Ts/2 for a delay at least, and another Ts/2 at most in which a sample is waited for.
    from scipy.optimize import brentq

    def amplitude(K, late):
        omega = brentq(lambda w: math.atan(0.2 * w) + w * late - 0.5 * math.pi, 1.0, 3e3)
        return 4.0 / math.pi * 0.5 * K * 2e-5 / (omega * math.hypot(0.5, 0.1 * omega))

    device, swings = hc.Device(0.1, 0.5, quantum=2e-5), []
    for K in (50.0, 200.0):
        wall = replace(BARE, K=K, device=device)
        record = hc.simulate(as_wall(wall).rest_run(Press(), 16.0, 4), every=4)
        swing, _ = wall_runs._swing(record, 0.8, 1.0)
        assert amplitude(K, 0.5e-3) < 0.5 * swing < amplitude(K, 1e-3)
        swings.append(swing / K)
    assert not come_to_rest([wall], Press(still=0.8 * swing))[0]
    assert come_to_rest([wall], Press(still=1.2 * swing))[0]
    assert swings[0] == pytest.approx(swings[1], rel=0.05)  # the loop scales with K Delta


@pytest.mark.usefixtures("few_points")
def test_rest_is_the_verdict_of_loops_that_are_not_linear():
    r = zwidth(replace(ROUGH, delay=1e-3), B=(2.0,), press=Press(still=1e-4)).regions[0]
    assert r.verdict == BY_REST and not r.linear and math.isnan(r.gap())
    # a surface that is pressed is the linear wall; 1 % is what the decay of a swing resolves
    exact = largest_stiffness(replace(BARE, B=1.0))
    walls = [replace(BARE, unilateral=True, B=1.0, K=share * exact) for share in (0.99, 1.01)]
    assert come_to_rest(walls) == [True, False]


def test_friction_holds_more_than_the_linear_loop():
    dry = replace(BARE, device=hc.Device(0.1, 0.5, friction=0.02))
    r = zwidth(dry, B=(0.5,)).regions[0]
    assert r.K[0] > 1.05 * r.exact[0] and not r.violations()


# Trends of Colgate and Brown (ICRA 1994)


@pytest.mark.usefixtures("few_points")
@pytest.mark.parametrize(
    "vary, values", [("damper", (2.0, 0.5)), ("Ts", (5e-4, 1e-3)), ("delay", (0.0, 2e-3))]
)
def test_the_range_grows_with_damping_and_falls_with_sample_and_delay(vary, values):
    more, less = zwidth(BARE, vary, values, quick=True).regions
    for name in ("area", "largest_K", "largest_B"):
        assert getattr(more, name) > getattr(less, name), name
    assert more.K[0] > 1.9 * less.K[0]  # K = b/(Ts/2 + delay), nearly
    exact = [largest_stiffness(replace(r.wall, B=0.0)) for r in (more, less)]
    assert [more.K[0], less.K[0]] == pytest.approx(exact, rel=3e-3)


def test_a_coarse_encoder_takes_from_the_range_and_a_filter_gives_back():
    B = (10.0, 60.0)  # the noise of the velocity grows with B Delta/Ts

    def rests(quantum, cutoff=None, B=B):
        wall = replace(BARE, device=hc.Device(0.1, 0.5, quantum=quantum), velocity_filter=cutoff)
        return sum(come_to_rest([replace(wall, K=300.0, B=x) for x in B], Press(still=1e-5)))

    coarse, filtered = rests(2e-5), rests(2e-5, 10.0)
    assert rests(2e-6) > coarse > rests(1e-4)
    assert filtered > coarse
    # all rest, but with a filter whose lag makes the linear loop unstable
    assert filtered == len(B) and not rests(2e-5, 3.0, B[-1:])


# The arm


def test_clay_on_the_arm():
    loop = boundary.PushedLoop("x", K=1.0, Ts=1e-3, operator=Operator())
    r = zwidth(loop, B=(0.0, 100.0)).regions[0]
    for B, K, exact in zip(r.B, r.K, r.exact, strict=True):
        for share in (0.99, 1.01):
            tried = replace(loop, b=B, k=share * K).linear
            assert gain_crossings.is_stable(tried) == (share < 1.0)
        assert K == pytest.approx(exact, rel=3e-3)


# Bad input, files, figures


@pytest.mark.parametrize(
    "given, field",
    [
        (dict(vary="dampr", values=(1.0,)), "vary"),
        (dict(vary="damper"), "values"),
        (dict(values=(1.0,)), "values"),
        (dict(vary="damper", values=(-1.0,)), "device.damper"),
        (dict(B=(1.0, 0.5)), "B"),
        (dict(box=3), "box"),
    ],
)
def test_bad_input_is_refused(given, field):
    with pytest.raises(ParameterError) as caught:
        zwidth(BARE, **given)
    assert caught.value.field == field


def test_other_things_are_refused():
    with pytest.raises(ParameterError):
        zwidth(3)
    with pytest.raises(ParameterError):
        zwidth(boundary.PushedLoop("x"))  # continuous time
    with pytest.raises(ParameterError):
        Press(still=0.0)


@pytest.mark.parametrize("ending", ["toml", "json"])
def test_a_wall_is_saved_and_loaded(tmp_path, ending):
    wall = replace(ROUGH, K=3.0, velocity_filter=50.0, operator=Operator(0.1, 2.0, 3.0))
    assert hc.VirtualWall.load(wall.save(tmp_path / f"w.{ending}")) == wall
    file = tmp_path / "own.toml"
    file.write_text('Ts = "2 ms"\n[device]\nmass = "500 g"\n')
    assert hc.VirtualWall.load(file) == hc.VirtualWall(Ts=2e-3, device=hc.Device(0.5))
    file.write_text("[device]\nmas = 1\n")
    with pytest.raises(ParameterError, match=r"device.mass"):
        hc.VirtualWall.load(file)
    for bad in ("gone.toml", "wall.txt"):
        with pytest.raises(ParameterError) as caught:
            hc.VirtualWall.load(tmp_path / bad)
        assert caught.value.field == "wall"


@pytest.mark.parametrize(
    "vary, values, names",
    [
        ("quantum", (0.0, "10um", 6e-5), ["Delta = 0 um", "Delta = 10 um", "Delta = 60 um"]),
        ("Ts", ("0.5 ms", 1e-3), ["Ts = 0.5 ms", "Ts = 1 ms"]),
        ("filter", (None, "none", 150.0), ["no filter", "no filter", "filter = 150 Hz"]),
        ("velocity_window", (1, 4.0), ["window = 1 samples", "window = 4 samples"]),
    ],
)
def test_a_family_is_named_by_symbol_and_unit(vary, values, names):
    assert [name for name, _ in study._family_walls(as_wall(BARE), vary, values)] == names


def test_tables_hold_what_the_figure_shows():
    z = zwidth(BARE, "damper", (0.5, 1.0), B=(0.0, 1.0, 50.0))
    tables = z.tables()
    assert all(len({len(c) for c in t.values()}) == 1 for t in tables.values())
    assert tables["runs"]["K [N/m]"] == [K for r in z.regions for K in r.K]
    assert tables["regions"]["region"] == ["b = 0.5 N.s/m", "b = 1 N.s/m"]
    json.dumps(tables)
    ax = zwidth_plot(z).axes[0]
    names = [t.get_text() for t in ax.texts]
    assert names == [unit_text(r.name) for r in z.regions]
    one = zwidth_plot(zwidth(BARE, B=(0.0, 1.0, 50.0))).axes[0]
    labels = one.get_legend_handles_labels()[1]
    assert "Colgate, Schenkel 1997 (sufficient)" in labels and "runs: limit of stability" in labels


def test_the_passive_line_has_points_enough_to_be_drawn_smoothly():
    lines = wall_lines.theory_limits(as_wall(BARE), 150.0, (0.0, 150.0))
    passive = next(x for x in lines if x.name.startswith("Colgate"))
    inside = [B for B in passive.B if B <= BARE.device.damper]
    assert len(inside) >= wall_lines.LIMIT_POINTS
    assert np.diff(inside).max() <= 0.02 * BARE.device.damper
    # a straight line between its points: 2 (b - B)/Ts
    assert passive.at(0.2) == pytest.approx(2.0 * (BARE.device.damper - 0.2) / BARE.Ts)


def test_studies_take_a_third_kind_of_wall(monkeypatch):
    class Third(hc.VirtualWall):
        pass

    class ThirdWall(DeviceWall):
        @property
        def damping(self):
            return 1.0

    monkeypatch.setitem(KINDS, Third, ThirdWall)
    assert type(as_wall(Third())) is ThirdWall and type(as_wall(BARE)) is DeviceWall
    found = [
        stiffest([wall], [1.0], 1.0, Press(), lambda share: None)
        for wall in (Third(device=BARE.device), replace(BARE, B=1.0))
    ]
    assert found[0] == found[1]
