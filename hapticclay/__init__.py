"""Virtual clay, cut with a simulated haptic arm.

    import hapticclay as hc

    record = hc.simulate(hc.constant_cut(b=90.0))
    print(record.status)
    record.save("out")

All quantities are SI; axes are ordered (x, y); force signs are fixed in docs/equations.md.
"""

from importlib.metadata import PackageNotFoundError, version

from .errors import ParameterError
from .model.experiments import SCENARIOS, constant_cut, free, irregularity, stability_test, variable_cut
from .model.hardware import Coupling, Interface
from .model.scenario import Clay, Multisine, Operator, Profile, Scenario
from .simulation.batch import simulate_batch
from .simulation.record import Crossing, Outcome, Record
from .simulation.simulate import simulate
from .stepping.scene import build
from .studies.identification import Identified, Noise, identify
from .studies.removal import removed
from .studies.workspace import Drift, drift_map
from .theory.design import Design, compare, design_gain, transparency_error
from .theory.gain_limit import gain_limit
from .theory.linear_loop import Compensator, closed_loop_poles
from .theory.margins import Margins, Nyquist, Verdict, coupled_stability, margins, nyquist, small_gain, transparency
from .theory.passivity import clay_passivity, observed_passivity, passivity, port_energy
from .theory.robustness import Box, WorstCase, worst_case

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
