"""
A tool that sticks, then jumps
==============================

A hand pulls a tool at 20 mm/s through layers of hard and soft clay. A soft grip winds up at each
hard layer and lets the tool jump behind it (stick-slip); a firm grip does so much less.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

edges = [0.004 * i for i in range(1, 16)]  # m
yields = [5.0 if i % 2 else 1.0 for i in range(16)]  # N
layers = hc.Profile(edges, [10.0] * 16, Fy=yields)
clay = hc.Clay(layers, hc.Profile((), (0.0,)))
speed = 0.02  # m/s
grips = {
    "soft grip: 200 N/m": hc.Operator(mass=0.0, damper=2.0, spring=200.0),
    "firm grip: 3000 N/m": hc.Operator(mass=0.0, damper=20.0, spring=3000.0),
}
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
for name, grip in grips.items():
    scenario = hc.Scenario(
        clay=clay,
        operator=grip,
        force=(0.0, 0.0),
        muscle=hc.Ramp((grip.spring * speed, 0.0), start=0.0),  # N/s: the hand moves on evenly
        gain=(1.0, 0.0),
        inertia_shaping=True,
        length=0.05,
        t_max=4.0,
        dt=1e-3,
    )
    record = hc.simulate(scenario)
    held = record.held()[:, 0].mean()
    print(
        f"{name}: at rest {100 * held:.0f} % of the time, {1e3 * record.v.max():.0f} mm/s at most"
    )
    above.plot(record.t, 1e3 * record.p[:, 0], label=name)
    below.plot(record.t, 1e3 * record.v[:, 0])
above.plot((0, 4), (0, 4e3 * speed), "--", color="0.3", lw=1, label="where the hand pulls to")
for i in range(0, 14, 2):
    label = "" if i else "hard layers"
    above.axhspan(4 * i + 4, 4 * i + 8, color="0.9", lw=0, label=label)
above.set(ylabel="position x [mm]", ylim=(0, 52))
above.legend(fontsize=8, loc="lower right")
below.axhline(1e3 * speed, color="0.3", ls="--", lw=1)
below.set(xlabel="time [s]", ylabel="velocity x [mm/s]", xlim=(0, 4))
plt.show()
