"""A sampled controller of the user's own: the paper's as one, others, and what goes wrong."""

import functools
import itertools
import math
import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.errors import ParameterError
from hapticclay.kernel import scene
from hapticclay.model.sampled_controller import LawCaller, LawFailed
from tests.hunt import some
from tests.oracles import paper_law

ARRAYS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau")
CUT = hc.constant_cut(clay=(0.004, 0.006), length=0.008, control="sampled")


def same(a, b, names=ARRAYS):
    return {name for name in names if not np.array_equal(getattr(a, name), getattr(b, name))}


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize(
    "kw",
    [
        {},
        dict(Ts=1.44e-3, force=(1.0, 0.3)),
        dict(torque_limit=(0.05, 0.05)),
        # without dropout: a lost sample holds the torque, but the built-in compensator goes on
        dict(
            hardware=hc.Hardware(delay=5e-4, jitter=1e-5, dac_bits=12),
            operator=hc.Operator(),
        ),
    ],
    ids=["ideal", "slow", "limits", "hardware, hand"],
)
def test_the_papers_controller_as_a_law_gives_the_same_bits(kw, engine, capsys):
    s = replace(CUT, **kw)
    params = [0.004, 0.006, 90.0, *paper_law.memory(s.gain, s.Ts or s.dt)]
    own = replace(s, controller=hc.Controller(paper_law.paper, [0.0] * 8, params))
    built_in, mine = hc.simulate(s, engine=engine), hc.simulate(own, engine=engine)
    # where hardware is given, fe of the built-in one is what the motors hold
    names = set(ARRAYS) - ({"fe"} if s.hardware else set())
    assert not same(built_in, mine, names)
    assert str(built_in.outcome) == str(mine.outcome) and built_in.crossings == mine.crossings
    assert not mine.delta.any()  # there is no compensator
    assert not capsys.readouterr().err


def to_pose(t, q, qd, fh, state, params):
    """Proportional, derivative and, in its state, integral action on each joint."""
    k, d, i = params
    e1, e2 = 0.5 * math.pi - q[0], -0.5 * math.pi - q[1]
    s1, s2 = state[0] + i * e1, state[1] + i * e2
    return (k * e1 - d * qd[0] + s1, k * e2 - d * qd[1] + s2), (s1, s2)


POSE = hc.Scenario(
    control="sampled",
    render="physical",
    clay=hc.constant_cut(b=30.0).clay,
    controller=hc.Controller(to_pose, (0.0, 0.0), (20.0, 2.0, 0.01)),
    start=(0.05, 0.02),
    force=(0.5, 0.0),
    length=None,
    t_max=6.0,
    Ts=7.2e-4,
)


def test_a_law_with_a_state_holds_its_pose_against_a_force_in_every_engine():
    pose = replace(POSE, dt=7.2e-4)
    a = hc.simulate(pose, engine="python")
    assert np.allclose(a.q[-1], (0.5 * math.pi, -0.5 * math.pi), rtol=0.0, atol=1e-3)
    u = hc.Arm().links
    # at rest the motors hold the force: tau = -J' fh, J' fh = (-l1 fx + ..., ...) at this pose
    assert np.allclose(a.tau[-1], [u[0] * 0.5 - u[1] * 0.0, 0.0], atol=2e-3)
    b = hc.simulate(pose, engine="native")
    c, d = hc.simulate_batch([pose, replace(pose, t_max=1.0)])
    assert not same(a, b) and not same(a, c) and d.outcome.time == 1.0


def test_a_law_may_keep_what_it_sees(capfd):
    seen = {}

    def law(t, q, qd, fh, state, params):
        seen[t] = q  # a dictionary of the caller's
        return to_pose(t, q, qd, fh, state, params)

    s = replace(POSE, controller=hc.Controller(law, (0.0, 0.0), (20.0, 2.0, 0.01)), t_max=0.1)
    plain = hc.simulate(s, engine="python")
    native = hc.simulate(s, engine="native")
    assert not same(plain, native) and not capfd.readouterr().err
    n = len(seen)
    assert n >= 0.1 / 7.2e-4 and [*seen] == plain.t[::2][:n].tolist()
    assert [*map(list, seen.values())] == plain.q[::2][:n].tolist()


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
    s = replace(POSE, controller=hc.Controller(law))
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
    s = replace(POSE, controller=hc.Controller(raises_later), t_max=0.2)
    with pytest.raises(LawFailed, match="t = 0.0504 s: ValueError: no such place"):
        hc.simulate(s, engine=engine)
    assert not capfd.readouterr().err


