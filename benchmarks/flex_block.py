"""A picture of clay as finite elements: the tool dents an elasto-plastic block, MuJoCo's flex.

    python -m benchmarks.flex_block                     its cost beside that of the arm alone
    python -m benchmarks.flex_block --film dent.webp    the film

The arm follows a path and does not feel the block: nothing here is a haptic loop.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hapticclay.formulas.arm import inverse_kinematics
from hapticclay.kernel.engine import build, mujoco, warnings_caught
from hapticclay.model.arm import PAPER
from hapticclay.scene.scenario import Scenario
from hapticclay.views import film
from hapticclay.views.stage import THICKNESS, picture_spec

FILE = "flex_block.xml"
TOOL = 0.040  # [m] width, that of the capsule in FILE
SURFACE = 0.230  # y of the block's face [m]
PATH = np.array([  # t [s], x and y of the tool's axis [m]: 20 mm into the block, and away
    (0.0, 0.320, SURFACE - 0.035), (1.0, 0.320, SURFACE), (1.2, 0.320, SURFACE),
    (1.7, 0.320, SURFACE - 0.045), (2.4, 0.220, SURFACE - 0.080), (3.2, 0.220, SURFACE - 0.080),
])  # fmt: skip
RATE = 25  # frames a second


class Scene:
    """The arm, the room and the block; what `film.Lens` draws.

    Attributes:
        model: of all three.
        data: of all three.
        field: no heightfield.
    """

    field = -1

    def __init__(self, yields: bool = True):
        """Compiles the model, and puts the tool at the start of its path.

        Args:
            yields: whether the block stays deformed; else it is elastic.
        """
        depth = THICKNESS - 0.002  # of the tool's tip, just above the table
        with warnings_caught() as caught:
            spec = picture_spec(PAPER, None, (TOOL, depth), (FILE,))
            spec.option.disableflags = 0  # arm.xml steps without contacts and constraints
            if not yields:
                spec.flexes[0].stressyield[:] = 0.0
            self.model = spec.compile()
        assert not caught, caught
        self.data = mujoco.MjData(self.model)
        self._punch = self.model.body("punch").mocapid[0]
        self._target = self.model.body("target").mocapid[0]
        self.data.mocap_pos[self._target] = (0.0, 0.0, -5.0)
        self.pose()
        mujoco.mj_forward(self.model, self.data)
        self._face = self.data.flexvert_xpos[:, 1] < SURFACE + 1e-6

    def pose(self) -> None:
        """Puts tool and arm where the path leads at this time."""
        t, x, y = PATH.T
        at = float(np.interp(self.data.time, t, x)), float(np.interp(self.data.time, t, y))
        self.data.mocap_pos[self._punch] = (*at, 0.0)
        self.data.qpos[:2], self.data.qvel[:2] = inverse_kinematics(*at, PAPER.links), 0.0

    def step(self) -> None:
        """Makes one step."""
        self.pose()
        mujoco.mj_step(self.model, self.data)

    def dent(self) -> float:
        """How far the block's face lies behind where it was, at most [m]."""
        return float(self.data.flexvert_xpos[self._face, 1].max() - SURFACE)

    def relief(self) -> bool:
        """No heightfield to upload."""
        return False

    def draw_arrow(self, scene: Any) -> None:
        """No arrow.

        Args:
            scene: of the renderer.
        """


def frames(size: tuple[int, int], camera: str) -> Iterator[np.ndarray]:
    """Yields the frames of the film.

    Args:
        size: width and height [pixels].
        camera: of the room.
    """
    scene: Any = Scene()
    lens = film.Lens(scene, *size, camera, smooth=True)
    try:
        for n in range(int(PATH[-1, 0] * RATE)):
            while scene.data.time < n / RATE:
                scene.step()
            yield lens.photograph(f"t = {scene.data.time:.2f} s")
    finally:
        lens.close()


def cost() -> dict[str, float]:
    """Time of a step of the block while it is dented, and of the arm alone [us]; ratio; dents."""
    scene = Scene()
    while scene.data.time < 0.5:
        scene.step()
    each = []
    while scene.data.time < 1.5:
        begin = time.perf_counter()
        scene.step()
        each.append(time.perf_counter() - begin)
    while scene.data.time < PATH[-1, 0]:
        scene.step()
    arm = build(Scenario())
    data = mujoco.MjData(arm)
    alone = []
    for _ in range(20):
        begin = time.perf_counter()
        mujoco.mj_step(arm, data, nstep=1000)
        alone.append((time.perf_counter() - begin) / 1000)
    block, bare = 1e6 * float(np.median(each)), 1e6 * min(alone)
    return {
        "degrees of freedom": scene.model.nv,
        "step of block and arm [us]": block,
        "step of the arm alone [us]": bare,
        "ratio": block / bare,
        "simulated over real time": 1e6 * scene.model.opt.timestep / block,
        "dent that is left [mm]": 1e3 * scene.dent(),
    }


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--film", type=Path, help="write a film: .mp4, .webp or .gif")
    parser.add_argument("--camera", default="close")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480))
    args = parser.parse_args()
    if args.film:
        film.ready(args.film)
        film.write_images(args.film, frames(tuple(args.size), args.camera), RATE)
        print(f"written to {args.film}")
        return
    for name, value in cost().items():
        print(f"{name:32} {value:8.4g}")


if __name__ == "__main__":
    main()
