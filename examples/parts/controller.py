"""
Your own controller
===================

A function of the measured values replaces compensator and servo. Here it is PD control of the
joints towards an oscillating target. Python calls it once a control sample.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

start = hc.simulate(hc.Scenario(t_max=1e-3, length=None)).q[0]


def law(t, q, qd, fh, state, params):
    """Torques of shoulder and elbow [N.m], and the state."""
    stiffness, damper, shoulder, elbow = params
    swing = 0.1 * math.sin(2.0 * math.pi * t)
    tau1 = stiffness * (shoulder + swing - q[0]) - damper * qd[0]
    tau2 = stiffness * (elbow - swing - q[1]) - damper * qd[1]
    return (tau1, tau2), state


pd = hc.Controller(law, params=(200.0, 12.0, float(start[0]), float(start[1])))
scenario = hc.Scenario(
    clay=hc.slab(20.0),  # N.s/m, everywhere
    control="sampled",
    Ts=0.72e-3,
    render="physical",
    controller=pd,
    force=(0.0, 0.0),
    length=None,
    t_max=3.0,
)
record = hc.simulate(scenario)
print(record.status)

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.6))
swing = 0.1 * np.sin(2.0 * np.pi * record.t)
for i, (name, sign) in enumerate((("shoulder", 1.0), ("elbow", -1.0))):
    (line,) = above.plot(record.t, record.q[:, i] - start[i], label=name)
    above.plot(record.t, sign * swing, "--", color=line.get_color(), lw=1, label="its target")
    below.plot(record.t, record.tau[:, i])
above.set(ylabel="angle from the start [rad]", ylim=(-0.15, 0.22))
above.legend(ncols=4, loc="upper center")
below.set(xlabel="time [s]", ylabel="torque [N·m]")
plt.show()
