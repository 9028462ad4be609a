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

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from ..errors import ParameterError, choice, integer, number
from ..files import atomic
from ..model.constants import AXES
from ..simulation.record import Record
from ..stepping.engine import mujoco
from ..studies.removal import TOOL, Tool
from .stage import CAMERAS, Stage
from .style import BLUE, CLAY, GREEN, GREY, ORANGE, STYLE

FPS = {".mp4": 30, ".webp": 20, ".gif": 20}  # frames a second, by kind of file
ASPECT = 1.2  # width over height that the cameras are made for, at least
PLOTS = 0.375  # share of the width that the plots take
TITLE = 240  # width of a picture from which its title is one line [pixels]
SAMPLES, SHADOW = (
    4,
    2048,
)  # a pixel, and the width of the shadow's map [pixels], where edges are softened
ON, OFF = (
    ("enable", "enabled", "on", "true", "1"),
    ("disable", "disabled", "off", "false", "0"),
)  # MUJOCO_GL
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
            font, corner = (
                mujoco.mjtFont.mjFONT_NORMAL.value,
                mujoco.mjtGridPos.mjGRID_TOPLEFT.value,
            )
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
            raise ParameterError(
                "MUJOCO_GL", wanted, "needs a display: unset it, or set egl or osmesa"
            ) from None
        lacks = isinstance(
            error, AttributeError | ImportError
        )  # PyOpenGL's way to say that it found no library
        why = (
            "no library or driver"
            if lacks
            else " ".join(str(error).split()) or type(error).__name__
        )
        raise ParameterError(
            "OpenGL", wanted or "egl", f"cannot be started ({why}): {GL}"
        ) from None


def ready(
    out: Path, speed: float = 1.0, size: tuple[int, int] = (960, 480)
) -> tuple[str, float, tuple[int, int]]:
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
    width, height = (
        integer(f"size[{name}]", n, 160, 4096) for name, n in zip(("w", "h"), size, strict=True)
    )
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
                "out",
                kind,
                "needs a codec: pip install 'imageio[ffmpeg]'; or take .webp, which needs none",
            ) from None
        return
    try:
        from PIL import features

        if kind == ".webp" and not features.check("webp"):
            raise ImportError
    except ImportError:
        raise ParameterError(
            "out", kind, f"needs a codec: pip install --upgrade pillow, with {kind[1:]}"
        ) from None


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
        pass

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
    writer = imageio.get_writer(
        path, format="FFMPEG", fps=fps, codec="libx264", macro_block_size=2, quality=7
    )  # type: ignore[arg-type]
    with writer:
        for image in images:
            writer.append_data(image)


DPI = 100
PEN = 1.1  # half the width of a line [pixels]
STRIDE = 0.5  # between two dabs of the pen [pixels]


LEAST = (120, 100)  # width and height of one panel [pixels]: less has no room for its numbers
ROOMY = (180, 110)  # width and height of a panel from which axes are named in words [pixels]


def fits(width: int, height: int) -> bool:
    """Whether there is room for plots in so many pixels."""
    return width >= LEAST[0] and height >= LEAST[1]


class Running:
    """Velocity and fe/v against position, and the operator's force against time, one above the other.

    The first of these that there is room for.

    Attributes:
        image: as it is now, shape (height, width, 3) of bytes.
    """

    def __init__(self, record: Record, width: int, height: int):
        figure, curves = draw(record, width, height)
        canvas: Any = figure.canvas
        self.image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._pens = [_Pen(self.image, *curve) for curve in curves]

    def upto(self, n: int) -> np.ndarray:
        """The image with the first n samples on it; n must not fall from call to call."""
        for pen in self._pens:
            pen.draw(n)
        return self.image


