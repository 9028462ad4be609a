"""The leapfrog: what a kick works out, what the engine makes of it, one source for both engines."""

import dataclasses
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.model import arm, clay, controller
from hapticclay.model.operator import NO_HAND, Operator
from hapticclay.stepping import leapfrog, loop, path
from hapticclay.stepping import run as runs
from hapticclay.stepping.run import LeapfrogRun
from tests.oracles import Arm
from tests.oracles.laws import servo_kick

OTHER = dict(  # parts that have nothing in common with the paper's
    arm=hc.Arm(0.3, 0.25, 0.05, 0.4),
    servo=(
        hc.Servo(hc.SecondOrder(500.0, 30.0, 800.0), hc.SecondOrder(1.3, 25.0, 300.0)),
        hc.Servo(hc.SecondOrder(900.0, 55.0, 600.0), hc.SecondOrder(0.2, 40.0, 700.0)),
    ),
)
HANDS = Operator(0.4, 3.0, 5.0), Operator(0.1, 7.0, 20.0)
ZEROS = (  # with a zero, an output at once, complex poles; with an integrator on x alone
    hc.Compensator((0.3, 2.0), (1.0, 12.0, 0.0)),
    hc.Compensator((0.02, 1.0, 40.0, 30.0), (1.0, 14.0, 140.0, 400.0)),
)


def cut(**parts):
    return dataclasses.replace(hc.constant_cut(t_max=1.0), **parts)


CASES = {
    "plain": hc.constant_cut(t_max=1.0),
    "shaped": hc.constant_cut(t_max=1.0, shaping=True, force=(1.0, 0.3)),
    "hand": hc.constant_cut(t_max=1.0, operator=hc.Operator(), force=(2.0, 0.0)),
    "stiff": hc.constant_cut(t_max=1.0, b=1e6),
    "heavy hand": dataclasses.replace(
        hc.constant_cut(t_max=1.0), operator=Operator(100.0, 10.0, 1e5)
    ),
    "weak motors": hc.constant_cut(t_max=1.0, torque_limit=(0.2, 0.1)),
    "free": hc.free(t_max=1.0),
    "other": cut(force=(1.0, 0.3), **OTHER),
    "two hands": cut(operator=HANDS, force=(2.0, 0.3), **OTHER),
    "hand on y": cut(operator=(None, HANDS[1]), shaping=True, **OTHER),
    "formed": cut(compensator=ZEROS, force=(1.0, 0.3)),
    "all": cut(compensator=ZEROS, operator=HANDS, **OTHER),
}
fast = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="needs numba: pip install hapticclay[fast]"
)
unit = st.floats(-1.0, 1.0)


def held(compensator, h, z, f):
    """State of a compensator after a time in which the force is held, by the matrix exponential."""
    A, B, _, _ = compensator.state_space()
    n = len(B)
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A, B
    return (expm(h * M) @ (*z, f))[:n]


