"""Clay that yields, a damper plus the law of Herschel and Bulkley, in a kick."""

import math

from . import numbers

KICK_PARTS = 6  # most parts of a kick: two stops, the parts around them, and one spare
AXIS_ROUNDS = 60  # iterations between the axes until both forces agree
CLOSE = 1e-15  # tolerance of that agreement


def moving_force(Fy, K, n, speed):
    """Force of yielding clay on a tool of a speed >= 0, without its damping, Fy + K v^n [N]."""
    return Fy + K * numbers.power(speed, n) if K > 0.0 else Fy


def motion_force(law, along, vx, vy):
    """Force of yielding clay on a moving tool, (x, y) [N]; 0 at rest, where any up to Fy may act.

    law: Fy, K, n of x, then of y; `along` the motion it acts by the law of x, else on each axis by
    itself.
    """
    Fyx, Kx, nx, Fyy, Ky, ny = law
    x, y = abs(vx), abs(vy)
    if along:
        x = math.sqrt(vx * vx + vy * vy)
        f = moving_force(Fyx, Kx, nx, x) / x if x > 0.0 else 0.0
        return f * vx, f * vy
    fx = moving_force(Fyx, Kx, nx, x) if x > 0.0 else 0.0
    fy = moving_force(Fyy, Ky, ny, y) if y > 0.0 else 0.0
    return math.copysign(fx, vx), math.copysign(fy, vy)


def thinned(q, k, n):
    """Solves m + k m^n = q for m >= 0, to rounding, by Newton's method; q, k >= 0, n > 0.

    The start is chosen so that the tangent does not overshoot the root: below the root where m^n is
    concave, above it where m^n is convex.
    """
    if k <= 0.0 or q <= 0.0:
        return q
    m = 0.5 * q if n < 1.0 else q
    if k * numbers.power(m, n) > m:
        m = numbers.power(m / k, 1.0 / n)
    for _ in range(60):
        if m <= 0.0:
            break
        p = k * numbers.power(m, n)
        step = (q - m - p) / (1.0 + n * p / m)
        m += step
        if abs(step) <= 1e-15 * m:
            break
    return m


def implicit_share(z):
    """Weight of the velocity at the end of a step in the velocity at which a force is evaluated.

    One half, second order, unless the force would overshoot: as in `damping.split_damping`. z:
    velocity lost to the force by the end, per unit of velocity.
    """
    return 0.5 if z <= 2.0 else 1.0 - 1.0 / z


def sliding_force(a, end, slope, Fy, K, n):
    """Mean force of yielding clay on one sliding axis over a part of a kick [N].

    a: velocity at the begin, end: that at the end without this force [m/s]; slope: velocity lost by
    the end per unit of this force [m/(N.s)]. Positive for motion in the direction of a, or of end
    if a is 0. If the force stops the axis before the end, it is the force at half the initial
    speed.
    """
    sign = -1.0 if a < 0.0 or (a == 0.0 and end < 0.0) else 1.0
    if K <= 0.0:
        return sign * Fy
    a, end = sign * a, sign * end - slope * Fy
    m, stops = 0.0, True
    if end > 0.0:
        m = thinned(end, slope * K, n)
        if m > 0.0:
            share = implicit_share(slope * K * n * numbers.power(m, n - 1.0))
            m = thinned((1.0 - share) * a + share * end, share * slope * K, n)
            stops = m <= (1.0 - share) * a
    if stops:
        m = 0.5 * a
    return sign * (Fy + K * numbers.power(m, n))


def resist_axes(B, v, end, law, sample):
    """Yielding clay in one kick, each axis by itself: the solution of v' = d - B f from v on.

    Other forces count as constant in the kick. The kick is divided where an axis comes to rest. An
    axis stays at rest while no more than its yield force is needed to hold it.

    B: velocity lost in the kick per unit of force, (xx, xy, yx, yy) [m/(N.s)]; v, end: velocity at
    the begin, and at the end without this force [m/s]; law: Fy, K, n of x, then of y; sample: share
    of the kick before the sample. Mean force [N]; velocity at the end [m/s], 0.0 at rest; velocity
    and force at the sample, (x, y) each; shares of the kick at which x and y came to rest, -1.0
    where they did not or were.
    """
    xx, xy, yx, yy = B
    vx, vy = v
    dx, dy = end[0] - vx, end[1] - vy
    rx, ry, sx, sy, hx, hy, stopx, stopy = 0.0, 0.0, vx, vy, 0.0, 0.0, -1.0, -1.0
    begin, left, first = 0.0, 1.0, True
    for part in range(KICK_PARTS):
        fx, fy, stuckx, stucky = forces_on_axes(B, (vx, vy), (dx, dy), left, law)
        gx = 0.0 if stuckx else dx - xx * fx - xy * fy
        gy = 0.0 if stucky else dy - yx * fx - yy * fy
        span, axis = left, 0
        if part < KICK_PARTS - 1:
            if vx * (vx + span * gx) < 0.0:
                span, axis = -vx / gx, 1
            if vy * (vy + span * gy) < 0.0:
                span, axis = -vy / gy, 2
        if first and (begin + span >= sample or axis == 0):
            at = min(max(sample - begin, 0.0), span)
            sx, sy, hx, hy, first = vx + at * gx, vy + at * gy, fx, fy, False
        rx += span * fx
        ry += span * fy
        vx += span * gx
        vy += span * gy
        begin += span
        left -= span
        if axis == 0:
            break
        if axis == 1:
            vx, stopx = 0.0, begin
        else:
            vy, stopy = 0.0, begin
    if vx != 0.0:
        stopx = -1.0
    if vy != 0.0:
        stopy = -1.0
    return rx, ry, vx, vy, sx, sy, hx, hy, stopx, stopy


