"""Films of a run: the arm cuts the clay, and plots grow beside the picture."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ParameterError, choice, integer, number
from ..files import atomic
from ..kernel.engine import mujoco
from ..live.status import held_words
from ..model.constants import AXES
from ..simulation.pair_record import PairRecord
from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from .stage import CAMERAS, Stage
from .stick_stage import StickStage
from .sticks import LEAST_ASPECT

FRAME_RATES = {".mp4": 30, ".webp": 20, ".gif": 20}  # [1/s], by kind of file
PLOTS_SHARE = 0.375  # of the width
FONT_WIDTH = 175  # [pixels] of a picture by which its title grows by half of its usual size
SLOW = 0.2  # speed below which a title has four digits of the time
ONE_LINE_WIDTH = 240  # [pixels] of a picture from which its title is one line
SOFT_SAMPLES, SOFT_SHADOW = 4, 2048  # a pixel; width of the shadow map [pixels]
GL_ON = ("enable", "enabled", "on", "true", "1")  # values of MUJOCO_GL
GL_OFF = ("disable", "disabled", "off", "false", "0")
GL_PACKAGES = "apt-get install libegl1 libgl1 (or libosmesa6 and MUJOCO_GL=osmesa)"


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Attributes:
        camera: "room", "top" or "close".
        speed: of the film; 1 is real time.
        size: width and height [pixels].
        plots: whether plots grow on the right, if there is room: from 320 x 100.
        smooth: whether edges and shadows are softened, which doubles the time.
        tool: at the handle.
        magnify: times that the motion of an arm from a file about its median pose is shown.
    """

    camera: str = "room"
    speed: float = 1.0
    size: tuple[int, int] = (960, 480)
    plots: bool = True
    smooth: bool = False
    tool: Tool = TOOL
    magnify: float = 1.0


FILM_OPTIONS = FilmOptions()


class Lens:
    """Renders a stage without a display."""

    def __init__(
        self, stage: Stage | StickStage, width: int, height: int, camera: str, smooth: bool = False
    ):
        """Opens an OpenGL context."""
        self.stage = stage
        model = stage.model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        if smooth:
            model.vis.quality.offsamples, model.vis.quality.shadowsize = SOFT_SAMPLES, SOFT_SHADOW
        self._gl, self._context = _opened(model, width, height)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._option, self._perturb = mujoco.MjvOption(), mujoco.MjvPerturb()
        self._option.sitegroup[:] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = which = model.camera(camera).id
        if width < LEAST_ASPECT * height:  # keep the camera's horizontal field of view
            half = (
                math.tan(math.radians(0.5 * model.cam_fovy[which])) * LEAST_ASPECT * height / width
            )
            model.cam_fovy[which] = math.degrees(2.0 * math.atan(half))
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.zeros((height, width, 3), dtype=np.uint8)

    def photograph(self, title: str = "") -> np.ndarray:
        """Renders the stage."""
        stage = self.stage
        if stage.relief():
            mujoco.mjr_uploadHField(stage.model, self._context, stage.field)
        view = self._option, self._perturb, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(stage.model, stage.data, *view, self._scene)
        stage.draw_arrow(self._scene)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        if title:
            font = mujoco.mjtFont.mjFONT_NORMAL.value
            corner = mujoco.mjtGridPos.mjGRID_TOPLEFT.value
            mujoco.mjr_overlay(font, corner, self._rect, title, "", self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rect, self._context)
        return self._pixels[::-1]

    def close(self) -> None:
        """Releases graphics memory and context."""
        self._context.free()
        self._gl.free()