def kick_by_laws(run, before, after):
    """One kick put together from the laws, as docs/equations.md has it; motors without limits.

    Returns velocity, net force, torques, rates of the reference model, delta, and states of the
    compensator after it.
    """
    s, now = run.scenario, run.s
    H, L, R = (0.5 * (before + after), before / (before + after), after / (before + after))
    hands, links = [th or NO_HAND for th in s.operators], s.arm.links
    u = arm.jacobian(*now["q"], links)
    q1, q2 = now["q"]
    x, y = arm.handle_position(q1, q2, links)
    p = x - s.origin[0], y - s.origin[1]
    w1, w2 = now["w"]
    v = arm.handle_velocity(w1, w1 + w2, u)
    dx, dy, ex, ey, yx, yy, ydx, ydy, g1, g2, _, _ = now["loop"]
    statics = [servo.G.gain / servo.G.stiffness for servo in s.servo]
    dx, dy, ex, ey = (x / g for x, g in zip((dx, dy, ex, ey), statics * 2, strict=True))
    c = arm.centripetal(w1 + 0.5 * before * g1, w1 + w2 + 0.5 * before * g2, u)
    W = [s.servo[0].S.gain, 0.0, s.servo[1].S.gain] if s.shaping else [*arm.mobility(u, links)]
    b = run.b()
    trace = s.arm.l1**2 / s.arm.I1 + s.arm.l2**2 / s.arm.I2
    Wmost = trace / (1.0 + min(th.mass for th in hands) * trace)
    dampers = [th.damper for th in hands]
    b0x, b1x, b0y, b1y, stiff, *_ = clay.split_damping(b, b, H, L, R, Wmost, *dampers)
    assert not stiff
    f, d, n, a, feed, rate = [], [], [], [], [], []
    for i in (0, 1):
        th, compensator, K = hands[i], s.compensators[i], s.gain[i]
        delta, yi, ydi = (dx, dy)[i], (yx, yy)[i], (ydx, ydy)[i]
        ratio = s.servo[i].G.gain / s.servo[i].G.stiffness
        keep, take, ni, mi, spring = controller.servo_coefficients(s.servo[i].numbers, H, L, R)
        feed.append((0.0, 0.0))
        if run.s["formed"]:  # what it shows at the sample without the force of the kick, and per N
            _, B, C, D = compensator.state_space()
            z = now["form_states"][4 * i : 4 * i + compensator.order]
            delta += C @ held(compensator, 0.5 * before, z, 0.0)
            # held between equal steps; between others, one impulse at the sample
            moved = held(compensator, 0.5 * before, 0.0 * np.array(z), 1.0)
            moved = moved if before == after else 0.5 * after * B
            feed[i] = K * (C @ moved + D), take
            W[2 * i] += ni * take * ratio * feed[i][0]
        vr = keep * ydi + take * (ratio * delta - yi)
        a.append(controller.servo_acceleration(ni, mi, spring, vr, ydi, v[i], yi, p[i], c[i]))
        n.append(ni)
        rate.append([vr, delta, ratio])
        mass = th.mass + 0.25 * th.spring * H * H
        th0, th1 = th.damper * L - mass / H, th.damper * R + mass / H
        f.append(s.force[i] - (b0x, b0y)[i] * v[i] - (th.spring * p[i] - mass * c[i] + th0 * v[i]))
        d.append((b1x, b1y)[i] + th1)
    ux, uy, _, _, *ff, t1, t2 = servo_kick(H, v, u, links, n, a, W, f, d)
    each = list(zip(rate, feed, ff, strict=True))
    rates = [vr + take * ratio * e * x for (vr, _, ratio), (e, take), x in each]
    shown = [delta + e * x for (_, delta, _), (e, _), x in each]
    states = []
    for i, compensator in enumerate(s.compensators):
        if run.s["formed"]:
            z = now["form_states"][4 * i : 4 * i + compensator.order]
            drive, B = s.gain[i] * ff[i], compensator.state_space()[1]
            if before == after:
                states += [*held(compensator, H, z, drive)]
            else:
                kicked = held(compensator, 0.5 * before, z, 0.0) + H * B * drive
                states += [*held(compensator, 0.5 * after, kicked, 0.0)]
        else:
            keep, take = controller.compensator_coefficients(compensator.den[1], H, L, R)
            states.append(keep * (ex, ey)[i] + take * s.gain[i] * ff[i])
    return (ux, uy), ff, (t1, t2), rates, shown, states


