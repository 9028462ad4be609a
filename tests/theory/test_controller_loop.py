"""The loop with a controller of one's own: its limit by theory beside oracles and runs."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.linalg

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.sampled_controller import LawFailed
from hapticclay.simulation.period_map import PeriodMaps
from hapticclay.studies import growth
from hapticclay.theory import LinearLaw, controller_loop, controller_stability
from hapticclay.theory.wall_limits import stiffness_band

TS = 1e-3
ARM = hc.Arm()
SQUARE = (0.5 * math.pi, -0.5 * math.pi)  # the nominal pose: link 1 moves the handle along x
NOMINAL = (ARM.l2, ARM.l1)
HAND = hc.Operator(0.4, 5.0, 80.0)


def notch(f, depth, width, Ts=TS):
    """Biquad b0, b1, b2, a1, a2 of a notch at f [Hz], by the bilinear transform matched there."""
    w = math.tau * f
    c = w / math.tan(0.5 * w * Ts)
    num = (c * c + 2.0 * depth * width * w * c + w * w, 2.0 * (w * w - c * c))
    num = (*num, c * c - 2.0 * depth * width * w * c + w * w)
    den = (c * c + 2.0 * width * w * c + w * w, 2.0 * (w * w - c * c))
    den = (*den, c * c - 2.0 * width * w * c + w * w)
    return tuple(x / den[0] for x in (*num, *den[1:]))


def pi_notch(t, q, qd, fh, state, params):
    """PI of position and rate of each joint, behind a notch: K, integral, rate; filter; place."""
    K, ki, kd, b0, b1, b2, a1, a2, q1, q2 = params
    torques, after = [], []
    for j, place in enumerate((q1, q2)):
        i, z1, z2 = state[3 * j : 3 * j + 3]
        error = place - q[j]
        u = error - kd * qd[j] + i
        y = b0 * u + z1
        torques.append(K * y)
        after += [i + ki * error, b1 * u - a1 * y + z2, b2 * u - a2 * y]
    return tuple(torques), tuple(after)


def pd(t, q, qd, fh, state, params):
    """Without a state; the hand's force is fed forwards."""
    K, kd, q1, q2, share = params
    return (
        K * (q1 - q[0] - kd * qd[0]) - share * fh[0],
        K * (q2 - q[1] - kd * qd[1]) + share * fh[1],
    ), ()


CONTROLLERS = {
    "PI with a notch": hc.Controller(
        pi_notch, (0.0,) * 6, (20.0, 0.001, 0.1, *notch(40.0, 0.1, 0.5), *SQUARE)
    ),
    "PD": hc.Controller(pd, (), (20.0, 0.03, *SQUARE, 0.0)),
    "PD with force": hc.Controller(pd, (), (20.0, 0.03, *SQUARE, 0.05)),
}


def scene(controller="PI with a notch", b=0.0, **kw):
    clay = hc.Profile((), (b,))
    base = dict(
        control="sampled",
        render="physical",
        controller=CONTROLLERS[controller],
        origin=NOMINAL,
        force=(0.0, 0.0),
        length=None,
        Ts=TS,
        dt=TS / 16,
        t_max=1.0,
        operator=HAND,
        clay=hc.Clay(clay, clay) if b else None,
    )
    return hc.Scenario(**(base | kw))


def at_gain(s, K):
    return replace(s, controller=replace(s.controller, params=(K, *s.controller.params[1:])))


# ---- oracles -------------------------------------------------------------------------------------


def joint_loop(s, K, j, whole, part):
    """The loop of one joint with a PI and a notch at the nominal pose, written out by hand.

    There link j alone moves the handle along axis j. x = (angle, rate, i, z1, z2, torques).
    """
    _, ki, kd, b0, b1, b2, a1, a2, *_ = s.controller.params
    inertia, length = ((ARM.I1, ARM.l1), (ARM.I2, ARM.l2))[j]
    hand, b = s.operator or hc.Operator(0.0, 0.0, 0.0), s.clay.x.values[0] if s.clay else 0.0
    M = inertia + hand.mass * length**2
    c, k = (hand.damper + b) * length**2, hand.spring * length**2
    A = np.array([[0.0, 1.0, 0.0], [-k / M, -c / M, 1.0 / M], [0.0, 0.0, 0.0]])
    first, last = (scipy.linalg.expm(A * x * TS) for x in (part, 1.0 - part))
    n = 5 + 1 + whole
    x = np.eye(n)
    u = -x[0] - kd * x[1] + x[2]
    y = b0 * u + x[3]
    torques = [K * y, *x[5:]]
    mid = first[:2, :2] @ x[:2] + np.outer(first[:2, 2], torques[whole + 1])
    end = last[:2, :2] @ mid + np.outer(last[:2, 2], torques[whole])
    return np.vstack(
        (end, x[2] - ki * x[0], b1 * u - a1 * y + x[4], b2 * u - a2 * y, torques[: whole + 1])
    )


