"""
A leader and a follower in step
===============================

Two devices of 6 kg that follow each other, pushed for 50 ms. Below the largest delay of theory the
motion decays, above it grows, and the link feeds it: the energy that it took from the arms falls.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=6.0, damper=0.1)
law = hc.JointPD(Kp=(400.0,), Kd=(50.0,))
pair = hc.Pair(device, device, law, Ts=4e-3, t_max=6.0)
limit = hc.theory.pair_limits(pair)
print(limit.headline())

fig, (motion, energy) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
for samples in (30, 45):  # one way
    late = replace(pair, link=hc.Link(delay=samples * pair.Ts))
    record = hc.simulate(late)
    print(f"{4 * samples} ms: {record.headline()}")
    label = f"{4 * samples} ms, {'grows' if record.grows else 'decays'}"
    motion.plot(record.t, 1e3 * (record.leader - record.follower), label=label)
    energy.plot(record.t, 1e3 * record.energy)
motion.set(ylabel="leader less follower [mm]")
motion.legend()
energy.set(xlabel="time [s]", ylabel="energy taken [mJ]")
plt.show()
