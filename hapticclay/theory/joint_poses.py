"""Limits of an arm's joints over its workspace: a sample of poses, and the worst of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD
from ..arms.mjcf_arm import MjcfArm
from ..errors import Bound, ParameterError
from ..results import Result, Tables
from .client_loop import Delay, Sample
from .joint_gains import Study, first_joint
from .joint_loop import is_stable, timing_words

TRIES = 100  # poses drawn for each one wanted, where a chain cannot be closed at most


@named
@dataclass(frozen=True, repr=False, eq=False)
class OverPoses(Result):
    """What the joints of an arm carry over its workspace, m poses of n joints.

    Attributes:
        names: joints, shape (n,).
        q: poses [rad or m], shape (m, n), as `over_poses` draws them.
        p: positions of the handle [m], shape (m, 3); NaN without handle.
        radius: largest eigenvalue at each pose, shape (m,).
        scale: largest factor of all Kp at each pose, shape (m,); NaN where none is stable.
        buzz: frequency at that factor [Hz], shape (m,).
        first: number of the joint that buzzes first at each pose, shape (m,).
        units: of the positions of the joints, rad or m, shape (n,).
        Ts: control sample [s].
        delay: from a sample to its torque [s].
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
    """

    drawn_by = "hapticclay.views.joint_plots:poses_plot"
    written_as = "poses"

    names: tuple[str, ...]
    q: np.ndarray
    p: np.ndarray
    radius: np.ndarray
    scale: np.ndarray
    buzz: np.ndarray
    first: np.ndarray
    units: tuple[str, ...]
    Ts: float
    delay: float
    assumed: tuple[str, ...] = ()

    @property
    def worst(self) -> int:
        """Number of the pose with the least factor; with the largest radius if one is unstable."""
        unstable = ~is_stable(self.radius)
        return int(self.radius.argmax() if unstable.any() else np.nanargmin(self.scale))

    @property
    def worst_pose(self) -> dict[str, float]:
        """Joint positions of that pose by name [rad or m]."""
        return dict(zip(self.names, self.q[self.worst].tolist(), strict=True))

    @property
    def shares(self) -> dict[str, float]:
        """Share of the poses at which each joint buzzes first."""
        return {name: float(np.mean(self.first == j)) for j, name in enumerate(self.names)}

    def headline(self) -> str:
        """The verdict in one line."""
        at = f"{len(self.q)} poses at {timing_words(self.Ts, self.delay)}"
        unstable = int(np.sum(~is_stable(self.radius)))
        if unstable:
            return f"{at}: unstable at {unstable}; worst radius {self.radius.max():.4g}"
        name, share = max(self.shares.items(), key=lambda x: x[1])
        low, high = np.nanmin(self.scale), np.nanmax(self.scale)
        return f"{at}: all Kp up to {low:.4g} to {high:.4g} times; {name} first at {share:.0%}"

    def remarks(self) -> Sequence[str]:
        """The verdict, the worst pose, and what it rests on."""
        pose = " ".join(f"{name}={q:.4g}" for name, q in self.worst_pose.items())
        return [self.headline(), f"worst pose: {pose}", *self.assumed]

    def tables(self) -> Tables:
        """Every pose, and how often each joint buzzes first."""
        joints = zip(self.names, self.units, self.q.T, strict=True)
        poses: dict[str, Any] = {f"{name} [{unit}]": q for name, unit, q in joints}
        poses |= {f"{axis} [m]": self.p[:, i] for i, axis in enumerate("xyz")}
        poses |= {
            "radius": self.radius,
            "largest factor of all Kp": self.scale,
            "buzz [Hz]": self.buzz,
            "first": [self.names[j] for j in self.first],
        }
        shares = {"joint": self.names, "first at [share]": list(self.shares.values())}
        return {"joints": shares, "poses": poses}


@checked
def over_poses(
    arm: MjcfArm,
    law: JointPD,
    Ts: Sample,
    delay: Delay = 0.0,
    poses: Annotated[int, Bound(1, 100_000)] = 300,
    seed: Annotated[int, Bound(0, 2**63 - 1)] = 0,
) -> OverPoses:
    """The largest factor of all Kp over poses drawn evenly within the ranges of the joints.

    Args:
        arm: the arm; hinges without a range turn once around, slides without one stay where they
            are in its pose.
        law: gains of the joints, and where they act.
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the torque computed from it [s], 0 to 10.
        poses: number of poses.
        seed: seed of their draw.

    Raises:
        ParameterError: as `joint_limits`, or no drawn pose closes the arm's chain.
    """
    random, turning = np.random.default_rng(seed), np.array(arm.mechanism.turning)
    unlimited = np.where(turning, [[-math.pi], [math.pi]], arm.q).T
    bounds = np.where(np.isfinite(arm.ranges), arm.ranges, unlimited)
    rows, assumed = [], ()
    for _ in range(TRIES * poses):
        q = random.uniform(*bounds.T)
        try:
            study = Study(arm, law, Ts, delay, q)
        except ParameterError as error:
            if error.field != "pose":
                raise
            continue
        assumed = tuple(x for x in study.assumed() if not x.startswith("pose:"))
        rows.append((q, _handle(arm, q), *_at_pose(study)))
        if len(rows) == poses:
            break
    if not rows:
        raise ParameterError("poses", poses, "must be some at which the arm's chain can be closed")
    q, p, radius, scale, buzz, first = (np.array(column) for column in zip(*rows, strict=True))
    units = tuple(np.where(turning, "rad", "m").tolist())
    return OverPoses(arm.names, q, p, radius, scale, buzz, first, units, Ts, delay, assumed)


def _handle(arm: MjcfArm, q: np.ndarray) -> np.ndarray:
    return arm.handle(q) if arm.site is not None else np.full(3, math.nan)


def _at_pose(study: Study) -> tuple[float, float, float, int]:
    """Radius, largest factor of all Kp, frequency there, and the joint that buzzes first."""
    family = study.family("Kp")
    limit = family.limit()
    buzz = limit.frequency(study.Ts)
    return study.loop.radius(), limit.high, buzz, first_joint(family, limit)
