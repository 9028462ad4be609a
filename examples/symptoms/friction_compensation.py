"""
An arm that hums under friction compensation
============================================

The shoulder of a small arm under the law of a published prototype, which feeds more friction
forward than the joint has: a limit cycle, by harmonic balance and in a run. Few encoder counts cap
the law, and it rests.
"""

import matplotlib.pyplot as plt
import mujoco

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

# Inertia, damping and friction of the shoulder pan of an SO-101 (MuJoCo Menagerie):
PAN = """
<mujoco model="pan"><option gravity="0 0 0"/><worldbody><body>
  <inertial pos="0 0 0" mass="1" diaginertia="0.001 0.001 0.001"/>
  <joint name="pan" axis="0 0 1" armature="0.0423" damping="0.6" frictionloss="0.052"/>
  <site name="handle" pos="0.2 0 0"/>
</body></worldbody></mujoco>
"""
arm = hc.MjcfArm(mujoco.MjSpec.from_string(PAN))
law = hc.JointPD(
    Kp=(15.0,), Kd=(0.5,), velocity="difference", friction=[(0.2, 20.0, 0.05)]
)  # LeRobot, a bilateral prototype at 500 Hz: 0.2 tanh(20 w) + 0.05 w
found = hc.theory.friction_cycle(arm, law, Ts=2e-3)
print(found.text())

# %%
# A push of 20 N for 20 ms starts it. Behind 4096 counts a turn it comes to rest:
fig, (run, growth) = plt.subplots(1, 2, figsize=(7.2, 2.8))
push = hc.Pulse((0.0, 20.0), start=0.0, width=0.02)
for counts, label in ((None, "no encoder"), (4096, "4096 counts a turn")):
    scenario = hc.Scenario(
        arm=arm,
        controller=law,
        Ts=2e-3,
        t_max=2.0,
        force=(0.0, 0.0),
        length=None,
        muscle=push,
        hardware=hc.Hardware(encoder=counts) if counts else None,
    )
    record = hc.simulate(scenario)
    run.plot(record.t, 1e3 * record.q[:, 0], label=label)
    cycle = hc.theory.friction_cycle(arm, law, Ts=2e-3, counts=counts)
    growth.plot(cycle.line_rate[0], cycle.line_growth[0], label=label)
    print(cycle.headline())
for side in (1.0, -1.0):
    run.axhline(side * 1e3 * found.amplitude[1], color="0.4", ls=":")
run.set(xlabel="t [s]", ylabel="joint position [mrad]")
growth.axhline(0.0, color="0.4", lw=0.8)
growth.set(xscale="log", xlim=(3e-3, 3.0), xlabel="largest rate [rad/s]", ylabel="growth [1/s]")
fig.legend(*run.get_legend_handles_labels(), loc="outside upper center", ncols=2)
plt.show()
