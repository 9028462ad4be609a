"""A leader and a follower in a browser: the mouse is the hand at the leader's handle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arms.mechanism import Sticks
from ..display import time_words
from ..errors import ParameterError
from ..kernel.engine import mujoco
from ..live.pair_session import PairFrame, PairSession, Theory
from ..scene.link import ENDS
from ..scene.pair import joint_names, joint_unit
from ..scene.virtual_wall import Device
from ..theory.pair_onset import LATEST
from .arm_sticks import COLORS, force_axes, in_space, sticks_of
from .live_page import PLOT_TIME, LivePage, banner_html
from .palette import BLACK, BLUE, CLAY_DEEP, PART_COLORS, VERMILION, rgb_bytes
from .sticks import JOINT, KNOB, LINK, SHAFT, look
from .touched import AROUND, CLEAR, body_of

SPAN = 0.15  # [m] of a rail to either side
GAP = 0.4  # between both arms, as a share of their size
LONGEST, LEAST_FORCE = 0.35, 5.0  # longest arrow, as a share of the size, and the least force of it
AZIMUTH, ELEVATION = -50.0, 24.0  # [deg] of the first view
MOST_GAIN = 4.0  # factor of all gains of the slider
DELAYS, LEAST_DELAYS = 2.5, 20  # largest delay of the slider: of the limit, and control samples


class PairPage(LivePage):
    """The page of a pair, served until `close`."""

    def __init__(self, session: PairSession, host: str = "127.0.0.1", port: int = 8080):
        """Begins to serve the page."""
        super().__init__(session, host, port)
        import viser

        self.session, self._plot_time, self._most = session, -math.inf, LEAST_FORCE
        self._shift = np.zeros((2, 3))
        figures = [self._sticks(i, host.start) for i, host in enumerate(session.run.hosts)]
        places = [x.segments.reshape(-1, 3) for x in figures]
        self._size = max(float(np.ptp(x, axis=0).max()) for x in places)
        self._shift[1] = self._beside(places)
        self._start = figures[0].handle
        figures[1] = self._sticks(1, session.run.hosts[1].start)
        self._scene(figures)
        self._controls(viser.uplot)

    def _sticks(self, i: int, q: Any) -> Sticks:
        return sticks_of(self.session.pair.arms[i], q, SPAN, self._shift[i])

    def _beside(self, places: Sequence[np.ndarray]) -> np.ndarray:
        """Where the follower stands: to the right in the first view; a rail, in front."""
        if isinstance(self.session.pair.leader, Device):
            return np.array([0.0, -GAP * self._size, 0.0])
        a = math.radians(AZIMUTH)
        right = np.array([-math.sin(a), math.cos(a), 0.0])
        return ((places[0] @ right).max() - (places[1] @ right).min() + GAP * self._size) * right

    # ---- the scene

    def _scene(self, figures: Sequence[Sticks]) -> None:
        add, size = self.server.scene, self._size
        places = np.concatenate([x.segments.reshape(-1, 3) for x in figures])
        low, high = places.min(axis=0), places.max(axis=0)
        middle, wide = 0.5 * (low + high), float((high - low).max())
        camera, (back, _) = self.server.initial_camera, look(AZIMUTH, ELEVATION)
        camera.look_at, camera.fov = tuple(middle), 0.60
        camera.position = tuple(middle + 2.9 * wide * back)
        self._light()
        floor = float(low[2]) - 0.06 * size
        self._table((*middle[:2], floor), 6.0 * wide, 6.0 * wide, 0.1)
        self._parts = [self._arm(i, x) for i, x in enumerate(figures)]
        self._arrows = []
        for i, name in enumerate(ENDS):
            form: Any = dict(shaft_radius=SHAFT * size, head_radius=2.2 * SHAFT * size)
            form |= dict(head_length=5.0 * SHAFT * size, visible=False)
            color = rgb_bytes(COLORS[i])
            self._arrows.append(
                add.add_arrows(f"/{name}/force", np.zeros((1, 2, 3)), color, **form)
            )
        self._touched = [self._add_touched(i, x.handle) for i, x in enumerate(figures)]
        free: Any = [k in self._axes for k in range(3)]
        form = dict(active_axes=tuple(free), disable_rotations=True, depth_test=False)
        self.target = add.add_transform_controls("/hand", scale=0.25 * size, **form)
        self.target.position = self._start
        self.target.on_update(self._dragged)

    def _add_touched(self, i: int, start: np.ndarray) -> Any:
        """Adds what an arm touches; returns it if it moves with the handle."""
        add, body = self.server.scene, body_of(self.session.pair, i, start, self._size)
        if body is None:
            return None
        form: Any = dict(opacity=CLEAR, cast_shadow=False, position=body.place)
        name, color = f"/{ENDS[i]}/touched", rgb_bytes(CLAY_DEEP)
        if body.half is None:
            add.add_icosphere(name, AROUND * self._size, color, **form)
            return None
        made = add.add_box(name, color, tuple(2.0 * body.half), **form)
        return made if body.moves else None

    @property
    def _axes(self) -> list[int]:
        """Axes of the world along which the hand pulls."""
        leader = self.session.pair.leader
        return [0] if isinstance(leader, Device) else force_axes(leader)

    def _arm(self, i: int, figure: Sticks) -> dict[str, list[Any]]:
        """Adds links, joints and handle."""
        add, name, size = self.server.scene, ENDS[i], self._size
        links, joints = [], []
        for k, (begin, end) in enumerate(figure.segments):
            color = rgb_bytes(COLORS[i] if k % 2 else PART_COLORS["dark"])
            length = float(np.linalg.norm(end - begin))
            links.append(add.add_cylinder(f"/{name}/link{k}", LINK * size, length, color))
        for k in range(len(figure.joints)):
            color = rgb_bytes(PART_COLORS["steel"])
            joints.append(add.add_icosphere(f"/{name}/joint{k}", JOINT * size, color))
        knob = add.add_icosphere(f"/{name}/knob", KNOB * size, rgb_bytes(COLORS[i]))
        at = figure.joints[0] + np.array([0.0, 0.0, 0.08 * size])
        add.add_label(f"/{name}/name", name, position=at)
        return {"links": links, "joints": joints, "knob": [knob]}

    def _pose(self, i: int, shown: Sticks) -> None:
        parts = self._parts[i]
        for part, (begin, end) in zip(parts["links"], shown.segments, strict=True):
            part.position, part.wxyz = 0.5 * (begin + end), _along(end - begin)
        for part, place in zip(parts["joints"], shown.joints, strict=True):
            part.position = place
        parts["knob"][0].position = shown.handle

    def _point(self, i: int, handle: np.ndarray, force: np.ndarray) -> None:
        length = LONGEST * self._size / self._most * force
        shown = bool(np.linalg.norm(length) > 0.02 * self._size)
        if shown:
            points = np.stack((handle, handle + length))[None]
            self._arrows[i].points = points.astype(np.float32)
        self._arrows[i].visible = shown

    # ---- controls

    def _controls(self, uplot: Any) -> None:
        gui, session = self.server.gui, self.session
        form: Any = dict(show_logo=False, show_share_button=False)
        gui.configure_theme(control_layout="fixed", control_width="medium", **form)
        self.verdict, self.status = gui.add_html(""), gui.add_markdown("")
        self.run = gui.add_button("Pause")
        reset = gui.add_button("Reset")
        hint = "The hand pulls the leader's handle towards the arrows; drag them."
        self.hold = gui.add_checkbox("Hand holds", False, hint=hint)
        step, most = self._delays()
        now = min(1e3 * session.delay, most)
        hint = "One way; a change restarts the pair."
        self.delay = gui.add_slider("Delay [ms]", 0.0, most, step, now, hint=hint)
        hint = "Factor of all Kp; a change restarts the pair."
        self.gain = gui.add_slider("Gains [times]", 0.1, MOST_GAIN, 0.1, 1.0, hint=hint)
        self._plots(uplot)
        self.run.on_click(self._toggle)
        reset.on_click(self._reset)
        self.delay.on_update(lambda _: self._slid(self.delay, self._change))
        self.gain.on_update(lambda _: self._slid(self.gain, self._change))
        self.hold.on_update(lambda _: self._locked(self._hold))

    def _delays(self) -> tuple[float, float]:
        """Step and largest value of the slider of delay [ms]: halves of a control sample."""
        step = 0.5e3 * self.session.pair.Ts
        wanted = max(2.0 * LEAST_DELAYS * step, DELAYS * 1e3 * self.session.delay)
        return step, step * math.ceil(min(wanted, 1e4) / step)

    def _plots(self, uplot: Any) -> None:
        form: Any = dict(mode=1, aspect=2.0, padding=(12, 4, 0, 0))
        form["scales"] = {"x": uplot.Scale(time=False)}
        zero, gui = np.zeros(2), self.server.gui

        def add(title: str, *curves: tuple[str, str]) -> Any:
            lines = [uplot.Series(label=x, stroke=color, width=2) for x, color in curves]
            data = (np.array([0.0, 1.0]), *(zero for _ in curves))
            return gui.add_uplot(data, (uplot.Series(label="t [s]"), *lines), title=title, **form)

        unit = f"m{self._unit}"
        self._off = add("follower off", (f"off [{unit}]", BLACK))
        self._forces = add("forces", ("hand [N]", BLUE), ("contact [N]", VERMILION))
        ports = ("at leader [mJ]", BLUE), ("at follower [mJ]", VERMILION), ("together [mJ]", BLACK)
        self._energy = add("energy taken by controllers and link", *ports)

    @property
    def _unit(self) -> str:
        return joint_unit(joint_names(self.session.pair.leader))

    def _change(self) -> None:
        """Restarts with what the sliders say; what cannot run is taken back.

        A delay that was not moved stays as the file has it: exact, and by way.
        """
        session, delay = self.session, 1e-3 * self.delay.value
        moved = not math.isclose(delay, session.delay, rel_tol=1e-9)
        try:
            session.change(delay=delay if moved else None, gain=self.gain.value)
        except ParameterError:
            self.delay.value, self.gain.value = 1e3 * session.delay, session.gain
        self._restarted()

    def _restarted(self) -> None:
        self.run.label, self._most = "Pause", LEAST_FORCE
        self.hold.value = False

    def _hold(self) -> None:
        away = np.asarray(self.target.position) - self._start
        axes = force_axes(self.session.pair.leader)
        self.session.pull(away[axes] if self.hold.value else None)

    def _reset(self, _: Any) -> None:
        with self.player.lock:
            self.session.restart()
            self._restarted()

    # ---- what changes

    def _refresh(self, now: float) -> None:
        session = self.session
        with self.player.lock:  # a reset in between would be undone by what was before it
            starts = [host.start for host in session.run.hosts]
            nothing = (0.0, *starts, *[np.zeros(2)] * 6)
            _, leader, follower, *_, hand, contact, _, _ = session.run.newest or nothing
            pairs = zip(session.pair.arms, (hand, contact), strict=True)
            forces = [in_space(arm, f) for arm, f in pairs]
            self._most = max(self._most, *(float(np.linalg.norm(f)) for f in forces))
            frames = list(session.frames) if now - self._plot_time > PLOT_TIME else []
            words = self._words(frames[-1]) if frames else ("", "")
        with self.server.atomic():
            for i, q in enumerate((leader, follower)):
                if not np.isfinite(q).all():
                    continue
                shown = self._sticks(i, q)
                self._pose(i, shown)
                self._point(i, shown.handle, forces[i])
                if self._touched[i] is not None:
                    self._touched[i].position = shown.handle
                if i == 0:
                    self._follow(shown.handle)
        if frames:
            self._plot_time = now
            self._show(frames)
            self.verdict.content, self.status.content = words

    def _show(self, frames: Sequence[PairFrame]) -> None:
        t, off, hand, contact, energy = (np.array(x) for x in zip(*frames, strict=True))
        ports = 1e3 * energy.T
        self._off.data = t, 1e3 * off
        self._forces.data = t, hand, contact
        self._energy.data = t, *ports, ports.sum(axis=0)

    def _words(self, newest: PairFrame) -> tuple[str, str]:
        """The banner of the verdict, and the lines below it."""
        session, verdict = self.session, self.session.verdict()
        text = f"{verdict.text}: press Reset to start again" if session.ended else verdict.text
        return banner_html(text, verdict.unstable), "  \n".join(self._lines(newest))

    def _lines(self, newest: PairFrame) -> list[str]:
        session, clock = self.session, self.session.clock
        state = "paused" if session.paused else "ended" if session.ended else "running"
        slow = ", machine too slow" if clock.slow else ""
        return [
            f"**{state}** {session.t:.1f} s, {clock.factor:.2f} x real time{slow}",
            _left(session.theory),
            f"follower off by {1e3 * newest.off:.3g} m{self._unit}",
            f"controllers and link took {1e3 * sum(newest.energy):.3g} mJ",
        ]


def _left(theory: Theory) -> str:
    """How much delay there is left."""
    found = theory.found
    if found is None:
        return f"delay left: {'not known' if theory.error else 'being computed'}"
    return f"delay left: {time_words(found.delay_left, LATEST)} one way"


def _along(way: np.ndarray) -> np.ndarray:
    """The rotation that turns z, the axis of a cylinder, into a direction, as a quaternion."""
    out = np.zeros(4)
    mujoco.mju_quatZ2Vec(out, np.array(way))
    return out
