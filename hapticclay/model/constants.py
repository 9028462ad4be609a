"""Every printed number once, with its equation; SI units, axes ordered (x, y).

Source: M.-G. Her, K.-S. Hsu, T.-S. Lan, M. Karkoub, "Haptic Direct-Drive Robot Control Scheme in
Virtual Reality", Journal of Intelligent and Robotic Systems 35 (2002) 247-264.
"""

from __future__ import annotations

from typing import Annotated

from ..arguments import part
from ..errors import Bound, Real
from ..fields import AXES as AXES


@part("servo.")
class SecondOrder:
    """The transfer function gain / (s^2 + damping s + stiffness), stable.

    Attributes:
        gain: its numerator, > 0, at most 1e12: for G in 1/s^2, for Sh in 1/kg.
        damping: coefficient of s [1/s], > 0, at most 1e6.
        stiffness: constant coefficient [1/s^2], > 0, at most 1e12.
    """

    gain: Annotated[float, Bound(0.0, 1e12, above=True)]
    damping: Annotated[Real, Bound(0.0, 1e6, "1/s", above=True)]
    stiffness: Annotated[Real, Bound(0.0, 1e12, "1/s^2", above=True)]


CM = 1e-2  # the paper prints lengths in centimetres

L1 = 0.24  # link lengths [m], Sec. 4
L2 = 0.35
TS = 0.36e-3  # sampling period [s], Sec. 4

G = (SecondOrder(910.19, 41.8, 910.19), SecondOrder(765.5, 30.3, 765.5))  # [m/m], Eqs. 15, 16
S = (
    SecondOrder(79.19 * CM, 41.1, 432.0),
    SecondOrder(13.1 * CM, 32.4, 492.46),
)  # [m/N], Eqs. 17, 18

C_POLE = 10.0  # C = K/(s^2 + 10 s) [m/N], Eqs. 20, 22, 27: virtual mass 1/K, damper 10/K
C_NUM, C_DEN = (1.0,), (1.0, C_POLE, 0.0)  # C/K, in descending powers of s
B_CONSTANT = 90.0  # clay of the constant cut [N.s/m], Eq. 21
CLAY_X = (0.05, 0.15)  # the clay lies 5 cm ahead of the tool and is 10 cm long [m], Sec. 4.1
PATH_LENGTH = 0.20  # the records of Fig. 8 run to 20 cm [m]
B_VARIABLE = (50.0, 100.0)  # clay before and after the border [N.s/m], Eqs. 23-26
BORDER = 0.05  # that border, on each axis by its own coordinate [m], Sec. 4.2
GROWTH = 30.0  # "(100 + 30t)" in x: we take t in s since entry [N.s/m per s], Sec. 4.2
GROWTH_EQ25 = 0.15  # "(100 + 0.15t)", t not defined: per second or per sample, Eq. 25
COUNTERWEIGHT = (1.0, 45.0)  # force of the variable cut [N], its angle to both axes [deg], Sec. 4.2
GAINS_FIG11 = (2.0, 3.0, 25.0)  # K of Fig. 11: 2 in its caption, 3 in the text, 25 in both
B_STABILITY = 100.0  # clay of the stability test [N.s/m], Eq. 28
GAIN_LIMIT_PRINTED = 5.0  # "should not exceed 5C", Sec. 4.3

# Not printed. The middle of the 20 cm path is put at the nominal pose (elbow square, handle at
# (L2, L1)): 20 cm of +x travel from the nominal pose itself would leave the reach of 0.59 m.
ORIGIN = (0.25, 0.24)  # (L2 - PATH_LENGTH / 2, L1)
NOMINAL = (L2, L1)  # handle at the nominal pose: link 1 along y, link 2 along x
# The variable cut begins in the corner of a 10 cm square around NOMINAL.
ORIGIN_VARIABLE = (0.30, 0.19)
GAIN = (1.0, 0.5)  # K = 1 on y is unstable in the printed model for 62 < b < 3900 N.s/m
TORQUE_LIMIT = (40.0, 40.0)  # [N.m], ours: direct-drive motors for such inertias


def each_axis(part):
    """A part that both axes share, or a pair of parts, as a pair (x, y)."""
    return part if isinstance(part, tuple) else (part, part)