@given(
    st.sampled_from(
        ["plain", "shaped", "hand", "free", "other", "two hands", "hand on y", "formed", "all"]
    ),
    st.tuples(*[unit] * 18),
    st.floats(0.1, 1.0),
    st.none() | st.floats(0.1, 1.0),
)
def test_the_kick_is_what_its_laws_say(name, x, before, after):
    """`kicks` spells its laws out; put together from the laws, a kick is the same to rounding."""
    after = before if after is None else after
    s = dataclasses.replace(CASES[name], torque_limit=(1e6, 1e6))
    run = LeapfrogRun(s, 1)
    for i in (0, 1):
        run.s["w"][i] = x[i]
    for j in range(8):
        run.s["loop"][j] = 0.1 * x[2 + j]
    formed, orders = run.s["formed"], [c.order for c in s.compensators]
    assert bool(formed) == (name in ("formed", "all"))
    for i in (0, 1):
        for j in range(orders[i] if formed else 0):
            run.s["form_states"][4 * i + j] = 0.1 * x[10 + 4 * i + j]
    before, after = before * s.dt, after * s.dt
    run.s["before"] = before
    leapfrog.propose(run.s, run.e, before, after)
    u, f, tau, rates, shown, states = kick_by_laws(run, before, after)
    raw, end = np.asarray(run.e.raw)[0], run.s["next"]
    if formed:
        own = [run.s["form_next"][4 * i + j] for i in (0, 1) for j in range(orders[i])]
    else:
        own = [end[2 + i] / servo.numbers[0] for i, servo in enumerate(s.servo)]
    delta = [raw[12 + i] / servo.numbers[0] for i, servo in enumerate(s.servo)]
    found = raw[6:8], raw[8:10], raw[10:12], end[6:8], delta, own
    for a, b, what in zip(found, (u, f, tau, rates, shown, states), "uftrds", strict=True):
        # 1/dt = 2800 multiplies roundings of the velocity
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11, err_msg=what)


@pytest.mark.parametrize("name", CASES)
def test_engine_does_what_the_kick_foretold(name, monkeypatch):
    """The rates after each engine step are those worked out."""
    worst = 0.0
    plain = leapfrog.step_engine

    def engine(s, e, command, after):
        nonlocal worst
        foretold = e.raw[0, 16], e.raw[0, 17]
        plain(s, e, command, after)
        worst = max(worst, *(abs(a - b) for a, b in zip(s["w"], foretold, strict=True)))

    monkeypatch.setattr(leapfrog, "step_engine", engine)
    monkeypatch.setattr(leapfrog.Leapfrog, "glide", lambda *a: 0)
    hc.simulate(dataclasses.replace(CASES[name], t_max=0.8), engine="python")
    assert 0.0 < worst < 1e-11  # rounding of a 2x2 solve, conditioned by b dt/Lambda = 4e2 at most


@pytest.mark.parametrize("name", CASES)
def test_whole_steps_in_a_block_are_those_made_one_by_one(name, monkeypatch):
    blocks = hc.simulate(CASES[name], engine="python")
    monkeypatch.setattr(leapfrog.Leapfrog, "glide", lambda *a: 0)
    single = hc.simulate(CASES[name], engine="python")
    for field in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"):
        np.testing.assert_array_equal(getattr(blocks, field), getattr(single, field), field)
    assert blocks.energy == single.energy and blocks.crossings == single.crossings


@pytest.mark.parametrize("name", ["plain", "shaped", "weak motors"])
def test_recorded_clay_force_is_what_changed_the_engines_momentum(name, monkeypatch):
    """M dqd/dt - tau - J' fh, from the engine's own state, is -J' fe."""
    states = []
    step = mujoco.mj_step

    def spy(model, data):
        before = (data.qpos.copy(), data.qvel.copy(), data.ctrl[:2].copy())
        step(model, data)
        states.append((*before, data.qvel.copy(), model.opt.timestep))

    monkeypatch.setattr(mujoco, "mj_step", spy)
    monkeypatch.setattr(runs, "_idle", {})  # engines that call the plain one
    s = CASES[name]
    r = hc.simulate(s, engine="python")
    whole = [x for x in states if x[4] == s.dt]
    assert len(whole) > 2500
    rows = {tuple(q): i for i, q in enumerate(r.q)}
    checked = 0
    for q, w, tau, w1, h in whole:
        i = rows.get(tuple(q))
        if i is None or i == 0 or np.any(r.b[i - 1] != r.b[i]) or np.any(r.b[i - 2] != r.b[i]):
            continue  # the start and the two samples beside a border have kicks of another length
        fe = r.fh[i] - np.linalg.solve(Arm.jacobian(q).T, Arm.M @ (w1 - w) / h - tau)
        np.testing.assert_allclose(fe, r.fe[i], atol=2e-9)  # eps * q / h^2
        checked += 1
    assert checked > 2500
    assert np.max(np.abs(r.fe)) > 1.0