def uncoupled(s):
    """The same controller with both links driven as if each had its own motor at the base."""

    def law(t, q, qd, fh, state, params):
        links = (q[0], q[0] + q[1]), (qd[0], qd[0] + qd[1])
        (t1, t2), after = pi_notch(t, *links, fh, state, (*params[:9], 0.0))
        return (t1 + t2, t2), after

    return replace(s, controller=replace(s.controller, law=law))


@pytest.mark.parametrize("delay,whole,part", [(0.0, 0, 0.0), (1.3e-3, 1, 0.3), (2e-3, 2, 0.0)])
@pytest.mark.parametrize("operator", [None, HAND], ids=["free", "hand"])
@pytest.mark.parametrize("b", [0.0, 40.0])
def test_the_poles_are_those_of_the_loop_written_out(delay, whole, part, operator, b):
    s = uncoupled(scene(b=b, operator=operator, hardware=hc.Hardware(delay=delay)))
    found = controller_stability(s, gain=0)
    expected = np.concatenate(
        [np.linalg.eigvals(joint_loop(s, 20.0, j, whole, part)) for j in (0, 1)]
    )
    # eigenvalues of matrices of order 16, whose least ones have condition numbers up to 1e4
    assert sorted(np.abs(found.poles)) == pytest.approx(sorted(np.abs(expected)), abs=1e-9)
    at_limit = np.concatenate(
        [np.linalg.eigvals(joint_loop(s, found.high, j, whole, part)) for j in (0, 1)]
    )
    z = at_limit[np.argmax(np.abs(at_limit))]
    assert abs(z) == pytest.approx(1.0, abs=1e-10)
    assert found.omega == pytest.approx(abs(np.angle(z)) / TS, rel=1e-8)


@pytest.mark.parametrize("late", [0, 1, 3])
def test_the_limit_is_the_gain_margin_of_python_control(late):
    """Shoulder alone, with exact velocity and a delay of whole samples."""

    def law(t, q, qd, fh, state, params):
        torques, after = pi_notch(t, q, qd, fh, state, params)
        return (torques[0], 0.0), after

    s = scene(operator=None, hardware=hc.Hardware(delay=late * TS))
    own = replace(s.controller, law=law)
    found = controller_stability(replace(s, controller=own), gain=0)
    _, ki, kd, b0, b1, b2, a1, a2, *_ = own.params
    motion = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0 / ARM.I1]], np.eye(2), 0.0)
    pi = control.ss([[1.0]], [[ki, 0.0]], [[1.0]], [[1.0, kd]], TS)
    filtered = control.ss(control.tf([b0, b1, b2], [1.0, a1, a2], TS))
    hold = control.ss(control.tf([1.0], [1.0] + [0.0] * late, TS))
    L = filtered * pi * control.sample_system(motion, TS, "zoh") * hold
    poles = [control.feedback(x * found.high * L).poles() for x in (0.999, 1.0, 1.001)]
    least, at, most = (np.abs(z).max() for z in poles)
    assert least < 1.0 < most
    assert at == pytest.approx(1.0, abs=1e-9)  # of eigenvalues of order 1, without multiples
    turn = abs(np.angle(poles[1][np.argmax(np.abs(poles[1]))]))
    assert found.omega == pytest.approx(turn / TS, rel=1e-7)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"delay": 1.4e-3},
        {"velocity_window": 5, "velocity_filter": 60.0},
        {"velocity": "exact", "delay": 3e-3},
        {"operator": HAND, "B": 0.0},
        {"M": -0.02, "Ts": 2e-4},
    ],
    ids=str,
)
def test_a_virtual_wall_has_the_limit_of_its_own_theory(change):
    wall = replace(hc.VirtualWall(K=100.0, B=2.0, device=hc.Device(0.1, 0.5)), **change)
    s = wall.scenario(1.0)
    found = controller_stability(s, gain=0)
    low, high = stiffness_band(wall)
    assert found.high == pytest.approx(high, rel=1e-7)
    assert found.low == pytest.approx(low, abs=1e-6 * high)
    assert found.stable == hc.walls.stable_wall(wall)


