"""Classics of leader and follower: their runs against solutions that share nothing with them."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from hapticclay.model.operator import Operator
from hapticclay.paper.classics import (
    hard_contact,
    lawrence1993,
    niemeyer1991,
    ryu2004,
    sampled_pair,
    yokokohji1994,
)
from hapticclay.paper.classics.sampled_pair import HeldArm
from hapticclay.scene.link import KINDS
from hapticclay.theory.pair_build import Build
from tests.hunt import some


def lti(*coefficients):
    return control.tf(list(coefficients), [1.0])


def test_case_1_by_python_control():
    """The loop of hand, arms and object, closed block by block."""
    arm, hand, thing = lti(6.0, 0.1, 0.0), lti(2.0, 2.0, 10.0), lti(3.0, 1.0, 50.0)
    leader = 1.0 / (arm + 3.5 * hand)  # position per force
    follower = 400.0 / (arm + thing + lti(50.0, 400.0))  # position per leader's position
    loop = control.feedback(leader, 3.5 * follower * thing)
    found = control.minreal(loop, verbose=False).poles()
    found = found[np.lexsort((found.imag, found.real))]
    # minreal cancels factors of polynomials: 1e-6 of its tolerance
    np.testing.assert_allclose(found, yokokohji1994.case1_poles(), rtol=1e-6)
    np.testing.assert_allclose(found[[1, 3]], [-3.115 + 8.555j, 0.003 + 2.974j], atol=6e-4)


@pytest.mark.parametrize("law", ["case1", "case2", "case3"])
def test_runs_of_the_simulation_by_scipy(law):
    """Accelerations from Newton's law of both arms at every instant, by a linear solution."""
    pair = yokokohji1994.pair_of(getattr(yokokohji1994, law))

    def forces(y, a, u):
        """Residual of both arms' equations."""
        row = np.array([*y, *a, u])
        signals = pair.signals
        values = [[r @ row for r in rows] for rows in signals]
        x, v, acc, f = (np.array(each) for each in values)
        if law == "case1":
            tau = 2.5 * f[0] - 3.5 * f[1], 400.0 * (x[0] - x[1]) - 50.0 * v[1]
        else:
            lead = [
                6.0 * (acc.mean() + 8.0 * (v.mean() - v[i]) + 70.0 * (x.mean() - x[i])) + 0.1 * v[i]
                for i in range(2)
            ]
            tau = lead[0] - f.mean(), lead[1] + f.mean()
            if law == "case3":
                half = 0.5 * (2.0 * acc.mean() + v.mean())
                tau = tau[0] - half + 0.63 * f.mean(), tau[1] - half - 0.63 * f.mean()
        hand = u - (2.0 * a[0] + 2.0 * y[1] + 10.0 * y[0])
        thing = 3.0 * a[1] + y[3] + 50.0 * y[2]
        return np.array(
            [
                6.0 * a[0] + 0.1 * y[1] - tau[0] - hand,
                6.0 * a[1] + 0.1 * y[3] - tau[1] + thing,
            ]
        )

    def change(t, y):
        u = 5.0 - 5.0 * np.cos(4.0 * np.pi * t)
        none = forces(y, np.zeros(2), u)
        columns = [forces(y, e, u) - none for e in np.eye(2)]
        a = np.linalg.solve(np.column_stack(columns), -none)
        return [y[1], a[0], y[3], a[1]]

    t = np.linspace(0.0, 2.0, 21)
    ours = pair.run(yokokohji1994.SWING, t)
    found = solve_ivp(change, (0.0, 2.0), np.zeros(4), t_eval=t, rtol=1e-12, atol=1e-13).y
    # 1e-12 of SciPy over some hundred steps
    np.testing.assert_allclose(ours.x, found[[0, 2]].T, atol=1e-9)
    np.testing.assert_allclose(ours.v, found[[1, 3]].T, atol=1e-9)