def forces_on_axes(B, v, d, left, law):
    """Mean forces over a part of a kick, each axis by itself, iterated until they agree.

    d: velocity gained in a kick without this force [m/s]; left: remaining share of the kick; the
    rest as in `resist_axes`. Forces of x and of y [N]; whether x and y stay at rest.
    """
    xx, xy, yx, yy = B
    Fyx, Kx, nx, Fyy, Ky, ny = law
    vx, vy = v
    dx, dy = d
    fx, fy, stuckx, stucky = 0.0, 0.0, False, False
    if vx == 0.0 and vy == 0.0:
        det = xx * yy - xy * yx
        fx, fy = numbers.ratio(yy * dx - xy * dy, det), numbers.ratio(xx * dy - yx * dx, det)
        stuckx = stucky = abs(fx) <= Fyx and abs(fy) <= Fyy
    elif vy != 0.0:
        fy = Fyy if vy > 0.0 else -Fyy
    for _ in range(AXIS_ROUNDS if not (stuckx and stucky) else 0):
        oldx, oldy = fx, fy
        need = dx - xy * fy
        stuckx = vx == 0.0 and abs(need) <= xx * Fyx
        if stuckx:
            fx = numbers.ratio(need, xx)
        else:
            fx = sliding_force(vx, vx + left * need, left * xx, Fyx, Kx, nx)
        need = dy - yx * fx
        stucky = vy == 0.0 and abs(need) <= yy * Fyy
        if stucky:
            fy = numbers.ratio(need, yy)
        else:
            fy = sliding_force(vy, vy + left * need, left * yy, Fyy, Ky, ny)
        if abs(fx - oldx) <= CLOSE * abs(fx) and abs(fy - oldy) <= CLOSE * abs(fy):
            break
    return fx, fy, stuckx, stucky


def resist_along(B, v, end, law, sample):
    """As `resist_axes`, with a force along the motion, (Fy + K |v|^n) v/|v|, by the law of x."""
    xx, xy, yx, yy = B
    Fy, K, n = law[0], law[1], law[2]
    vx, vy = v
    dx, dy = end[0] - vx, end[1] - vy
    det = xx * yy - xy * yx
    holdx, holdy = numbers.ratio(yy * dx - xy * dy, det), numbers.ratio(xx * dy - yx * dx, det)
    rx, ry, sx, sy, hx, hy, stop = 0.0, 0.0, vx, vy, 0.0, 0.0, -1.0
    begin, left, first = 0.0, 1.0, True
    for _ in range(KICK_PARTS):
        stuck, fx, fy, span = False, holdx, holdy, left
        if vx == 0.0 and vy == 0.0:
            stuck = fx * fx + fy * fy <= Fy * Fy
        if not stuck:
            fx, fy, span = force_along(B, (vx, vy), (dx, dy), (holdx, holdy), left, Fy, K, n)
        gx = 0.0 if stuck else dx - xx * fx - xy * fy
        gy = 0.0 if stuck else dy - yx * fx - yy * fy
        if first and (begin + span >= sample or span == left):
            at = min(max(sample - begin, 0.0), span)
            sx, sy, hx, hy, first = vx + at * gx, vy + at * gy, fx, fy, False
            m = math.sqrt(sx * sx + sy * sy)
            if m > 0.0:
                f = moving_force(Fy, K, n, m) / m
                hx, hy = f * sx, f * sy
        rx += span * fx
        ry += span * fy
        begin += span
        if span == left:
            vx += span * gx
            vy += span * gy
            break
        left -= span
        vx, vy, stop = 0.0, 0.0, begin
    if vx != 0.0 or vy != 0.0:
        stop = -1.0
    return rx, ry, vx, vy, sx, sy, hx, hy, stop, stop


