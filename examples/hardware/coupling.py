"""
A virtual coupling
==================

Motors that hold their force for a sample cannot render clay stiffer than 2/(Ts W): each sample
overshoots. A spring k and a damper d between the handle and a virtual tool make clay of any
stiffness renderable, if d pays for the hold of the spring, k Ts/2.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, Ts = 8e3, 0.36e-3  # N.s/m, s
print(f"2/(Ts W) = {2.0 / (Ts * hc.Scenario().servo[0].S.gain):.0f} N.s/m")
base = hc.Scenario(
    clay=hc.slab(b, 0.05, 0.15),
    control="sampled",
    Ts=Ts,
    force=(0.2, 0.0),
    gain=(0.3, 0.3),
    inertia_shaping=True,
    start=(0.049, 0.0),
    torque_limit=(1e6, 1e6),  # N.m, so that nothing but the hold matters
    length=None,
    t_max=0.3,
    stop_when_unstable=False,
)
couplings = {"held by the motors": None, "coupled": hc.Coupling(spring=5e4, damper=500.0)}
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.8))
for name, coupling in couplings.items():
    hardware = hc.Hardware(coupling=coupling)
    record = hc.simulate(hc.with_fields(base, {"hardware": hardware}))
    print(f"{name}: {record.status}")
    t = 1e3 * (record.t - record.crossings[0].time)
    above.plot(t, 100 * record.v[:, 0], ".-", ms=3, lw=0.8, label=name)
    below.plot(t, record.fe[:, 0], ".-", ms=3, lw=0.8, label=name)
above.set(xlim=(-1, 6), ylim=(-5, 5), ylabel="velocity x [cm/s]")
above.legend(ncols=2)
below.set(xlabel="time in the clay [ms]", ylabel="force of the clay [N]", ylim=(-300, 300))
plt.show()
