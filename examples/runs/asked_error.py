"""
A requested error, and its cost
===============================

``error=`` chooses integrator and step, and verifies the choice by runs at other steps. The times at
which the handle crosses the borders then stay within the requested error.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.Scenario(  # a hit, and the way back out
    clay=hc.slab(300.0, 0.05, 0.15),
    force=(-2.0, 0.0),
    start=(0.03, 0.0),
    velocity=(0.3, 0.0),
    inertia_shaping=True,
    length=None,
    t_max=1.0,
)
exact = hc.simulate(scenario, error=1e-10).crossings
asked = [10.0**-i for i in range(4, 10)]  # s
records = [hc.simulate(scenario, error=e) for e in asked]
reached = [
    max(abs(a.time - b.time) for a, b in zip(r.crossings, exact, strict=True)) for r in records
]
for e, r in zip(asked, records, strict=True):
    print(f"{e:.0e} s: {r.error}")

fig, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.4))
left.loglog(asked, asked, "--", color="0.3", lw=1, label="asked")
left.loglog(asked, [r.error.estimate for r in records], "s", mfc="none", label="estimated")
left.loglog(asked, reached, "o", ms=4, label="reached")
left.set(xlabel="requested error [s]", ylabel="error of the border times [s]")
left.legend()
for name, marker in (("fast", "o"), ("accurate", "s")):
    chosen = [(r.error.asked, 1e3 * r.error.dt) for r in records if r.error.integrator == name]
    if chosen:
        right.loglog(*zip(*chosen, strict=True), marker, label=name)
right.set(xlabel="requested error [s]", ylabel="chosen step [ms]")
right.legend(title="integrator")
plt.show()
