"""Independent solutions. Nothing here is taken from hapticclay but the printed numbers' meaning."""

from .arm import G0, G1, I1, I2, L1, L2, ORIGIN, S0, S1, SG, Arm
from .hybrid import hybrid
from .linear import Linear, axis_rates, bounces, piecewise_linear
from .nonlinear import Pieces, Solved, nonlinear, nonlinear_pieces

__all__ = [
    "G0",
    "G1",
    "I1",
    "I2",
    "L1",
    "L2",
    "ORIGIN",
    "S0",
    "S1",
    "SG",
    "Arm",
    "Linear",
    "Pieces",
    "Solved",
    "axis_rates",
    "bounces",
    "hybrid",
    "nonlinear",
    "nonlinear_pieces",
    "piecewise_linear",
]
