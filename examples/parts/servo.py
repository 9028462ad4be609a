"""
Your own servo
==============

G is the response of the handle to the compensator, Sh its response to a force. Both are
second-order and stable, one per axis. A step of the command shows G alone.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import lti

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

S = hc.Scenario().servo[0].S
servos = {
    "the paper's": hc.Scenario().servo[0],
    "fast": hc.Servo(G=hc.SecondOrder(2500.0, 80.0, 2500.0), S=S),
    "ringing": hc.Servo(G=hc.SecondOrder(900.0, 9.0, 900.0), S=S),
}
fig, ax = plt.subplots()
for name, servo in servos.items():
    scenario = hc.Scenario(
        servo=(servo, servo),
        gain=(0.0, 0.0),
        force=(0.0, 0.0),
        command=hc.Step((0.01, 0.0), time=0.1),  # m, s
        length=None,
        t_max=0.9,
    )
    record = hc.simulate(scenario)
    (line,) = ax.plot(record.t, 100 * record.p[:, 0], label=name)
    G = servo.G
    t, y = lti([G.gain], [1.0, G.damping, G.stiffness]).step(T=np.linspace(0.0, 0.8, 40))
    ax.plot(0.1 + t, y, ".", color=line.get_color())
ax.plot([], [], ".", color="0.3", label="step response of G")
ax.set(xlabel="time [s]", ylabel="position x [cm]")
ax.legend()
plt.show()