# ---- runs ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize(
    "change",
    [
        dict(),
        dict(operator=None, b=30.0),
        dict(hardware=hc.Hardware(delay=1.3e-3)),
        dict(hardware=hc.Hardware(delay=2e-3), operator=hc.Operator(1.0, 10.0, 300.0), b=120.0),
        dict(
            hardware=hc.Hardware(
                velocity="difference", velocity_window=3, velocity_filter=120.0, force_filter=60.0
            )
        ),
    ],
    ids=["hand", "clay", "late", "late, firm, clay", "filters"],
)
def test_runs_cross_at_the_limit(controller, change):
    """Within 0.2 %: the steps of a run are 1/16 of a sample, their error falls with the square."""
    s = scene(controller, **change)
    found = controller_stability(s, gain=0)
    assert found.stable and 0.0 < found.high < math.inf
    maps = PeriodMaps()

    def rate(K):
        m = max((maps.of(at_gain(s, K), i) for i in (0, 1)), key=growth.growth_of_map)
        return growth.growth_of_map(m)

    assert rate(0.998 * found.high) < 0.0 < rate(1.002 * found.high)


def test_a_run_decays_below_the_limit_and_grows_above():
    s = scene(hardware=hc.Hardware(delay=1.3e-3))
    high = controller_stability(s, gain=0).high
    pushed = replace(s, velocity=(1e-6, 1e-6), t_max=4.0, stop_when_unstable=False)
    below, above = (
        growth.growth_rate(hc.simulate(at_gain(pushed, share * high)), "x")
        for share in (0.998, 1.002)
    )
    assert below < 0.0 < above


# ---- linearisation -------------------------------------------------------------------------------


def test_declared_matrices_are_those_of_differences():
    s = scene()
    by_differences = controller_stability(s)
    law = by_differences.law
    _, ki, kd, b0, b1, b2, a1, a2, *_ = s.controller.params
    assert law.A[:3, :3] == pytest.approx(
        np.array([[1.0, 0.0, 0.0], [b1 - a1 * b0, -a1, 1.0], [b2 - a2 * b0, -a2, 0.0]]), abs=1e-9
    )
    assert law.D[0, [0, 2]] == pytest.approx([-20.0 * b0, -20.0 * b0 * kd], rel=1e-9)
    declared = controller_stability(s, matrices=law)
    assert declared.high == pytest.approx(by_differences.high, rel=1e-12)
    assert declared.high == pytest.approx(controller_stability(s, gain=0).high / 20.0, rel=1e-7)


def test_a_smooth_law_is_linearised_at_the_pose_where_it_rests():
    def spring(t, q, qd, fh, state, params):
        return (-params[0] * (math.sin(q[0] - 1.8) + 0.02 * qd[0]),
                -params[0] * (math.sin(q[1] + 1.7) + 0.02 * qd[1])), ()  # fmt: skip

    s = scene(controller="PD", operator=None)
    s = replace(s, controller=hc.Controller(spring, (), (20.0,)))
    found = controller_stability(s, gain=0)
    assert found.rest == pytest.approx((1.8, -1.7), abs=1e-9)
    assert found.law.D[:, :4] == pytest.approx(
        np.array([[-20.0, 0.0, -0.4, 0.0], [0.0, -20.0, 0.0, -0.4]]), abs=1e-7
    )
    straight = replace(s, controller=hc.Controller(pd, (), (20.0, 0.02, 1.8, -1.7, 0.0)))
    assert found.high == pytest.approx(controller_stability(straight, gain=0).high, rel=1e-6)


def test_the_hands_spring_loads_an_arm_that_rests_elsewhere(monkeypatch):
    """The force of a stretched spring turns with the links: the map of a run has it, too.

    Each gain has a rest of its own; one in twenty is searched, since the limit is not asked for.
    """
    monkeypatch.setattr(controller_loop, "GAINS", controller_loop.GAINS[::20])
    s = scene(controller="PD", operator=hc.Operator(0.3, 3.0, 400.0))
    away = replace(s, controller=hc.Controller(pd, (), (80.0, 0.03, 1.75, -1.75, 0.0)))
    found = controller_stability(away, gain=0)
    u1, u2 = (np.array(x) for x in np.reshape(rest_columns(found.rest), (2, 2)))
    p = np.array([u1[1] + u2[1], -u1[0] - u2[0]]) - NOMINAL
    torque = [400.0 * p @ (u1 + u2), 400.0 * p @ u2]
    e = np.array((1.75, -1.75)) - found.rest
    assert 80.0 * e == pytest.approx(torque, rel=1e-6)  # the law balances the spring
    start = replace(away, start=tuple(p.tolist()), dt=TS / 32)
    m = PeriodMaps().of(start, 0)
    rates = np.log(np.sort(np.abs(np.linalg.eigvals(m.matrix)))[::-1][:4]) / TS
    exact = np.log(np.sort(np.abs(found.poles))[::-1][:4]) / TS
    assert exact == pytest.approx(rates, abs=2e-3 * np.abs(rates).max())


