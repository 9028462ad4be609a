"""
Probability of instability
==========================

Hand and delay are random; each run is judged by itself. The interval shows how much so few runs can
say. The runs are stored in a folder, and the same call resumes an interrupted study.
Needs pyarrow: ``pip install 'hapticclay[sweep]'``.
"""

import tempfile

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

trials = hc.studies.Trials(
    hc.studies.PushedLoop("x", b=90.0, Ts=1e-3),  # N.s/m, s
    vary={"delay": hc.studies.Distribution("uniform", 0.0, 2e-3)},  # s
    hands=hc.studies.Hands.around(hc.Operator(), variation=0.5),
    grid={"K": hc.studies.Range(1.0, 5.0, 4)},
    runs=30,  # of each K
)
with tempfile.TemporaryDirectory() as folder:
    hc.studies.monte_carlo(trials, out=folder)
    result = hc.studies.stored_runs(trials, folder)
print(f"over all K: {result.total}")

chart = result.map()
fig, ax = plt.subplots()
share = 100.0 * chart.probability[:, 0]  # %
low, high = (100.0 * x[:, 0] for x in chart.interval())
ax.errorbar(chart.x, share, (share - low, high - share), fmt="o", capsize=4)
ax.set(xlabel="gain K [1/kg]", ylabel="unstable runs, 95 % interval [%]", ylim=(-3.0, 103.0))
ax.set_title(f"{trials.runs} runs at each gain", loc="left")
plt.show()
