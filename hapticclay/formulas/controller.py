"""The servo's law and the velocity lost per unit of force."""

from . import numbers


def feedback_law(servo, delta, y, yd, p, v, c):
    """Servo acceleration of one axis at an instant, without forces; see `feedback_vector`.

    servo: `Servo.numbers`; delta: compensator output, y, yd: reference, p, v: handle, c:
    centripetal acceleration. Accelerations of the handle and of the reference [m/s^2].
    """
    ydd = servo[2] * (servo[0] * delta - y) - servo[1] * yd
    return ydd - servo[4] * (v - yd) + servo[5] * (y - p) + c, ydd


def velocity_per_force(n, W, d):
    """Velocity lost in a kick per unit of force, (n + W d)^-1 W: (xx, xy, yx, yy) [m/(N.s)].

    n: weight of u in the servo's law, (x, y) [1/s]; W: acceleration per unit of net hand force,
    (xx, xy, yy) [1/kg]; d: resisting force per unit of the velocity after the kick, (xx, yy, xy)
    [N.s/m].
    """
    a, b = n[0] + W[0] * d[0] + W[1] * d[2], W[0] * d[2] + W[1] * d[1]
    c, e = W[1] * d[0] + W[2] * d[2], n[1] + W[1] * d[2] + W[2] * d[1]
    det = a * e - b * c
    return (
        numbers.ratio(e * W[0] - b * W[1], det),
        numbers.ratio(e * W[1] - b * W[2], det),
        numbers.ratio(a * W[1] - c * W[0], det),
        numbers.ratio(a * W[2] - c * W[1], det),
    )


def along_axes(c, s, x, y):
    """Components of a vector along axes rotated by an angle of cosine c and sine s."""
    return c * x + s * y, c * y - s * x
