"""
Your own arm
============

Lengths and inertias define an arm; the MuJoCo model is generated from them. Without inertia shaping
the handle has the arm's own mobility, so the transient at the border of the clay differs.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

arms = {
    "the paper's": hc.Arm(),
    "light": hc.Arm(l1=0.3, l2=0.3, I1=0.04, I2=0.4),  # m, kg.m^2
    "heavy": hc.Arm(l1=0.3, l2=0.3, I1=0.3, I2=2.0),
}
fig, ax = plt.subplots()
for name, arm in arms.items():
    scenario = hc.with_fields(hc.constant_cut(b=40.0), {"arm": arm})
    record = hc.simulate(scenario)
    W = arm.nominal_mobility[0]
    print(
        f"{name}: {record.status}, limit of K on x {hc.theory.gain_limit(scenario, 'x'):.2f} 1/kg"
    )
    t = record.t - record.crossings[0].time
    ax.plot(t, 100 * record.v[:, 0], label=f"{name}, W = {W:.2f} 1/kg")
ax.axhline(100.0 / 50.0, color="0.3", ls="--", lw=1, label="expected, K f/(10 + K b)")
ax.set(xlim=(-0.2, 1.2), ylim=(-1, 11))
ax.set(xlabel="time after the border [s]", ylabel="velocity x [cm/s]")
ax.legend()
plt.show()
