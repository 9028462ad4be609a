"""The accurate integrator: fourth order, and a guest in the engine that leaves no trace."""

import dataclasses

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from tests.oracles import nonlinear, piecewise_linear, store

EDGES = (0.05, 0.15, 0.20)
CASES = {
    "plain": dict(),
    "shaped": dict(shaping=True),
    "hand": dict(operator=hc.Operator(), force=(2.0, 0.0)),
    "off axis": dict(force=(1.0, 0.3)),
}


@pytest.mark.parametrize("name", CASES)
def test_fourth_order_and_1e_9_s_at_2_ms(name):
    s = hc.constant_cut(integrator="accurate", **CASES[name])
    th = (0.25, 2.0, 6.0) if s.operator else None
    grid = np.arange(1, 15_000) * 4e-3  # in every dt below
    exact = store.solution(
        f"fourth-order-{name}", nonlinear, (0, 90, 0), EDGES, s.gain, s.force, th, s.shaping, 60.0,
        grid, 1e-13, 1e-15,
    )  # fmt: skip
    steps, border, place = np.array([4e-3, 2e-3, 1e-3]), [], []
    for dt in steps:
        r = hc.simulate(dataclasses.replace(s, dt=float(dt)))
        border.append(np.max(np.abs(np.array([c.time for c in r.crossings]) - exact.crossings)))
        i = np.rint(exact.t / dt).astype(int)
        place.append(np.max(np.abs(r.p[i] - exact.p)))
    assert border[1] < 1e-9 and place[1] < 1e-8
    for error in (border, place):
        assert 3.6 < np.polyfit(np.log(steps), np.log(error), 1)[0] < 4.6, error


def test_agrees_with_the_fast_integrator_in_everything_recorded():
    kw = dict(operator=hc.Operator(), force=(2.0, 0.2), t_max=1.0)
    a, b = (
        hc.simulate(hc.constant_cut(**kw)),
        hc.simulate(hc.constant_cut(integrator="accurate", **kw)),
    )
    away = np.min(np.abs(a.t[:, None] - [c.time for c in a.crossings]), axis=1) > 1e-3
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.b, b.b)
    for name, scale in dict(
        p=1e-7, v=1e-4, fh=1e-2, fe=1e-2, q=1e-6, qd=1e-3, tau=1e-2, delta=1e-7
    ).items():
        np.testing.assert_allclose(
            getattr(a, name)[away], getattr(b, name)[away], atol=scale, err_msg=name
        )
    for name in a.energy:
        assert a.energy[name] == pytest.approx(b.energy[name], abs=1e-5), name
    assert a.crossings[0].speed == pytest.approx(b.crossings[0].speed, rel=1e-5)


def test_residual_of_the_energy_converges_at_fourth_order():
    steps, rest = np.array([2e-3, 1e-3, 5e-4]), []
    for dt in steps:
        e = hc.simulate(
            hc.constant_cut(
                integrator="accurate", dt=float(dt), operator=hc.Operator(), force=(2.0, 0.0)
            )
        ).energy
        rest.append(abs(e["residual"]) / e["throughput"])
    assert rest[-1] < 1e-8 and 3.5 < np.polyfit(np.log(steps), np.log(rest), 1)[0] < 4.5, rest


def test_free_path_and_a_last_step_that_is_shorter():
    exact, position = piecewise_linear((0.20,), (0.0,), 1.0, 1.0)
    r = hc.simulate(hc.free(shaping=True, integrator="accurate", dt=2e-3))
    assert r.crossings[0].time == pytest.approx(exact[0], abs=1e-10)
    r = hc.simulate(hc.free(shaping=True, integrator="accurate", dt=2e-3, t_max=0.1234567))
    assert r.t[-1] == 0.1234567 and r.p[-1, 0] == pytest.approx(position(r.t[-1:])[0], abs=1e-10)


def test_stiffness_takes_more_steps_and_then_is_refused():
    s = hc.constant_cut(integrator="accurate", b=1e4, dt=1e-3, t_max=1.0)
    r, f = hc.simulate(s), hc.simulate(dataclasses.replace(s, integrator="fast", dt=1e-4))
    assert r.steps > 15_000
    assert r.p[-1, 0] == pytest.approx(f.p[-1, 0], abs=1e-7)
    for stiff in (
        dict(clay=hc.constant_cut(b=1e9).clay),
        dict(operator=Operator(0.0, 0.0, 1e9), dt=0.02),
    ):
        with pytest.raises(ParameterError, match="explicit.*choose 'fast'"):
            hc.simulate(dataclasses.replace(s, **stiff))


def test_the_control_callback_is_removed_and_a_stranger_s_is_respected():
    hc.simulate(hc.free(integrator="accurate", t_max=0.01))
    assert mujoco.get_mjcb_control() is None

    def stop(t, x):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hc.simulate(hc.free(integrator="accurate"), progress=stop)
    assert mujoco.get_mjcb_control() is None

    def mine(model, data):
        return None

    mujoco.set_mjcb_control(mine)
    try:
        for integrator in ("fast", "accurate"):
            with pytest.raises(ParameterError, match="mjcb_control"):
                hc.simulate(hc.free(integrator=integrator))
        assert mujoco.get_mjcb_control() is mine
    finally:
        mujoco.set_mjcb_control(None)


def test_instability_is_a_result_here_too():
    r = hc.simulate(hc.constant_cut(gain=(1.0, 1.0), integrator="accurate", dt=1e-3))
    assert (r.outcome.code, r.outcome.axis) == ("diverged", "y")
    assert np.all(np.isfinite(r.p))


def test_states_are_in_the_accurate_scene_alone():
    assert hc.build(hc.constant_cut()).na == 0
    model = hc.build(hc.constant_cut(integrator="accurate"))
    assert (
        model.na == 13
        and model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
        and model.ngeom == 0
    )
    assert hc.build(hc.free(integrator="accurate")).nu == 2 + 13


def test_the_choice_is_checked():
    with pytest.raises(ParameterError, match="did you mean 'accurate'"):
        hc.constant_cut(integrator="acurate")  # type: ignore[arg-type]
