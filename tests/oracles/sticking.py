"""A linear loop with Coulomb friction, in time: SciPy between the events of stick and slip."""

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCES = dict(method="DOP853", rtol=1e-10, atol=1e-13)


def motion(A, B, Fy, z, t_max, step=1e-3):
    """Moves z' = A z + B u, u = -Fy v/|v|, v = z[1], exactly at rest while |u| <= Fy can hold it.

    Args:
        A: shape (n, n).
        B: of the friction, shape (n,).
        Fy: [N].
        z: state at the start, shape (n,); v != 0.
        t_max: [s].
        step: largest one [s], of which there are some in each half swing.

    Returns:
        (t, z) of all steps, the time at which it stuck for good or inf.
    """
    t, ts, zs, sign = 0.0, [], [], float(np.sign(z[1]))

    def need(z):  # force that keeps v as it is
        return -(A[1] @ z) / B[1]

    def until(rate, event):
        nonlocal t, z
        event.terminal = True
        run = solve_ivp(rate, (t, t_max), z, events=event, max_step=step, **TOLERANCES)
        ts.append(run.t)
        zs.append(run.y.T)
        t, z = run.t[-1], run.y[:, -1]
        return run.status == 1

    while t < t_max:
        # the event must not fire at the start, where v is 0 to rounding
        def stops(time, z, start=t, sign=sign):
            return sign if time < start + 1e-6 else z[1]

        if not until(lambda _, z, u=-sign * Fy: A @ z + B * u, stops):
            break
        z[1] = 0.0
        if abs(need(z)) <= Fy:

            def breaks(_, z):
                return abs(need(z)) - Fy

            if not until(lambda _, z: A @ z + B * need(z), breaks):
                return np.concatenate(ts), np.concatenate(zs), ts[-1][0]
        sign = -float(np.sign(need(z)))
    return np.concatenate(ts), np.concatenate(zs), np.inf
