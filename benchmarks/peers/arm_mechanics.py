"""Inertia and Jacobian of arms from files beside Pinocchio, which reads the same MJCF.

    python -m benchmarks.peers.arm_mechanics [FILE ...]

By default the arms of mjcf/arms. Closed chains are closed and projected here, in Pinocchio's terms.
"""

from __future__ import annotations

import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import hapticclay as hc

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
POSES = 20
AROUND = 0.3  # [rad] of the arm's pose
NEWTON = 8  # steps that close a chain
LEFT_OUT = ("keyframe", "equality", "tendon", "actuator")  # of the file that Pinocchio reads


class PinocchioArm:
    """An arm in Pinocchio: the joints of its file, and constraints of closed chains.

    Args:
        file: MJCF file.
        arm: the same in hapticclay, for the names of joints, handle and the pose.
    """

    def __init__(self, file: Path, arm: hc.MjcfArm):
        root = ET.parse(file).getroot()
        self._ties = [x for x in root.iter() if x.tag in ("connect", "fixed")]
        for part in [x for x in root if x.tag in LEFT_OUT]:
            root.remove(part)
        world = root.find("worldbody")
        assert world is not None
        base = ET.Element("body", name="base_of_all")  # Pinocchio reads the first body alone
        base.extend(list(world))
        world[:] = [base]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.xml"
            ET.ElementTree(root).write(path)
            self.model = pin.buildModelFromMJCF(str(path))
        self._data = self.model.createData()
        names = list(self.model.names)[1:]
        self._start = np.array([arm.pose[name] for name in names])
        self._own = [names.index(name) for name in arm.names]
        self._tied = [
            i for name, i in zip(names, range(len(names)), strict=True) if self._moves(name)
        ]
        self._tied = [i for i in self._tied if i not in self._own]
        self._names, self._site = names, arm.site

    def _moves(self, name: str) -> bool:
        """Whether a constraint moves the joint."""
        for tie in self._ties:
            if tie.tag == "fixed":
                if any(x.get("joint") == name for x in tie):
                    return True
            elif any(self._is_before(name, tie.get(end)) for end in ("body1", "body2")):
                return True
        return False

    def _is_before(self, name: str, body: str | None) -> bool:
        frame = self.model.frames[self.model.getFrameId(str(body), pin.FrameType.BODY)]
        joint = frame.parentJoint
        while joint:
            if self.model.names[joint] == name:
                return True
            joint = self.model.parents[joint]
        return False

    def terms(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """M (n, n) and the Jacobian of the handle (3, n) at positions of the arm's joints."""
        whole = self._start.copy()
        whole[self._own] = q
        for _ in range(NEWTON if self._tied else 0):
            gap = self._gap(whole)
            whole[self._tied] -= np.linalg.lstsq(self._rows(whole)[:, self._tied], gap)[0]
        inertia, rows = pin.crba(self.model, self._data, whole), self._rows(whole)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        follow = np.zeros((len(whole), len(self._own)))
        follow[self._own] = np.eye(len(self._own))
        if self._tied:
            follow[self._tied] = -np.linalg.lstsq(
                rows[:, self._tied], rows[:, self._own], rcond=1e-9
            )[0]
        if self._site is None:
            return follow.T @ inertia @ follow, np.zeros((3, len(self._own)))
        jacobian = self._jacobian(self.model.getFrameId(self._site), np.zeros(3))
        return follow.T @ inertia @ follow, jacobian @ follow

    def _gap(self, whole: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self._data, whole)
        out: list[float] = []
        for tie in self._ties:
            if tie.tag == "fixed":
                coef = {x.get("joint"): float(x.get("coef", 1.0)) for x in tie}
                out.append(sum(c * whole[self._names.index(name)] for name, c in coef.items()))
            else:
                first, second = (self._anchor(tie, i) for i in (0, 1))
                out += (first - second).tolist()
        return np.array(out)

    def _anchor(self, tie: Any, i: int) -> np.ndarray:
        """Place of an end of a connection: the same point of both bodies in these files."""
        frame = self._data.oMf[self.model.getFrameId(tie.get(f"body{i + 1}"), pin.FrameType.BODY)]
        return frame.act(np.array([float(x) for x in tie.get("anchor").split()]))

    def _rows(self, whole: np.ndarray) -> np.ndarray:
        """Constraints, per rate of all joints."""
        pin.computeJointJacobians(self.model, self._data, whole)
        pin.updateFramePlacements(self.model, self._data)
        rows = []
        for tie in self._ties:
            if tie.tag == "fixed":
                row = np.zeros(len(whole))
                for x in tie:
                    row[self._names.index(x.get("joint"))] = float(x.get("coef", 1.0))
                rows.append(row[None])
            else:
                anchor = np.array([float(x) for x in tie.get("anchor").split()])
                ends = [
                    self._jacobian(self.model.getFrameId(tie.get(x), pin.FrameType.BODY), anchor)
                    for x in ("body1", "body2")
                ]
                rows.append(ends[0] - ends[1])
        return np.vstack(rows) if rows else np.zeros((0, len(whole)))

    def _jacobian(self, frame: int, point: np.ndarray) -> np.ndarray:
        """Velocity of a point of a frame in the world, per joint rate."""
        J = pin.getFrameJacobian(self.model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
        arm = self._data.oMf[frame].rotation @ point
        return J[:3] - pin.skew(arm) @ J[3:]


def largest_gaps(file: Path) -> tuple[float, float]:
    """Largest difference of M [kg.m^2] and of the Jacobian [m] over poses about the arm's own."""
    arm, random = hc.MjcfArm(file), np.random.default_rng(0)
    theirs, gaps = PinocchioArm(file, arm), []
    for _ in range(POSES):
        q = arm.q + AROUND * random.uniform(-1.0, 1.0, len(arm.names))
        M, J = theirs.terms(q)
        own = arm.jacobian(q) if arm.site else J
        gaps.append((np.abs(arm.mass_matrix(q) - M).max(), np.abs(own - J).max()))
    M_gap, J_gap = np.max(gaps, axis=0).tolist()
    return M_gap, J_gap


def main() -> None:
    """Prints a table."""
    files = [Path(x) for x in sys.argv[1:]] or sorted(CARDS.glob("*.xml"))
    print("| arm | M [kg.m^2] | J [m] |\n|---|---|---|")
    for file in files:
        M, J = largest_gaps(file)
        print(f"| {file.stem} | {M:.1e} | {J:.1e} |")


if __name__ == "__main__":
    main()
