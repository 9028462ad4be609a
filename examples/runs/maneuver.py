"""
A maneuver with too high a gain
===============================

The paper's test of stability: an arbitrary maneuver through clay, at K = 3 and at K = 25.
``hc.out_of_band_ratio`` is the share of the force that lies above the band of the maneuver.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

fig, axes = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.6))
for ax, K in zip(axes, (3.0, 25.0), strict=True):
    record = hc.simulate(hc.stability_test(K), every=4)
    share = hc.out_of_band_ratio(record)
    poles = hc.theory.closed_loop_poles("x", K, 50.0, hc.Operator())
    print(f"K = {K:g}: {record.status}; rightmost pole {poles.real.max():.3g} 1/s")
    ax.plot(record.t, record.fh[:, 0], lw=0.7)
    ax.set_title(f"K = {K:g}: {share:.3g} out of band", fontsize=9, loc="left")
    ax.set_ylabel("force of the hand x [N]")
axes[1].set(xlabel="time [s]")
plt.show()
