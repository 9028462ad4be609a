"""The hardware between computer and arm: one formula for each imperfection."""

import math

from . import flow, numbers


def slide(case):
    """Direction in which a joint slides: case 0 at rest, 1 forwards, 2 backwards."""
    return 0.0 if case == 0 else 1.0 if case == 1 else -1.0


def round_to_even(x, step):
    """The multiple of step nearest to x, of two the even one; x itself if infinite or NaN."""
    return numbers.nearest(x / step) * step


def quantize(x, bits, span):
    """Output of a converter: 2^bits levels from -span to span, with zero in the middle.

    0 bits are an ideal converter without limits. NaN stays NaN, with which a run ends.
    """
    if not bits or x != x:
        return x
    half = 2.0 ** (bits - 1)
    y = x * half / span
    # the bounds keep rounded values within the integers of a compiled run
    level = half if y > half else -half if y < -half else numbers.nearest(y)
    return min(level, half - 1.0) * span / half


def encode(q, count):
    """Joint position as an encoder reads it, in counts of a size [rad or m]; 0 for exactly."""
    return round_to_even(q, count) if count else q


def velocity_difference(then, old, k, q, Ts):
    """Mean rate of a joint from sample `then` with angle `old` to sample k with angle q [rad/s]."""
    return (q - old) / ((k - then) * Ts)


def low_pass(y, mean, cutoff, span):
    """Output of a first-order low-pass filter after a span [s]; exact for a constant signal.

    y: output before; mean: of the signal over the span; cutoff: corner frequency [Hz].
    """
    keep = math.exp(-math.tau * cutoff * span)
    return keep * y + (1.0 - keep) * mean


def filter_step(f, x0, x1, u):
    """State of a filter from `butterworth` after one sample of input u; its first is the output."""
    return f[0] * x0 + f[1] * x1 + f[4] * u, f[2] * x0 + f[3] * x1 + f[5] * u


def coulomb_friction(w, a11, a12, a22, limit):
    """Coulomb friction of two joints in one kick, implicit: torques on both joints [N.m].

    After the kick, each joint either rests under a torque within its limit or slides against the
    limit. The rates after the kick are w + a phi; with a positive definite, one of the nine cases
    fits (a linear complementarity problem; Stewart, Trinkle, Int. J. Numerical Methods in
    Engineering 39, 1996). w: rates without friction [rad/s]; a: rate per torque [rad/s per N.m].
    """
    best1, best2, least = 0.0, 0.0, math.inf
    for case in range(9):
        # sliding direction of each joint, 0 at rest
        s1, s2 = slide(case // 3), slide(case % 3)
        if s1 and s2:
            f1, f2 = -s1 * limit[0], -s2 * limit[1]
        elif s1:
            f1 = -s1 * limit[0]
            f2 = numbers.ratio(-(w[1] + a12 * f1), a22)
        elif s2:
            f2 = -s2 * limit[1]
            f1 = numbers.ratio(-(w[0] + a12 * f2), a11)
        else:
            det = a11 * a22 - a12 * a12
            f1 = numbers.ratio(a12 * w[1] - a22 * w[0], det)
            f2 = numbers.ratio(a12 * w[0] - a11 * w[1], det)
        v1, v2 = w[0] + a11 * f1 + a12 * f2, w[1] + a12 * f1 + a22 * f2
        # violation of the case: a resting joint beyond its limit, a sliding one reversed
        wrong = max(
            numbers.ratio(-s1 * v1, a11) if s1 else abs(f1) - limit[0],
            numbers.ratio(-s2 * v2, a22) if s2 else abs(f2) - limit[1],
        )
        if wrong < least:
            best1, best2, least = f1, f2, wrong
        if wrong <= 0.0:
            break
    return min(max(best1, -limit[0]), limit[0]), min(max(best2, -limit[1]), limit[1])


def passivity_controller(energy, f, v, Ts, W):
    """Passivity controller of one axis: another force if the clay would be active [N].

    Hannaford, Ryu (IEEE Trans. Robotics and Automation 18, 2002), including the motion that the
    held force causes: over a sample the clay takes Ts f (v - Ts W f/2). The controller recovers a
    deficit of energy. As Ts W goes to zero, it does so by their damping, -energy/(Ts v^2). If the
    hold overshoots and a force returns energy, it is replaced by the force that takes the most
    energy, v/(Ts W), which stops the handle. So is a force that cannot recover the deficit within a
    sample. Energy taken earlier is not returned: clay stores none.

    energy: that the clay has taken [J]; f: requested force [N]; W: mobility of the handle [1/kg].
    """
    most, lack = numbers.ratio(v, Ts * W), min(energy, 0.0)
    left = v * v + 2.0 * W * lack
    if lack and left <= 0.0:
        return most
    root = math.sqrt(left) if lack else abs(v)
    along, low = math.copysign(1.0, v) * f, -2.0 * lack / (Ts * (abs(v) + root)) if lack else 0.0
    if along * Ts * W > abs(v) + root:
        return most
    return math.copysign(low, v) if along < low else f


def virtual_coupling(tool, p, v, b, coupling, Ts):
    """Spring and damper between handle and massless tool in clay, implicit over a sample.

    b v_t = spring (p - tool+) + damper (v - v_t), tool+ = tool + Ts v_t (Colgate, Stanley, Brown,
    IROS 1995). Position of the tool after the sample [m], and its velocity [m/s]; b times the
    velocity is the resisting force. coupling: stiffness [N/m] and damping [N.s/m].
    """
    spring, damper = coupling
    u = (spring * (p - tool) + damper * v) / (b + damper + spring * Ts)
    return tool + Ts * u, u


def tool_that_yields(tool, p, v, b, law, along, coupling, Ts):
    """As `virtual_coupling`, for both axes in yielding clay: below the yield force the tool rests.

    (b + damper + spring Ts) v_t + (Fy + K |v_t|^n) v_t/|v_t| = spring (p - tool) + damper v.
    Velocity of the tool (x, y) [m/s]; resisting force (x, y) [N]. law, along: as in
    `flow.motion_force`.
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
        ux, uy = math.copysign(ux, qx), math.copysign(uy, qy)
    fx, fy = flow.motion_force(law, along, ux, uy)
    fx, fy = b[0] * ux + fx if ux else qx, b[1] * uy + fy if uy else qy
    return ux, uy, fx, fy