def test_the_ideal_response_is_a_solution():
    """Starts at rest, and obeys Newton's law of hand and object by finite differences."""
    run = yokokohji1994.direct()
    assert abs(run.x[0, 0]) < 1e-15 and abs(run.v[0, 0]) < 1e-15
    a = np.gradient(run.v[:, 0], run.t)[1:-1]
    u = yokokohji1994.SWING.at(run.t)[1:-1]
    left = 5.0 * a + 3.0 * run.v[1:-1, 0] + 60.0 * run.x[1:-1, 0] - u
    assert np.abs(left).max() < 1e-4  # second order: h^2 w^3/6 of 10 N


@pytest.mark.parametrize("dt", [1e-3, 1e-6])
def test_a_held_acceleration_diverges_at_any_step(dt):
    assert np.abs(yokokohji1994.held("hand", 0.0, dt))[-1] > 3.0**10
    assert np.abs(yokokohji1994.held("arm", 0.0, dt))[-1] < 1.0


def test_case_1_of_the_second_order_settles_by_its_polynomial():
    """z^2 + z/3 + 2.5/3 = 0 has roots of size 0.913: it holds, by a little."""
    size = np.abs(np.roots([1.0, 1.0 / 3.0, 2.5 / 3.0])).max()
    assert size == pytest.approx(0.9129, abs=1e-4) and size < 1.0


