"""Arguments at the door of every public function and class: kinds, names, units."""

import importlib
import inspect
import math
import pickle
import pkgutil
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay import errors, units
from hapticclay.arguments import checked, named
from hapticclay.errors import ParameterError, check_fields
from hapticclay.model.fields import fields_of, with_fields
from hapticclay.simulation import simulate

CALLED = ("progress", "announce", "draw", "f", "law")  # functions of the caller's own
MOST_CALLS = 300  # of functions of ours in one call of the test: a longer one is past the door


def junk_function(*args, **given):
    return None


JUNK = [1, "x", None, object(), [], {}, math.nan, 10**400, np.array([]), junk_function]


class Enough(BaseException):
    """A call was let in and works."""


@pytest.fixture(scope="module")
def good():
    """Good values of the arguments that must be given, by name, and by function and name."""
    cut, wall = hc.constant_cut(t_max=0.01), hc.VirtualWall(K=100.0)
    profile, t = hc.Profile((), (40.0,)), np.linspace(0.0, 4.0, 400)
    loop = hc.Loop(K=1.0, b=90.0)
    by_name = {
        "axis": "x", "K": 1.0, "b": 90.0, "wall": wall, "scenario": cut, "subject": wall,
        "record": hc.simulate(cut, engine="python"), "loop": loop, "box": hc.Box(), "omega": [1.0],
        "flow": hc.Flow(Fy=1.0, b=5.0), "compensators": [hc.Compensator()], "V": 0.1,
        "data": hc.Measurement(t, np.sin(t), np.cos(t)), "hands": next(iter(hc.POPULATIONS)),
        "mass": 1.0, "damper": 1.0, "spring": 1.0, "Ts": 1e-3, "decay": 1.0, "name": "stiff clay",
        "trials": hc.Trials(wall, {"K": hc.Distribution("uniform", 1.0, 9.0)}), "out": "nowhere",
        "part": cut, "changes": {"gain.x": 1.0}, "scenarios": [cut], "resists": 90.0,
    }  # fmt: skip
    pushed = importlib.import_module("hapticclay.studies.boundary").PushedLoop()
    ramp = {"amplitude": (1.0, 0.0), "low": 1.0, "high": 2.0, "duration": 3.0, "rate": (1.0, 0.0)}
    grid = {"x_edges": (), "y_edges": (), "values": ((40.0,),)}
    smooth = {"x": (0.0, 0.1), "y": (0.0, 0.1), "values": ((1.0, 1.0), (1.0, 1.0))}
    by_function = {
        "stable_band": {"part": "K"}, "arm_mbk": {"loop": pushed}, "gain_band": {"b": [10.0]},
        "wall_band": {"B": [1.0]}, "Chirp": ramp, "Clay": {"x": profile, "y": profile},
        "Constant": {"value": (1.0, 0.0)}, "Controller": {"law": "a:b"}, "Function": {"f": abs},
        "Coupling": {"spring": 1.0, "damper": 1.0}, "Grid": grid, "Smooth": smooth,
        "Distribution": {"law": "uniform", "first": 1.0, "second": 2.0},
        "Groove": {"x": (0.0, 0.1), "y": (0.0, 0.1)}, "Ramp": {**ramp, "start": 0.0},
        "Profile": {"edges": (), "values": (1.0,)}, "Material": {"source": "own"},
        "Pulse": {"value": (1.0, 0.0), "start": 0.0, "width": 1.0},
        "Samples": {"t": (0.0, 1.0), "values": ((0.0, 0.0), (1.0, 1.0))},
        "SecondOrder": {"gain": 1.0, "damping": 1.0, "stiffness": 1.0},
        "Servo": {"G": hc.SecondOrder(1.0, 1.0, 1.0), "S": hc.SecondOrder(1.0, 1.0, 1.0)},
        "Spring": {"start": 0.0, "end": 0.1, "stiffness": 10.0},
        "Step": {"value": (1.0, 0.0), "start": 0.0}, "Sum": {"parts": (hc.Constant((1.0, 0.0)),)},
        "Trials": {"base": wall, "vary": {"K": hc.Distribution("uniform", 1.0, 9.0)}},
        "Measurement": {"t": t, "input": np.sin(t), "output": np.cos(t)},
    }  # fmt: skip
    return by_name, by_function


def public_callables():
    for name in hc.__all__:
        made = getattr(hc, name)
        if callable(made) and made is not hc.Warning:
            yield name, made


def required(name, made, good):
    """Arguments of a call with defaults wherever there are some."""
    by_name, by_function = good
    return {
        word: by_function.get(name, {}).get(word, by_name.get(word))
        for word, p in inspect.signature(made).parameters.items()
        if p.default is p.empty and p.kind is not p.VAR_KEYWORD
    }


def outcome(made, arguments):
    """What a call ended in: "result", "working", or an exception."""
    calls = 0

    def count(frame, event, _):
        nonlocal calls
        if event == "call" and frame.f_globals.get("__name__", "").startswith("hapticclay"):
            calls += 1
            if calls > MOST_CALLS:
                raise Enough

    sys.setprofile(count)
    try:
        made(**arguments)
    except Enough:
        return "working"
    except Exception as error:
        return error
    finally:
        sys.setprofile(None)
    return "result"


@pytest.mark.plain
@pytest.mark.filterwarnings("ignore")
def test_junk_is_refused_at_the_door(good, monkeypatch, tmp_path):
    """Junk for each argument in turn gives ParameterError or an answer: no other exception."""
    monkeypatch.setitem(sys.modules, "numba", None)  # nothing is compiled
    for module in pkgutil.walk_packages(hc.__path__, "hapticclay."):  # none while calls are counted
        if ".views" not in module.name and not module.name.endswith(("compiled", "cache", "__main__")):
            importlib.import_module(module.name)
    monkeypatch.chdir(tmp_path)
    wrong, tried, refused = [], 0, 0
    for name, made in public_callables():
        arguments = required(name, made, good)
        for word, p in inspect.signature(made).parameters.items():
            if p.kind in (p.VAR_KEYWORD, p.VAR_POSITIONAL):
                continue
            for junk in JUNK:
                if junk is junk_function and word in CALLED:
                    continue
                ended, tried = outcome(made, {**arguments, word: junk}), tried + 1
                refused += isinstance(ended, ParameterError)
                if isinstance(ended, Exception) and not isinstance(ended, ParameterError):
                    wrong.append(f"{name}({word}={errors._short(junk)}): {ended!r}")
    assert not wrong, "\n".join(wrong)
    assert tried > 4000 and refused > tried / 2
