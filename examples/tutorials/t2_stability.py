"""
2. Is it stable, and by how much?
=================================

A motor-assisted handle can become unstable. You raise the gain K until it does, compute the limit
beforehand, and see how sampling, latency and other hands lower it.
"""

# %%
# An unstable run is not an error: its status says that it diverged, its advice what would help.

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

for K in (0.5, 1.0):
    record = hc.simulate(hc.constant_cut(b=90.0, gain=(1.0, K)))
    print(f"K = {K:g} on y: {record.status}")
    if record.outcome.advice:
        print("   ", record.outcome.advice)

# %%
# The limit, computed
# -------------------
# ``hc.theory.gain_limit`` is the K below which every gain is stable. It is exact for the linear
# loop of one axis. It depends on the clay, and stiffer clay is not always worse:

dampings = np.geomspace(3.0, 3e4, 60)
fig, ax = plt.subplots()
for axis in "xy":
    limits = [hc.theory.gain_limit(axis, float(b)) for b in dampings]
    ax.loglog(dampings, limits, label=f"{axis} axis")
ax.axhline(1.0, color="0.3", ls="--", lw=1)
ax.axvline(90.0, color="0.3", ls="--", lw=1)
ax.plot(90.0, 1.0, "kx", label="the run that diverged, on y")
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="largest stable K [1/kg]")
ax.legend()
plt.show()

# %%
# The run and the limit agree: just below the limit an oscillation of y dies out, just above it
# grows.

limit = hc.theory.gain_limit("y", 90.0)
fig, ax = plt.subplots()
for share in (0.95, 1.0, 1.05):
    scenario = hc.Scenario(
        clay=hc.slab(90.0),
        gain=(0.0, share * limit),
        force=(0.0, 0.0),
        velocity=(0.0, 0.01),
        inertia_shaping=True,
        length=None,
        t_max=3.0,
        stop_when_unstable=False,
    )
    run = hc.simulate(scenario)
    ax.plot(run.t, 100 * run.v[:, 1], lw=1, label=f"K = {share:g} of {limit:.4f}")
ax.set(xlabel="time [s]", ylabel="velocity y [cm/s]", ylim=(-2.2, 2.6))
ax.legend(ncols=3, loc="upper right")
plt.show()

# %%
# How large is the margin?
# ------------------------
# A verdict states its margin and its assumptions; ``hc.theory.margins`` has gain, phase, delay and
# disk margins.

verdict = hc.theory.coupled_stability("x", 1.0, 90.0)
print(verdict.verdict, f"{verdict.margin:.2f}", verdict.measures)
margins = hc.theory.margins("x", 1.0, 90.0)
print(f"phase {np.degrees(margins.phase):.0f}°, delay {1e3 * margins.delay:.0f} ms")

# %%
# Hardware samples and has latency
# --------------------------------
# Ts is the control sample, delay the time from a measurement to its torque.

for timing in ({}, dict(Ts=0.36e-3), dict(Ts=0.36e-3, delay=0.36e-3), dict(Ts=2e-3, delay=2e-3)):
    print(
        f"{hc.theory.gain_limit('x', 90.0, **timing):.3f} 1/kg with "
        f"{timing or 'continuous control'}"
    )

# %%
# Any hand
# --------
# These limits hold without a hand. ``hc.Operator()`` is the paper's hand; ``hc.theory.worst_case``
# finds the worst hand of a box, and ``hc.theory.passivity`` covers all passive hands.

box = hc.theory.Box(mass=(0.1, 1.0), damper=(1.0, 10.0), spring=(0.0, 300.0))
worst = hc.theory.worst_case("y", 0.5, 90.0, box)
print(f"no hand       {limit:.4f} 1/kg")
print(f"the paper's   {hc.theory.gain_limit('y', 90.0, hc.Operator()):.4f} 1/kg")
print(f"worst of box  {worst.limit:.4f} 1/kg, {worst.hand}")
for axis, K in (("x", 1.0), ("y", 0.5)):
    passive = hc.theory.passivity(axis, K, 90.0)
    print(f"{axis}, K = {K:g}: passive {passive.verdict}, {passive.margin:.0f} N.s/m to spare")

# %%
# So y at K = 0.5 is stable with every hand of the box, and some other passive hand makes it
# unstable. ``hc.theory.design_gain`` answers the reverse question: the largest K with
# requested margins.

K = hc.theory.design_gain("y", 90.0, hc.Operator(), disk_margin=0.5)
print(f"K = {K:.3f} keeps a disk margin of 0.5")

# %%
# Next: :doc:`t3_own_controller`. More: :doc:`/stability`, :doc:`/gallery/theory/index`. On the
# command line: ``hapticclay stability --axis y --b 90``.
