"""What can be run and is hardly meant is said before the run."""

import dataclasses
import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.scene.plausible import implausible
from hapticclay.simulation.batch import checked_scenarios

FAR = dataclasses.replace(hc.constant_cut(t_max=0.01), clay=hc.slab(90.0, 5.0, 15.0))
HEAVY = dataclasses.replace(hc.free(t_max=0.01), operator=hc.Operator(250.0))


@pytest.mark.parametrize(
    ("scenario", "told"),
    [
        (FAR, "clay: .*0.59 m of the shoulder"),
        (HEAVY, "operator.mass = 250: .* 0 to 30 kg"),
        (dataclasses.replace(HEAVY, operator=(None, hc.Operator(0.2, 2e3))), "operator.y.damper"),
    ],
)
def test_what_is_hardly_meant_is_a_warning(scenario, told):
    for make in (
        lambda s: hc.simulate(s, engine="python"),
        lambda s: list(checked_scenarios([s], set())),
        hc.Simulation,
    ):
        with pytest.warns(hc.Warning, match=told):
            make(scenario)
        with warnings.catch_warnings():
            warnings.simplefilter("error", hc.Warning)
            with pytest.raises(hc.Warning):
                make(scenario)
    assert issubclass(hc.Warning, UserWarning)


def test_what_is_usual_is_none():
    usual = [make() for make in hc.SCENARIOS.values()]
    usual.append(dataclasses.replace(hc.free(), operator=hc.Operator()))
    usual.append(
        dataclasses.replace(hc.free(), clay=hc.Clay(*[hc.Profile((5.0,), (0.0, 0.0))] * 2))
    )
    assert [text for s in usual for text in implausible(s)] == []


@given(
    st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
    st.floats(1e-4, 0.3),
    st.floats(1e-4, 0.3),
)
def test_a_block_is_out_of_reach_where_none_of_its_points_is_within(corner, wide, high):
    (x, y), arm = corner, hc.Arm(0.3, 0.2)
    law = hc.Grid((x, x + wide), (y, y + high), ((0.0,) * 3, (0.0, 9.0, 0.0), (0.0,) * 3))
    s = dataclasses.replace(hc.free(), arm=arm, length=None, clay=hc.Clay(law, law))
    px, py = np.meshgrid(np.linspace(x, x + wide, 60), np.linspace(y, y + high, 60))
    r = np.hypot(px + s.origin[0], py + s.origin[1])
    folded, stretched = arm.reach
    near = math.hypot(wide, high) / 59.0  # points between those of the net
    told = bool(list(implausible(s)))
    if told:
        assert not ((r > folded + 1e-12) & (r < stretched - 1e-12)).any()
    else:
        assert ((r > folded - near) & (r < stretched + near)).any()


def test_the_command_line_prints_a_line(capsys, tmp_path):
    words = ["run", "constant", "--clay", "5", "15", "--t-max", "0.01", "--no-plots"]
    with warnings.catch_warnings():
        warnings.simplefilter("default", hc.Warning)
        assert app.main([*words, "--out", str(tmp_path)]) == 0
    err = capsys.readouterr().err
    assert err.startswith("hapticclay: clay: lies where") and len(err.splitlines()) == 1


def test_the_line_of_the_user_is_named():
    odd = dataclasses.replace(hc.constant_cut(t_max=0.01), operator=hc.Operator(mass=250.0))
    calls = (
        lambda: hc.simulate(odd, engine="python"),
        lambda: list(checked_scenarios([odd], set())),
        lambda: hc.Simulation(odd).close(),
    )
    for call in calls:
        with pytest.warns(hc.Warning, match="operator.mass = 250") as caught:
            call()
        assert {w.filename for w in caught} == {__file__}
