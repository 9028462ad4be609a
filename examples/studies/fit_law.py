"""
The law of a clay from a record
===============================

``hc.studies.fit_flow`` chooses among five laws and finds the parameters from noisy, rounded values
of time, position and force. Nothing is differentiated, so noise does not bias the law.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

true = hc.Flow(Fy=2.0, K=15.0, n=0.5)
push = hc.Function(lambda t: (8.0 * math.sin(2.2 * t) + 5.0 * math.sin(6.9 * t), 0.0))
scenario = hc.Scenario(
    clay=hc.slab(true), muscle=push, force=(0.0, 0.0), length=None, t_max=8.0, dt=1e-3
)
record = hc.simulate(scenario, every=4)

rng = np.random.default_rng(1)
p = np.round((record.p[:, 0] + 1e-5 * rng.standard_normal(len(record.t))) / 3e-5) * 3e-5
f = np.round((record.fe[:, 0] + 0.05 * rng.standard_normal(len(record.t))) / 0.02) * 0.02
fitted = hc.studies.fit_flow(hc.studies.Measurement(record.t, input=f, output=p))
print("law:", fitted.law)
for name, x in zip(("Fy", "K", "n"), fitted.parameters, strict=True):
    print(f"{name}: {x.low:.3f} to {x.high:.3f}, true {getattr(true, name):g}")

fig, ax = plt.subplots()
ax.plot(100 * np.gradient(p, record.t), f, ".", ms=3, color="0.6", label="measured")
v = np.linspace(-0.12, 0.12, 601)
ax.plot(100 * v, np.sign(v) * true.force(np.abs(v)), label="true law")
ax.plot(100 * v, np.sign(v) * fitted.flow.force(np.abs(v)), "--", label=f"fitted: {fitted.law}")
ax.set(xlabel="velocity [cm/s], differentiated for the picture alone", ylabel="force [N]")
ax.set(xlim=(-12, 12), ylim=(-9, 9))
ax.legend()
plt.show()