@pytest.mark.parametrize("engine", ["python", "native"])
def test_first_torques_that_are_not_finite_are_an_error(engine):
    s = replace(POSE, controller=hc.Controller(not_a_number))
    with pytest.raises(LawFailed, match=r"t = 0 s: .* must be finite, not \(nan, 0.0\)"):
        hc.simulate(s, engine=engine)


def counting():
    n = 0.0

    def law(t, q, qd, fh, state, params):
        nonlocal n
        n += 1e-3
        return (n, 0.0), state

    return law


def test_a_law_may_change_a_variable_around_it(capfd):
    a, b = (
        hc.simulate(replace(POSE, t_max=0.05, controller=hc.Controller(counting())), engine=e)
        for e in ("python", "native")
    )
    assert not same(a, b) and a.tau[-1, 0] > 0.0 and not capfd.readouterr().err


PULL = 1.0


def pulls(t, q, qd, fh, state, params):
    return (PULL, 0.0), state


def test_a_law_follows_a_number_outside_of_it_from_run_to_run(monkeypatch):
    s = replace(POSE, t_max=0.01, controller=hc.Controller(pulls))
    assert hc.simulate(s, engine="native").tau[-1, 0] == 1.0
    monkeypatch.setitem(globals(), "PULL", 2.0)
    assert hc.simulate(s, engine="native").tau[-1, 0] == 2.0


@pytest.mark.parametrize("engine", ["python", "native"])
def test_torques_that_are_not_finite_end_the_run(engine):
    s = replace(POSE, controller=hc.Controller(burst))
    r = hc.simulate(s, engine=engine)
    assert r.outcome.code in ("diverged", "out of reach") and np.isfinite(r.p).all()


def burst(t, q, qd, fh, state, params):
    return (math.inf if t > 0.1 else 0.0, 0.0), state


@pytest.mark.parametrize(
    "make,field",
    [
        (lambda: hc.Controller(3), "controller.law"),
        (lambda: hc.Controller("no name"), "controller.law"),
        (lambda: hc.Controller(""), "controller.law"),
        (lambda: hc.Controller("os:path:join"), "controller.law"),
        (lambda: hc.Controller(to_pose, state=("a",)), "controller.state[0]"),
        (lambda: hc.Controller(to_pose, params=(math.nan,)), "controller.params[0]"),
        (lambda: replace(POSE, control="continuous", Ts=None, render="held"), "control"),
        (lambda: replace(POSE, render="held", hardware=hc.Hardware(passivity=True)), "hardware"),
        (lambda: replace(POSE, inertia_shaping=True), "inertia_shaping"),
        (lambda: hc.Scenario(controller=to_pose), "controller"),
    ],
)
def test_bad_controllers_are_refused_by_name(make, field):
    with pytest.raises(ParameterError) as e:
        make()
    assert e.value.field == field


def test_a_law_may_be_named(tmp_path):
    c, law = hc.Controller("tests.oracles.paper_law:paper"), paper_law.paper
    assert c.law == "tests.oracles.paper_law:paper" and c.function() is law
    assert c == hc.Controller(law) and hash(c) == hash(hc.Controller(law))
    assert c != hc.Controller(to_pose) and c != hc.Controller(law, (1.0,)) and c != law
    assert pickle.loads(pickle.dumps(c)) == c
    scene = replace(POSE, controller=c)
    again = hc.Scenario.load(scene.save(tmp_path / "named.toml"))
    assert again == scene == hc.with_fields(scene, {"t_max": POSE.t_max})
    of_function = replace(POSE, controller=hc.Controller(law)).save(tmp_path / "other.toml")
    told = of_function.read_text().replace("other", "named")
    assert told == again.save(tmp_path / "named.toml").read_text()


RUNS_AWAY = {
    "quits": "raise SystemExit(0)",
    "fails": "raise ZeroDivisionError('x')",
    "lacks": "",
    "number": "law = 3",
}


