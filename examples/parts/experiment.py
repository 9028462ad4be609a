"""
Your own experiment
===================

A dataclass with bounds becomes an experiment, with a function, options of ``hapticclay run`` and
names for sweeps. A value out of its bounds is refused, and the error names field, value and bound.
"""

from dataclasses import dataclass
from typing import Annotated

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")


@dataclass(frozen=True, kw_only=True)
class Stripes(hc.Experiment):
    """Stripes of hard clay, evenly spaced.

    Attributes:
        b: damping of a stripe [N.s/m], 0 to 1e4.
        pitch: from one stripe to the next [m], 0.005 to 0.1.
    """

    b: Annotated[float, hc.Bound(0.0, 1e4, "N.s/m")] = 90.0
    pitch: Annotated[float, hc.Bound(0.005, 0.1, "m")] = 0.02

    def scenario(self):
        edges = tuple(0.04 + 0.5 * self.pitch * i for i in range(10))
        law = hc.Profile(edges, (0.0, self.b) * 5 + (0.0,))
        return self.build_scenario("stripes", clay=hc.Clay(law, law), gain=(1.0, 0.3))


hc.EXPERIMENTS["stripes"] = Stripes
try:
    Stripes(b=-1.0)
except hc.ParameterError as error:
    print(error)

fig, ax = plt.subplots()
for b in (20.0, 90.0):
    record = hc.simulate(Stripes(b=b).scenario())
    ax.plot(100 * record.p[:, 0], 100 * record.v[:, 0], label=f"{b:g} N·s/m")
del hc.EXPERIMENTS["stripes"]  # leave the registry as it was
print("from the start:", ", ".join(hc.SCENARIOS))
ax.set(xlabel="position x [cm]", ylabel="velocity x [cm/s]")
ax.legend(title="stripes of")
plt.show()
