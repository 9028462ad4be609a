"""Distributions and populations of hands, and limits as bands over them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import hapticclay as hc
from hapticclay.studies import distribution, population
from hapticclay.studies.distribution import Distribution
from hapticclay.theory import wall_limits
from hapticclay.theory.loops import Loop

HAND = hc.Operator(0.4, 5.0, 80.0)


def of_scipy(law):
    """The same distribution by SciPy, from the textbook parameters."""
    a, b = law.first, law.second
    if law.law == "log-normal":
        sigma = math.sqrt(math.log(1.0 + b * b / (a * a)))
        return stats.lognorm(sigma, scale=a / math.exp(0.5 * sigma * sigma))
    return {
        "normal": stats.norm(a, b),
        "uniform": stats.uniform(a, b - a),
        "log-uniform": stats.loguniform(a, b) if a > 0.0 else None,
    }[law.law]


LAWS = [
    Distribution("normal", -1.0, 2.0),
    Distribution("log-normal", 4.0, 3.0),
    Distribution("uniform", -1.0, 3.0),
    Distribution("log-uniform", 0.1, 30.0),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda x: x.law)
def test_a_distribution_is_that_of_scipy(law):
    u, other = np.linspace(0.001, 0.999, 97), of_scipy(law)
    # 1e-9: the inverse of the normal law is known to about 1e-14, and sigma multiplies it
    np.testing.assert_allclose(law.spread(u), other.ppf(u), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(law.share_below(law.spread(u)), u, rtol=1e-9)
    z = stats.norm.ppf(u)
    np.testing.assert_allclose(law.of_score(z), other.ppf(u), rtol=1e-9, atol=1e-12)
    assert law.median == pytest.approx(other.median(), abs=1e-12)
    if law.law.endswith("normal"):
        assert other.mean() == pytest.approx(law.first)
        assert other.std() == pytest.approx(law.second)


@given(
    st.sampled_from(distribution.LAWS),
    st.floats(1e-3, 1e3),
    st.floats(1.001, 1e3),
)
def test_words_give_the_distribution(name, low, factor):
    law = Distribution(name, low, low * factor)
    assert Distribution.parse("x", f"{name}:{law.first!r}:{law.second!r}") == law
    assert distribution.parse_laws(f"a.b={name}:{law.first!r}:{law.second!r}") == {"a.b": law}


@pytest.mark.parametrize(
    "text, told",
    [
        ("lognormal:1:2", "did you mean 'log-normal'"),
        ("uniform:1", "uniform:LOW:HIGH"),
        ("normal:a:b", "normal:MEAN:SD"),
        ("uniform:2:1", "must be > 2"),
        ("log-uniform:0:1", "must be > 0"),
        ("normal:1:0", "must be > 0"),
    ],
)
def test_bad_words_are_refused(text, told):
    with pytest.raises(hc.ParameterError, match=told):
        Distribution.parse("x", text)


def test_a_name_stands_once():
    with pytest.raises(hc.ParameterError, match="each name once"):
        distribution.parse_laws("K=uniform:0:1 K=uniform:0:2")


# ---- hands ---------------------------------------------------------------------------------------


def test_published_hands_have_sources():
    assert all(hands.source for hands in hc.studies.POPULATIONS.values())
    assert hc.studies.POPULATIONS["paper"].median == hc.Operator()  # Eq. 19
    low, high = hc.studies.POPULATIONS["paper"], hc.studies.POPULATIONS["posture"]
    for name in population.HAND:  # nothing but what was published is in the range
        law = getattr(hc.studies.POPULATIONS["published range"], name)
        assert (law.first, law.second) == (getattr(low, name), getattr(high, name))


def test_hands_are_spread_as_asked():
    hands = hc.studies.Hands(
        Distribution("log-normal", 0.4, 0.2),
        Distribution("log-normal", 5.0, 2.0),
        Distribution("log-uniform", 10.0, 200.0),
        correlation=(0.6, 0.0, -0.3),
    )
    n = 20_000
    drawn = np.array([[h.mass, h.damper, h.spring] for h in hands.sample(n, seed=4)])
    # four standard errors of a mean, and of a correlation
    assert drawn[:, 0].mean() == pytest.approx(0.4, abs=4.0 * 0.2 / math.sqrt(n))
    assert drawn[:, 1].mean() == pytest.approx(5.0, abs=4.0 * 2.0 / math.sqrt(n))
    scores = np.column_stack(
        [stats.norm.ppf(getattr(hands, x).share_below(c)) for x, c in zip(population.HAND, drawn.T)]  # noqa: B905
    )
    found = np.corrcoef(scores.T)[np.triu_indices(3, 1)]
    np.testing.assert_allclose(found, hands.correlation, atol=4.0 / math.sqrt(n))
    box = hands.box(0.9)
    inside = (drawn >= np.array([box.mass, box.damper, box.spring])[:, 0]) & (
        drawn <= np.array([box.mass, box.damper, box.spring])[:, 1]
    )
    share = inside.mean(axis=0)
    np.testing.assert_allclose(share, 0.9, atol=4.0 * math.sqrt(0.09 / n))


def test_fully_correlated_hands_move_together():
    hands = replace(hc.studies.Hands.around(HAND, 0.5), correlation=(1.0, 1.0, 1.0))
    drawn = hands.sample(50)
    # 1e-7: the square root of an eigenvalue of 1e-16 that should be 0
    np.testing.assert_allclose([h.damper / h.mass for h in drawn], 5.0 / 0.4, rtol=1e-7)


@pytest.mark.parametrize(
    "given, told",
    [
        (dict(mass=-1.0), "hands.mass"),
        (dict(mass=Distribution("normal", 1.0, 0.1)), "no negative values"),
        (dict(correlation=(1.0, 1.0, -1.0)), "no three numbers have these"),
        (dict(correlation=(2.0, 0.0, 0.0)), "<= 1"),
    ],
)
def test_impossible_hands_are_refused(given, told):
    with pytest.raises(hc.ParameterError, match=told):
        hc.studies.Hands(**{"mass": 0.4, "damper": 5.0, "spring": 80.0, **given})


def test_an_unknown_population_names_the_nearest():
    with pytest.raises(hc.ParameterError, match="did you mean 'posture'"):
        hc.studies.gain_band(Loop("x"), "postures", [90.0])


# ---- bands ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("timing", [{}, {"Ts": 1e-3, "delay": 5e-4}], ids=["continuous", "sampled"])
def test_a_band_is_of_the_exact_limits(timing):
    clays, n = [20.0, 200.0], 6
    band = hc.studies.gain_band(
        Loop("x", **timing), hc.studies.Hands.around(HAND, 0.5), clays, hc.studies.Draw(n, 3)
    )
    hands = hc.studies.Hands.around(HAND, 0.5).sample(n, 3)
    for i, b in enumerate(clays):
        limits = [hc.theory.gain_limit("x", b, hand, **timing) for hand in hands]
        assert band.limits[i].tolist() == limits
        assert band.least[i] == min(limits)
        assert band.quantile(0.5)[i] in limits
    assert np.all(band.least <= band.quantile(0.05))
    assert np.all(band.quantile(0.05) <= band.quantile(0.5))
    tables = band.tables()
    assert len(tables["band"]["clay b [N.s/m]"]) == 2 and len(tables["hands"]["mass [kg]"]) == n


def test_a_wall_has_a_band_too():
    wall = hc.VirtualWall(device=hc.Device(0.5, 2.0), Ts=1e-3)
    band = hc.walls.wall_band(
        wall, hc.studies.Hands.around(HAND, 0.5), [0.0, 20.0], hc.studies.Draw(5)
    )
    for i, B in enumerate((0.0, 20.0)):
        for j, hand in enumerate(band.hands):
            limit = band.limits[i, j]
            made = replace(wall, B=B, operator=hand)
            assert wall_limits.stable_wall(replace(made, K=0.999 * limit))
            assert not wall_limits.stable_wall(replace(made, K=1.001 * limit))


def test_bands_refuse_what_they_cannot_take():
    with pytest.raises(hc.ParameterError, match="must be a Loop"):
        hc.studies.gain_band(HAND, "paper", [90.0])
    with pytest.raises(hc.ParameterError, match="must be a VirtualWall"):
        hc.walls.wall_band(Loop("x"), "paper", [90.0])
    with pytest.raises(hc.ParameterError, match="must hold a value"):
        hc.studies.gain_band(Loop("x"), "paper", [])
