"""Laws of the clay that are functions of a user."""


def load(m, k):
    """Adds their loads to that of a kick."""
    for j in range(m.laws):
        m.law[j].load(m.law[j].z, k)


def move(m, px, py, vx, vy, h):
    """Their states after a step."""
    for j in range(m.laws):
        m.law[j].moved(m.law[j].z, px, py, vx, vy, h)


def force(m, px, py, vx, vy, since):
    """Their force at an instant, some time after the start of the step, (x, y) [N]."""
    x, y, out = 0.0, 0.0, m.engine.out
    for j in range(m.laws):
        a = m.law[j]
        z = a.z
        if since > 0.0:
            z = a.scratch
            for n in range(a.size):
                z[n] = a.z[n]
            a.moved(z, px, py, vx, vy, since)
        a.force(z, px, py, vx, vy, out)
        x, y = x + out[0], y + out[1]
    return x, y
