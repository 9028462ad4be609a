"""
A follower at a wall, and in clay that gives way
================================================

A hand presses a leader against what its follower meets 5 mm away: a wall, which pushes and never
pulls, and clay that keeps a dent. With position and force sent over 2 ms, the hand feels the wall;
as it lets go, the follower leaves it, and leaves the clay where its dent ends.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.5, damper=2.0)
law = hc.JointPD(Kp=(600.0,), Kd=(25.0,))
link = hc.Link("position-force", delay="2 ms")
press = hc.Pulse((3.0, 0.0), 0.05, 0.5)  # N, for half a second
hand = hc.Operator(mass=1.0, damper=10.0, spring=50.0)
wall = hc.Contact(K=2000.0, B=10.0, unilateral=True, start=5e-3)
soft = hc.Spring(k=2000.0, limit=1.5, unilateral=True)
clay = hc.Clay(
    hc.Profile((5e-3,), (0.0, 10.0), springs=(hc.Spring(), soft)), hc.Profile((), (0.0,))
)
pair = hc.Pair(device, device, law, link, leader_operator=hand, muscle=press, t_max=1.0)
print(hc.theory.pair_limits(replace(pair, follower_clay=wall)).headline())

fig, axes = plt.subplots(2, 2, sharex=True, sharey="row", figsize=(8.4, 5.0))
for (motion, force), (name, touched) in zip(
    axes.T, {"wall": wall, "clay that gives way": clay}.items(), strict=True
):
    record = hc.simulate(replace(pair, follower_clay=touched))
    print(f"{name}: up to {record.contact[:, 0].max():.2f} N")
    motion.plot(record.t, 1e3 * record.leader[:, 0], label="leader")
    motion.plot(record.t, 1e3 * record.follower[:, 0], label="follower")
    motion.axhline(5.0, color="0.4", ls="--", lw=1, label="surface")
    motion.set_title(name)
    force.plot(record.t, record.contact[:, 0], color="C2")
    force.set(xlabel="time [s]")
axes[0, 0].set(ylabel="position [mm]")
axes[0, 0].legend()
axes[1, 0].set(ylabel="force of the follower [N]")
plt.show()
