"""
Yielding clay as a damper
=========================

For an oscillation of velocity amplitude V, clay acts as a damper N(V), stiff at small speeds.
Oscillations grow where N lies in a band of dampings for which the loop is unstable.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

loop = hc.theory.Loop("y", K=1.0)
((low, high),) = hc.theory.unstable_dampings(loop)
V = np.geomspace(1e-4, 1.0, 200)  # m/s
flows = {
    "Bingham": hc.Flow(Fy=5.0, b=30.0),
    "Coulomb": hc.Flow(Fy=5.0),
    "power law": hc.Flow(K=40.0, n=0.4),
    "viscous": hc.Flow(b=90.0),
}
fig, ax = plt.subplots()
ax.axhspan(low, high, color="0.92", label="the loop is unstable")
for name, flow in flows.items():
    ax.loglog(V, hc.theory.describing_function(flow, V), label=name)
    for cycle in hc.theory.limit_cycles(loop, flow):
        print(f"{name}: {cycle.kind} at {cycle.speed:.4f} m/s, {cycle.frequency:.2f} Hz")
        style = "o" if cycle.kind == "limit cycle" else "x"
        ax.plot(cycle.speed, hc.theory.describing_function(flow, cycle.speed), style, color="0.2")
ax.plot([], [], "o", color="0.2", label="limit cycle")
ax.plot([], [], "x", color="0.2", label="threshold")
ax.set(xlabel="amplitude of the velocity [m/s]", ylabel="N [N·s/m]", xlim=(1e-4, 1.0))
fig.legend(loc="outside right upper")
plt.show()
