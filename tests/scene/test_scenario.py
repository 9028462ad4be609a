import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay import errors
from hapticclay.errors import ParameterError
from hapticclay.model import operator


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(b=-1.0), "b"),
        (dict(b=math.nan), "b"),
        (dict(b=math.inf), "b"),
        (dict(b="90"), "b"),
        (dict(b=True), "b"),
        (dict(b=1e12), "b"),
        (dict(b=None), "b"),
        (dict(b=10**400), "b"),
        (dict(gain=1.0), "gain"),
        (dict(gain=(1.0,)), "gain"),
        (dict(gain=(1.0, 0.0)), "gain[y]"),
        (dict(gain="ab"), "gain"),
        (dict(gain=(1.0, -2.0)), "gain[y]"),
        (dict(force=(1.0, 2.0, 3.0)), "force"),
        (dict(force=(math.inf, 0.0)), "force[x]"),
        (dict(operator=1), "operator"),
        (dict(inertia_shaping="yes"), "inertia_shaping"),
        (dict(dt=0.0), "dt"),
        (dict(dt=-1e-3), "dt"),
        (dict(dt=1.0), "dt"),
        (dict(dt=math.nan), "dt"),
        (dict(t_max=0.0), "t_max"),
        (dict(t_max=-1.0), "t_max"),
        (dict(t_max=math.inf), "t_max"),
        (dict(clay=(0.15, 0.05)), "clay"),
        (dict(clay=(0.1,)), "clay"),
        (dict(clay=0.1), "clay"),
        (dict(length=0.5), "length"),
        (dict(length=-0.1), "length"),
        (dict(length="far"), "length"),
        (dict(start=(0.5, 0.5)), "start"),
        (dict(start=(math.nan, 0.0)), "start[x]"),
        (dict(origin=(0.0, 0.0)), "start"),
        (dict(origin=(0.5, 0.24)), "length"),
        (dict(origin=(-0.45, 0.01), length=0.9, start=(0.0, 0.0)), "length"),
        (dict(torque_limit=(0.0, 1.0)), "torque_limit[shoulder]"),
        (dict(torque_limit=5.0), "torque_limit"),
    ],
)
def test_bad_input_names_field_value_and_bound(kw, field):
    with pytest.raises(ParameterError) as e:
        hc.constant_cut(**kw)
    assert e.value.field == field
    assert e.value.bound and field in str(e.value)
    assert "\n" not in str(e.value)


def test_parameter_error_is_a_value_error():
    assert issubclass(hc.ParameterError, ValueError)


@pytest.mark.parametrize("kw", [dict(clay=3), dict(operator="me"), dict(name=""), dict(name=3)])
def test_scenario_refuses_parts_of_the_wrong_kind(kw):
    with pytest.raises(ParameterError):
        dataclasses.replace(hc.free(), **kw)


def test_replace_checks_too():
    with pytest.raises(ParameterError, match="dt"):
        dataclasses.replace(hc.free(), dt=-1.0)


@pytest.mark.parametrize("kw", [dict(mass=-1.0), dict(damper=math.nan), dict(spring="6")])
def test_operator_is_checked(kw):
    with pytest.raises(ParameterError, match="operator"):
        operator.Operator(**kw)


def test_numpy_numbers_and_arrays_are_welcome():
    s = hc.constant_cut(
        b=np.float64(50), gain=np.array([1.0, 0.5]), force=[1, 0], dt=np.float32(0.001)
    )  # type: ignore[arg-type]
    assert s == dataclasses.replace(s)
    assert all(type(x) is float for x in (*s.gain, *s.force, s.dt))
    hash(s)


@given(st.text(max_size=80))
def test_choice_lists_what_would_have_been_valid(name):
    valid = ("constant", "free")
    if name not in valid:
        with pytest.raises(ParameterError) as e:
            errors.choice("scenario", name, valid)
        assert "constant, free" in str(e.value) and "\n" not in str(e.value)


def test_scenarios_are_frozen_and_listed():
    assert set(hc.SCENARIOS) == {"constant", "variable", "stability", "free"}
    with pytest.raises(dataclasses.FrozenInstanceError):
        hc.free().dt = 1.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))]
)
@pytest.mark.parametrize("value", [-1.0, "x" * 100, (1.0, [2.0]), None])
def test_a_parameter_error_survives_copies_and_the_way_between_processes(again, value):
    error = ParameterError("b", value, "must be >= 0")
    error.add_note("while sweeping")
    other = again(error)
    assert type(other) is ParameterError and other is not error
    assert (other.field, other.value, other.bound) == ("b", value, "must be >= 0")
    assert (str(other), other.args, other.__notes__) == (str(error), error.args, ["while sweeping"])
