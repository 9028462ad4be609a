"""A window on a model, turned by the mouse. One thread makes, draws and closes it: nothing waits for another."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

import glfw
import mujoco
import numpy as np

from .errors import ParameterError

SIZE = (1280, 800)  # [pixels] where the monitor has room
INSTEAD = "use --web for a browser, or hapticclay video for a film"
ZOOM = -0.05  # of one notch of the wheel, as MuJoCo's own viewer


class Screen:
    """The window. The left button turns the view, the right one shifts it, the wheel zooms; Ctrl drags.

    Attributes:
        keys: pressed since they were last read, GLFW's numbers. hand: where a drag with Ctrl has led to in the
            plane of the handle, from where it began (x, y) [m]; None while nobody drags. camera: of the view.
    """

    def __init__(self, title: str):
        """Opens it, empty until `show`.

        Raises:
            ParameterError: there is no display, or no OpenGL.
        """
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise ParameterError("display", "", f"there is none: {INSTEAD}")
        said: list[str] = []
        glfw.set_error_callback(lambda _, text: said.append(text.decode(errors="replace")))
        if not glfw.init():
            raise ParameterError("display", os.environ.get("DISPLAY", ""), f"does not answer: {INSTEAD}")
        self._x = _Xlib() if glfw.get_platform() == glfw.PLATFORM_X11 else None
        mode = glfw.get_video_mode(monitor) if (monitor := glfw.get_primary_monitor()) else None
        room = [int(0.9 * x) for x in mode.size] if mode else SIZE
        glfw.window_hint(glfw.SAMPLES, 4)
        width, height = (min(a, b) for a, b in zip(SIZE, room, strict=True))
        self._window = glfw.create_window(width, height, title, None, None)
        if not self._window:
            self._end()
            raise ParameterError("OpenGL", said[-1] if said else "", f"libgl1 may be missing: {INSTEAD}")
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # a hidden window may never be swapped
        glfw.set_key_callback(self._window, self._key)
        glfw.set_mouse_button_callback(self._window, self._button)
        glfw.set_cursor_pos_callback(self._window, self._move)
        glfw.set_scroll_callback(self._window, self._scroll)
        self.keys: list[int] = []
        self.hand: tuple[float, float] | None = None
        self.camera, self._option = mujoco.MjvCamera(), mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._context: Any = None
        self._at = (0.0, 0.0)
        self._held: set[int] = set()
        self._grip: np.ndarray | None = None
        self._room = (1, 1)  # of the view [window's units]

    @property
    def closed(self) -> bool:
        """Whether somebody has closed it, in whatever way."""
        return bool(self._x and self._x.lost) or bool(glfw.window_should_close(self._window))

    def show(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Shows this from now on."""
        if self._context:
            self._context.free()
        self._model, self._data = model, data
        self._scene = mujoco.MjvScene(model, 1000)
        scale = 100 * min(max(round(2.0 * glfw.get_window_content_scale(self._window)[0]) / 2.0, 0.5), 3.0)
        self._context = mujoco.MjrContext(model, int(scale))

    def upload(self, field: int) -> None:
        """Brings a heightfield of the model to the graphics card."""
        mujoco.mjr_uploadHField(self._model, self._context, field)

    def draw(self, share: float, paint: Callable[[Any, Any, Any], None]) -> None:
        """Draws the model into this share of the width, and lets `paint` draw over it.

        Args:
            paint: takes the rectangle of the model's picture, that of the rest, and the engine's context.
        """
        width, height = glfw.get_framebuffer_size(self._window)
        if self.closed or not (width and height):
            return
        view = mujoco.MjrRect(0, 0, int(share * width), height)
        across, down = glfw.get_window_size(self._window)
        self._room = (max(int(share * across), 1), max(down, 1))
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self.camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        mujoco.mjr_render(view, self._scene, self._context)
        paint(view, mujoco.MjrRect(view.width, 0, width - view.width, height), self._context)
        glfw.swap_buffers(self._window)

    def poll(self) -> None:
        """Takes in what mouse, keys and window manager have done."""
        glfw.poll_events()

    def close(self) -> None:
        """Closes it; whatever it held is given back."""
        if self._context and not (self._x and self._x.broken):
            self._context.free()
        self._end()

    def _end(self) -> None:
        if not (self._x and self._x.broken):  # nobody is left to say goodbye to
            glfw.terminate()
        if self._x:
            self._x.restore()

    def _key(self, _: Any, key: int, __: int, action: int, mods: int) -> None:
        if action == glfw.PRESS and key == glfw.KEY_Q and mods & glfw.MOD_CONTROL:
            glfw.set_window_should_close(self._window, True)
        elif action == glfw.PRESS:
            self.keys.append(key)

    def _button(self, _: Any, button: int, action: int, mods: int) -> None:
        if action == glfw.RELEASE:
            self._held.discard(button)
            if not self._held:
                self._grip = self.hand = None
            return
        self._at = glfw.get_cursor_pos(self._window)
        if self._at[0] < self._room[0]:
            self._held.add(button)
            if mods & glfw.MOD_CONTROL:
                self._grip = self._point()
                self.hand = None if self._grip is None else (0.0, 0.0)

    def _move(self, _: Any, x: float, y: float) -> None:
        dx, dy = ((b - a) / self._room[1] for a, b in zip(self._at, (x, y), strict=True))
        self._at = (x, y)
        if self._grip is not None:
            point = self._point()
            if point is not None:
                self.hand = (float(point[0] - self._grip[0]), float(point[1] - self._grip[1]))
        elif self._held and self._context:
            turn = glfw.MOUSE_BUTTON_LEFT in self._held
            action = mujoco.mjtMouse.mjMOUSE_ROTATE_V if turn else mujoco.mjtMouse.mjMOUSE_MOVE_H
            mujoco.mjv_moveCamera(self._model, action, dx, dy, self.camera)

    def _scroll(self, _: Any, __: float, y: float) -> None:
        if self._context:
            mujoco.mjv_moveCamera(self._model, mujoco.mjtMouse.mjMOUSE_ZOOM, 0.0, ZOOM * y, self.camera)

    def _point(self) -> np.ndarray | None:
        """Where the mouse points to in the plane of the handle, z = 0 [m]; None above its horizon."""
        if not self._context:
            return None
        c, (width, height) = self._scene.camera[0], self._room
        top, bottom = c.frustum_top, c.frustum_bottom
        up = bottom + (top - bottom) * (1.0 - self._at[1] / height)
        right = c.frustum_center + (top - bottom) * (self._at[0] - 0.5 * width) / height
        ray = c.frustum_near * c.forward + up * c.up + right * np.cross(c.forward, c.up)
        if ray[2] > -1e-2 * np.linalg.norm(ray):
            return None
        return c.pos - c.pos[2] / ray[2] * ray


