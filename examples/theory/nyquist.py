"""
Nyquist curves below and above the limit
========================================

The curve is that of the loop broken at the compensator. Where it crosses the negative real axis,
its distance from -1 gives the gain margin: at the limit of K it goes through -1, and beyond the
limit it encircles -1.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

axis, b, hand = "y", 90.0, hc.Operator()
limit = hc.theory.gain_limit(axis, b, hand)
fig, ax = plt.subplots(figsize=(5.2, 4.4))
for share in (0.5, 1.0, 1.5):
    K = share * limit
    curve = hc.theory.nyquist(axis, K, b, hand, at="compensator")
    low = hc.theory.margins(axis, K, b, hand).gain[1]
    print(f"K = {K:.3f}: Z = N + P = {curve.N} + {curve.P} = {curve.Z}, gain margin {low:.2f}")
    ax.plot(curve.L.real, curve.L.imag, label=f"K = {share:g} of the limit, Z = {curve.Z}")
ax.plot(-1, 0, "k+", ms=12, mew=2)
ax.annotate("-1", (-1, 0), (-4, 8), textcoords="offset points", ha="right")
ax.set(xlim=(-2.5, 1), ylim=(-2, 1.5), xlabel="Re L", ylabel="Im L", aspect="equal")
ax.legend(loc="upper left", fontsize=9)
plt.show()
