"""
Clay at the hand of a device
============================

A device is the hand of a simulated arm. It is pulled through the clay along a line and feels the
clay through a spring and damper that are passive at its rate. Here the device is simulated; for a
real Inverse3, give its address instead.
Needs websockets: ``pip install 'hapticclay[device]'``.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

holder = hc.Scenario(operator=hc.Operator(0.25, 2.0, 300.0), force=(0.0, 0.0))  # kg, N.s/m, N/m
line = hc.ports.Trajectory((0.0, 3.0), ((0.0, 0.0), (0.14, 0.0)))  # s, m
coupling = hc.ports.Coupled(K=300.0, B=5.0)  # N/m, N.s/m: B >= K Ts/2
limits = hc.ports.Limits(largest_force=3.0, ramp=0.5, period=0.01, patience=1.0)  # N, s

with hc.ports.serve(holder, period=0.01, hand=line) as server:
    clay = hc.constant_cut(b=30.0)
    found = hc.ports.render(clay, server.url, 3.0, coupling=coupling, limits=limits)
columns = found.log.columns()
print(f"{found.timing.exchanges} exchanges, {found.timing.missed} lost")

# the device alone: a push, and where it goes
with hc.ports.serve(holder, period=0.01) as server, hc.ports.connect(server.url, limits) as device:
    samples: list[hc.ports.DeviceSample | None] = [
        device.exchange((1.0, 0.0, 0.0)) for _ in range(50)
    ]
print(f"pushed by {1e3 * np.ptp([s.position[0] for s in samples if s]):.1f} mm")

fig, (top, bottom) = plt.subplots(2, sharex=True)
begin = columns["t_s"][-1] - found.record.t[-1]  # the first samples are without force
t = columns["t_s"] - begin
top.plot(t, 1e3 * (columns["x_m"] - columns["x_m"][0]), label="device")
top.plot(found.record.t, 1e3 * found.record.p[:, 0], "--", label="simulated handle")
bottom.plot(t, -columns["fx_N"], label="at the device")
bottom.plot(found.record.t, found.record.fe[:, 0], "--", label="of the clay")
top.set(ylabel="x [mm]")
bottom.set(xlabel="time [s]", ylabel="resisting force [N]")
top.legend()
bottom.legend()
plt.show()
