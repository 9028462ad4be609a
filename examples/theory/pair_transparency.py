"""
What a hand feels through a pair
================================

Two devices of 0.5 kg, 5 ms apart each way, the follower in free motion or at a spring of 500 N/m.
Four kinds of link trade lightness in free motion for the stiffness that comes through.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.5, damper=0.5)
law = hc.JointPD(Kp=(300.0,), Kd=(15.0,))
pair = hc.Pair(device, device, law, follower_clay=hc.Contact(K=500.0, B=1.0))

fig, (free, touching) = plt.subplots(1, 2, figsize=(9.2, 3.6), sharey=True)
for kind in ("position-position", "position-force", "four-channel", "waves"):
    linked = replace(pair, link=hc.Link(kind, delay="5 ms"))
    found = hc.theory.pair_transparency(linked)
    print(found.headline())
    free.plot(found.frequency, np.abs(found.free), label=kind)
    touching.plot(found.frequency, np.abs(found.felt))
touching.plot(found.frequency, np.abs(found.contact), "k--", label="the spring itself")
free.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel="impedance felt [N·s/m]")
free.set_title("free motion")
touching.set(xscale="log", yscale="log", xlabel="frequency [Hz]")
touching.set_title("at the spring")
free.legend()
touching.legend()

# %%
# The largest delay over some hands, and what the follower may touch:
hands = hc.theory.Box(mass=(0.1, 1.0), damper=(1.0, 10.0), spring=(0.0, 100.0))
contacts = hc.theory.Box(mass=(0.0, 0.0), damper=(0.0, 5.0), spring=(0.0, 2000.0))
linked = replace(pair, link=hc.Link("position-force", delay="5 ms"))
print(hc.theory.pair_hands(linked, hands, contacts, samples=20).headline())
plt.show()