@pytest.mark.parametrize("name", RUNS_AWAY)
def test_opening_a_file_runs_nothing_and_a_run_refuses_what_it_cannot_import(
    name, tmp_path, monkeypatch, capsys
):
    module, ran = f"module_that_{name}", tmp_path / "ran"
    source = f"import pathlib\npathlib.Path({str(ran)!r}).touch()\n{RUNS_AWAY[name]}\n"
    (tmp_path / f"{module}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    named = replace(POSE, controller=hc.Controller(f"{module}:law"))
    file = named.save(tmp_path / "scene.toml")
    made = hc.simulate(replace(POSE, t_max=0.01, controller=hc.Controller(idle)), engine="python")
    folder = replace(made, scenario=named).save(tmp_path / "record")
    assert hc.Scenario.load(file) == named
    assert hc.Record.load(folder).scenario.controller == named.controller
    assert main(["info", str(folder)]) == 0 and f"{module}:law" in capsys.readouterr().out
    assert main(["export", str(folder), "--format", "csv", "--out", str(tmp_path / "a.csv")]) == 0
    assert not ran.exists()
    for start in (hc.simulate, lambda s: hc.simulate_batch([s])):
        with pytest.raises(ParameterError, match="must .*function") as e:
            start(named)
        assert e.value.field == "controller.law" and "\n" not in str(e.value)
    assert ran.exists()


def idle(t, q, qd, fh, state, params):
    return (0.0, 0.0), state


LATE = hc.Hardware(delay=2e-3, dropout_probability=0.2)
ERRORS = KeyboardInterrupt, SystemExit, GeneratorExit
ENDS = itertools.product(("python", "native"), (None, LATE), ERRORS, (0.0, 0.05))


@pytest.mark.parametrize("engine,parts,error,when", some(ENDS, 10))  # these have all pairs
def test_what_a_law_raises_ends_the_run_and_is_raised(engine, parts, error, when):
    asked, raised = [], error("as asked")

    def law(t, q, qd, fh, state, params):
        asked.append(t)
        if t >= when:
            raise raised
        return (0.0, 0.0), state

    s = replace(POSE, controller=hc.Controller(law), hardware=parts, t_max=0.2)
    with pytest.raises(error) as e:
        hc.simulate(s, engine=engine)
    assert e.value is raised
    assert sum(t >= when for t in asked) == 1 and asked[-1] < when + 0.01


@pytest.mark.parametrize("keep", ["records", "summaries"])
def test_a_batch_raises_what_a_law_raises(keep):
    def law(t, q, qd, fh, state, params):
        if t > 0.05:
            raise SystemExit(3)
        return (0.0, 0.0), state

    scenes = [replace(POSE, t_max=0.1, force=(0.01 * i, 0.0)) for i in range(5)]
    scenes[3] = replace(scenes[3], controller=hc.Controller(law))
    scenes = [replace(s, controller=s.controller or hc.Controller(idle)) for s in scenes]
    with pytest.raises(SystemExit) as e:
        hc.simulate_batch(scenes, threads=2, keep=keep)
    assert e.value.code == 3


def test_ctrl_c_at_any_moment_of_a_law_ends_the_run():
    """It comes before the first line of the call, too, where nothing can keep it."""
    asked = []

    class Signalled(LawCaller):
        def __call__(self, buffer=None):
            asked.append(1)
            if len(asked) == 3:
                raise KeyboardInterrupt
            super().__call__(buffer)

    s = replace(POSE, controller=hc.Controller(counting()), t_max=0.2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene, "LawCaller", Signalled)
        patch.setattr(sys, "unraisablehook", lambda told: None)
        with pytest.raises(KeyboardInterrupt):
            hc.simulate(s, engine="native")
    assert len(asked) <= 4  # a step that ends nowhere is worked out once more


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize(
    "answer", [0.0, (1.0, 2.0), ((1.0,), ()), ((1.0, 2.0, 3.0), ()), ((0.0, 0.0), 0.0), None, "ab"]
)
def test_a_law_is_told_what_to_return(answer, engine, capfd):
    s = replace(POSE, controller=hc.Controller(lambda *measured: answer), t_max=0.01)
    with pytest.raises(LawFailed, match=r"must return \(\(shoulder, elbow\), state\)") as e:
        hc.simulate(s, engine=engine)
    assert repr(answer) in str(e.value)


def nan_later(t, q, qd, fh, state, params):
    return (math.nan if 0.1 < t < 0.101 else 0.0, 0.0), state


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize("parts", [None, LATE], ids=["bare", "late"])
def test_torques_that_are_once_not_finite_end_the_run_at_once(engine, parts):
    r = hc.simulate(
        replace(POSE, controller=hc.Controller(nan_later), hardware=parts, t_max=0.2),
        engine=engine,
    )
    assert r.outcome.code == "out of reach" and 0.1 < r.outcome.time < 0.102
    assert r.outcome.cause == "the torques of the controller are not finite"


def test_a_partial_law_works_too():
    s = replace(POSE, t_max=0.05, controller=hc.Controller(functools.partial(outer), (), (3.0,)))
    assert hc.simulate(s, engine="native").outcome.code == "time limit"
