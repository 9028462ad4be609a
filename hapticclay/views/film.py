"""A film of a run: the arm and the clay being cut, the plots running beside them."""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ParameterError, choice, integer, number
from ..simulation.record import Record, atomic
from ..stepping.engine import mujoco
from ..studies.removal import TOOL, Tool
from .stage import CAMERAS, Stage

FPS = {".mp4": 30, ".webp": 20, ".gif": 20}  # frames a second, by kind of file
ASPECT = 1.2  # width over height that the cameras are made for, at least
PLOTS = 0.375  # share of the width that the plots take
TITLE = 240  # width of a picture from which its title is one line [pixels]
SAMPLES, SHADOW = 4, 2048  # a pixel, and the width of the shadow's map [pixels], where edges are softened
ON, OFF = ("enable", "enabled", "on", "true", "1"), ("disable", "disabled", "off", "false", "0")  # MUJOCO_GL
GL = "apt-get install libegl1 libgl1 (or libosmesa6 and MUJOCO_GL=osmesa)"


class Lens:
    """Photographs a stage without a display."""

    def __init__(self, stage: Stage, width: int, height: int, camera: str, smooth: bool = False):
        """Sets up.

        Args:
            stage: to be photographed. width, height: of the picture [pixels]. camera: one of the room's.
            smooth: whether edges and shadows are softened; a picture then takes twice as long.

        Raises:
            ParameterError: there is no OpenGL to do it with.
        """
        self.stage = stage
        model = stage.model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        if smooth:
            model.vis.quality.offsamples, model.vis.quality.shadowsize = SAMPLES, SHADOW
        self._gl, self._context = _opened(model, width, height)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._option, self._perturb = mujoco.MjvOption(), mujoco.MjvPerturb()
        self._option.sitegroup[:] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = which = model.camera(camera).id
        if width < ASPECT * height:  # a narrow picture holds as much from left to right
            half = math.tan(math.radians(0.5 * model.cam_fovy[which])) * ASPECT * height / width
            model.cam_fovy[which] = math.degrees(2.0 * math.atan(half))
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.zeros((height, width, 3), dtype=np.uint8)

    def photograph(self, title: str = "") -> np.ndarray:
        """The stage as it is, shape (height, width, 3) of bytes, under a title; the next call reuses the memory."""
        stage = self.stage
        if stage.relief():
            mujoco.mjr_uploadHField(stage.model, self._context, stage.field)
        mujoco.mjv_updateScene(
            stage.model, stage.data, self._option, self._perturb, self._camera,
            mujoco.mjtCatBit.mjCAT_ALL.value, self._scene,
        )  # fmt: skip
        mujoco.mjr_render(self._rect, self._scene, self._context)
        if title:
            font, corner = mujoco.mjtFont.mjFONT_NORMAL.value, mujoco.mjtGridPos.mjGRID_TOPLEFT.value
            mujoco.mjr_overlay(font, corner, self._rect, title, "", self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rect, self._context)
        return self._pixels[::-1]

    def close(self) -> None:
        """Gives graphics memory and context back."""
        self._context.free()
        self._gl.free()


