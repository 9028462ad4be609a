"""The loop with 60 digits (mpmath): its polynomials, its map over a sample, and where their roots
lie.

Roots within 1e-40 of their size count as on the border. Nothing of the package is used but the
numbers of a loop's parts.
"""

import mpmath as mp

DIGITS = 60
ON = mp.mpf(10) ** -40


def numbers(*x):
    return [mp.mpf(float(v)) for v in x]


def product(*factors):
    """Coefficients, highest power first."""
    out = [mp.mpf(1)]
    for f in factors:
        longer = [mp.mpf(0)] * (len(out) + len(f) - 1)
        for i, a in enumerate(out):
            for j, b in enumerate(f):
                longer[i + j] += a * b
        out = longer
    return out


def total(a, b):
    n = max(len(a), len(b))
    a, b = ([mp.mpf(0)] * (n - len(x)) + x for x in (a, b))
    return [x + y for x, y in zip(a, b, strict=True)]


def polynomials(loop):
    """A and B of the closed-loop polynomial A + K B, spelt out from Eq. 8."""
    with mp.workdps(DIGITS):
        G, S, th, c = loop.servo.G, loop.servo.S, loop.hand, loop.compensator
        T = numbers(th.mass, th.damper + loop.b, th.spring)
        g, s = numbers(1, G.damping, G.stiffness), numbers(1, S.damping, S.stiffness)
        follows = total(s, [mp.mpf(S.gain) * x for x in T])
        A = product(numbers(*c.den), g, follows)
        return A, product(numbers(*c.num), s, [mp.mpf(G.gain) * x for x in T])


def roots(p):
    """Roots other than zero."""
    p = list(p)
    while p and p[0] == 0:
        p.pop(0)
    while p and p[-1] == 0:
        p.pop()
    if len(p) < 2:
        return []
    return mp.polyroots(p[::-1], maxsteps=2000, extraprec=400, asc=True)


def sides(p):
    """Number of roots right of the imaginary axis, and on it."""
    with mp.workdps(DIGITS):
        z = roots(p)
        right = sum(1 for x in z if mp.re(x) > ON * abs(x))
        return right, sum(1 for x in z if abs(mp.re(x)) <= ON * abs(x))


def closed(loop, K):
    """`sides` of the closed loop at K."""
    with mp.workdps(DIGITS):
        A, B = polynomials(loop)
        return sides(total(A, [mp.mpf(float(K)) * x for x in B]))


def period(loop, K):
    """One period of the sampled loop: events walked through, everything by one exponential each.

    The states: place, rate, C and reference model, torques that wait (the oldest last).
    """
    c, g, s, th, Ts = loop.compensator, loop.servo.G, loop.servo.S, loop.hand, mp.mpf(loop.Ts)
    m, d, k, b, K = numbers(th.mass, th.damper, th.spring, loop.b, K)
    n, den = len(c.den) - 1, numbers(*c.den)
    num = [mp.mpf(0)] * (n + 1 - len(c.num)) + numbers(*c.num)
    D, W = num[0], mp.mpf(s.gain)
    out = [x - D * y for x, y in zip(num[1:], den[1:], strict=True)]
    physical = b if loop.render == "physical" else mp.mpf(0)
    waits = int(loop.delay / loop.Ts + 1e-9) + 1
    changes = mp.mpf(loop.delay) - (waits - 1) * Ts
    mass = 1 / W + m
    plant = mp.matrix([[0, 1, 0], [-k / mass, -(d + physical) / mass, 1 / mass], [0, 0, 0]])
    before, after = mp.expm(changes * plant), mp.expm((Ts - changes) * plant)
    M = mp.zeros(n + 3)  # C, y, y' and the held force
    for i in range(n - 1):
        M[i + 1, i] = 1
    for i in range(n):
        M[0, i], M[n + 1, i] = -den[1 + i], mp.mpf(g.gain) * K * out[i]
    if n:
        M[0, n + 2] = 1
    M[n, n + 1], M[n + 1, n], M[n + 1, n + 1] = 1, -mp.mpf(g.stiffness), -mp.mpf(g.damping)
    M[n + 1, n + 2] = mp.mpf(g.gain) * K * D
    held = mp.expm(Ts * M)

    def walk(x):
        p, v, inner, queue = x[0], x[1], list(x[2 : 4 + n]), list(x[4 + n :])
        acceleration = (queue[-1] - k * p - (d + physical) * v) / mass
        f = -k * p - d * v - m * acceleration - b * v
        y2 = sum((M[n + 1, i] * z for i, z in enumerate([*inner, f])), mp.mpf(0))
        wanted = y2 + mp.mpf(s.damping) * (inner[n + 1] - v) + mp.mpf(s.stiffness) * (inner[n] - p)
        u = wanted / W - (0 if loop.render == "physical" else b * v)
        state = before * mp.matrix([p, v, queue[-1]])
        queue = [u, *queue]
        state = after * mp.matrix([state[0], state[1], queue[-2]])
        inner = held * mp.matrix([*inner, f])
        return [*state[:2], *inner[: n + 2], *queue[:-1]]

    size = n + 4 + waits
    columns = [walk([mp.mpf(i == j) for i in range(size)]) for j in range(size)]
    return mp.matrix(columns).T


def outside(loop, K):
    """Number of eigenvalues of the sampled loop outside the unit circle, and the least gap.

    Those at z = 1, motions that no force feels, do not count.
    """
    with mp.workdps(DIGITS):
        z = mp.eig(period(loop, K), left=False, right=False)
        z = [x for x in z if abs(x - 1) > mp.mpf(10) ** -20]
        return sum(1 for x in z if abs(x) > 1 + ON), min(abs(abs(x) - 1) for x in z)
