"""simulate_columns: the summaries of simulate_batch, without a scenario for each run."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.simulation import column_batch
from tests.simulation.test_stepwise import fast

RICH = hc.Hardware(
    delay=1e-4, encoder=4000, velocity="difference", velocity_window=3, velocity_filter=80.0,
    adc_bits=12, dac_bits=12, force_filter=200.0, friction=(0.02, 0.01),
)  # fmt: skip
GUARDED = replace(RICH, passivity=True, coupling=hc.Coupling(5e3, 5.0))
SHORT = replace(hc.constant_cut(operator=hc.Operator()), length=None, t_max=0.02)
SAMPLED = replace(SHORT, control="sampled", hardware=GUARDED)
N = 60


def columns(seed=0):
    rng = np.random.default_rng(seed)
    return {
        "operator.x.damper": rng.uniform(0.0, 20.0, N),
        "operator.mass": rng.uniform(0.1, 2.0, N),
        "gain.y": rng.uniform(0.1, 300.0, N),  # some diverge, which the monitor has to judge
        "gain": rng.uniform(0.1, 2.0, N),  # of both axes, beneath it
        "force.x": rng.uniform(-1.0, 4.0, N),
        "velocity.x": rng.uniform(-0.1, 0.1, N),
    }


def by_objects(base, given):
    rows = ({name: float(x[k]) for name, x in given.items()} for k in range(N))
    return hc.simulate_batch([hc.with_fields(base, row) for row in rows], keep="summaries")


def assert_same(got, want):
    for name in want.dtype.names:
        both = got[name], want[name]
        assert np.array_equal(*both, equal_nan=want.dtype[name].base.kind == "f"), name


@fast
@pytest.mark.parametrize("base", [SHORT, SAMPLED], ids=["continuous", "sampled"])
def test_columns_give_the_bits_of_scenarios(base, monkeypatch):
    monkeypatch.setattr(column_batch, "PART", 20 * base.t_max / base.dt)  # several parts
    given = columns()
    if base.hardware:
        given["hardware.delay"] = np.random.default_rng(1).uniform(0.0, 1e-3, N)
        given["hardware.delay"][7] = 0.0  # of another kind
    assert column_batch.Columns(base, given).is_plain
    assert_same(hc.simulate_columns(base, given, threads=2), by_objects(base, given))


@fast
def test_clay_that_is_stiffer_for_some_rows():
    base = replace(SHORT, start=(0.051, 0.0))
    b = np.concatenate([np.geomspace(90.0, 2e3, N // 2), np.geomspace(4e3, 1e5, N - N // 2)])
    given = {"clay.x.values.1": b, "clay.y.values.1": np.where(np.arange(N) % 7, 90.0, b)}
    drawn = column_batch.Columns(base, given)
    good = drawn.of_kind(drawn.differences(0, N))
    assert 0 < good.sum() < N
    assert_same(hc.simulate_columns(base, given), by_objects(base, given))


def test_other_fields_vary_with_a_scenario_each():
    given = {"arm.l1": np.linspace(0.25, 0.3, N), "force.x": np.linspace(1.0, 2.0, N)}
    assert not column_batch.Columns(SHORT, given).is_plain
    assert_same(hc.simulate_columns(SHORT, given), by_objects(SHORT, given))


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("columns", {}),
        ("columns", {"gain.x": [1.0, 2.0], "gain.y": [1.0]}),
        ("gain.x", {"gain.x": 1.0}),
        ("gain.x", {"gain.x": "much"}),
        ("gian.x", {"gian.x": [1.0]}),
        ("gain.x[2]", {"gain.x": [1.0, 2.0, -1.0]}),
        ("operator.mass[1]", {"operator.mass": [1.0, np.nan]}),
        ("dt[1]", {"dt": [1e-4, 0.0]}),
        ("clay.x.values.1[1]", {"clay.x.values.1": [1.0, 1e10]}),
        ("1", {1: [1.0]}),
    ],
)
def test_bad_columns_are_refused_at_the_door(field, given, monkeypatch):
    monkeypatch.setattr(column_batch.batch, "simulate_batch", None)  # no run begins
    with pytest.raises(ParameterError) as error:
        hc.simulate_columns(SHORT, given)
    assert str(error.value.field) == field


def test_what_a_scenario_refuses_is_told_with_its_row():
    with pytest.raises(ParameterError, match=r"hardware.delay\[1\]"):  # 100 samples, before a run
        column_batch.Columns(SAMPLED, {"hardware.delay": [1e-3, 0.9]})
    given = {"start.x": [0.0, 0.25], "length": [0.01, 0.2]}
    with pytest.raises(ParameterError, match=r"length\[1\]"):
        hc.simulate_columns(SHORT, given)
