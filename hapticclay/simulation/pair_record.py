"""What a run of a leader and a follower leaves."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import named
from ..results import Result, Tables
from ..scene.link import ENDS
from ..scene.pair import Pair, joint_unit

RELATIVE = 1e-9  # growth of an amplitude that is none
FEWEST = 5  # samples in whose four quarters there is a rate each


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairRecord(Result):
    """What a leader and a follower did, m control samples of n joints.

    Attributes:
        kind: kind of the link.
        names: joints of the leader.
        t: times [s], shape (m,).
        leader: positions of the leader's joints [rad], shape (m, n).
        follower: positions of the follower's joints [rad], shape (m, n).
        leader_torque: torques that its host has held [N.m], shape (m, n).
        follower_torque: likewise, of the follower.
        hand: force of the hand on the leader [N], shape (m, 2) or (m, 3).
        contact: force of the follower on what it touches [N], likewise.
        energy: energy that controllers and link have taken from both arms [J], shape (m,): where
            it falls without bound, they feed the motion.
        port_energy: the same at leader and follower [J], shape (m, 2).
        ended: how the run ended: "" at its time, else what ended it.
        follows: motion of the follower's joints that the link asks for per the leader's, its scale
            of motion and map of axes, shape (n, n).
        pair: what ran, which films show; None in a record that was read from a file.
    """

    drawn_by = "hapticclay.views.pair_run_plots:run_plot"
    written_as = "pair_run"
    printed = {"end": ()}

    kind: str
    names: tuple[str, ...]
    t: np.ndarray
    leader: np.ndarray
    follower: np.ndarray
    leader_torque: np.ndarray
    follower_torque: np.ndarray
    hand: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    port_energy: np.ndarray
    ended: str
    follows: np.ndarray
    pair: Pair | None = None

    @property
    def unit(self) -> str:
        """Unit of the joints' positions, "m" for a device of one axis, which may be rotary."""
        return joint_unit(self.names)

    @property
    def motion(self) -> np.ndarray:
        """Largest motion of a joint of either arm from its pose [rad], shape (m,)."""
        both = np.hstack([self.leader - self.leader[0], self.follower - self.follower[0]])
        return np.abs(both).max(axis=1)

    @property
    def grows(self) -> bool:
        """Whether rates in the last quarter are larger than in the one before, or it ended.

        False for a record of fewer than five samples, which shows no trend.
        """
        if self.ended or len(self.t) < FEWEST:
            return bool(self.ended)
        both = np.diff(np.hstack([self.leader, self.follower]), axis=0)
        third, last = np.array_split(np.abs(both).max(axis=1), 4)[2:]
        return bool(last.max() > (1.0 + RELATIVE) * third.max())

    @property
    def trend(self) -> str:
        """Whether its rates grow or fall at its end, in words."""
        if len(self.t) < FEWEST:
            return "too short for a trend"
        return f"rates {'grow' if self.grows else 'fall'} in its last quarter"

    @property
    def off(self) -> np.ndarray:
        """Motion of the follower less the one that the link asks for [rad], shape (m, n)."""
        asked = (self.leader - self.leader[0]) @ self.follows.T
        return self.follower - self.follower[0] - asked

    @property
    def error(self) -> float:
        """Root mean square of `off`, all joints [rad]."""
        return float(np.sqrt(np.mean(self.off**2)))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the record with exact values, without its pair, whole or not at all.

        Args:
            path: the file, .json.

        Raises:
            ParameterError: the file cannot be written.
        """
        bare = self if self.pair is None else replace(self, pair=None)
        return super(PairRecord, bare).save(path)

    def headline(self) -> str:
        """The run in one line."""
        how = f"ended at {self.t[-1]:.4g} s: {self.ended}" if self.ended else "to its end"
        off = f"follower off by {1e3 * self.error:.3g} m{self.unit} rms"
        return (
            f"{self.kind}, {how}; {self.trend}; {off}; "
            f"controllers and link took {self.energy[-1]:.3g} J, at least {self.energy.min():.3g} J"
        )

    def tables(self) -> Tables:
        """How it ended, and every sample."""
        end: dict[str, Any] = {
            "t [s]": [float(self.t[-1])],
            "grows": [self.grows],
            f"error [{self.unit}]": [self.error],
            "energy [J]": [float(self.energy[-1])],
        }
        samples: dict[str, Any] = {"t [s]": self.t, "energy [J]": self.energy}
        for i, name in enumerate(ENDS):
            samples[f"energy at {name} [J]"] = self.port_energy[:, i]
        samples["hand [N]"] = np.linalg.norm(self.hand, axis=1)
        samples["contact [N]"] = np.linalg.norm(self.contact, axis=1)
        for j, name in enumerate(self.names):
            samples[f"leader {name} [{self.unit}]"] = self.leader[:, j]
            samples[f"follower {name} [{self.unit}]"] = self.follower[:, j]
        return {"end": end, "samples": samples}
