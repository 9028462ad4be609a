"""A stored solution is taken only for its own case, solved by its own source."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import hapticclay as hc
from benchmarks import reference
from tests.oracles import nonlinear, store

EDGES, PUSH = (0.01, 0.02), (1.0, 0.0)
TIMES = np.linspace(0.01, 0.1, 5)
CASE = (0.0, 90.0), EDGES, (1.0, 0.5), PUSH, None, False, 0.5, TIMES


@pytest.fixture
def solved(tmp_path, monkeypatch):
    """How often the oracle was asked."""
    monkeypatch.setattr(store, "FOLDER", tmp_path / "references")
    return []


def counted(asked):
    def oracle(*case):
        asked.append(case)
        return nonlinear(*case)

    return oracle


def test_a_solution_is_computed_once_and_is_the_oracle_s(solved):
    oracle = counted(solved)
    first, again = (store.solution("a", oracle, *CASE) for _ in range(2))
    exact = nonlinear(*CASE)
    assert len(solved) == 1
    for found in (first, again):
        for name, value in exact._asdict().items():
            np.testing.assert_array_equal(getattr(found, name), value)


@pytest.mark.parametrize("change", ["value", "array", "source", "damage"])
def test_what_changed_is_solved_anew(solved, change, tmp_path, monkeypatch):
    """Another case, another source, a damaged file."""
    oracle, case = counted(solved), list(CASE)
    store.solution("a", oracle, *CASE)
    if change == "value":
        case[3] = (1.0, 1e-9)
    elif change == "array":
        case[7] = TIMES * (1.0 + 1e-9)
    elif change == "source":
        other = tmp_path / "oracle.py"
        other.write_text("# a comment more\n")
        monkeypatch.setattr(store.inspect, "getfile", lambda f: str(other))
    else:
        file = tmp_path / "references" / "a.npz"
        file.write_bytes(file.read_bytes()[:-40])
    store.solution("a", oracle, *case)
    store.solution("a", oracle, *case)
    assert len(solved) == 2


@pytest.mark.parametrize(
    "part",
    [
        dict(arm=hc.Arm(l1=0.25)),
        dict(compensator=hc.Compensator((1.0,), (1.0, 9.0, 0.0))),
        dict(servo=2 * (hc.Servo(*2 * (hc.SecondOrder(900.0, 40.0, 900.0),)),)),
        dict(operator=hc.Operator(0.25, 2.0, 6.1)),
    ],
    ids=lambda x: next(iter(x)),
)
def test_scenes_of_other_parts_are_other_cases(part):
    s = hc.constant_cut(operator=hc.Operator(0.25, 2.0, 6.0))
    keys = {store.digest(nonlinear, (x,)) for x in (s, dataclasses.replace(s, **part))}
    assert len(keys) == 2
    assert store.digest(nonlinear, (dataclasses.replace(s),)) in keys


def test_sources_are_those_that_the_oracle_imports():
    names = {file.name for file in store.sources(Path(reference.__file__))}
    assert names == {"reference.py", "arm.py"}
    folder = Path(store.__file__).parent
    needed = {folder / f"{name}.py" for name in ("nonlinear", "arm_loop", "arm")}
    assert store.sources(folder / "nonlinear.py") == needed


def test_what_is_stored_is_small():
    assert sum(f.stat().st_size for f in store.FOLDER.glob("*")) < 2e6
