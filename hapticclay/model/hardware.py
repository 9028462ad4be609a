"""The hardware between computer and arm (Fig. 3): parts as frozen dataclasses, and their laws."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, exp, inf, sqrt, tau
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import named
from ..errors import Bound, ParameterError, check_fields
from . import flow
from .traits import LEFT_OUT, YES, Refusal, Told, Trait, present, told_values

STIFF = 1e12  # [N/m, N.s/m] upper bound of a coupling
JOINTS = ("shoulder", "elbow")


@named
@dataclass(frozen=True)
class Coupling:
    """A virtual coupling: spring and damper between the handle and a massless tool in the clay.

    Colgate, Stanley, Brown, Issues in the haptic display of tool use, IROS 1995.

    Attributes:
        spring: stiffness [N/m], > 0, at most 1e12.
        damper: damping [N.s/m], > 0, at most 1e12.
    """

    spring: Annotated[float, Bound(0.0, STIFF, "N/m", above=True)]
    damper: Annotated[float, Bound(0.0, STIFF, "N.s/m", above=True)]

    def __post_init__(self):
        check_fields(self, "coupling.")


@named
@dataclass(frozen=True)
class Hardware:
    """The hardware between computer and arm, part by part; ideal by default.

    Attributes:
        jitter: how far a sampling instant is off its time, uniform, rms [s], at most 0.28 Ts, so
            that samples keep their order.
        dropout_probability: probability that a sample is lost, 0 to 0.99; the torque is then held
            for one more.
        encoder: counts per turn of each joint, 4 to 2^40; None measures angles exactly.
        velocity: of the joints: "exact" (a tachometer) or "difference" of measured angles.
        velocity_window: samples that the difference spans, 1 to 10000.
        velocity_filter: first-order low-pass behind the difference [Hz]; None for none.
        adc_bits: bits of the converter of the hand's force, 2 to 32; None for none.
        adc_range: that converter spans -range to range on each axis [N].
        force_noise: white noise ahead of the filter, on each axis, rms [N], 0 to 1e3.
        force_filter: Butterworth low-pass ahead of the converter [Hz]; None for none.
        filter_order: order of that low-pass, 1 or 2.
        dac_bits: bits of the converter of the torques, 2 to 32; None for none.
        dac_range: that converter spans -range to range at shoulder and elbow [N.m]; None for the
            torque limit.
        delay: from a sampling instant to the torque computed from it [s], any multiple or
            fraction of Ts.
        friction: Coulomb friction in the shoulder and elbow joint [N.m].
        passivity: whether an observer and controller keep the rendered clay passive (Hannaford,
            Ryu 2002).
        coupling: between the handle and a virtual tool in the clay; None puts the handle into it.
        seed: seed of jitter, losses and noise, 0 to 2^32 - 1.
    """

    jitter: Annotated[float, Bound(0.0, 1.0, "s")] = 0.0
    dropout_probability: Annotated[float, Bound(0.0, 0.99)] = 0.0
    encoder: Annotated[int | None, Bound(4, 2**40)] = None
    velocity: Literal["exact", "difference"] = "exact"
    velocity_window: Annotated[int, Bound(1, 10_000)] = 1
    velocity_filter: Annotated[float | None, Bound(0.0, 1e6, "Hz", above=True)] = None
    adc_bits: Annotated[int | None, Bound(2, 32)] = None
    adc_range: Annotated[float, Bound(0.0, 1e6, "N", above=True)] = 50.0
    force_noise: Annotated[float, Bound(0.0, 1e3, "N")] = 0.0
    force_filter: Annotated[float | None, Bound(0.0, 1e6, "Hz", above=True)] = None
    filter_order: Annotated[int, Bound(1, 2)] = 2
    dac_bits: Annotated[int | None, Bound(2, 32)] = None
    dac_range: Annotated[
        tuple[float, float] | None, Bound(0.0, 1e6, "N.m", above=True, names=JOINTS)
    ] = None
    delay: Annotated[float, Bound(0.0, 1.0, "s")] = 0.0
    friction: Annotated[tuple[float, float], Bound(0.0, 1e6, "N.m", names=JOINTS)] = (0.0, 0.0)
    passivity: bool = False
    coupling: Coupling | None = None
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0

    def __post_init__(self):
        check_fields(self, "hardware.")
        if self.velocity == "exact" and (
            self.velocity_filter is not None or self.velocity_window != 1
        ):
            raise ParameterError(
                "hardware.velocity", self.velocity, "must be 'difference' for a window or a filter"
            )


SLIDES = (0.0, 1.0, -1.0)
NOISE_BLOCK = 1024  # samples drawn at once
ALL_WHOLE = 2.0**52  # floats beyond it are whole; none of them, nor NaN, needs an integer


def round_to_even(x, step):
    """The multiple of step nearest to x; of two equally near, the even one.

    Args:
        x: value, in any unit.
        step: in the unit of x.

    Returns:
        The multiple; x itself if it is infinite or NaN.
    """
    n = x / step
    return (round(n) if abs(n) < ALL_WHOLE else n) * step


def quantize(x, bits, span):
    """Output of a converter: 2^bits levels from -span to span, with zero in the middle.

    Args:
        x: input, in any unit.
        bits: resolution; 0 for an ideal converter without limits.
        span: full scale, in the unit of x.

    Returns:
        The output, in the unit of x; NaN for NaN, with which a run ends.
    """
    if not bits or x != x:
        return x
    half = 1 << (bits - 1)
    y = x * half / span
    # the bounds keep rounded values within the integers of a compiled run
    level = half if y > half else -half if y < -half else round(y)
    return min(level, half - 1) * span / half


def encode(q, counts):
    """Joint angle as an encoder reads it.

    Args:
        q: joint angle [rad].
        counts: counts per turn; 0 for an exact reading.

    Returns:
        The reading [rad].
    """
    return round_to_even(q, tau / counts) if counts else q


def velocity_difference(then, old, k, q, Ts):
    """Mean rates of both joints since an earlier sample.

    Args:
        then: index of the earlier sample.
        old: joint angles of the earlier sample [rad].
        k: index of the present sample.
        q: joint angles of the present sample [rad].
        Ts: control sample [s].

    Returns:
        Rates of both joints [rad/s].
    """
    span = (k - then) * Ts
    return (q[0] - old[0]) / span, (q[1] - old[1]) / span


def low_pass(y, mean, cutoff, span):
    """First-order low-pass filter over one interval; exact for a constant signal.

    Args:
        y: output before, in any unit.
        mean: mean of the signal over the interval, in the unit of y.
        cutoff: corner frequency [Hz].
        span: length of the interval [s].

    Returns:
        Output after the interval.
    """
    keep = exp(-tau * cutoff * span)
    return keep * y + (1.0 - keep) * mean


def butterworth(cutoff: float, order: int, Ts: float) -> tuple[float, ...]:
    """Butterworth low-pass filter of unit gain under a held input: x+ = A x + B u, y = x[0], exact.

    The poles lie on a circle of radius 2 pi cutoff (matrix exponential).

    Args:
        cutoff: corner frequency [Hz].
        order: 1 or 2.
        Ts: hold of the input [s].

    Returns:
        (A00, A01, A10, A11, B0, B1); for order 1, only A00 and B0 are not zero.
    """
    from scipy.linalg import expm

    w = tau * cutoff
    a = (
        [[-w, w], [0.0, 0.0]]
        if order == 1
        else [[0.0, 1.0, 0.0], [-w * w, -sqrt(2.0) * w, w * w], [0.0, 0.0, 0.0]]
    )
    e = expm(Ts * np.array(a))
    A, B = np.zeros((2, 2)), np.zeros(2)
    A[:order, :order], B[:order] = e[:order, :order], e[:order, order]
    return (*A.ravel().tolist(), *B.tolist())


def filter_step(f, x0, x1, u):
    """State of a filter after one sample.

    Args:
        f: from `butterworth`.
        x0: first state before the sample, which is the output.
        x1: second state before the sample.
        u: input.

    Returns:
        The state after the sample.
    """
    return f[0] * x0 + f[1] * x1 + f[4] * u, f[2] * x0 + f[3] * x1 + f[5] * u


def coulomb_friction(w, a11, a12, a22, limit):
    """Coulomb friction of two joints in one kick, implicit.

    After the kick, each joint either rests under a torque within its limit or slides against the
    limit. The rates after the kick are w + a phi; with a positive definite, one of the nine cases
    fits (a linear complementarity problem; Stewart, Trinkle, Int. J. Numerical Methods in
    Engineering 39, 1996).

    Args:
        w: rates after the kick without friction [rad/s].
        a11: rate of joint 1 per torque on joint 1 [rad/s per N.m].
        a12: rate of joint 1 per torque on joint 2 [rad/s per N.m].
        a22: rate of joint 2 per torque on joint 2 [rad/s per N.m].
        limit: Coulomb torques of both joints [N.m].

    Returns:
        Torques on both joints [N.m].
    """
    best1, best2, least = 0.0, 0.0, inf
    for case in range(9):
        # sliding direction of each joint, 0 at rest
        s1, s2 = SLIDES[case // 3], SLIDES[case % 3]
        if s1 and s2:
            f1, f2 = -s1 * limit[0], -s2 * limit[1]
        elif s1:
            f1 = -s1 * limit[0]
            f2 = -(w[1] + a12 * f1) / a22
        elif s2:
            f2 = -s2 * limit[1]
            f1 = -(w[0] + a12 * f2) / a11
        else:
            det = a11 * a22 - a12 * a12
            f1, f2 = (a12 * w[1] - a22 * w[0]) / det, (a12 * w[0] - a11 * w[1]) / det
        v1, v2 = w[0] + a11 * f1 + a12 * f2, w[1] + a12 * f1 + a22 * f2
        # violation of the case: a resting joint beyond its limit, a sliding one reversed
        wrong = max(
            -s1 * v1 / a11 if s1 else abs(f1) - limit[0],
            -s2 * v2 / a22 if s2 else abs(f2) - limit[1],
        )
        if wrong < least:
            best1, best2, least = f1, f2, wrong
        if wrong <= 0.0:
            break
    return min(max(best1, -limit[0]), limit[0]), min(max(best2, -limit[1]), limit[1])


def passivity_controller(energy, f, v, Ts, W):
    """Passivity controller of one axis: changes the resisting force if the clay would be active.

    Hannaford, Ryu (IEEE Trans. Robotics and Automation 18, 2002), including the motion that the
    held force causes: over a sample the clay takes Ts f (v - Ts W f/2). The controller recovers a
    deficit of energy. As Ts W goes to zero, it does so by their damping, -energy/(Ts v^2). If the
    hold overshoots and a force returns energy, it is replaced by the force that takes the most
    energy, v/(Ts W), which stops the handle. So is a force that cannot recover the deficit within a
    sample. Energy taken earlier is not returned: clay stores none.

    Args:
        energy: energy that the clay has taken [J].
        f: requested force [N].
        v: handle velocity [m/s].
        Ts: hold [s].
        W: mobility of the handle [1/kg].

    Returns:
        The force [N].
    """
    most, lack = v / (Ts * W), min(energy, 0.0)
    left = v * v + 2.0 * W * lack
    if lack and left <= 0.0:
        return most
    root = sqrt(left) if lack else abs(v)
    along, low = copysign(1.0, v) * f, -2.0 * lack / (Ts * (abs(v) + root)) if lack else 0.0
    if along * Ts * W > abs(v) + root:
        return most
    return copysign(low, v) if along < low else f


def virtual_coupling(tool, p, v, b, coupling, Ts):
    """Spring and damper between handle and massless tool in clay, implicit over a sample.

    b v_t = spring (p - tool+) + damper (v - v_t), tool+ = tool + Ts v_t (Colgate, Stanley, Brown,
    IROS 1995).

    Args:
        tool: position of the tool before the sample [m].
        p: position of the handle [m].
        v: velocity of the handle [m/s].
        b: clay at the tool [N.s/m].
        coupling: its stiffness [N/m] and damping [N.s/m].
        Ts: control sample [s].

    Returns:
        (position of the tool after the sample [m], its velocity [m/s]); b times the velocity is the
        resisting force.
    """
    spring, damper = coupling
    u = (spring * (p - tool) + damper * v) / (b + damper + spring * Ts)
    return tool + Ts * u, u


def tool_that_yields(tool, p, v, b, law, along, coupling, Ts):
    """As `virtual_coupling`, for both axes in yielding clay: below the yield force the tool rests.

    (b + damper + spring Ts) v_t + (Fy + K |v_t|^n) v_t/|v_t| = spring (p - tool) + damper v.

    Args:
        tool: position of the tool before the sample, (x, y) [m].
        p: position of the handle, (x, y) [m].
        v: velocity of the handle, (x, y) [m/s].
        b: clay at the tool, (x, y) [N.s/m].
        law: Fy, K, n of x, then of y.
        along: whether the clay yields along the motion, by the law of x; else each axis by itself.
        coupling: its stiffness [N/m] and damping [N.s/m].
        Ts: control sample [s].

    Returns:
        Velocity of the tool (x, y) [m/s]; resisting force (x, y) [N].
    """
    spring, damper = coupling
    qx, qy = spring * (p[0] - tool[0]) + damper * v[0], spring * (p[1] - tool[1]) + damper * v[1]
    dx, dy = b[0] + damper + spring * Ts, b[1] + damper + spring * Ts
    if along:
        ux, uy = flow.slowed(
            (1.0 / dx, 0.0, 0.0, 1.0 / dy), qx / dx, qy / dy, 1.0, law[0], law[1], law[2]
        )
    else:
        ux = flow.thinned(max(abs(qx) - law[0], 0.0) / dx, law[1] / dx, law[2])
        uy = flow.thinned(max(abs(qy) - law[3], 0.0) / dy, law[4] / dy, law[5])
        ux, uy = copysign(ux, qx), copysign(uy, qy)
    fx, fy = flow.motion_force(law, along, ux, uy)
    fx, fy = b[0] * ux + fx if ux else qx, b[1] * uy + fy if uy else qy
    return ux, uy, fx, fy


class SampleNoise:
    """Random effects on each sample, reproducible by seed and index; one stream per part.

    Args:
        parts: the hardware, with its seed.
    """

    def __init__(self, parts: Hardware):
        self.parts = parts
        self._streams = [np.random.default_rng([parts.seed, i]) for i in range(3)]
        self._first, self._rows = 0, np.zeros((0, 4))

    @property
    def first(self) -> int:
        """Index of the first sample that is still kept."""
        return self._first

    def forget(self, first: int) -> None:
        """Drops the samples before a given one.

        Args:
            first: index of the first sample to keep.
        """
        self._rows, self._first = self._rows[first - self._first :], first

    def table(self, first: int, n: int) -> np.ndarray:
        """Random effects on n samples; the first sample of a run is on time and never lost.

        Args:
            first: index of the first of these samples; it must still be kept.
            n: number of samples.

        Returns:
            One row per sample: offset of the sampling instant [s], whether the sample is lost (1 or
            0), noise on the force (x, y) [N].
        """
        blocks, at = [self._rows], first - self._first
        missing = at + n - len(self._rows)
        while missing > 0:
            blocks.append(self._draw())
            missing -= NOISE_BLOCK
        self._rows = np.concatenate(blocks)
        if self._first == 0:
            self._rows[0, :2] = 0.0
        return self._rows[at : at + n].copy()

    def _draw(self) -> np.ndarray:
        s, (time, loss, noise) = self.parts, self._streams
        width = s.jitter * sqrt(3.0)
        late = time.uniform(-width, width, NOISE_BLOCK)
        lost = loss.random(NOISE_BLOCK) < s.dropout_probability
        hiss = s.force_noise * noise.standard_normal((NOISE_BLOCK, 2))
        return np.column_stack((late, lost, hiss))


_UNSAMPLED = Refusal("hardware", "must be None unless control is 'sampled'")
_SAMPLED = {"fast": _UNSAMPLED, "accurate": _UNSAMPLED}
_HELD = {"physical": Refusal("render", "must be 'held' for a passivity controller or a coupling")}


def _told_difference(x: Hardware) -> list[Told]:
    window = [Told("over {} samples", (float(x.velocity_window),))] * (x.velocity_window > 1)
    cutoff = x.velocity_filter
    low_pass = [] if cutoff is None else [Told("low-pass {}", (cutoff,), "Hz")]
    return [Told("velocity by difference"), *window, *low_pass]


def _told_converters(x: Hardware) -> list[Told]:
    bits = {"A/D": x.adc_bits, "D/A": x.dac_bits}
    return [Told(f"{name} {{}}", (float(n),), "bits") for name, n in bits.items() if n]


PARTS = (  # name, whether hardware has it, how linear theory treats it, what refuses it, words
    ("jitter", lambda x: x.jitter > 0.0, LEFT_OUT, {},
     lambda x: told_values("jitter {}", (x.jitter,), "s rms")),
    ("dropouts", lambda x: x.dropout_probability > 0.0, LEFT_OUT, {},
     lambda x: told_values("dropout probability {}", (x.dropout_probability,))),
    ("encoder", lambda x: x.encoder is not None, LEFT_OUT, {},
     lambda x: told_values("encoder {}", (x.encoder,), "counts per turn")),
    ("velocity by difference", lambda x: x.velocity == "difference", LEFT_OUT, {},
     _told_difference),
    ("converters", lambda x: bool(x.adc_bits or x.dac_bits), LEFT_OUT, {}, _told_converters),
    ("force noise", lambda x: x.force_noise > 0.0, LEFT_OUT, {},
     lambda x: told_values("force noise {}", (x.force_noise,), "N rms")),
    ("force filter", lambda x: x.force_filter is not None, LEFT_OUT, {},
     lambda x: told_values("force filter {}", (x.force_filter,), "Hz")),
    ("delay", lambda x: x.delay > 0.0, YES, {},
     lambda x: told_values("delay {}", (x.delay,), "s")),
    ("joint friction", lambda x: any(x.friction), LEFT_OUT, {},
     lambda x: [Told(f"joint friction ({x.friction[0]:.4g}, {x.friction[1]:.4g})", (), "N.m")]),
    ("passivity controller", lambda x: x.passivity, LEFT_OUT, _HELD,
     lambda x: [Told("passivity controller")]),
    ("virtual coupling", lambda x: x.coupling is not None, LEFT_OUT, _HELD,
     lambda x: [
         Told("virtual coupling {}", (x.coupling.spring,), "N/m"),
         Told("{}", (x.coupling.damper,), "N.s/m"),
     ]),
)  # fmt: skip


def _trait(name: str, of: Any, theory: str, refuses: dict[str, Refusal], words: Any) -> Trait:
    """The trait of scenes whose hardware has a part."""
    return Trait(
        name,
        "part",
        lambda s: s.hardware is not None and of(s.hardware),
        theory,
        _SAMPLED | refuses,
        lambda s: words(s.hardware),
    )


def hardware_words(scenario: Any) -> str:
    """The parts of the hardware of a scenario, with units; "ideal" if there are none.

    Args:
        scenario: scenario with hardware.
    """
    found = [told.text() for x in present(scenario, TRAITS[1:]) for told in x.words(scenario)]
    return ", ".join(found) or "ideal"


TRAITS = (
    Trait("hardware", "part", lambda s: s.hardware is not None, YES, _SAMPLED),
    *(_trait(*part) for part in PARTS),
)
