"""Films of a leader and a follower: both as stick figures side by side, with their forces."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..errors import ParameterError
from ..kernel.engine import mujoco
from ..scene.link import ENDS
from ..scene.pair import Pair
from ..scene.virtual_wall import Device
from ..simulation.pair_record import PairRecord
from .arm_sticks import COLORS, in_space, sticks_of
from .palette import CLAY_DEEP
from .sticks import SHAFT, VIEWS, arrow, box, capsule, draw_sticks, fit, look, room, sphere
from .touched import AROUND, CLEAR, body_of

POSES = 40  # of a run, from which the cameras see all
GAP = 0.3  # between both arms, as a share of their size
LONGEST = 0.35  # arrow, of the size
LEAST = 0.02  # of the longest arrow: shorter ones are not drawn
SWUNG = 0.25  # [rad] to which the largest motion of a joint is magnified
SHARE = 0.25  # of the rail of a slide that its motion takes
ABOVE = np.array([0.0, 0.0, 0.07])  # of a slide's handle, where its arrow is, of the size
ABOUT = 0.12  # space around both arms, of the size
WATCHED = 8.0  # [s] that a film takes at least


def look_of(record: PairRecord) -> dict[str, Any]:
    """Speed and magnification of a film in which the motion can be seen."""
    moved = float(record.motion.max(initial=0.0))
    slides = record.pair is not None and isinstance(record.pair.leader, Device)
    magnify = 1.0 if slides else min(max(SWUNG / max(moved, 1e-9), 1.0), 1e9)
    end = float(record.t[-1])
    return {"speed": min(max(end / WATCHED, 2e-3), 1.0), "magnify": magnify}


class PairReel:
    """What a film shows of a pair, sample by sample."""

    def __init__(self, record: PairRecord, camera: str, magnify: float = 1.0):
        if record.pair is None:
            bound = "must have its pair: a record that was read from a file has none"
            raise ParameterError("record.pair", None, bound)
        self._record, self._ends = record, (record.leader, record.follower)
        arms = record.pair.arms
        forces = in_space(arms[0], record.hand), in_space(arms[1], record.contact)
        self._forces = np.stack(forces)
        self.stage = PairStage(record.pair, self._ends, self._forces, camera, magnify)

    def show(self, n: int) -> list[str]:
        """Poses the scene after the first n samples, and names the force of each arrow."""
        self.stage.pose([q[n - 1] for q in self._ends], self._forces[:, n - 1])
        record, (hand, contact) = self._record, np.linalg.norm(self._forces[:, n - 1], axis=1)
        words = [f"hand {hand:.2f} N"]
        if record.pair is not None and record.pair.follower_clay is not None:
            words.append(f"contact {contact:.2f} N")
        return [*words, record.ended] if n == len(record.t) and record.ended else words


class PairStage:
    """The scene of a pair: `model` and `data` for a renderer; see `stage.Stage`.

    Motion of each joint from its first position is shown `magnify` times.
    """

    field = -1  # without clay that is cut

    def __init__(self, pair: Pair, ends: Any, forces: np.ndarray, camera: str, magnify: float):
        self._pair, self._magnify = pair, magnify
        self._start = [np.array(q[0]) for q in ends]
        moved = max(float(np.abs(q - q[0]).max()) for q in ends)
        self._span = max(moved, 1e-6) / SHARE  # of a rail
        self._shift = np.zeros((2, 3))
        chosen = np.unique(np.linspace(0, len(ends[0]) - 1, POSES).astype(int))
        figures = [[self._sticks(i, q[k]) for k in chosen] for i, q in enumerate(ends)]
        places = [np.concatenate([x.segments.reshape(-1, 3) for x in end]) for end in figures]
        self._size = max(float(np.ptp(x, axis=0).max()) for x in places)
        self._shift[1] = self._beside(places, camera)
        self._starts = [self._sticks(i, q).handle for i, q in enumerate(self._start)]
        self._most = float(np.linalg.norm(forces, axis=-1).max(initial=0.0)) or 1.0
        handles = np.array([x.handle for x in figures[1]]) + self._shift[1]
        seen = self._seen(np.concatenate([places[0], places[1] + self._shift[1]]))
        self.model = room(seen, handles)
        if camera != "close":
            fit(self.model, camera, seen)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.pose([q[0] for q in ends], forces[:, 0])

    @property
    def _slides(self) -> bool:
        return isinstance(self._pair.leader, Device)

    def _beside(self, places: Any, camera: str) -> np.ndarray:
        """Where the follower stands: to the right in the picture; a rail, below the leader's."""
        if self._slides:
            return np.array([0.0, -GAP * self._size, 0.0])
        back, _ = look(*VIEWS[camera][:2])
        right = np.array([-back[1], back[0], 0.0]) / np.hypot(*back[:2])
        wide = (places[0] @ right).max() - (places[1] @ right).min()
        return (wide + GAP * self._size) * right

    def _seen(self, places: np.ndarray) -> np.ndarray:
        """Places that cameras see: both arms, and what is written and drawn about them."""
        about = ABOUT * self._size * np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, 0.0]])
        return (places[:, None] + about).reshape(-1, 3)

    def _sticks(self, i: int, q: Any) -> Sticks:
        place = self._start[i] + self._magnify * (np.asarray(q) - self._start[i])
        try:
            return sticks_of(self._pair.arms[i], place, self._span, self._shift[i])
        except ParameterError:
            bound = "must be smaller: its chains cannot be closed in the motion so magnified"
            raise ParameterError("magnify", self._magnify, bound) from None

    def pose(self, q: Any, forces: Any) -> None:
        """Poses both arms under their forces [N]."""
        self._shown = [self._sticks(i, x) for i, x in enumerate(q)]
        self._pressed = np.asarray(forces)

    def relief(self) -> bool:
        """No heightfield is to be uploaded."""
        return False

    def draw_arrow(self, scene: mujoco.MjvScene) -> None:
        """Adds both arms, what the follower touches, and forces to what a renderer draws."""
        size = self._size
        self._draw_touched(scene)
        for i, shown in enumerate(self._shown):
            draw_sticks(scene, shown, size, COLORS[i], COLORS[i])
            self._draw_name(scene, i)
            length = LONGEST * size / self._most * self._pressed[i]
            if np.linalg.norm(length) > LEAST * LONGEST * size:
                begin = shown.handle + (ABOVE * size if self._slides else 0.0)
                arrow(scene, begin, begin + length, SHAFT * size, COLORS[i])

    def _draw_name(self, scene: mujoco.MjvScene, i: int) -> None:
        """Writes which arm it is, at its foot."""
        geom = sphere(scene, self._shown[i].joints[0], 1e-4 * self._size, COLORS[i], 0.0)
        if geom is not None:
            geom.label = ENDS[i]

    def _draw_touched(self, scene: mujoco.MjvScene) -> None:
        """Walls and clay, objects that move with a handle, and their springs."""
        size = self._size
        for i, start in enumerate(self._starts):
            body = body_of(self._pair, i, start, size, self._magnify)
            if body is None:
                continue
            now = self._shown[i].handle
            if body.half is None:
                sphere(scene, body.place, AROUND * size, CLAY_DEEP, CLEAR)
            else:
                box(scene, now if body.moves else body.place, body.half, CLAY_DEEP, CLEAR)
            if body.spring:
                capsule(scene, start, now, 0.3 * SHAFT * size, CLAY_DEEP)
