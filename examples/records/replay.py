"""
A recording drives two models
=============================

The force of a recorded run moves the arm through two clays. Beside the recording, the model whose
clay is too soft moves too far.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

push = hc.Multisine((2.0, 1.0), low=0.3, high=3.0, period=4.0, lines=8, seed=3)
real = hc.Scenario(
    clay=hc.slab(60.0),
    muscle=push,
    force=(0.0, 0.0),
    operator=hc.Operator(),
    length=None,
    t_max=4.0,
)
record = hc.simulate(real)  # in the place of a log
log = hc.studies.Recording(record.t, p=record.p, f=record.fh)

fig, ax = plt.subplots()
ax.plot(record.t, 1e3 * record.p[:, 0], color="black", lw=1, label="recorded")
for b in (40.0, 60.0):
    found = hc.studies.replay(hc.with_fields(real, {"clay": hc.slab(b)}), log)
    print(f"clay of {b:g} N.s/m: {found.headline()}")
    ax.plot(found.t, 1e3 * found.p[:, 0], "--", label=f"run in clay of {b:g} N·s/m")
ax.set(xlabel="time [s]", ylabel="position x [mm]")
ax.legend()
plt.show()