def test_an_arm_under_held_force_by_scipy():
    hand = Operator(2.0, 3.0, 40.0)
    arm = HeldArm((1.0, 0.5), (hand.mass, hand.damper, hand.spring), 0.05)
    arm.x, arm.v = 0.1, -0.2

    def change(t, y):
        return [y[1], (7.0 - 3.5 * y[1] - 40.0 * y[0]) / 3.0]

    found = solve_ivp(change, (0.0, 0.05), [0.1, -0.2], rtol=1e-12, atol=1e-14).y[:, -1]
    arm.step(7.0)
    np.testing.assert_allclose([arm.x, arm.v], found, rtol=1e-10)
    a = (7.0 - 3.5 * arm.v - 40.0 * arm.x) / 3.0
    assert arm.seen().F == pytest.approx(2.0 * a + 3.0 * arm.v + 40.0 * arm.x, rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_free_runs_are_those_of_the_map(kind):
    """The matrix of theory, state by state: formulas of each link are written twice."""
    pair = yokokohji1994.sampled(kind)
    loop = Build(pair).loop((0.05, 0.05))
    state, A, out = np.zeros(loop.states), loop.map(), []
    state[0] = 1.0
    for _ in range(300):
        out.append(state[[0, loop.leader.states]])
        state = A @ state
    # 300 products of matrices
    np.testing.assert_allclose(out, sampled_pair.free_run(pair, 50, 300), atol=1e-11)


@pytest.mark.parametrize("b", [0.5, 3.0, 80.0])
def test_energy_of_waves(b):
    """What both ends take is on its way, whatever they do."""
    taken, stored = niemeyer1991.energies(b)
    assert np.abs(taken - stored).max() < 1e-12 * stored.max() * len(taken)
    assert taken.min() >= 0.0 and taken[-1] > 0.0


def test_reflection_by_a_transmission_line():
    """d'Alembert: at a damper Z at the end of a line of impedance b the force is 2 Z/(Z + b)."""
    b, Z, u = 3.0, 7.0, 1.3
    speed = np.sqrt(2.0 * b) * u / (b + Z)
    rate, w = niemeyer1991.follower_wave(b, Z * speed, u)
    assert rate == pytest.approx(speed, rel=1e-14)
    assert w == pytest.approx((b - Z) / (b + Z) * u, rel=1e-14)
    force, sent = niemeyer1991.leader_wave(b, 0.4, w)
    assert sent**2 - w**2 == pytest.approx(2.0 * force * 0.4, rel=1e-13)  # power


def test_what_a_late_link_gives_by_quadrature():
    """Leader at V cos(w t), a spring behind T, its force T later: by SciPy over a period."""
    V, K, T, w = niemeyer1991.SPEED, niemeyer1991.SPRING, 0.1, 2.0 * np.pi

    def power(t):
        force = K * V / w * np.sin(w * (t - 2.0 * T))
        own = K * V / w * np.sin(w * (t - T)) * V * np.cos(w * (t - T))
        return force * V * np.cos(w * t) - own

    taken = quad(power, 0.0, 1.0, epsabs=1e-12)[0]
    assert -niemeyer1991.given_in_a_period() == pytest.approx(taken, rel=1e-10)


@pytest.mark.parametrize("law", lawrence1993.LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("K", [50.0, 1000.0])
def test_delay_limits_by_python_control(law, K):
    """Half the delay margin of what goes around, over all crossings of size 1."""
    thing = replace(lawrence1993.OBJECT, K=K)
    above, below = lawrence1993.around(law, thing)
    loop = control.tf(above.coeffs, below.coeffs)
    assert control.feedback(loop, 1).poles().real.max() < 0.0
    _, phase, _, _, omega, _ = control.stability_margins(loop, returnall=True)
    margins = np.radians(np.asarray(phase) % 360.0) / np.asarray(omega) / 2.0
    expected = margins.min() if len(margins) else np.inf
    # both are roots of polynomials of degree 8 and more
    assert lawrence1993.largest_delay(law, thing) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("law", lawrence1993.LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("T", [0.0, 0.02])
def test_two_port_and_felt_impedance_by_the_equations(law, T):
    """Both arms' equations at a frequency, solved as they stand."""
    s = 1j * 7.3
    late, Z = np.exp(-s * T), (6.0 * s**2 + 0.1 * s) / s
    C1, C4, Cm, Cs = (poly(s) / s for poly in (law.C1, law.C4, law.Cm, law.Cs))

    def solved(v, fe, more):
        """(v_l, v_f, f_h, f_e) of both arms and of two equations more."""
        rows = [
            [Z + Cm, C4 * late, -1.0, law.C2 * late],
            [-C1 * late, Z + Cs, -law.C3 * late, 1.0],
            [1.0, 0.0, 0.0, 0.0],
            more,
        ]
        return np.linalg.solve(np.array(rows), np.array([0.0, 0.0, v, fe]))

    h11, h12, h21, h22 = (x[0] for x in lawrence1993.two_port(law, np.array([7.3]), T))
    for v, fe, first, second in ((1.0, 0.0, h11, h21), (0.0, 1.0, h12, h22)):
        _, vf, fh, _ = solved(v, fe, [0.0, 0.0, 0.0, 1.0])
        np.testing.assert_allclose([fh, -vf], [first, second], rtol=1e-10, atol=1e-13)
    if T == 0.0:
        Ze = (3.0 * s**2 + s + 50.0) / s
        _, _, fh, _ = solved(1.0, 0.0, [0.0, -Ze, 0.0, 1.0])
        felt = lawrence1993.felt_impedance(law, np.array([s]))[0] / s
        assert felt == pytest.approx(fh, rel=1e-10)


def test_llewellyn_by_all_springs_and_masses():
    """Passive ends at one frequency are any with a real part of 0 or more: here, reactances.

    Stable with all of them means h11 - h12 h21 Y/(1 + h22 Y), felt at the hand, is passive.
    """
    law, omega = lawrence1993.LAWS[0], np.geomspace(0.5, 200.0, 60)
    for T in (1e-3, 0.1):
        h11, h12, h21, h22 = lawrence1993.two_port(law, omega, T)
        least = []
        for x in np.concatenate([-np.geomspace(1e-6, 1e6, 4000), np.geomspace(1e-6, 1e6, 4000)]):
            Ze = 1j * x
            least.append((h11 - h12 * h21 * Ze / (1.0 + h22 * Ze)).real)
        felt = np.min(least, axis=0)
        number = lawrence1993.llewellyn(law, omega, T)
        clear = np.abs(number - 1.0) > 1e-3
        assert np.array_equal(felt[clear] > 0.0, (number > 1.0)[clear])


@pytest.mark.parametrize("kind", ["position-position", "position-force", "four-channel"])
def test_lawrence_channels_are_those_of_the_links(kind):
    """The table of channels against the controls of theory."""
    law = next(x for x in lawrence1993.LAWS if x.name == kind)
    pair = yokokohji1994.sampled(kind)
    mine = sampled_pair.free_run(pair, 3, 500, lawrence1993.sampled_ends(law))
    np.testing.assert_allclose(mine, sampled_pair.free_run(pair, 3, 500), atol=1e-12)


@pytest.mark.parametrize("kind", ["position-position", "position-force", "four-channel"])
def test_runs_from_sample_to_sample_grow_as_the_map_says(kind):
    """At 150 ms, where the largest eigenvalue stands out; 60 s are many of its periods."""
    pair = yokokohji1994.sampled(kind)
    z = Build(pair).loop((0.15, 0.15)).eigenvalues[0]
    expected = np.log(np.abs(z)) / pair.Ts
    # beats of a real oscillation in two windows: some 1e-3 1/s of a slow one
    assert sampled_pair.growth(pair, 150) == pytest.approx(expected, abs=3e-3)


@pytest.mark.parametrize(
    "m, b, k",
    [(1.0, 0.0, 0.0), (1.0, 3.0, 0.0), (2.0, 4.0, 2.0), (1.0, 0.3, 50.0), (0.5, 9.0, 4.0)],
)
def test_an_oscillator_in_closed_form(m, b, k):
    """Against SciPy: no spring, no damper, critical, under- and overdamped."""

    def change(t, y):
        return [y[1], (0.7 - b * y[1] - k * y[0]) / m]

    found = solve_ivp(change, (0.0, 0.9), [0.2, -0.4], rtol=1e-12, atol=1e-14).y[:, -1]
    ours = hard_contact.moved(m, b, k, 0.7, 0.2, -0.4, 0.9)
    np.testing.assert_allclose(ours, found, rtol=1e-9, atol=1e-11)


def test_bounces_of_a_wall_by_scipy():
    """Touches found by SciPy's events, each mode integrated at 1e-12."""
    arm = hard_contact.WalledArm(1.0, 0.4, 0.0, 2e4)
    arm.x, arm.v, t, y = -0.01, 0.5, 0.0, np.array([-0.01, 0.5])
    force = 3.0
    for _ in range(200):
        arm.step(force, 1e-3)

    def touch(t, y):
        return y[0]

    touch.terminal = True
    while t < 0.2:
        K = 2e4 if y[0] > 0.0 or (y[0] == 0.0 and y[1] > 0.0) else 0.0

        def change(t, y, K=K):
            return [y[1], force - 0.4 * y[1] - K * y[0]]

        if y[0] == 0.0:
            y = np.array([1e-300 if y[1] > 0.0 else -1e-300, y[1]])
        touch.direction = -np.sign(y[0])
        run = solve_ivp(change, (t, 0.2), y, events=touch, rtol=1e-12, atol=1e-15)
        t, y = float(run.t[-1]), run.y[:, -1].copy()
        if run.status == 1:
            y[0] = 0.0
    # a touch found to 1e-13 s, at a bounce of 0.5 m/s
    np.testing.assert_allclose([arm.x, arm.v], y, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("control", ["none", "observer", "sides"])
@pytest.mark.parametrize("delay", [0, 7])
def test_the_observer_counts_the_energy_of_the_motion(control, delay):
    run = ryu2004.Teleoperation(ryu2004.HARD, control, delay=delay, time=0.3)
    energy, motion = np.array(run.energy), np.array(run.motion)
    assert np.abs(energy - motion).max() < ryu2004.BY_MOTION * np.abs(motion).max()


@pytest.mark.parametrize("seed", some(range(8), 4))
def test_late_observers_keep_their_reserves(seed):
    """Any delay up to 300 ms, any wall and gain: two reserves, and what was let out unobserved.

    That depends on gain and speed: 25 % of the reserves at most in 30 draws.
    """
    random = np.random.default_rng(seed)
    run = ryu2004.Teleoperation(
        10.0 ** random.uniform(2.5, 3.5),
        "sides",
        delay=int(random.integers(1, 300)),
        reserve=0.02,
        Kp=random.uniform(100.0, 800.0),
        speed=random.uniform(0.02, 0.1),
        time=4.0,
    )
    assert min(run.energy) >= -0.04 * 1.5
    assert np.abs(run.v).max() < 1.0
