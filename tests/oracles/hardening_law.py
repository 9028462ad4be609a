"""A law of the clay: a damper that hardens with the way that the handle has gone.

Its numbers z: damping at the start [N.s/m], way after which it is twice as much [m]; then its
state: way so far [m], place of the handle (x, y) [m].
"""

from math import sqrt

DAMPING, WAY = 4.0, 0.02  # [N.s/m]; [m]


def numbers(scenario):
    return (DAMPING, WAY) if scenario.clay else None


def refuses(scenario):
    return "must not have rotated axes" if scenario.clay.angle else ""


def start(numbers, p):
    return 0.0, *p


def damping(z):
    return z[0] * (1.0 + z[2] / z[1])


def load(z, k):
    b = damping(z)
    for o in (k.x, k.y):
        o.f -= k.L * b * o.v
        o.d += k.R * b


def moved(z, px, py, vx, vy, h):
    x, y = px - z[3], py - z[4]
    z[2], z[3], z[4] = z[2] + sqrt(x * x + y * y), px, py


def force(z, px, py, vx, vy, out):
    b = damping(z)
    out[0], out[1] = b * vx, b * vy
