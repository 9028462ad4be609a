"""
1. A first cut
==============

You simulate a hand that pushes a tool through a slab of clay, look at the result, and replace the
clay with your own. All quantities are in SI units; pairs are ordered (x, y).
"""

# %%
# The scene
# ---------
# ``hc.constant_cut`` makes the scene of the paper: a hand pushes a handle along x with 1 N. From
# 5 to 15 cm there is clay that resists with b = 90 N.s/m. The handle sits on a two-link arm whose
# motors make it feel like a light mass with a damper: this is the compensator, K/(s² + 10 s).

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.constant_cut(b=90.0, force=(1.0, 0.0))
record = hc.simulate(scenario)
print(record.status)

# %%
# The record
# ----------
# A run is a :obj:`~hapticclay.Record`: arrays over time, and how it ended. ``record.t`` has n
# times; every other array has one row per time: position ``p``, velocity ``v``, the forces
# ``fh`` of the hand and ``fe`` of the clay, and more. Every border that the handle passed is in
# ``record.crossings``.

print(len(record.t), "samples;", "p has the shape", record.p.shape)
for crossing in record.crossings:
    print(f"{crossing.border:.2f} m at {crossing.time:.4f} s")

# %%
# Force and speed
# ---------------
# In steady motion the compensator's own damper, 10/K, and the clay carry the force together:
# v = K f/(10 + K b). With K = 1 these are 10 cm/s outside and 1 cm/s inside.

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
x = 100 * record.p[:, 0]
above.plot(x, 100 * record.v[:, 0], label="simulated")
for b in (0.0, 90.0):
    label = "expected, K f/(10 + K b)" if b else None
    above.axhline(100 / (10 + b), color="0.3", ls="--", lw=1, label=label)
above.set(ylabel="velocity x [cm/s]")
above.legend(loc="center")
below.plot(x, record.fh[:, 0], label="hand")
below.plot(x, record.fe[:, 0], label="clay")
below.set(xlabel="position x [cm]", ylabel="force x [N]")
below.legend(loc="center")
plt.show()

# %%
# A hand perceives viscosity as force over velocity. That of the clay is b at any speed:

inside = record.b[:, 0] > 0.0
felt = record.ratio(record.fe)[inside, 0]
print(f"{felt.min():.3f} to {felt.max():.3f} N.s/m")

# %%
# Your own clay
# -------------
# :obj:`~hapticclay.Profile` describes clay by layers. ``hc.with_fields`` makes a changed copy of
# a scenario, any field by its name; scenarios themselves never change.

layers = hc.Profile(edges=(0.05, 0.08, 0.12), values=(0.0, 40.0, 150.0, 0.0))
mine = hc.with_fields(scenario, {"clay": hc.Clay(layers, layers), "gain.y": 0.3})
layered = hc.simulate(mine)
print(layered.status)

# %%
# Real clay does not flow under a small force. ``hc.slab`` makes a slab of clay that yields, here at
# 2 N, and resists with 30 N.s/m beyond. A tool pushed with 1 N comes to rest half a
# centimetre inside the clay; one pushed with 3 N goes through.

firm = hc.slab(hc.Flow(Fy=2.0, b=30.0), 0.05, 0.15)
fig, ax = plt.subplots()
ax.axhspan(5, 15, color="0.92")
ax.text(0.05, 14, "clay")
ax.plot(layered.t, 100 * layered.p[:, 0], label="layers, 1 N")
for force in (1.0, 3.0):
    pushed = hc.with_fields(scenario, {"clay": firm, "force.x": force, "t_max": 8.0})
    run = hc.simulate(pushed)
    print(f"{force:g} N: {run.status}, at {100 * run.p[-1, 0]:.2f} cm")
    ax.plot(run.t, 100 * run.p[:, 0], label=f"clay that yields at 2 N, {force:g} N")
ax.set(xlabel="time [s]", ylabel="position x [cm]", xlim=(0, 10))
ax.legend(loc="lower right")
plt.show()

# %%
# Save the run, and check its error
# ---------------------------------
# ``record.save(folder)`` writes the record, a summary and the scenario, from which the run can be
# repeated with bit-identical results; ``hc.Record.load`` reads them back. If the times of the
# crossings matter, request an error: step and integrator are then chosen and verified.

exact = hc.simulate(scenario, error=1e-8)
print(exact.error)
print(f"error of the default step: {record.crossings[-1].time - exact.crossings[-1].time:.1e} s")

# %%
# Next: :doc:`t2_stability`. More clay: :doc:`/clay`, :doc:`/gallery/clay/index`.