def force_along(B, v, d, hold, left, Fy, K, n):
    """Mean force along the motion on a sliding tool over a part of a kick, (x, y) [N].

    d: as in `forces_on_axes`; hold: force that would cancel all of d [N]; left: remaining share of
    the kick. The last value is the share for which the force acts, less than left if the tool then
    comes to rest.
    """
    qx, qy = v[0] + left * d[0], v[1] + left * d[1]
    endx, endy = slowed(B, qx, qy, left, Fy, K, n)
    mx, my = endx, endy
    m = math.sqrt(mx * mx + my * my)
    stops = m == 0.0
    if m > 0.0:
        f = moving_force(Fy, K, n, m)
        z = 0.5 * left * (B[0] + B[3]) * f * max(n if K > 0.0 else 1.0, 1.0) / m
        share = implicit_share(z)
        keep = 1.0 - share
        px, py = keep * v[0] + share * qx, keep * v[1] + share * qy
        mx, my = slowed(B, px, py, share * left, Fy, K, n)
        m = math.sqrt(mx * mx + my * my)
        stops = m == 0.0 or (mx - keep * v[0]) * v[0] + (my - keep * v[1]) * v[1] < 0.0
    if stops:
        # a force of this size, or less if it turns, cancels the whole velocity within some time
        f = 0.5 * math.sqrt(v[0] * v[0] + v[1] * v[1])
        f = moving_force(Fy, K, n, f)
        det = B[0] * B[3] - B[1] * B[2]
        px = numbers.ratio(B[3] * v[0] - B[1] * v[1], det)
        py = numbers.ratio(B[0] * v[1] - B[2] * v[0], det)
        square, mixed = px * px + py * py, px * hold[0] + py * hold[1]
        rest = mixed * mixed - square * (hold[0] * hold[0] + hold[1] * hold[1] - f * f)
        if square > 0.0 and rest >= 0.0:
            rate = (math.sqrt(rest) - mixed) / square
            if rate * left > 1.0:
                return hold[0] + rate * px, hold[1] + rate * py, 1.0 / rate
        mx, my = endx, endy
        m = math.sqrt(mx * mx + my * my)
        if m == 0.0:  # at rest at the very end
            return hold[0] + px / left, hold[1] + py / left, left
    f = numbers.ratio(moving_force(Fy, K, n, m), m)
    return f * mx, f * my, left


def slowed(B, qx, qy, k, Fy, K, n):
    """Solves m + k B (Fy + K |m|^n) m/|m| = q, by Newton's method on the length of m.

    B: (xx, xy, yx, yy) [m/(N.s)]; q [m/s]; k: share of a kick. (0.0, 0.0) where the yield force
    holds.
    """
    xx, xy, yx, yy = k * B[0], k * B[1], k * B[2], k * B[3]
    most = math.sqrt(qx * qx + qy * qy)
    if most == 0.0 or Fy == K == 0.0:
        return qx, qy
    det = xx * yy - xy * yx
    if Fy > 0.0:
        x, y = yy * qx - xy * qy, xx * qy - yx * qx
        if x * x + y * y <= Fy * det * Fy * det:
            return 0.0, 0.0
    low, high, s = 0.0, 2.0 * most, most
    x, y = qx / most, qy / most
    if K > 0.0:  # along q alone
        s = thinned(most, 0.5 * (xx + yy) * K, n)
        if s <= 0.0:
            s = 0.5 * most
    for _ in range(60):
        # u = m/|m| if s is the length of m
        f = moving_force(Fy, K, n, s)
        a, b, c, e = s + f * xx, f * xy, f * yx, s + f * yy
        det = a * e - b * c
        x, y = numbers.ratio(e * qx - b * qy, det), numbers.ratio(a * qy - c * qx, det)
        long = math.sqrt(x * x + y * y)
        if long > 1.0:
            low = s
        else:
            high = s
        slope = n * K * numbers.power(s, n - 1.0) if K > 0.0 else 0.0
        px, py = x + slope * (xx * x + xy * y), y + slope * (yx * x + yy * y)
        gx, gy = numbers.ratio(e * px - b * py, det), numbers.ratio(a * py - c * px, det)
        # 1/long - 1 is nearly linear in s
        step, far = 0.0, (long - 1.0) * long * long
        if long > 0.0:
            step = numbers.ratio(far, x * gx + y * gy)
        if abs(step) > CLOSE * s and not low < s + step < high:
            step = 0.5 * (low + high) - s
        s += step
        if abs(step) <= CLOSE * s:
            break
    f = moving_force(Fy, K, n, s)
    a, b, c, e = s + f * xx, f * xy, f * yx, s + f * yy
    det = a * e - b * c
    x, y = numbers.ratio(e * qx - b * qy, det), numbers.ratio(a * qy - c * qx, det)
    return s * x, s * y
