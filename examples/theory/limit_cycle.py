"""
A limit cycle in clay that yields
=================================

The loop of y at K = 1 sticks after a small push and oscillates after a large one. The describing
function predicts speed and frequency, ``hc.theory.exact_cycles`` computes them exactly, and a run
confirms them.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

flow = hc.Flow(Fy=0.5, b=30.0)  # N, N.s/m
loop = hc.theory.Loop("y", K=1.0)
print("a small push:", hc.theory.push_outcomes(loop, flow)[0], "- a large one:", end=" ")
print(hc.theory.push_outcomes(loop, flow)[1])
predicted = hc.theory.limit_cycles(loop, flow)[-1]
exact = hc.theory.exact_cycles(loop, flow)[-1]
print(f"predicted {predicted.speed:.4f} m/s, {predicted.frequency:.3f} Hz")
print(f"exact     {exact.speed:.4f} m/s, {exact.frequency:.3f} Hz")

fig, ax = plt.subplots()
for push, name in ((0.05, "pushed at 5 cm/s"), (1e-4, "pushed at 0.1 mm/s")):
    scenario = hc.Scenario(
        clay=hc.slab(flow),
        gain=(0.0, 1.0),
        force=(0.0, 0.0),
        velocity=(0.0, push),
        inertia_shaping=True,
        torque_limit=(1e6, 1e6),
        length=None,
        t_max=3.0,
        stop_when_unstable=False,
    )
    record = hc.simulate(scenario)
    ax.plot(record.t, 100 * record.v[:, 1], lw=1, label=name)
for sign in (1.0, -1.0):
    label = "largest speed, exact" if sign > 0.0 else None
    ax.axhline(100 * sign * exact.speed, color="0.3", ls="--", lw=1, label=label)
ax.set(xlabel="time [s]", ylabel="velocity y [cm/s]", ylim=(-6.5, 7.5))
ax.legend(ncols=3, loc="upper center", fontsize=9)
plt.show()