def rest_columns(q):
    from hapticclay.formulas import arm

    return arm.jacobian(*q, ARM.links)


def quantized(t, q, qd, fh, state, params):
    step = 1e-3
    return (-20.0 * step * round((q[0] - SQUARE[0]) / step) - qd[0], 0.0), ()


def saturating(t, q, qd, fh, state, params):
    return (min(1e-3, max(-1e-3, -20.0 * (q[0] - SQUARE[0]))) - qd[0], 0.0), ()


def one_sided(t, q, qd, fh, state, params):
    return (-20.0 * max(0.0, q[0] - SQUARE[0]) - qd[0], 0.0), ()


def stepping(t, q, qd, fh, state, params):
    return (-0.1 * math.copysign(1.0, qd[0]) * (qd[0] != 0.0), 0.0), ()


@pytest.mark.parametrize("law", [quantized, saturating, one_sided, stepping])
def test_a_law_that_is_not_linear_around_rest_is_refused(law):
    s = replace(scene(), controller=hc.Controller(law))
    with pytest.raises(ParameterError, match="quantized, saturating or discontinuous") as e:
        controller_stability(s)
    assert e.value.field == "controller.law" and "torques[0]" in str(e.value)


def test_a_law_that_saturates_further_away_is_linear_within_a_smaller_size():
    s = replace(scene(), controller=hc.Controller(saturating))
    found = controller_stability(s, size=1e-5)
    assert found.law.D[0, :3] == pytest.approx([-20.0, 0.0, -1.0], abs=1e-6)


def drifting(t, q, qd, fh, state, params):
    return (0.1, 0.0), ()


def timed(t, q, qd, fh, state, params):
    return (-20.0 * (q[0] - SQUARE[0]) + 0.1 * math.sin(t), -20.0 * (q[1] - SQUARE[1])), ()


def failing(t, q, qd, fh, state, params):
    return q[2], state


def test_what_has_no_rest_or_no_law_is_refused():
    s = scene(operator=None)

    def refused(law, **kw):
        with pytest.raises(ParameterError) as e:
            controller_stability(replace(s, controller=hc.Controller(law)), **kw)
        return str(e.value)

    assert "come to rest" in refused(drifting)
    assert "time" in refused(timed)
    assert "no parameters" in refused(drifting, gain=0)
    with pytest.raises(LawFailed):
        controller_stability(replace(s, controller=hc.Controller(failing)))
    with pytest.raises(ParameterError, match="must be given"):
        controller_stability(hc.constant_cut())
    with pytest.raises(ParameterError, match="0 to 9"):
        controller_stability(s, gain=10)
    with pytest.raises(ParameterError, match="shape"):
        LinearLaw(np.eye(2), np.zeros((2, 6)), np.zeros((2, 3)), np.zeros((2, 6)))


# ---- the result ----------------------------------------------------------------------------------


def test_the_result_says_what_it_is_and_survives_a_file(tmp_path):
    s = scene(hardware=hc.Hardware(encoder=4000, friction=(0.01, 0.0), delay=1e-3))
    found = controller_stability(s, gain=0)
    assert found.left_out == ("encoder", "joint friction")
    assert f"to {found.high:.4g}" in found.headline() and "Hz" in found.headline()
    tables = found.tables()
    assert tables["gain"]["largest stable"] == [found.high]
    assert len(tables["poles"]["Re z"]) == len(found.poles)
    again = hc.theory.ControllerStability.load(found.save(tmp_path / "found.json"))
    assert again.high == found.high and np.array_equal(again.poles, found.poles)
    assert np.array_equal(again.law.A, found.law.A)
    assert found.plot().axes[0].get_xlabel() == "gain"


def test_theory_of_the_papers_loop_names_this_one():
    with pytest.raises(ParameterError, match="controller_stability"):
        hc.theory.gain_limit(scene(), "x")