def draw(
    record: Record, width: int, height: int
) -> tuple[Figure, list[tuple[Axes, np.ndarray, np.ndarray, str]]]:
    """The plots before anything runs on them, and the curves that will: axes, x, y, colour."""
    r, count = record, max(1, min(3, height // LEAST[1]))
    roomy = width >= ROOMY[0] and height >= ROOMY[1] * count
    axis = "y" if float(np.ptp(r.p[:, 1])) > 1.2 * float(np.ptp(r.p[:, 0])) else "x"
    i = AXES.index(axis)
    x, v, force = 100.0 * r.p[:, i], r.v[:, i], r.fh[:, i]
    ratio, top = r.ratio(r.fe)[:, i], max(float(r.b[:, i].max(initial=0.0)), 1.0)
    ratio = np.clip(ratio, -top, 2.0 * top)  # 0/0 as a run begins or turns
    usual = np.percentile(
        np.concatenate((force, r.fe[:, i])), (1.0, 99.0)
    )  # not the spike at a border
    where, when = (f"position {axis} [cm]", "time [s]") if roomy else (f"{axis} [cm]", "t [s]")
    speed, ratio_name = f"v$_{axis}$ [m/s]", "f$_e$/v [N$\\cdot$s/m]"
    plans: Any = (  # x, y to be seen, names of x and y, title where there is room, title where there is not; curves
        (x, v, where, f"velocity {speed}", record.scenario.name, speed, ((v, BLUE),)),
        (x, np.array([0.0, 1.25 * top]), where, ratio_name, "", ratio_name, ((ratio, BLUE),)),
        (r.t, np.append(1.15 * usual, 0.0), when, "force [N]", "operator f$_h$, clay f$_e$", "f$_h$, f$_e$ [N]",
         ((force, GREEN), (r.fe[:, i], BLUE))),
    )[:count]  # fmt: skip
    with matplotlib.rc_context({**STYLE, "font.size": 7.5, "lines.linewidth": 1.0}):
        figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
        panels: Any = figure.subplots(count, 1, squeeze=False)[:, 0]
        for ax, (across, up, xlabel, ylabel, title, short, _) in zip(panels, plans, strict=True):
            _frame(ax, across, up, xlabel, ylabel if roomy else "")
            ax.set_title(title if roomy else short, fontsize=7.5, color=GREY, pad=2, loc="left")
        for ax in panels[:2]:
            _clay(ax, r, i)
        b = np.unique(r.b[:, i])
        for value in b[b > 0.0] if len(b) <= 4 and len(panels) > 1 else ():
            panels[1].axhline(value, color=ORANGE, ls="--", lw=0.9)
            panels[1].annotate("b", (1.0, value), (-2, 2), xycoords=("axes fraction", "data"),
                               textcoords="offset points", color=ORANGE, ha="right")  # fmt: skip
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()  # which settles the ticks, and so what room they take
        canvas.draw()
    curves = [
        (ax, plan[0], y, color)
        for ax, plan in zip(panels, plans, strict=True)
        for y, color in plan[-1]
    ]
    return figure, curves


class _Pen:
    """Inks one curve onto an image; what is drawn already is not drawn again."""

    def __init__(self, image: np.ndarray, ax: Axes, x: np.ndarray, y: np.ndarray, color: str):
        self.image, self.done = image, 0
        self.paper = image.astype(np.float32)
        self.color = np.array(to_rgb(color), dtype=np.float32) * 255.0
        self.ink = np.zeros(image.shape[:2], dtype=np.float32)
        known = np.isfinite(x) & np.isfinite(y)
        self.index = np.flatnonzero(known)
        self.at = ax.transData.transform(np.column_stack((x[known], y[known])))
        self.at[:, 1] = image.shape[0] - self.at[:, 1]
        self.at -= 0.5  # centres of pixels
        x0, y0, x1, y1 = np.rint(ax.bbox.extents).astype(int)
        self.low, self.high = (x0, image.shape[0] - y1), (x1, image.shape[0] - y0)
        self.at = np.clip(
            self.at, np.array(self.low) - 9, np.array(self.high) + 9
        )  # a spike leaves the panel soon

    def draw(self, n: int) -> None:
        end = int(np.searchsorted(self.index, n))
        if end <= self.done:
            return
        begin = max(self.done - 1, 0)
        self.done = end
        points = _dabs(self.at[begin:end])
        whole = np.rint(points).astype(int)
        low = np.clip(whole.min(axis=0) - 2, self.low, self.high)
        high = np.clip(whole.max(axis=0) + 3, self.low, self.high)
        for dx in range(-2, 3):
            for dy in range(-2, 3):
                px, py = whole[:, 0] + dx, whole[:, 1] + dy
                inside = (px >= low[0]) & (px < high[0]) & (py >= low[1]) & (py < high[1])
                away = np.hypot(px - points[:, 0], py - points[:, 1])
                dab = np.clip(PEN + 0.5 - away, 0.0, 1.0)[inside].astype(np.float32)
                np.maximum.at(self.ink, (py[inside], px[inside]), dab)
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        ink, paper = self.ink[window][..., None], self.image[window].astype(np.float32)
        paper = np.where(
            ink > 0.0, self.paper[window] + ink * (self.color - self.paper[window]), paper
        )
        self.image[window] = paper.astype(np.uint8)


def _dabs(points: np.ndarray) -> np.ndarray:
    """Points along a polyline, no more than a stride apart."""
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    at = np.append(np.arange(0.0, way[-1], STRIDE), way[-1])
    return np.column_stack([np.interp(at, way, points[:, i]) for i in (0, 1)])


def _frame(ax: Axes, x: np.ndarray, y: np.ndarray, xlabel: str, ylabel: str) -> None:
    for values, put, least in ((x, ax.set_xlim, 1e-6), (y, ax.set_ylim, 1e-6)):
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        span = max(high - low, least)
        put(low - 0.04 * span, high + 0.06 * span)
    ax.set_xlabel(xlabel, labelpad=1)
    ax.set_ylabel(ylabel, labelpad=2)


def _clay(ax: Axes, record: Record, i: int) -> None:
    """Shades where there is clay along this coordinate."""
    clay = record.scenario.clay
    profile = (clay.x, clay.y)[i] if clay else None
    if profile and profile.along == AXES[i] and max(profile.values):
        edges = (-10.0, *profile.edges, 10.0)
        for low, high, b in zip(edges, edges[1:], profile.values, strict=False):
            ax.axvspan(
                100.0 * low, 100.0 * high, color=CLAY, alpha=0.6 * b / max(profile.values), lw=0
            )