def test_engine_never_sees_more_than_the_motors_can_give():
    r = hc.simulate(CASES["weak motors"])
    limit = np.array([0.2, 0.1])
    assert np.all(np.abs(r.tau) <= limit)
    assert np.any(np.abs(r.tau) == limit)


@pytest.mark.parametrize("name", CASES)
def test_a_plain_run_holds_no_numpy_numbers(name):
    """They are several times slower in CPython, and divide by zero without an error."""
    run = LeapfrogRun(CASES[name], 1)
    run.go(None)
    numbers = {k: x for k, x in run.s.items() if not isinstance(x, memoryview)}
    assert {type(x) for x in numbers.values()} == {int, float}, numbers
    assert all(isinstance(x, memoryview) for x in run.s.values() if x not in numbers.values())


@pytest.mark.parametrize("name", ["plain", "hand", "stiff"])
def test_both_ways_to_tabulate_a_block_agree(name):
    run = LeapfrogRun(CASES[name], 1)
    run.go(None)  # fills the workspace; the rows below are of its last block
    s, n = run.s, 50
    tables = []
    for tabulate in (leapfrog.tabulate, leapfrog.tabulate_each):
        s["filled"] = 0
        for j in range(path.SUMS):
            s["work"][j] = 0.1 * j
        leapfrog.prepare(s, run.e, s["dt"], s["dt"])
        e = (
            run.e
            if tabulate is leapfrog.tabulate
            else run.e._replace(raw=np.asarray(run.e.raw), varied=np.asarray(run.e.varied))
        )
        tabulate(s, e, n)
        tables.append((run.store.rows[:n].copy(), [*s["work"]]))
    (rows, work), (again, other) = tables
    np.testing.assert_array_equal(rows, again)
    assert work == other


@fast
def test_a_changed_law_changes_both_engines(tmp_path):
    """Python and machine code come from one source."""
    package = Path(hc.__file__).parent
    shutil.copytree(package, tmp_path / "hapticclay", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(package.parent / "mjcf", tmp_path / "mjcf")
    code = (
        "import sys, hapticclay as hc\n"
        "for engine in sys.argv[1:]:\n"
        "    r = hc.simulate(hc.constant_cut(t_max=0.8), engine=engine)\n"
        "    print(r.p[-1].tolist(), r.energy['clay'])\n"
    )
    env = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def ends(*engines):
        out = subprocess.run(
            [sys.executable, "-c", code, *engines],
            cwd=tmp_path,
            env=env,
            capture_output=True,
            text=True,
        )
        assert out.returncode == 0, out.stderr
        return out.stdout.splitlines()

    (python,) = ends("python")
    law = tmp_path / "hapticclay/model/clay.py"
    text = law.read_text()
    changed = text.replace("x0, y0 = L * b0[0], L * b0[1]", "x0, y0 = L * b0[0], 2.0 * L * b0[1]")
    assert changed != text
    law.write_text(changed)
    new_python, new_native = ends("python", "native")
    assert new_python == new_native != python


def test_inputs_of_a_whole_step_are_those_of_its_clay_and_hand():
    """Half of the clay on either side of the sample; all of the muscle."""
    run = LeapfrogRun(CASES["hand"], 1)
    run.s["base"][0], run.s["base"][1] = 8.0, 6.0
    for j, x in enumerate((8.0, 6.0, 0.0, 0.0)):
        run.s["old"][j] = x
    k = leapfrog.inputs(run.s, run.e, 1e-3, 1e-3)
    assert k[:7] == (4.0, 4.0, 3.0, 3.0, 0.5, 2.0, 0.0) and k[7:] == (0.0,) * 5
    assert len(loop.loop_coefficients(run.s, 1e-3, 1e-3)) == 33
