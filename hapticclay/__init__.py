"""Virtual clay, cut with a simulated haptic arm.

    import hapticclay as hc

    record = hc.simulate(hc.constant_cut(b=90.0))
    print(record.status)
    record.save("out")

All quantities are SI; axes are ordered (x, y); force signs are fixed in docs/equations.md.
"""

from importlib.metadata import PackageNotFoundError, version

from .batch import simulate_batch
from .errors import ParameterError
from .experiments import SCENARIOS, constant_cut, free
from .lti import closed_loop_poles, gain_limit
from .params import Clay, Multisine, Operator, Profile, Scenario
from .record import Crossing, Outcome, Record
from .scene import build
from .sim import simulate

try:
    __version__ = version("hapticclay")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "unknown"

__all__ = [
    "SCENARIOS",
    "Clay",
    "Crossing",
    "Multisine",
    "Operator",
    "Outcome",
    "ParameterError",
    "Profile",
    "Record",
    "Scenario",
    "build",
    "closed_loop_poles",
    "constant_cut",
    "free",
    "gain_limit",
    "simulate",
    "simulate_batch",
]
