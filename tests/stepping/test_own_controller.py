"""A sampled controller of the user's own: the paper's as one, others, and what goes wrong."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.sampled_controller import LawFailed
from tests.oracles import paper_law

ARRAYS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau")
CUT = hc.constant_cut(clay=(0.01, 0.02), length=0.03, control="sampled")


def same(a, b, names=ARRAYS):
    return {name for name in names if not np.array_equal(getattr(a, name), getattr(b, name))}


@pytest.mark.plain
@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize(
    "kw",
    [
        {},
        dict(operator=hc.Operator()),
        dict(Ts=1.44e-3, force=(1.0, 0.3)),
        dict(torque_limit=(0.05, 0.05)),
        dict(interface=hc.Interface(delay=5e-4, jitter=1e-5, lost=0.1, dac_bits=12)),
    ],
    ids=["ideal", "hand", "slow", "limits", "hardware"],
)
def test_the_papers_controller_as_a_law_gives_the_same_bits(kw, engine):
    if kw.get("interface"):  # a lost sample holds the torque, but the compensator goes on
        kw = {"interface": replace(kw["interface"], lost=0.0)}
    s = replace(CUT, **kw)
    params = [0.01, 0.02, 90.0, *paper_law.memory(s.gain, s.Ts or s.dt)]
    own = replace(s, controller=hc.Controller(paper_law.paper, [0.0] * 8, params))
    built_in, mine = hc.simulate(s, engine=engine), hc.simulate(own, engine=engine)
    # where an interface is given, fe of the built-in one is what the motors hold
    names = set(ARRAYS) - ({"fe"} if s.interface else set())
    assert not same(built_in, mine, names)
    assert str(built_in.outcome) == str(mine.outcome) and built_in.crossings == mine.crossings
    assert not mine.delta.any()  # there is no compensator


def to_pose(t, q, qd, fh, state, params):
    """Proportional, derivative and, in its state, integral action on each joint."""
    k, d, i = params
    e1, e2 = 0.5 * math.pi - q[0], -0.5 * math.pi - q[1]
    s1, s2 = state[0] + i * e1, state[1] + i * e2
    return (k * e1 - d * qd[0] + s1, k * e2 - d * qd[1] + s2), (s1, s2)


POSE = hc.Scenario(
    control="sampled",
    render="implicit",
    clay=hc.constant_cut(b=30.0).clay,
    controller=hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01)),
    start=(0.05, 0.02),
    force=(0.5, 0.0),
    length=None,
    t_max=8.0,
    Ts=7.2e-4,
)


@pytest.mark.plain
def test_a_law_with_a_state_holds_its_pose_against_a_force_in_every_engine():
    a = hc.simulate(POSE, engine="python")
    assert np.allclose(a.q[-1], (0.5 * math.pi, -0.5 * math.pi), rtol=0.0, atol=1e-3)
    u = hc.Arm().links
    # at rest the motors hold the force: tau = -J' fh, J' fh = (-l1 fx + ..., ...) at this pose
    assert np.allclose(a.tau[-1], [u[0] * 0.5 - u[1] * 0.0, 0.0], atol=2e-3)
    b = hc.simulate(POSE, engine="native")
    c, d = hc.simulate_batch([POSE, replace(POSE, t_max=1.0)])
    assert not same(a, b) and not same(a, c) and d.outcome.time == 1.0


def test_what_numba_cannot_compile_runs_in_python_to_the_same_numbers(capfd):
    seen = {}

    def law(t, q, qd, fh, state, params):
        seen[t] = q  # a dictionary of the caller's
        return to_pose(t, q, qd, fh, state, params)

    s = replace(POSE, controller=hc.Controller(law, (0.0, 0.0), (20.0, 2.0, 0.01)), t_max=0.1)
    plain = hc.simulate(s, engine="python")
    capfd.readouterr()
    native, again = hc.simulate(s, engine="native"), hc.simulate(s, engine="native")
    assert not same(plain, native) and not same(plain, again)
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 1 and said[0].startswith("hapticclay: Python runs the controller ")
    assert "seen" in said[0]
    assert len(seen) >= 0.1 / 7.2e-4


def test_a_law_may_call_other_functions(capfd):
    s = replace(POSE, t_max=0.05, controller=hc.Controller(outer, (), (3.0,)))
    a, b = (hc.simulate(s, engine=e) for e in ("python", "native"))
    assert not same(a, b) and not capfd.readouterr().err


def outer(t, q, qd, fh, state, params):
    return inner(q, params[0]), ()


def inner(q, k):
    return -k * (q[0] - 1.5), -k * (q[1] + 1.5)


def divides(t, q, qd, fh, state, params):
    return (1.0 / (q[0] - q[0]), 0.0), state


def too_long(t, q, qd, fh, state, params):
    return (0.0, 0.0), (1.0, 2.0)


def no_pair(t, q, qd, fh, state, params):
    return 0.0


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize(
    "law,said", [(divides, "ZeroDivisionError"), (too_long, "state must"), (no_pair, "TypeError")]
)
def test_a_law_that_fails_says_when_and_why(law, said, engine, capfd):
    s = replace(POSE, controller=hc.Controller(law, (0.0,)))
    with pytest.raises(LawFailed, match=said) as e:
        hc.simulate(s, engine=engine)
    assert "t = 0 s" in str(e.value) and e.value.__cause__ is not None


def raises_later(t, q, qd, fh, state, params):
    if t > 0.05:
        raise ValueError("no such place")
    return (0.0, 0.0), state


def not_a_number(t, q, qd, fh, state, params):
    return (math.nan, 0.0), state


@pytest.mark.parametrize("engine", ["python", "native"])
def test_a_law_that_raises_later_ends_the_run_where_it_raises(engine, capfd):
    s = replace(POSE, controller=hc.Controller(raises_later, (0.0,)), t_max=0.2)
    with pytest.raises(LawFailed, match="t = 0.0504 s: ValueError: no such place"):
        hc.simulate(s, engine=engine)
    assert not capfd.readouterr().err


@pytest.mark.parametrize("engine", ["python", "native"])
def test_first_torques_that_are_not_finite_are_an_error(engine):
    s = replace(POSE, controller=hc.Controller(not_a_number, (0.0,)))
    with pytest.raises(LawFailed, match=r"t = 0 s: .* must be finite, not \(nan, 0.0\)"):
        hc.simulate(s, engine=engine)


def counting():
    n = 0.0

    def law(t, q, qd, fh, state, params):
        nonlocal n
        n += 1e-3
        return (n, 0.0), state

    return law


def test_a_law_that_changes_a_variable_around_it_runs_in_python(capfd):
    a, b = (
        hc.simulate(replace(POSE, t_max=0.05, controller=hc.Controller(counting())), engine=e)
        for e in ("python", "native")
    )
    assert not same(a, b) and a.tau[-1, 0] > 0.0
    assert "changes n, a variable outside of it" in capfd.readouterr().err


PULL = 1.0


def pulls(t, q, qd, fh, state, params):
    return (PULL, 0.0), state


def test_machine_code_of_a_law_follows_a_number_outside_of_it_from_run_to_run(monkeypatch):
    s = replace(POSE, t_max=0.01, controller=hc.Controller(pulls))
    assert hc.simulate(s, engine="native").tau[-1, 0] == 1.0
    monkeypatch.setitem(globals(), "PULL", 2.0)
    assert hc.simulate(s, engine="native").tau[-1, 0] == 2.0


@pytest.mark.parametrize("engine", ["python", "native"])
def test_torques_that_are_not_finite_end_the_run(engine):
    s = replace(POSE, controller=hc.Controller(burst, (0.0,)))
    r = hc.simulate(s, engine=engine)
    assert r.outcome.code in ("diverged", "out of reach") and np.isfinite(r.p).all()


def burst(t, q, qd, fh, state, params):
    return (math.inf if t > 0.1 else 0.0, 0.0), state


@pytest.mark.parametrize(
    "make,field",
    [
        (lambda: hc.Controller(3), "controller.law"),
        (lambda: hc.Controller("nowhere:law"), "controller.law"),
        (lambda: hc.Controller("math:no_such"), "controller.law"),
        (lambda: hc.Controller(to_pose, state=("a",)), "controller.state[0]"),
        (lambda: hc.Controller(to_pose, params=(math.nan,)), "controller.params[0]"),
        (lambda: replace(POSE, control="continuous", Ts=None, render="held"), "control"),
        (lambda: replace(POSE, render="held", interface=hc.Interface(passivity=True)), "interface"),
        (lambda: replace(POSE, shaping=True), "shaping"),
        (lambda: hc.Scenario(controller=to_pose), "controller"),
    ],
)
def test_bad_controllers_are_refused_by_name(make, field):
    with pytest.raises(ParameterError) as e:
        make()
    assert e.value.field == field


def test_a_law_may_be_named():
    c = hc.Controller("tests.oracles.paper_law:paper")
    assert c.law is paper_law.paper and c == hc.Controller(paper_law.paper)


def test_a_partial_law_works_too():
    s = replace(POSE, t_max=0.05, controller=hc.Controller(functools.partial(outer), (), (3.0,)))
    assert hc.simulate(s, engine="native").outcome.code == "time limit"
