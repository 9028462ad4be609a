"""A law of the clay: a quadratic drag that grows while the tool moves.

f = c m |v| v, m' = (|v|/v0 - m)/tau. Its numbers z: c [N.s^2/m^2], v0 [m/s], tau [s]; then its
state: m.
"""

from math import exp, sqrt


def numbers(scenario):
    return (40.0, 0.1, 0.2) if scenario.clay else None


def refuses(scenario):
    return ""


def start(numbers, p):
    return (0.0,)


def load(z, k):
    b = z[0] * z[3] * sqrt(k.x.v * k.x.v + k.y.v * k.y.v)
    for o in (k.x, k.y):
        o.f -= k.L * b * o.v
        o.d += k.R * b


def moved(z, px, py, vx, vy, h):
    e = exp(-h / z[2])
    z[3] = e * z[3] + (1.0 - e) * sqrt(vx * vx + vy * vy) / z[1]


def force(z, px, py, vx, vy, out):
    b = z[0] * z[3] * sqrt(vx * vx + vy * vy)
    out[0], out[1] = b * vx, b * vy
