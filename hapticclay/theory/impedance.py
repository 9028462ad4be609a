"""The impedance that a hand feels, split into stiffness, damping and mass, and transparency.

In a sampled loop a sinusoidal muscle force causes sidebands at every multiple of the sampling
frequency. The response is then that of the fundamental. It is exact: the pulse transfer function of
the held arm gives it at the samples, and the spectrum of the hold between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import checked, named
from ..errors import ParameterError, array_of
from ..model import controller
from ..model.operator import Operator
from ..results import Result
from ..scene.virtual_wall import VirtualWall
from . import linear_loop
from .loops import Loop, of_loop
from .wall_limits import wall_law

UNIT_SPRING = Operator(0.0, 0.0, 1.0)


@named
@dataclass(frozen=True, eq=False, repr=False)
class Impedance(Result):
    """Impedance at the hand over frequency, computed or measured.

    Stiffness, damping and mass are effective values (Colonnese, Sketch, Okamura, Closed-loop
    stiffness and damping accuracy of impedance-type haptic displays, IEEE Haptics Symposium 2014):
    the spring or mass, and the damper, that have the same impedance at this frequency.

    Attributes:
        omega: [rad/s], shape (n,).
        Z: fh/v, hand force over handle velocity [N.s/m], complex, shape (n,).
        transparency: fe/fh, the share of the hand's force that is rendered, complex, (n,).
        rendered: Ze, the desired impedance [N.s/m], complex, shape (n,).
    """

    drawn_by = "hapticclay.views.impedance_plots:effective_parts_plot"

    omega: np.ndarray
    Z: np.ndarray
    transparency: np.ndarray
    rendered: np.ndarray

    def headline(self) -> str:
        """Band and range of |Z|, in one line."""
        f, size = self.frequency, np.abs(self.Z)
        span = f"{len(f)} lines, {f[0]:.3g} to {f[-1]:.3g} Hz"
        return f"{span}, |Z| {size.min():.3g} to {size.max():.3g} N.s/m"

    def tables(self) -> dict[str, dict[str, list[float]]]:
        """The numbers in the figures, columns headed with their units."""
        return {
            "impedance": {
                "f [Hz]": self.frequency.tolist(),
                "Re Z [N.s/m]": self.Z.real.tolist(),
                "Im Z [N.s/m]": self.Z.imag.tolist(),
                "effective stiffness [N/m]": self.stiffness.tolist(),
                "effective damping [N.s/m]": self.damping.tolist(),
                "effective mass [kg]": self.mass.tolist(),
                "|fe/fh|": np.abs(self.transparency).tolist(),
                "phase of fe/fh [deg]": np.degrees(np.angle(self.transparency)).tolist(),
                "|Z/Ze|": np.abs(self.ratio).tolist(),
                "phase of Z/Ze [deg]": np.degrees(np.angle(self.ratio)).tolist(),
            }
        }

    @property
    def frequency(self) -> np.ndarray:
        """[Hz], shape (n,)."""
        return self.omega / (2.0 * math.pi)

    @property
    def damping(self) -> np.ndarray:
        """Effective damping, Re Z [N.s/m], shape (n,)."""
        return self.Z.real

    @property
    def stiffness(self) -> np.ndarray:
        """Effective stiffness, -omega Im Z [N/m], (n,); NaN where Z is inertial."""
        return np.where(self.Z.imag < 0.0, -self.omega * self.Z.imag, np.nan)

    @property
    def mass(self) -> np.ndarray:
        """Effective mass, Im Z/omega [kg], shape (n,); NaN where Z is elastic."""
        return np.where(self.Z.imag > 0.0, self.Z.imag / self.omega, np.nan)

    @property
    def ratio(self) -> np.ndarray:
        """Z/Ze, effective over rendered impedance, complex, shape (n,); NaN where Ze = 0."""
        out = np.full(self.Z.shape, complex(np.nan, np.nan))
        return np.divide(self.Z, self.rendered, out=out, where=self.rendered != 0.0)


@of_loop("K", "b", "omega", timing=True)
def loop_response(loop: Loop, omega: np.ndarray) -> Impedance:
    """Impedance of a loop at the hand, over frequency.

    In continuous time, with or without delay, it does not depend on the hand. In a sampled loop it
    is the ratio of fundamentals under a sinusoidal muscle force. The operator's arm returns
    sidebands, so the result depends slightly on the arm. For a loop that is unstable with this hand
    the result is only formal, because there is no steady state.

    Args:
        loop: the loop with its K; or axis, K, b, omega, and other parts by name.
        omega: [rad/s], > 0, shape (n,).

    Raises:
        ParameterError: a frequency is not above 0.
    """
    omega = frequencies(omega)
    s = 1j * omega
    rendered = loop.b + loop.k / s
    if loop.Ts is None:
        Z, sent = late_impedance(loop, omega), np.exp(-s * loop.delay)
        force = rendered * (sent if loop.render == "held" else 1.0)
        return Impedance(omega, Z, force / Z, rendered)
    v, fh, fe = _sampled_response(loop, omega)
    return Impedance(omega, fh / v, fe / fh, rendered)


@of_loop("K", "b", "omega", timing=True)
def loop_impedance(loop: Loop, omega: np.ndarray) -> np.ndarray:
    """fh/v of a loop, the Z of `loop_response` [N.s/m], complex, shape (n,).

    Args:
        loop: the loop with its K; or axis, K, b, omega, and other parts by name.
        omega: [rad/s], > 0, shape (n,).

    Raises:
        ParameterError: a frequency is not above 0.
    """
    return loop_response(loop, omega).Z


def frequencies(omega: Sequence[float] | np.ndarray) -> np.ndarray:
    """Frequencies as an array of floats."""
    out = np.atleast_1d(array_of("omega", omega))
    if out.ndim != 1 or not np.all(np.isfinite(out)) or np.any(out <= 0.0):
        raise ParameterError("omega", omega, "must be numbers above 0 rad/s, shape (n,)")
    return out


def late_impedance(loop: Loop, omega: np.ndarray) -> np.ndarray:
    """fh/v of a loop in continuous time with motors delayed by loop.delay [N.s/m], complex, (n,).

    The closed-loop polynomial is P + Th N with any hand Th, so p = (N/P) fh without one.
    """
    s = 1j * omega
    late = np.exp(-s * loop.delay)
    now, then = _now_and_late(replace(loop, operator=None))
    # N does not depend on the clay: it is the term added by a hand of Th = 1 N/m
    bare = replace(loop, b=0.0, k=0.0, operator=None)
    touched = zip(
        _now_and_late(replace(bare, operator=UNIT_SPRING)), _now_and_late(bare), strict=True
    )
    N_now, N_then = (a - b for a, b in touched)
    return (now(s) + late * then(s)) / (s * (N_now(s) + late * N_then(s)))


def _now_and_late(loop: Loop) -> tuple[Polynomial, Polynomial]:
    """The closed-loop polynomial as its undelayed part and its delayed part from the motors."""
    physical, motors, driven = linear_loop.delayed_polynomials(loop)
    return physical, motors + loop.gain * driven


def _sampled_response(loop: Loop, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fundamentals of v, fh and fe per unit of a sinusoidal muscle force in the sampled loop.

    The control law is that of `linear_loop.sampled_differences`, at z = exp(j omega Ts).
    """
    Ts, th, b, k, n = loop.Ts, loop.hand, loop.b, loop.k, loop.compensator.order
    assert Ts is not None
    s, physical = 1j * omega, float(loop.render == "physical")
    W = loop.servo.S.gain if loop.mobility is None else loop.mobility
    shaped = loop.servo.S.gain / W - 1.0  # share of the net force that shapes the inertia
    total = 1.0 / W + th.mass
    damper, spring = th.damper + physical * b, th.spring + physical * k
    arm = linear_loop.held_arm(total, damper, spring, Ts, loop.delay, omega)
    # compensator and reference model, to the net force
    D, B = linear_loop.held_change(loop, loop.gain)
    ahead = np.expm1(s * Ts)[:, None, None] * np.eye(n + 2) - D
    states = np.linalg.solve(ahead, np.broadcast_to(B[:, None], (len(s), n + 2, 1)))[:, :, 0]
    through = controller.controller_matrices(loop.servo, loop.compensator, loop.gain)[1][-1]
    law, delta = controller.feedback_vector(loop.servo), loop.compensator.state_space()[2]
    per_force = (states @ np.array([*(law[2] * delta), *law[4:]]) + through) / W + shaped
    # f = uh - Th p - b v - k p with the acceleration under the force that acted until the sample
    share = th.mass / total
    f_place, f_own = share * spring - th.spring - k, 1.0 - share
    f_speed = share * damper - th.damper - b
    u_place = per_force * f_place + law[0] / W - (1.0 - physical) * k
    u_speed = per_force * f_speed + law[1] / W - (1.0 - physical) * b
    loop_gain = u_place * arm.held_place + u_speed * arm.held_speed
    loop_gain = loop_gain - per_force * share * arm.before
    commanded = (u_place * arm.place + u_speed * arm.speed + per_force * f_own) / (1.0 - loop_gain)
    v = arm.speed * (1.0 + arm.hold * commanded)
    fh = 1.0 - (th.mass * s + th.damper + th.spring / s) * v
    if physical:
        return v, fh, (b + k / s) * v
    rendered = b * (arm.speed + arm.held_speed * commanded) + k * (
        arm.place + arm.held_place * commanded
    )
    return v, fh, arm.hold * rendered


