"""
Sampled control, latency and jitter
===================================

Hardware measures, computes a torque and holds it (zero-order hold). With ``control="sampled"`` a
run does the same every Ts, with the latency and jitter of ``hc.Hardware``. A cut close to its gain
limit shows the effect.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

K, b = 3.0, 90.0  # 1/kg, N.s/m
common = dict(b=b, gain=(K, 0.5), length=0.08)
loops = {
    "continuous": hc.constant_cut(**common),
    "sampled, 0.36 ms": hc.constant_cut(control="sampled", **common),
    "sampled, 1.44 ms": hc.constant_cut(control="sampled", Ts=1.44e-3, **common),
}
jitter = hc.Hardware(delay=0.36e-3, jitter=0.1e-3)  # s
loops["a sample late, with jitter"] = hc.with_fields(
    hc.constant_cut(control="sampled", **common), {"hardware": jitter}
)
fig, axes = plt.subplots(len(loops), 1, sharex=True, sharey=True, figsize=(6.4, 6.0))
for ax, (name, scenario) in zip(axes, loops.items(), strict=True):
    record = hc.simulate(scenario)
    limit = hc.theory.gain_limit(scenario, "x") if not scenario.hardware else float("nan")
    if scenario.hardware:
        limit = hc.theory.gain_limit("x", b, Ts=0.36e-3, delay=0.36e-3)
    t = record.t - record.crossings[0].time
    ax.plot(t, 100 * record.v[:, 0])
    ax.set_title(f"{name}: K = {K:g} of {limit:.2f} 1/kg at most", fontsize=9, loc="left")
axes[0].set(xlim=(-0.2, 2.0), ylim=(-15, 32))
axes[-1].set_xlabel("time after the border [s]")
fig.supylabel("velocity x [cm/s]", fontsize=10)
plt.show()
