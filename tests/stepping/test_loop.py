"""One tick at a time: what the loop predicts is what the engine does."""

import dataclasses

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.model.operator import Operator
from hapticclay.stepping import inline, leapfrog
from tests.oracles import Arm

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
}


@pytest.mark.parametrize("name", CASES)
def test_inlined_loop_is_bit_identical_to_the_plain_one(name, monkeypatch):
    monkeypatch.setattr(leapfrog, "FUSE_FROM", 0)
    fused = hc.simulate(CASES[name])
    monkeypatch.setattr(leapfrog, "_fused", {})
    monkeypatch.setattr(leapfrog, "FUSE_FROM", 10**9)
    plain = hc.simulate(CASES[name])
    assert (
        not leapfrog._fused
        and inline.inline(leapfrog.glide_constant) is not leapfrog.glide_constant
    )
    for field in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta"):
        np.testing.assert_array_equal(getattr(fused, field), getattr(plain, field), err_msg=field)


@pytest.mark.parametrize("name", CASES)
def test_engine_does_what_the_tick_foretold(name, monkeypatch):
    """The rates after each engine step are the predicted ones."""
    worst = 0.0
    plain = leapfrog.Leapfrog._engine

    def engine(self, w, command, out, after):
        nonlocal worst
        plain(self, w, command, out, after)
        worst = max(worst, np.max(np.abs(np.array(self.rates) - out[2:])))

    monkeypatch.setattr(leapfrog.Leapfrog, "_engine", engine)
    monkeypatch.setattr(leapfrog.Leapfrog, "_glide", lambda self: False)
    hc.simulate(dataclasses.replace(CASES[name], t_max=0.8))
    assert worst < 1e-11  # rounding of a 2x2 solve, conditioned by b dt/Lambda = 4e2 at most


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
    s = CASES[name]
    r = hc.simulate(s)
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