def _opened(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """An OpenGL context that needs no display (what MUJOCO_GL says, or EGL on Linux), and the renderer's own in it."""
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    linux = sys.platform.startswith("linux")
    if wanted in OFF:
        raise ParameterError("MUJOCO_GL", wanted, "switches rendering off: unset it")
    if linux and wanted not in ("", "egl", "osmesa", "glfw", "glx", *ON):
        raise ParameterError("MUJOCO_GL", wanted, "must be egl or osmesa, or unset")
    try:
        if linux and wanted in ("", "egl"):
            from mujoco.egl import GLContext
        elif wanted == "osmesa":
            from mujoco.osmesa import GLContext
        else:
            GLContext = mujoco.GLContext
        with warnings.catch_warnings():  # GLFW's, where there is no display
            warnings.simplefilter("ignore")
            gl = GLContext(width, height)
            gl.make_current()
        return gl, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
    except Exception as error:  # each backend fails in its own ways: ImportError, AttributeError, GLError, FatalError
        if wanted not in ("", "egl", "osmesa"):
            raise ParameterError("MUJOCO_GL", wanted, "needs a display: unset it, or set egl or osmesa") from None
        lacks = isinstance(error, AttributeError | ImportError)  # PyOpenGL's way to say that it found no library
        why = "no library or driver" if lacks else " ".join(str(error).split()) or type(error).__name__
        raise ParameterError("OpenGL", wanted or "egl", f"cannot be started ({why}): {GL}") from None


def ready(out: Path, speed: float = 1.0, size: tuple[int, int] = (960, 480)) -> tuple[str, float, tuple[int, int]]:
    """Whether a film can be made here, to be asked before a long run.

    Args:
        out: the file. speed, size: as in `frames`.

    Returns:
        (kind of file, speed, size) as they will be used.

    Raises:
        ParameterError: a value is out of its bounds, or OpenGL or a codec is missing; says what to install.
    """
    kind = choice("out", out.suffix.lower(), tuple(FPS))
    speed = number("speed", speed, 1e-3, 1e3, above=True)
    width, height = (integer(f"size[{name}]", n, 160, 4096) for name, n in zip(("w", "h"), size, strict=True))
    _codec(kind)
    gl, context = _opened(mujoco.MjSpec().compile(), 64, 64)
    context.free()
    gl.free()
    return kind, speed, (width - width % 2, height - height % 2)  # as the codec wants


def _codec(kind: str) -> None:
    """Refuses a kind of file that nothing here can write."""
    if kind == ".mp4":
        try:
            import imageio_ffmpeg

            imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise ParameterError(
                "out", kind, "needs a codec: pip install 'imageio[ffmpeg]'; or take .webp, which needs none"
            ) from None
        return
    try:
        from PIL import features

        if kind == ".webp" and not features.check("webp"):
            raise ImportError
    except ImportError:
        raise ParameterError("out", kind, f"needs a codec: pip install --upgrade pillow, with {kind[1:]}") from None


def frames(
    record: Record, camera: str = "room", speed: float = 1.0, size: tuple[int, int] = (960, 480), plots: bool = True,
    tool: Tool = TOOL, fps: int = 30, smooth: bool = False,
) -> Iterator[np.ndarray]:  # fmt: skip
    """The frames of a film, shape (height, width, 3) of bytes each; the next one reuses the memory.

    Args:
        record: of the run. camera: "room", "top" or "close". speed: of the film, 1 for real time.
        size: width and height [pixels]. plots: whether plots run on the right, if there is room: from 320 x 100.
        tool: at the handle. fps: frames a second. smooth: whether edges are softened, at twice the time.

    Raises:
        ParameterError: there is no such camera, or no OpenGL.
    """
    width, height = size
    beside, running = 0, None
    stage = Stage(record.scenario, tool)
    if plots:
        from .running import Running, fits

        share = 2 * round(0.5 * PLOTS * width)
        if fits(share, height):
            beside, running = share, Running(record, share, height)
    lens = Lens(stage, width - beside, height, choice("camera", camera, CAMERAS), smooth)
    image = np.empty((height, width, 3), dtype=np.uint8)
    try:
        done = 0
        for n in shots(record, speed, fps):
            stage.carve(_thinned(record.p[done:n]))
            stage.pose(record.q[n - 1])
            title = f"t = {record.t[n - 1]:.2f} s"
            if stage.field >= 0:
                title += "   " if width - beside >= TITLE else "\n"
                title += f"removed {1e6 * stage.removal.volume:.1f} cm3"
            image[:, : width - beside] = lens.photograph(title)
            if running:
                image[:, width - beside :] = running.upto(n)
            done = n
            yield image
    finally:
        lens.close()


def shots(record: Record, speed: float, fps: int) -> np.ndarray:
    """Number of samples that each frame has seen."""
    end = float(record.t[-1]) if len(record.t) else 0.0
    at = np.append(np.arange(0.0, end, speed / fps), end)
    return np.searchsorted(record.t, at, "right").clip(1)


def _thinned(p: np.ndarray) -> np.ndarray:
    """At most eight of the points between two frames, the last among them."""
    return p[:: -max(1, len(p) // 8)][::-1]


def film(
    record: Record, out: Path, camera: str = "room", speed: float = 1.0, size: tuple[int, int] = (960, 480),
    plots: bool = True, tool: Tool = TOOL, progress: Callable[[Iterator[np.ndarray], int], Iterator] | None = None,
    smooth: bool = False,
) -> Path:  # fmt: skip
    """Writes a film of a run: .mp4, .webp or .gif.

    Args:
        out: the file; other arguments as in `frames`. progress: wraps the iterator over so many frames.

    Raises:
        ParameterError: a value is out of its bounds, the file cannot be written, or OpenGL or a codec is missing.
    """
    kind, speed, size = ready(out, speed, size)
    if not len(record.t):
        raise ParameterError("record", record.scenario.name, "must hold samples")
    fps = FPS[kind]
    images: Any = frames(record, camera, speed, size, plots, tool, fps, smooth)
    if progress:
        images = progress(images, len(shots(record, speed, fps)))
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(images):
        temporary = Path(folder) / f"film{kind}"
        _write(temporary, images, kind, fps)
        with atomic(out) as f, open(temporary, "rb") as made:
            shutil.copyfileobj(made, f)
    return out


def _write(path: Path, images: Iterator[np.ndarray], kind: str, fps: int) -> None:
    import imageio.v2 as imageio

    if kind != ".mp4":
        imageio.mimwrite(path, [x.copy() for x in images], duration=1000 // fps, loop=0)
        return
    writer = imageio.get_writer(path, format="FFMPEG", fps=fps, codec="libx264", macro_block_size=2, quality=7)  # type: ignore[arg-type]
    with writer:
        for image in images:
            writer.append_data(image)
