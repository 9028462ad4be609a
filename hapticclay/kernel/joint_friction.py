"""Coulomb friction in the joints of an arm on the engine's terms, in a kick under given torques.

The rates after the kick are linear in the friction: w = w0 + C f, with C positive definite. Each
joint slides (f = -F sign w) or rests (w = 0, |f| <= F), which is a linear complementarity problem
with bounds: Murty's least index rule ends at its one solution (Cottle, Pang, Stone, The linear
complementarity problem, 4.2).
"""

from . import joints

MOST = 512  # pivots; each joint is in one of three states, and few change
CLOSE = 1e-13  # a torque or rate so near to its bound, as a share, is at it


def find(m, k):
    """Friction torques in a kick, by the momentum and the dampers at the handle [N.m]."""
    e, n = m.engine, m.joints
    put_matrix(m, k)
    for i in range(n):  # begin where each joint slides on
        e.pivots[i] = 1 if k.o[i] > 0.0 else -1 if k.o[i] < 0.0 else 0
    for _ in range(MOST):
        rates(m, k)
        worst = wrong(m, k)
        if worst < 0:
            return
        if e.pivots[worst] == 0:  # it cannot be held: it slides against the friction
            e.pivots[worst] = 1 if k.slip[worst] < 0.0 else -1
        else:
            e.pivots[worst] = 0


def put_matrix(m, k):
    """Inertia with all dampers of the kick, those at the handle too, and its right side."""
    e, n, H = m.engine, m.joints, k.H
    x, y = k.x, k.y
    for i in range(n):
        for j in range(n):
            a = e.joint_M[i * n + j]
            if i == j:
                a += H * k.R * m.damper[i]
            if m.computed:
                a += H * k.R * e.joint_D[i * n + j]
            px, py, qx, qy = e.joint_J[i], e.joint_J[n + i], e.joint_J[j], e.joint_J[n + j]
            a += H * (px * (x.d * qx + k.dxy * qy) + py * (y.d * qy + k.dxy * qx))
            if m.axes > 2:
                a += H * e.joint_J[2 * n + i] * k.z.d * e.joint_J[2 * n + j]
            e.matrix[i * n + j] = a
        e.matrix[n * n + i] = e.moment[i] + H * pushed(m, k, i)


def pushed(m, k, j):
    """Torque of the handle's load on a joint, without its dampers [N.m]."""
    torque = 0.0
    for i in range(m.axes):
        torque += m.engine.joint_J[i * m.joints + j] * k.axis[i].f
    return torque


def rates(m, k):
    """Rates of the joints that slide, and the friction of those that rest, into k."""
    e, n = m.engine, m.joints
    A, L = e.matrix, n * n + n
    for i in range(n):
        slides = e.pivots[i] != 0
        k.slip[i] = -m.slip[i] * e.pivots[i]
        k.w[i] = A[n * n + i] + k.H * k.slip[i] if slides else 0.0
        for j in range(i + 1):
            if slides and e.pivots[j] != 0:
                A[L + i * n + j] = A[i * n + j]
            else:  # a joint at rest stands alone
                A[L + i * n + j] = 1.0 if i == j else 0.0
    joints.factor(A, L, n)
    joints.solve(A, L, k.w, 0, n)
    for i in range(n):
        if e.pivots[i] == 0:
            k.slip[i] = held(m, k, i) / k.H


def held(m, k, i):
    """Impulse that holds a joint at rest while others slide [N.m.s]."""
    A, n = m.engine.matrix, m.joints
    impulse = -A[n * n + i]
    for j in range(n):
        impulse += A[i * n + j] * k.w[j]
    return impulse


def wrong(m, k):
    """The first joint whose state contradicts its rate or friction; -1 for none."""
    e = m.engine
    for i in range(m.joints):
        if e.pivots[i] == 0:
            if abs(k.slip[i]) > m.slip[i] * (1.0 + CLOSE):
                return i
        elif m.slip[i] > 0.0 and k.w[i] * e.pivots[i] < 0.0:
            return i
    return -1