@checked
def wall_response(wall: VirtualWall, omega: np.ndarray) -> Impedance:
    """Impedance of a virtual wall at the hand, over frequency: the fundamental, exact.

    The wall acts everywhere (unilateral=False), without Coulomb friction and encoder steps. The
    operator's arm returns sidebands, so the result depends slightly on the arm.

    Args:
        wall: the wall; friction and quantum of its device are ignored.
        omega: [rad/s], > 0, shape (n,).

    Raises:
        ParameterError: a frequency is not above 0.
    """
    omega = frequencies(omega)
    s, Ts, d, th = 1j * omega, wall.Ts, wall.device, wall.hand
    arm = linear_loop.held_arm(
        d.mass + th.mass, d.damper + th.damper, th.spring, Ts, wall.delay, omega
    )
    by_place, speed = wall_law(wall, omega * Ts)  # force per unit of each, measured
    place = wall.K + by_place
    held = place * arm.held_place + speed * arm.held_speed
    commanded = -(place * arm.place + speed * arm.speed) / (1.0 + held)
    v = arm.speed * (1.0 + arm.hold * commanded)
    fh = 1.0 - (th.mass * s + th.damper + th.spring / s) * v
    return Impedance(omega, fh / v, -arm.hold * commanded / fh, wall.K / s + wall.B + wall.M * s)


@checked
def wall_impedance(wall: VirtualWall, omega: np.ndarray) -> np.ndarray:
    """Force of the hand over velocity of the device with the wall, fh/v, without a hand: exact.

    The Z of `wall_response`. At multiples of pi/Ts a real force aliases onto itself, so its
    impedance depends on its phase.

    Args:
        wall: the wall with its K; friction, quantum, surface and hand are ignored. If it is
            unstable without a hand, the motion needs a hand that stabilises it.
        omega: frequencies, > 0 [rad/s], shape (n,).

    Returns:
        [N.s/m], shape (n,), complex.

    Raises:
        ParameterError: a frequency is not above 0.
    """
    return wall_response(replace(wall, operator=None), omega).Z
