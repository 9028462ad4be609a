"""
My leader and follower oscillate
================================

Two arms of seven joints that follow each other, gains in their drives. Left: how late the link may
be, over a common factor of all Kp. Right: growth of the common motion over the share of a published
friction compensation that is fed forward. Above some share it grows, and half the Kp with 1.5 times
the Kd changes hardly anything.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

KP, KD = (240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2)
SLOPES = (0.93, 0.93, 1.77, 2.97, 0.79, 2.08, 0.22)  # Fc k + Fv of each joint [N.m.s/rad]

arm = hc.MjcfArm("leader_7")
law = hc.JointPD(KP, KD, runs="drive")
pair = hc.Pair(arm, arm, law, hc.Link(delay="4 ms"), Ts="2 ms")
print(hc.theory.pair_limits(pair).headline())

fig, (late, grows) = plt.subplots(1, 2, figsize=(9.2, 3.6))
alone = replace(pair, link=hc.Link(delay="4 ms", rates=False))
for name, each in (("positions and rates sent", pair), ("positions alone", alone)):
    found = hc.theory.pair_map(each, gains=12, delays=2)
    late.plot(found.gains, 1e3 * found.limits, label=name)
late.plot(1.0, 4.0, "o", color="0.2", label="the pair")
late.set(xscale="log", ylim=(0.0, 40.0), xlabel="factor of all Kp", ylabel="largest delay [ms]")
late.set_xticks([0.125, 0.25, 0.5, 1, 2, 4, 8], ["1/8", "1/4", "1/2", "1", "2", "4", "8"])
late.minorticks_off()
late.legend()
touching = replace(pair, leader_operator=hc.Operator(), follower_clay=hc.Contact(B=90.0, axis="z"))
print(hc.theory.compare_links(touching).headline())

softer = replace(law, Kp=[0.5 * x for x in KP], Kd=[1.5 * x for x in KD])
shares = np.linspace(0.0, 1.0, 9)
one_late = replace(pair, link=hc.Link(), Ts="1 ms", delay="1 ms")
for name, gains in (("Kp, Kd", law), ("Kp/2, 1.5 Kd", softer)):
    rates = []
    for share in shares:
        rubbed = replace(gains, friction=[(0.0, 1.0, share * x) for x in SLOPES])
        found = hc.theory.pair_limits(replace(one_late, law=rubbed))
        rates.append(np.log(found.radius) / found.Ts)
    grows.plot(shares, rates, label=name)
grows.axhline(0.0, color="0.3", lw=1)
grows.set(xlabel="share of the friction fed forward", ylabel="growth [1/s]")
grows.legend()
plt.show()
