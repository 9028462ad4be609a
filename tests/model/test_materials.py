"""Materials by name: their numbers, and the force of a tool in them by independent arithmetic."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.model import materials
from hapticclay.model.materials import MATERIALS, SMALL_TOOL, Material, material

DOC = (Path(__file__).parents[2] / "docs" / "materials.md").read_text()
CLAYS = [name for name, m in MATERIALS.items() if m.strength[1]]
WIDTH, DEPTH = st.floats(0.004, 0.1), st.floats(1e-4, 0.025)
STRENGTH = st.floats(1.0, 1e6)  # [Pa]


def of_strength(low, high=None):
    """A clay of this strength [Pa]."""
    return Material(source="test", strength=(low, low if high is None else high))


def test_tool_of_the_moist_clay_by_hand():
    """20 kPa, 10 x 5 mm: 5 (1 + 0.2/2) (1 + 0.2) = 6.6 times 20 kPa x 50 mm^2 = 1 N."""
    clay = of_strength(20e3)
    assert clay.flow().Fy == pytest.approx(6.6, rel=1e-14) and clay.flow().kind == "Coulomb"
    low, high = clay.range()
    # Prandtl's strip and Skempton's deep square: 5.14 and 9 N
    assert (low.Fy, high.Fy) == (pytest.approx(2.0 + math.pi), pytest.approx(9.0))
    assert 5.0 < low.Fy < clay.flow().Fy < high.Fy < 9.0 + 1e-12
    assert 500.0 < clay.flow().Fy / 0.01 < 900.0  # secant damping at 1 cm/s [N.s/m]


@pytest.mark.parametrize(
    "width, depth, factor",
    [
        (0.01, 0.01, 5 * 1.2 * 1.2),  # square
        (0.1, 0.001, 5 * 1.002 * 1.2),  # wide and shallow
        (0.004, 0.008, 5 * 1.1 * 1.4),  # D/B = 2
        (0.004, 0.02, 7.5 * 1.04),  # D/B = 5: Skempton's limit 7.5 (1 + 0.2 B/L)
    ],
)
def test_bearing_factor_by_hand(width, depth, factor):
    tool = hc.Tool(width, depth)
    assert materials.bearing_factor(tool) == pytest.approx(factor, rel=1e-14)
    assert of_strength(1e3).flow(tool).Fy == pytest.approx(1e3 * factor * width * depth, rel=1e-14)


@given(WIDTH, DEPTH)
def test_bearing_factor_stays_between_the_textbook_limits(width, depth):
    # 6: no face is less deep than high; 8.1: where D/B reaches 2.5 at B/L = 0.4
    assert 6.0 <= materials.bearing_factor(hc.Tool(width, depth)) <= 8.1 + 1e-12


@given(WIDTH, DEPTH, STRENGTH, st.floats(1.0, 2.0), st.floats(1.0, 2.0), st.floats(1.0, 2.0))
def test_force_grows_with_strength_and_size(width, depth, strength, wider, deeper, stronger):
    other = hc.Tool(min(0.1, width * wider), min(0.025, depth * deeper))
    less = of_strength(strength).flow(hc.Tool(width, depth)).Fy
    more = of_strength(strength * stronger).flow(other).Fy
    assert more >= less * (1.0 - 1e-12)  # equal sizes differ by rounding at most


@given(WIDTH, DEPTH, STRENGTH, st.floats(1.0, 10.0))
def test_flow_lies_within_its_range(width, depth, strength, spread):
    clay, tool = of_strength(strength, strength * spread), hc.Tool(width, depth)
    low, high = clay.range(tool)
    assert low.Fy < clay.flow(tool).Fy < high.Fy


@given(st.floats(0.4, 2.5))
def test_force_of_the_paste_goes_with_the_area_at_equal_shear_rate(scale):
    """A tool of any size at a speed that grows with it."""
    paste = MATERIALS["printable paste"]
    force = paste.flow(hc.Tool(0.03, 0.01)).force(0.01)
    scaled = paste.flow(hc.Tool(0.03 * scale, 0.01 * scale)).force(0.01 * scale)
    assert scaled == pytest.approx(force * scale**2, rel=1e-12)


def test_classes_double_from_one_to_the_next():
    strengths = [MATERIALS[name].strength for name in CLAYS]
    # half of the compressive strengths of 25, 50, 100, 200, 400 kPa
    assert strengths == [
        (0.0, 12.5e3),
        (12.5e3, 25e3),
        (25e3, 50e3),
        (50e3, 100e3),
        (100e3, 200e3),
    ]
    forces = [material(name).Fy for name in CLAYS]
    assert forces == pytest.approx([6.6 * su * 5e-5 for su in (6.25e3, 18750, 37.5e3, 75e3, 150e3)])


def test_flow_index_of_the_paste_from_its_three_points():
    rpm, viscosity = np.array([1.0, 5.0, 50.0]), np.array([828.0, 202.4, 40.4])
    slope, _ = np.polyfit(np.log10(rpm), np.log10(viscosity), 1)
    paste = MATERIALS["printable paste"]
    assert paste.n == pytest.approx(1.0 + slope, rel=1e-12)
    assert paste.n == pytest.approx(0.23, abs=0.005)
    local = 1.0 + np.diff(np.log(viscosity)) / np.diff(np.log(rpm))
    assert local == pytest.approx([0.125, 0.30], abs=0.001)  # as docs/materials.md says
    # what the instrument would show of this paste: the line misses its points by up to 12 %
    shown = [reading(paste.K, paste.n, r) for r in rpm]
    residual = np.array(shown) / viscosity - 1.0
    assert np.abs(residual).max() == pytest.approx(0.12, abs=0.005)
    assert paste.rates == pytest.approx((0.899, 45.0), rel=1e-3)


def reading(K, n, rpm):
    """Apparent viscosity that a cylinder in a wide vessel of a power-law fluid shows [Pa.s].

    Shear stress falls with the radius, t = T (R/r)^2; the speed of the cylinder is the integral of
    the shear rate (t/K)^(1/n) over dr/r. It is solved for T by bisection; the instrument takes the
    fluid for Newtonian, T = viscosity x 2 w.
    """
    w = rpm * 2.0 * math.pi / 60.0
    r = np.linspace(0.0, 30.0, 200_001)  # log of the radius over that of the spindle
    falls = np.exp(-2.0 * r)

    def speed(T):
        return np.trapezoid((T * falls / K) ** (1.0 / n), r)

    low, high = 0.0, 1e6
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if speed(middle) < w else (low, middle)
    return low / (2.0 * w)


@given(st.floats(0.1, 1.5), st.floats(1.0, 1e4))
def test_viscometer_is_read_backwards(n, K):
    """Readings that a power-law fluid gives return its K and n."""
    rpm = [1.0, 7.0, 60.0]
    w = [2.0 * math.pi * r / 60.0 for r in rpm]
    shown = [K * (2.0 * a / n) ** n / (2.0 * a) for a in w]  # stress over 2 w, in closed form
    assert materials.power_law(rpm, shown) == pytest.approx((K, n), rel=1e-9)


def test_viscometer_is_that_of_the_quadrature():
    for n in (0.25, 0.6, 1.0):
        w = 2.0 * math.pi * 5.0 / 60.0
        # trapezoids of 1.5e-4 in the logarithm: second order, below 1e-6
        assert reading(100.0, n, 5.0) == pytest.approx(100.0 * (2 * w / n) ** n / (2 * w), rel=1e-6)


def test_paste_under_the_small_tool_by_hand():
    paste, tool = MATERIALS["printable paste"], SMALL_TOOL
    flow = paste.flow()
    stress = paste.K * (0.02 / 0.005) ** paste.n  # shear rate 2 cm/s over 5 mm
    assert flow.Fy == flow.b == 0.0 and flow.kind == "power law"
    assert flow.force(0.02) == pytest.approx(6.6 * 5e-5 * stress, rel=1e-12)
    assert paste.speeds(tool) == pytest.approx((0.0045, 0.225), rel=2e-3)
    assert MATERIALS["stiff clay"].speeds() is None


def test_paper_clay_is_the_papers_whatever_the_tool():
    assert material("paper clay") == material("paper clay", hc.Tool()) == hc.Flow(b=90.0)
    assert hc.constant_cut(material="paper clay") == hc.constant_cut()


def test_constant_cut_takes_a_material_in_place_of_b():
    scenario = hc.constant_cut(material="stiff clay")
    assert scenario.clay == hc.slab(hc.materials.material("stiff clay"), 0.05, 0.15)
    with pytest.raises(ParameterError, match="give one of the two"):
        hc.constant_cut(50.0, material="stiff clay")


def test_bad_names_and_numbers_are_refused():
    with pytest.raises(ParameterError, match="did you mean 'stiff clay'"):
        material("stif clay")
    with pytest.raises(ParameterError, match="did you mean 'printable paste'"):
        hc.constant_cut(material="printable past")
    with pytest.raises(ParameterError, match="material.strength"):
        of_strength(2.0, 1.0)
    with pytest.raises(ParameterError, match="material.strength.high"):
        of_strength(0.0, math.nan)
    for take in (hc.materials.material, lambda name, tool: MATERIALS[name].range(tool)):
        with pytest.raises(ParameterError, match="tool = 0.01: must be a Tool"):
            take("stiff clay", 0.01)
    with pytest.raises(ParameterError, match=r"as hc.materials.material\('stiff clay'\) returns"):
        hc.slab("stiff clay", 0.05, 0.15)
    with pytest.raises(ParameterError, match="tool.width"):
        hc.Tool(0.001)


def test_command_lists_them(capsys):
    assert app.main(["materials", "--tool-width", "0.02", "--tool-depth", "0.02"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name, m in MATERIALS.items():
        (row,) = [line for line in lines if line.startswith(name + " ")]
        numbers = [float(x) for x in re.findall(r" ([\d.]+)(?= )", row)]
        tool = hc.Tool(0.02, 0.02)
        flow, (low, high) = m.flow(tool), m.range(tool)
        known = [flow.Fy, low.Fy, high.Fy] if high.Fy else [flow.K, flow.n] if flow.K else [flow.b]
        assert numbers == pytest.approx(known, rel=5e-4)  # four digits
        (source,) = [line for line in lines if line.endswith("] " + m.source)]
        (told,) = re.findall(rf"^\| {name} \|.*\| ([\d, ]+) \|$", DOC, re.M)
        # the document's first number, of a list that begins with what the command lists
        assert row.split()[-1] == source.split()[0] == f"[{told.split(', ')[0]}]"


def test_document_has_each_material_with_its_numbers():
    rows = dict(re.findall(r"^\| ([a-z ]+?) \|(.*)\|$", DOC, re.M))
    for name, m in MATERIALS.items():
        cells = [c.strip() for c in rows[name].split("|")]
        flow, (low, high) = m.flow(), m.range()
        told = [high.Fy and flow.Fy, high.Fy and low.Fy, high.Fy, flow.K, flow.K and flow.n, flow.b]
        for cell, x in zip(cells[1:7], told, strict=True):
            assert float(cell or 0) == pytest.approx(x, rel=6e-3)  # two or three digits
