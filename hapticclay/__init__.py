"""Virtual clay, cut with a simulated haptic arm.

    import hapticclay as hc

    record = hc.simulate(hc.constant_cut(b=90.0))
    print(record.status)
    record.save("out")

All quantities are SI; axes are ordered (x, y); force signs are fixed in docs/equations.md.
"""

from importlib.metadata import PackageNotFoundError, version

from . import engine  # noqa: F401, before whatever else imports mujoco
from .batch import simulate_batch
from .design import Design, compare, design_gain, transparency_error
from .drift import Drift, drift_map
from .errors import ParameterError
from .experiments import SCENARIOS, constant_cut, free, irregularity, stability_test, variable_cut
from .hardware import Coupling, Interface
from .identify import Identified, Noise, identify
from .limits import gain_limit
from .lti import Compensator, closed_loop_poles
from .params import Clay, Multisine, Operator, Profile, Scenario
from .passive import clay_passivity, observed_passivity, passivity, port_energy
from .record import Crossing, Outcome, Record
from .removal import removed
from .robust import Box, WorstCase, worst_case
from .scene import build
from .sim import simulate
from .stability import (
    Margins,
    Nyquist,
    Verdict,
    coupled_stability,
    margins,
    nyquist,
    small_gain,
    transparency,
)

try:
    __version__ = version("hapticclay")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "unknown"

__all__ = [
    "Box",
    "Clay",
    "Compensator",
    "Coupling",
    "Crossing",
    "Design",
    "Drift",
    "Identified",
    "Interface",
    "Margins",
    "Multisine",
    "Noise",
    "Nyquist",
    "Operator",
    "Outcome",
    "ParameterError",
    "Profile",
    "Record",
    "SCENARIOS",
    "Scenario",
    "Verdict",
    "WorstCase",
    "build",
    "clay_passivity",
    "closed_loop_poles",
    "compare",
    "constant_cut",
    "coupled_stability",
    "design_gain",
    "drift_map",
    "free",
    "gain_limit",
    "identify",
    "irregularity",
    "margins",
    "nyquist",
    "observed_passivity",
    "passivity",
    "port_energy",
    "removed",
    "simulate",
    "simulate_batch",
    "small_gain",
    "stability_test",
    "transparency",
    "transparency_error",
    "variable_cut",
    "worst_case",
]
