"""
A cut through clay that grows
=============================

The paper's cut along both axes: beyond 5 cm the clay is harder, and in x it grows by 30 N·s/m each
second (Eq. 25). The speed drops at the border and then keeps falling as K f/(10 + K b(t)).
"""

import math

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.variable_cut()
record = hc.simulate(scenario)
print(record.status)

f = 1.0 / math.sqrt(2.0)  # N along each axis
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
for i, (axis, K) in enumerate(zip("xy", scenario.gain, strict=True)):
    b = record.b[:, i]
    (line,) = above.semilogy(record.t, 100 * record.v[:, i], label=f"{axis}, K = {K:g}")
    expected = 100 * K * f / (10.0 + K * b)
    above.plot(record.t, expected, "--", color="0.2", lw=1, label="expected" if i else None)
    below.semilogy(record.t, b, color=line.get_color(), label=axis)
above.set(ylabel="velocity [cm/s]", ylim=(0.05, 4))
above.legend()
below.set(xlabel="time [s]", ylabel="damping of the clay [N·s/m]")
plt.show()