def _opened(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """Opens an OpenGL context without a display: as MUJOCO_GL says, or EGL on Linux."""
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    linux = sys.platform.startswith("linux")
    if wanted in GL_OFF:
        raise ParameterError("MUJOCO_GL", wanted, "switches rendering off: unset it")
    if linux and wanted not in ("", "egl", "osmesa", "glfw", "glx", *GL_ON):
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
        return gl, mujoco.MjrContext(model, 50 * min(max(width // FONT_WIDTH, 2), 6))
    except Exception as error:  # ImportError, AttributeError, GLError, FatalError: each backend
        if wanted not in ("", "egl", "osmesa"):
            bound = "needs a display: unset it, or set egl or osmesa"
            raise ParameterError("MUJOCO_GL", wanted, bound) from None
        why = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, AttributeError | ImportError):  # PyOpenGL found no library
            why = "no library or driver"
        bound = f"cannot be started ({why}): {GL_PACKAGES}"
        raise ParameterError("OpenGL", wanted or "egl", bound) from None


def ready(out: Path, options: FilmOptions = FILM_OPTIONS) -> tuple[str, FilmOptions]:
    """Checks that a film can be made on this machine; call it before a long run."""
    kind = choice("out", out.suffix.lower(), tuple(FRAME_RATES))
    speed = number("speed", options.speed, 1e-3, 1e3, above=True)
    number("magnify", options.magnify, 1e-3, 1e9)
    width, height = (
        integer(f"size[{name}]", n, 160, 4096)
        for name, n in zip(("w", "h"), options.size, strict=True)
    )
    choice("camera", options.camera, CAMERAS)
    _check_codec(out, kind)
    gl, context = _opened(mujoco.MjSpec().compile(), 64, 64)
    context.free()
    gl.free()
    even = width - width % 2, height - height % 2  # as H.264 requires
    return kind, replace(options, speed=speed, size=even)


def usual_file(folder: Path) -> Path:
    """Where a film goes that has no name: an .mp4 if its codec is installed, else a .webp."""
    found = importlib.util.find_spec("imageio_ffmpeg")
    return folder / ("film.mp4" if found else "film.webp")


def _check_codec(out: Path, kind: str) -> None:
    """Refuses a kind of file that nothing here can write."""
    if kind == ".mp4":
        try:
            import imageio_ffmpeg

            imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            bound = "needs a codec: pip install 'hapticclay[video]'; or use .webp, which needs none"
            raise ParameterError("film", out.name, bound) from None
        return
    try:
        from PIL import features

        if kind == ".webp" and not features.check("webp"):
            raise ImportError
    except ImportError:
        bound = f"needs a codec: pip install --upgrade pillow, with {kind[1:]}"
        raise ParameterError("film", out.name, bound) from None


class ArmReel:
    """What a film shows of a run: its scene, posed sample by sample, and words."""

    def __init__(self, record: Record, options: FilmOptions):
        self.stage, self._record = stage_of(record, options), record
        self._held = record.held()[:, : len(AXES)].tolist()
        self._removed = None if record.ground is None else record.extra.get("removed")
        self._done = 0

    def show(self, n: int) -> list[str]:
        """Poses the scene after the first n samples, and says what of it is no picture."""
        record, stage, words = self._record, self.stage, []
        stage.carve(_thinned(record.p[self._done : n]))
        self._done = n
        stage.pose(record.q[n - 1])
        stage.push(record.fe[n - 1], all(self._held[n - 1]))
        if stage.field >= 0:
            volume = stage.removal.volume if self._removed is None else float(self._removed[n - 1])
            words.append(f"removed {1e6 * volume:.1f} cm3")
        if still := held_words(self._held[n - 1]):
            words.append(still)
        return words


def frames(
    record: Record | PairRecord, options: FilmOptions = FILM_OPTIONS, rate: int = 30
) -> Iterator[np.ndarray]:
    """Yields the frames of a film, shape (height, width, 3) of bytes; each overwrites the last."""
    width, height = options.size
    beside, running = 0, None
    if options.plots:
        from .running_plots import RunningPlots, plots_fit

        share = 2 * round(0.5 * PLOTS_SHARE * width)
        if plots_fit(share, height):
            beside, running = share, RunningPlots(record, share, height)
    reel = _reel(record, options)
    camera = choice("camera", options.camera, CAMERAS)
    lens = Lens(reel.stage, width - beside, height, camera, options.smooth)
    image = np.empty((height, width, 3), dtype=np.uint8)
    digits = 2 if options.speed > SLOW else 4
    gap = "   " if width - beside >= ONE_LINE_WIDTH else "\n"
    magnified = [f"motion x {options.magnify:.0f}"] if options.magnify != 1.0 else []
    try:
        for n in samples_shown(record, options.speed, rate):
            words = reel.show(n)
            time = f"t = {record.t[n - 1]:.{digits}f} s"
            image[:, : width - beside] = lens.photograph(gap.join([time, *magnified, *words]))
            if running:
                image[:, width - beside :] = running.draw(n)
            yield image
    finally:
        lens.close()


def _reel(record: Record | PairRecord, options: FilmOptions) -> Any:
    if isinstance(record, Record):
        return ArmReel(record, options)
    from .pair_stage import PairReel

    return PairReel(record, options.camera, options.magnify)


def stage_of(record: Record, options: FilmOptions) -> Any:
    """The scene of a record: the arm in closed form and its clay, or a stick figure."""
    if record.scenario.is_closed_form:
        if options.magnify != 1.0:
            bound = "must be 1 for the arm in closed form"
            raise ParameterError("magnify", options.magnify, bound)
        return Stage(record.scenario, options.tool)
    return StickStage(record, options.magnify)


def samples_shown(record: Record | PairRecord, speed: float, rate: int) -> np.ndarray:
    """Counts the samples up to each frame of a film."""
    end = float(record.t[-1]) if len(record.t) else 0.0
    at = np.append(np.arange(0.0, end, speed / rate), end)
    return np.searchsorted(record.t, at, "right").clip(1)


def _thinned(p: np.ndarray) -> np.ndarray:
    """At most eight of the points between two frames, the last among them."""
    return p[:: -max(1, len(p) // 8)][::-1]


def film(
    record: Record | PairRecord,
    out: Path,
    options: FilmOptions = FILM_OPTIONS,
    progress: Callable[[Iterator[np.ndarray], int], Iterator] | None = None,
) -> Path:
    """Writes a film of a run."""
    kind, options = ready(out, options)
    if not len(record.t):
        name = record.scenario.name if isinstance(record, Record) else record.kind
        raise ParameterError("record", name, "must hold samples")
    rate = FRAME_RATES[kind]
    images: Any = frames(record, options, rate)
    if progress:
        images = progress(images, len(samples_shown(record, options.speed, rate)))
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(images):
        temporary = Path(folder) / f"film{kind}"
        write_images(temporary, images, rate)
        with atomic(out) as f, open(temporary, "rb") as made:
            shutil.copyfileobj(made, f)
    return out


def write_images(path: Path, images: Iterator[np.ndarray], rate: int) -> None:
    """Writes a film of images."""
    import imageio.v2 as imageio

    if path.suffix != ".mp4":
        imageio.mimwrite(path, [x.copy() for x in images], duration=1000 // rate, loop=0)
        return
    options: Any = dict(format="FFMPEG", codec="libx264", macro_block_size=2, quality=7)
    with imageio.get_writer(path, fps=rate, **options) as writer:
        for image in images:
            writer.append_data(image)