class _Xlib:
    """Hears of X errors, at which Xlib would end the process: a window that another program has destroyed.

    Attributes:
        lost: whether the window is gone. broken: whether the connection to the display is.
    """

    def __init__(self):
        self.lost = self.broken = False
        self._lib = ctypes.CDLL("libX11.so.6")  # by which GLFW has loaded it
        one, two = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p), ctypes.CFUNCTYPE(None, *2 * [ctypes.c_void_p])
        self._hear = ctypes.CFUNCTYPE(ctypes.c_int, *2 * [ctypes.c_void_p])(self._error)
        self._hear_break, self._go_on = one(self._break), two(lambda *_: None)
        for name in ("XSetErrorHandler", "XSetIOErrorHandler"):
            getattr(self._lib, name).restype = ctypes.c_void_p
        self._before = self._lib.XSetErrorHandler(self._hear), self._lib.XSetIOErrorHandler(self._hear_break)
        if hasattr(self._lib, "XSetIOErrorExitHandler"):  # since 1.7
            self._lib.XSetIOErrorExitHandler(ctypes.c_void_p(glfw.get_x11_display()), self._go_on, None)

    def restore(self) -> None:
        for name, handler in zip(("XSetErrorHandler", "XSetIOErrorHandler"), self._before, strict=True):
            if not self.broken:
                getattr(self._lib, name)(ctypes.c_void_p(handler))

    def _error(self, *_: Any) -> int:
        self.lost = True
        return 0

    def _break(self, *_: Any) -> int:
        self.lost = self.broken = True
        return 0
