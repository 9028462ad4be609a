"""
A controller of your own: its largest stable gain
=================================================

A PD controller of the joints, once as matrices and once as a function. The torque acts at once or
later: each delay lowers the gain at which the loop begins to oscillate.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

STIFFNESS, DAMPING = 20.0, 1.0  # N.m/rad, N.m.s/rad


def law(t, q, qd, fh, state, params):
    """Torques of shoulder and elbow [N.m], and the state."""
    gain, shoulder, elbow = params
    tau1 = gain * (STIFFNESS * (shoulder - q[0]) - DAMPING * qd[0])
    tau2 = gain * (STIFFNESS * (elbow - q[1]) - DAMPING * qd[1])
    return (tau1, tau2), state


arm = hc.Arm()
pd = hc.Controller(law, params=(1.0, 0.5 * math.pi, -0.5 * math.pi))


def scene(delay):
    return hc.Scenario(
        control="sampled",
        Ts=1e-3,
        render="physical",
        controller=pd,
        hardware=hc.Hardware(delay=delay),
        operator=hc.Operator(),
        origin=(arm.l2, arm.l1),
        force=(0.0, 0.0),
        length=None,
    )


# states, then torques of shoulder and elbow over (q1, q2, their rates, hand force)
matrices = hc.theory.LinearLaw(
    np.zeros((0, 0)),
    np.zeros((0, 6)),
    np.zeros((2, 0)),
    -np.hstack((STIFFNESS * np.eye(2), DAMPING * np.eye(2), np.zeros((2, 2)))),
)
declared = hc.theory.controller_stability(scene(0.0), matrices=matrices)
print(declared.headline())

fig, ax = plt.subplots()
for delay in (0.0, 1e-3, 2.5e-3):
    found = hc.theory.controller_stability(scene(delay), gain=0)
    ax.semilogx(found.gains, found.rates, label=f"{1e3 * delay:g} ms: to {found.high:.3g}")
ax.axhline(0.0, color="black", lw=0.8)
ax.set(
    xlabel="gain", ylabel="growth rate of oscillation [1/s]", ylim=(-100.0, 400.0), xlim=(1, 300)
)
ax.legend(title="delay, and stable gains")
plt.show()
