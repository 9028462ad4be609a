"""A kick: the velocity step from the middle of the step before a sample to that of the step after.

It changes nothing but its own record. Each row of the table in docs/equations.md, section 4, is a
function here or in the module of its part.
"""

from ..formulas import arm as arm_law
from . import arm, hand, joints, own_laws, servo, signals, springs, viscous, yielding


def begin(k, before, after):
    """The steps around a sample."""
    span = before + after
    k.H, k.L, k.R, k.before, k.after = 0.5 * span, before / span, after / span, before, after


def take_over(m, s, k):
    """Takes over what the kick before left."""
    k.o[0], k.o[1] = s.w[0], s.w[1]
    if m.special:
        for i in range(2):
            z, o = s.axis[i], k.axis[i]
            o.owed0, o.stuck0, o.anchor0 = z.owed, z.stuck, z.anchor


# ---- what acts on the handle ---------------------------------------------------------------------


def load(m, s, k):
    """Load of the handle that is linear in its velocity after the kick: f - d u."""
    signals.push(m, s, k)
    k.splits = k.dxy = k.clay_dxy = 0.0
    if m.acts:
        viscous.damp(m, s, k)
        if m.special:
            end_path(m, k)
        viscous.load(m, k)
    else:
        for i in range(2):
            o = k.axis[i]
            o.f, o.d, o.b0, o.b1, o.clay, o.clay_d = o.uh, 0.0, 0.0, 0.0, 0.0, 0.0
    if m.axes > 2:
        k.z.f, k.z.d = k.z.uh, 0.0
    if m.hand:
        hand.load(m, k)


def end_path(m, k):
    """Straightens the path of a handle that clay stops."""
    if m.stiff and k.splits != 0.0:
        viscous.rest_after_sample(k)
    if m.flow and k.o[0] == 0.0 and k.o[1] == 0.0:
        k.x.c = k.y.c = 0.0


# ---- the motion ----------------------------------------------------------------------------------


def move(m, s, k):
    """Motion of the handle in a kick, by the law that drives it."""
    x, y = k.x, k.y
    k.still = 0.0
    if m.acts and m.special:
        move_in_clay(m, s, k)
    else:
        x.u, y.u = servo.solve(k)
        x.net = x.f - x.d * x.u - k.dxy * y.u
        y.net = y.f - y.d * y.u - k.dxy * x.u
        damped(k)
        x.fe, y.fe = x.clay + x.damped, y.clay + y.damped
    if m.general:
        joints.answer(m, k)
        return
    k.g[0], k.g[1] = arm_law.joint_velocity(x.u - x.v, y.u - y.v, k.u, k.H)
    if k.still > 0.0:
        k.w[0] = k.w[1] = 0.0
    else:
        k.w[0], k.w[1] = k.o[0] + k.H * k.g[0], k.o[1] + k.H * (k.g[1] - k.g[0])


def damped(k):
    """Force of the dampers after the sample."""
    x, y = k.x, k.y
    x.damped = x.clay_d * x.u + k.clay_dxy * y.u
    y.damped = y.clay_d * y.u + k.clay_dxy * x.u


def move_in_clay(m, s, k):
    """As `move`, in clay of more laws than plain damping."""
    x, y = k.x, k.y
    for i in range(2):
        o = k.axis[i]
        o.back = o.owed = o.pull = o.mean = 0.0
        o.stuck, o.anchor = o.stuck0, o.anchor0
    fx, fy, dx, dy, dxy = x.f, y.f, x.d, y.d, k.dxy
    if m.springs:
        springs.load(s, k)
    barex, barey = x.f, y.f
    if m.laws:
        own_laws.load(m, k)
    ownx, owny, own_dx, own_dy, own_dxy = x.f, y.f, x.d, y.d, k.dxy
    owing = m.stiff and k.splits != 0.0
    owesx = owesy = softx = softy = 0.0
    if owing:
        gx, gy = viscous.slow_force(m, k)
        if m.flow:
            gx, gy = yielding.creeping(m, s, k, gx, gy)
        owesx, owesy = x.share * gx, y.share * gy
        softx, softy = 0.5 * k.after * m.x.spring * x.share, 0.5 * k.after * m.y.spring * y.share
        x.back, y.back = x.owed0 / k.H, y.owed0 / k.H
        x.f, y.f = x.f + (owesx - x.back), y.f + (owesy - y.back)
        x.d, y.d = x.d + softx, y.d + softy
    x.u, y.u = servo.solve(k)
    if m.springs and not owing and springs.let_go(m, s, k):
        x.u, y.u = servo.solve(k)
    if m.flow:
        yielding.resist(m, s, k)
    if owing:
        owedx, owedy = owesx - softx * x.u, owesy - softy * y.u
        x.back, y.back = x.back - owedx, y.back - owedy
        x.owed, y.owed = k.H * owedx, k.H * owedy
    x.net = x.f - x.mean - x.d * x.u - k.dxy * y.u
    y.net = y.f - y.mean - y.d * y.u - k.dxy * x.u
    damped(k)
    if m.springs:
        springs.put_freed(k)
    besidex, besidey = x.back + x.mean + x.pull, y.back + y.mean + y.pull
    if m.laws:
        besidex += barex - dx * x.u - dxy * y.u - (ownx - own_dx * x.u - own_dxy * y.u)
        besidey += barey - dy * y.u - dxy * x.u - (owny - own_dy * y.u - own_dxy * x.u)
    x.fe, y.fe = x.clay + x.damped + besidex, y.clay + y.damped + besidey
    x.f, y.f, x.d, y.d, k.dxy = fx, fy, dx, dy, dxy  # another law may drive the same kick


# ---- the kick ------------------------------------------------------------------------------------


def by_servo(m, s, k, after):
    """The kick of the continuous law at a sample, before a step of length `after`."""
    begin(k, s.before, after)
    take_over(m, s, k)
    half, r1, r2 = 0.5 * s.before, s.w[0], s.w[0] + s.w[1]
    arm.handle_at(m, k, s.q[0], s.q[1], r1, r2)
    arm.turning(k, r1 + half * s.g[0], r2 + half * s.g[1])
    load(m, s, k)
    servo.servo_law(m, s, k)
    move(m, s, k)
    arm.link_torques(m, k)
    t1, t2 = k.tau[0], k.tau[1]
    if abs(t1) > m.limit[0] or abs(t2) > m.limit[1]:
        k.tau[0], k.tau[1] = arm.clipped(t1, m.limit[0]), arm.clipped(t2, m.limit[1])
        servo.torque_law(m, k, k.tau[0], k.tau[1])
        move(m, s, k)
    servo.advance(m, s, k)


def is_limited(m, k):
    """Whether a motor is at its limit in a kick."""
    return abs(k.tau[0]) >= m.limit[0] or abs(k.tau[1]) >= m.limit[1]


def velocity(m, k, i):
    """Velocity of an axis at the sample [m/s]."""
    o = k.axis[i]
    slow = o.v + k.L * (o.u - o.v)
    if not (m.acts and m.special):
        return slow
    if m.stiff:
        slow = viscous.velocity_over(o, slow)
    return yielding.velocity(m, k, i) if m.flow else slow


def shown_delta(k, i):
    """Compensator output at the sample [m]."""
    o = k.axis[i]
    return o.delta + o.feed * o.net
