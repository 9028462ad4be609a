"""What a hand feels through a pair, and whether it is absolutely stable by Llewellyn's criterion.

A pair is a two-port: forces on the handles of leader and follower, and their rates. Its admittance
Y at a frequency, of sines between samples, gives all: impedance felt in free motion, against a wall
that does not move, and in what the follower touches; tracking of motion and force; Llewellyn's
criterion. Sidebands beyond the Nyquist frequency are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, named
from ..arms.mechanism import STILL
from ..errors import Bound, ParameterError, Real
from ..results import Result, Tables
from ..scene import pair as pairs
from ..scene.link import ENDS
from ..scene.pair import Pair
from .pair_build import Build

LOWEST = 0.05  # [Hz] of the curves
HIGHEST = 0.9  # of the Nyquist frequency
POINTS = 400
AT = 1.0  # [Hz] at which mass, damping and stiffness are stated
THREE_DB = 10.0**0.15  # factor of an amplitude
STIFF = 1e12  # of a wall: no admittance


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairTransparency(Result):
    """What goes through a pair along one axis, m frequencies.

    Attributes:
        kind: kind of the link.
        axis: axis of the world.
        frequency: frequencies [Hz], shape (m,).
        free: impedance felt with the follower in free motion [N.s/m], shape (m,).
        rigid: impedance felt with the follower against a wall that does not move [N.s/m].
        felt: impedance felt with the follower in its contact [N.s/m].
        contact: impedance of that contact [N.s/m].
        motion: motion of the follower over that of the leader, in free motion.
        force: force of the follower on a rigid wall over that of the hand.
        criterion: Llewellyn's 2 Re y11 Re y22/|y12 y21| - cos arg(y12 y21); below 1 at a frequency,
            a passive hand and object are unstable there.
        absolutely_stable: whether it is 1 or more at the frequencies, Re y11 and Re y22 are not
            negative, and the free pair is stable: then passive hands and objects leave the pair
            stable, but for those that resonate near the Nyquist frequency.
        worst: frequency of the least criterion [Hz].
        mass: mass felt in free motion at 1 Hz [kg].
        damping: damping felt there [N.s/m].
        stiffness: size of force over position against the rigid wall at the lowest frequency [N/m].
            With forces sent both ways unscaled it grows as that falls: nothing but delay yields.
        motion_bandwidth: frequency at which the follower's motion is 3 dB off [Hz]; NaN for none.
        force_bandwidth: the same of its force on the wall [Hz]; NaN for none.
        assumed: what the numbers rest on, a sentence each.
    """

    drawn_by = "hapticclay.views.pair_plots:transparency_plot"
    written_as = "transparency"
    printed = {"numbers": ()}

    kind: str
    axis: str
    frequency: np.ndarray
    free: np.ndarray
    rigid: np.ndarray
    felt: np.ndarray
    contact: np.ndarray
    motion: np.ndarray
    force: np.ndarray
    criterion: np.ndarray
    absolutely_stable: bool
    worst: float
    mass: float
    damping: float
    stiffness: float
    motion_bandwidth: float
    force_bandwidth: float
    assumed: tuple[str, ...] = ()

    def headline(self) -> str:
        """What the hand feels in one line."""
        least = float(self.criterion.min())
        verdict = (
            "absolutely stable by Llewellyn's criterion"
            if self.absolutely_stable
            else f"not absolutely stable (Llewellyn's {least:.3g} at {self.worst:.3g} Hz)"
        )
        return (
            f"{self.kind} along {self.axis}: {self.mass:.3g} kg and {self.damping:.3g} N.s/m in "
            f"free motion, walls up to {self.stiffness:.4g} N/m at {self.frequency[0]:.3g} Hz; "
            f"{verdict}"
        )

    def remarks(self) -> Sequence[str]:
        """What the numbers rest on."""
        return [self.headline(), *self.assumed]

    def tables(self) -> Tables:
        """Numbers of the pair, and its curves."""
        numbers: dict[str, Any] = {
            "felt mass [kg]": [self.mass],
            "felt damping [N.s/m]": [self.damping],
            "stiffest wall felt [N/m]": [self.stiffness],
            "motion bandwidth [Hz]": [self.motion_bandwidth],
            "force bandwidth [Hz]": [self.force_bandwidth],
            "least criterion": [float(self.criterion.min())],
        }
        curves: dict[str, Any] = {"frequency [Hz]": self.frequency}
        for name in ("free", "rigid", "felt", "contact"):
            curves[f"{name} [N.s/m]"] = np.abs(getattr(self, name))
        curves |= {
            "motion": np.abs(self.motion),
            "force": np.abs(self.force),
            "criterion": self.criterion,
        }
        return {"numbers": numbers, "curves": curves}


@checked
def pair_transparency(
    pair: Pair,
    axis: Literal["x", "y", "z"] = "x",
    frequency: Annotated[tuple[Real, ...] | None, Bound(0.0, 1e6, "Hz", above=True)] = None,
) -> PairTransparency:
    """Impedance felt through a pair, its tracking, and Llewellyn's criterion, along one axis.

    The hand of the pair takes no part; its contact does in what is felt in it.

    Args:
        pair: two arms, their laws and the link between them.
        axis: axis of the world along which hand and follower move.
        frequency: frequencies [Hz], below the Nyquist frequency; None for 0.05 Hz to 0.9 of it.

    Raises:
        ParameterError: an arm has no handle, or none that moves along the axis, or a frequency is
            not below the Nyquist frequency.
    """
    build = Build(replace(pair, leader_operator=None, follower_clay=None))
    along = _along(pair, axis)
    top = 0.5 / pair.Ts
    f = np.geomspace(LOWEST, HIGHEST * top, POINTS) if frequency is None else np.sort(frequency)
    if not len(f) or not f.max() < top:
        bound = f"must be one or more frequencies below {top:g} Hz"
        raise ParameterError("frequency", f.tolist(), bound)
    loop = build.loop()
    omega = 2.0 * math.pi * f
    Y, at = loop.admittance(omega, along), loop.admittance(np.array([2.0 * math.pi * AT]), along)
    contact = _contact(pair, omega, axis)
    free, rigid = 1.0 / Y[:, 0, 0], _felt(Y, np.full(len(f), STIFF))
    motion, force = Y[:, 1, 0] / Y[:, 0, 0], Y[:, 1, 0] / Y[:, 1, 1]
    criterion = llewellyn(Y)
    passive = bool(np.all(Y[:, [0, 1], [0, 1]].real >= 0.0) and criterion.min() >= 1.0)
    felt = complex(1.0 / at[0, 0, 0])
    return PairTransparency(
        pair.link.kind,
        axis,
        f,
        free,
        rigid,
        _felt(Y, contact),
        contact,
        motion,
        force,
        criterion,
        passive and loop.stable(),
        float(f[criterion.argmin()]),
        felt.imag / (2.0 * math.pi * AT),
        felt.real,
        float(abs(omega[0] * rigid[0])),
        _bandwidth(f, motion),
        _bandwidth(f, force),
        (*build.assumed(), *_limits(axis, f, top)),
    )


def _limits(axis: str, f: np.ndarray, top: float) -> tuple[str, str]:
    """What the criterion does not say."""
    return (
        f"hand and object along {axis} alone, at {len(f)} frequencies from {f.min():.3g} to "
        f"{f.max():.3g} Hz",
        f"sidebands beyond the Nyquist frequency of {top:.4g} Hz: left out; what resonates near it "
        "may be unstable beside Llewellyn's criterion",
    )


def llewellyn(Y: np.ndarray) -> np.ndarray:
    """2 Re y11 Re y22/|y12 y21| - cos arg(y12 y21) of admittances of shape (m, 2, 2).

    Llewellyn, Some Fundamental Properties of Transmission Systems, Proc. IRE 40(3), 1952.
    """
    through = Y[:, 0, 1] * Y[:, 1, 0]
    size = np.maximum(np.abs(through), 1e-300)
    return (2.0 * Y[:, 0, 0].real * Y[:, 1, 1].real - through.real) / size


def _felt(Y: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """Impedance at the leader with one at the follower."""
    other = Y[:, 0, 1] * Y[:, 1, 0] * contact / (1.0 + Y[:, 1, 1] * contact)
    return 1.0 / (Y[:, 0, 0] - other)


def _along(pair: Pair, axis: str) -> tuple[np.ndarray, np.ndarray]:
    """Joint torques per force on each handle along an axis."""
    out = []
    for name, arm in zip(ENDS, pair.arms, strict=True):
        if not pairs.has_handle(arm):
            arm.check_handle()
        row = pairs.linear_arm(arm).jacobian["xyz".index(axis)]
        if not np.abs(row).max() > STILL:
            bound = f"must be one along which the handle of the {name} can move"
            raise ParameterError("axis", axis, bound)
        out.append(row)
    return out[0], out[1]


def _contact(pair: Pair, omega: np.ndarray, axis: str) -> np.ndarray:
    """Impedance of what the follower touches, along an axis."""
    s, i = 1j * omega, "xyz".index(axis)
    mass, damping, stiffness = (x[i, i] for x in pairs.touched_load(pair, 1))
    return mass * s + damping + stiffness / s


def _bandwidth(f: np.ndarray, ratio: np.ndarray) -> float:
    """First frequency at which a ratio is 3 dB off its value at the lowest one; NaN for none."""
    size = np.abs(ratio) / max(abs(ratio[0]), 1e-300)
    off = np.flatnonzero((size > THREE_DB) | (size < 1.0 / THREE_DB))
    return float(f[off[0]]) if len(off) else math.nan
