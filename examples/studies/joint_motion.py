"""
How an arm swings under a controller of one's own
=================================================

Two links under a law that a function computes every 2 ms, 4 ms late. Growth, frequency and joint
of the swing are read from the samples of all joints: at 50 N.m/rad it dies out, at four times as
much the elbow buzzes.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

arm = hc.MjcfArm("planar_2r", friction=(0.0, 0.0))
aim = [q + 1e-3 for q in arm.q]


def law(t, q, qd, fh, state, params):
    (K,) = params
    return [K * (a - x) - 0.3 * w for a, x, w in zip(aim, q, qd, strict=True)], state


fig, axes = plt.subplots(2, 1, figsize=(6.4, 4.4))
for ax, K, span in zip(axes, (50.0, 200.0), (1.0, 0.12), strict=True):
    record = hc.simulate(
        hc.Scenario(
            arm=arm,
            controller=hc.Controller(law, params=[K]),
            hardware=hc.Hardware(delay=4e-3),
            Ts=2e-3,
            dt=5e-4,
            t_max=span,
            force=(0.0, 0.0),
            stop_when_unstable=False,
        )
    )
    motion = hc.studies.joint_motion(record)
    print(motion.headline())
    for i, name in enumerate(arm.names):
        ax.plot(1e3 * record.t, 1e3 * (record.q[:, i] - aim[i]), label=name)
    ax.set_title(f"{K:g} N·m/rad: {motion.headline()}", loc="left", fontsize=9)
    ax.set_ylabel("off its aim [mrad]")
axes[1].set_xlabel("time [ms]")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
plt.show()
