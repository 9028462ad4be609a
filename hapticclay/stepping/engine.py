"""MuJoCo, the model of a scenario, and what all ways of stepping it share.

MuJoCo is imported whatever MUJOCO_GL says: a run draws nothing, and views report their own errors.
"""

import contextlib
import ctypes
import math
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ParameterError
from ..model import arm
from ..model.clay import Regions, viscous_force
from ..model.constants import AXES, L1, L2
from ..model.scenario import Scenario
from ..model.signals import Multisine
from . import monitor

try:
    import mujoco
except (AttributeError, ImportError, OSError, RuntimeError):  # each backend has its own
    wanted = os.environ.get("MUJOCO_GL")
    if wanted is None:
        raise
    os.environ["MUJOCO_GL"] = "disable"
    try:
        import mujoco
    finally:
        os.environ["MUJOCO_GL"] = wanted

__all__ = ["mujoco"]


@dataclass(frozen=True)
class Crossing:
    """The handle crossed a border.

    Attributes:
        axis: coordinate of the border, "x" or "y".
        border: where it lies [m].
        time: when it was crossed [s].
        speed: velocity along the axis [m/s].
    """

    axis: str
    border: float
    time: float
    speed: float


def mjcf_folder() -> Path:
    """The folder of MJCF files: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent / "mjcf"
    return checkout if (checkout / "arm.xml").is_file() else package / "mjcf"


@contextlib.contextmanager
def warnings_caught() -> Iterator[list[str]]:
    """Collects the engine's warnings instead of letting it write MUJOCO_LOG.TXT."""
    caught: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(caught.append)
    try:
        yield caught
    finally:
        mujoco.set_mju_user_warning(before)


def build(scenario: Scenario) -> mujoco.MjModel:
    """The model that simulate(scenario) steps.

    It holds joints, inertias and motors; dampers where there is clay; the controller's states for
    an accurate run. It holds no geom, sensor, contact, mesh, material, light or camera.

    Args:
        scenario: what to build for.

    Raises:
        RuntimeError: the engine warned while compiling; the parts in mjcf/ do not fit together.
    """
    accurate = scenario.integrator == "accurate"
    parts = ["arm.xml"] + ["clay.xml"] * (scenario.clay is not None) + ["states.xml"] * accurate
    with warnings_caught() as caught:
        spec = compose_spec(parts)
        spec.option.timestep = scenario.dt
        if accurate:
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        for name, limit in zip(("shoulder", "elbow"), scenario.torque_limit, strict=True):
            spec.actuator(name).ctrlrange = (-limit, limit)
        model = spec.compile()
    return checked_model(model, caught)


def compose_spec(parts: list[str]) -> mujoco.MjSpec:
    """The specification of a model from files of mjcf/, with the arm of model.constants.

    Args:
        parts: names of the files.
    """
    text = "".join(f'<include file="{part}"/>' for part in parts)
    files = {part: (mjcf_folder() / part).read_bytes() for part in parts}
    spec = mujoco.MjSpec.from_string(f'<mujoco model="hapticclay">{text}</mujoco>', include=files)
    # the arm of model.constants, whatever lengths and inertias the file has
    upper, lower = spec.body("link1"), spec.body("link2")
    lower.pos[0], spec.site("handle").pos[0] = L1, L2
    for body, inertia in ((upper, arm.I1 - lower.mass * L1 * L1), (lower, arm.I2)):
        # the other two do not matter in the plane, but no body has less than half of the third
        body.inertia = *(max(x, 0.5 * inertia) for x in body.inertia[:2]), inertia
    return spec


def checked_model(model: mujoco.MjModel, caught: list[str]) -> mujoco.MjModel:
    """The model, refused if the engine warned while compiling it.

    Args:
        model: the model.
        caught: warnings of the engine.

    Raises:
        RuntimeError: there are some.
    """
    if caught:
        raise RuntimeError(f"mjcf: {'; '.join(caught)}")
    return model


def arm_at(q: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kinematics and inertia of the arm by the engine, independent of the formulas of `model.arm`.

    Args:
        q: joint angles, shoulder and elbow [rad].

    Returns:
        Handle position [m], shape (2,); Jacobian J(q) [m], shape (2, 2); M(q) [kg.m^2], shape
        (2, 2).
    """
    with warnings_caught() as caught:
        model = checked_model(compose_spec(["arm.xml"]).compile(), caught)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    handle = model.site("handle").id
    J, M = np.zeros((3, 2)), np.zeros((2, 2))
    mujoco.mj_jacSite(model, data, J, None, handle)
    mujoco.mj_fullM(model, data, M)
    return data.site_xpos[handle][:2].copy(), J[:2], M


TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings
CHUNK = 4096  # rows between two looks at the run (progress, Ctrl-C, outcome); fits the cache


class Run:
    """One run of a scenario. A subclass makes the steps; this class keeps their results.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.

    Raises:
        ParameterError: a control callback is installed in the engine, which would interfere.

    Attributes:
        i: index of the sample at or before now.
        t: now [s].
        last: number of whole steps.
        steps: engine steps made.
        pause: index of the sample to pause at.
    """

    def __init__(self, scenario: Scenario, every: int):
        if mujoco.get_mjcb_control() is not None:
            bound = "the engine must be free of control callbacks"
            raise ParameterError("mjcb_control", mujoco.get_mjcb_control(), bound)
        self.scenario, self.every = scenario, every
        self.model, self.data = self.engine()
        (x, y), (ox, oy) = scenario.start, scenario.origin
        q1, q2 = arm.inverse_kinematics(ox + x, oy + y)
        self.data.qpos[:] = q1, q2
        r1, r2 = arm.joint_velocity(*scenario.velocity, arm.jacobian(q1, q2), 1.0)
        self.data.qvel[:] = r1, r2 - r1
        self.muscle, self.command = _build_signal(scenario.muscle), _build_signal(scenario.command)
        self.angles: Any = memoryview(self.data.qpos)  # floats, in the engine's own memory
        self.rates: Any = memoryview(self.data.qvel)
        self.regions = Regions(scenario.clay, scenario.length, scenario.start)
        self.varies = bool(self.muscle or self.command or self.regions.grows)  # from step to step
        self.last = math.floor(scenario.t_max / scenario.dt + 1e-6)
        self.i, self.t, self.steps = 0, 0.0, 0
        self.pause = math.inf
        self.watch = monitor.StabilityMonitor(scenario)
        self.looked = 0  # samples judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # index, rows, b
        self.crossings: list[Crossing] = []
        self.outcome: monitor.Outcome | None = None
        self.end_time: float | None = None

    def engine(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The engine's model of the scenario, and its data."""
        model = build(self.scenario)
        return model, mujoco.MjData(model)

    def advance(self) -> bool:
        """Makes one step or many; True if their results are to be judged."""
        raise NotImplementedError

    def flush(self) -> None:
        """Judges the steps since the last look, by `judge`."""
        raise NotImplementedError

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy."""
        raise NotImplementedError

    def go(self, progress: Callable[[float, float], bool | None] | None) -> None:
        """Runs to the end, until progress returns True, or until sample `pause`.

        A run that was paused is not flushed.

        Args:
            progress: called now and then with (time [s], handle x [m]); True ends the run.
        """
        try:
            while self.outcome is None and self.i < self.pause:
                if self.advance() or self.outcome:
                    x, _ = self.position(self.angles, self.rates, 0.0)
                    if progress and progress(self.t, x) and self.outcome is None:
                        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
                    self.flush()
        except (ArithmeticError, ValueError) as error:
            finite = all(map(math.isfinite, (*self.angles, *self.rates)))
            if isinstance(error, ValueError) and finite:
                raise
            self.flush()  # beyond floating point, or the arm exactly straight
            if self.outcome is None:
                cause = "the arm is stretched or folded"
                self.outcome = monitor.Outcome("out of reach", self.t, self.i, cause=cause)

    def uh(self, begin: Any, end: Any) -> Any:
        """Mean muscle force over one interval, or over many.

        Args:
            begin: start [s], a float or shape (n,).
            end: end [s], as begin.

        Returns:
            Force [N], (x, y) or shape (n, 2).
        """
        force = self.scenario.force
        one = isinstance(begin, float)
        if self.muscle:
            force = force + self.muscle.mean(begin, end)
            return force.tolist() if one else force
        return force if one else np.broadcast_to(force, (len(begin), 2))

    def shift(self, begin: Any, end: Any) -> np.ndarray:
        """Change of the command over an interval.

        Args:
            begin: start [s], a float or shape (n,).
            end: end [s], as begin.

        Returns:
            Change [m], shape (2,) or (n, 2).
        """
        if self.command:
            return self.command(end) - self.command(begin)
        return np.zeros(np.shape(begin) + (2,))

    def position(self, q, w, h: float) -> tuple[float, float]:
        """Handle position after the joints have turned at constant rates.

        Args:
            q: joint angles [rad].
            w: joint rates [rad/s].
            h: time [s].

        Returns:
            (x, y) [m].
        """
        x, y = arm.handle_position(q[0] + h * w[0], q[1] + h * w[1])
        return x - self.scenario.origin[0], y - self.scenario.origin[1]

    def target(self) -> tuple[float, float, bool]:
        """(time of the next sample [s], length of the step to it [s], whether now is a sample).

        The length is 0 at the end.
        """
        return next_sample(self.t, self.i, self.last, self.scenario.dt, self.scenario.t_max)

    def inside(self, i: int, p: float) -> bool:
        """Whether a coordinate is in the present region; a NaN is, and is judged later.

        Args:
            i: coordinate, 0 for x, 1 for y.
            p: its value [m].
        """
        return not (p > self.regions.high[i] + TOUCH or p < self.regions.low[i] - TOUCH)

    def cross(self, i: int, up: bool, speed: float) -> bool:
        """Records a crossing and enters the next region; at the end of the path, records it alone.

        Args:
            i: coordinate, 0 for x, 1 for y.
            up: True towards larger values.
            speed: velocity along the axis [m/s].

        Returns:
            True at the end of the path.
        """
        end = self.regions.at_end(i, up)
        border = self.regions.high[i] if up else self.regions.low[i]
        self.crossings.append(Crossing(axis=AXES[i], border=border, time=self.t, speed=speed))
        if not end:
            self.regions.cross(i, up, self.t)
        return end

    def finish(self, code: str) -> None:
        """Ends the run now.

        Args:
            code: as Outcome.code.
        """
        self.end_time = self.t
        self.outcome = monitor.Outcome(code, self.t, self.i)

    def look(self, rows: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """Judges the next rows, as StabilityMonitor.look.

        Args:
            rows: shape (12, n).
        """
        return self.watch.look(rows, self.looked)

    def judge(self, rows: np.ndarray, b: Callable[[], np.ndarray]) -> int:
        """Takes samples into the record, up to the end of the good part of the run.

        Args:
            rows: (q, p, v, fh, tau, delta), shape (12, n).
            b: gives the clay at each sample, shape (2, n).

        Returns:
            Number of samples taken.
        """
        good, found = self.look(rows)
        if found is not None:
            self.outcome, self.end_time = found, None
            self.crossings = [c for c in self.crossings if c.time <= found.time]
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.looked + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self.crossings = [c for c in self.crossings if c.time <= self.outcome.time]
            self.outcome = self.watch.end(self.outcome)
        if good:
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            everything = len(keep) == rows.shape[1]
            rows = rows if everything else rows[:, keep]
            self.kept.append((self.looked + keep, rows, b()[:, keep]))
        self.looked += good
        return good

    def arrays(self) -> dict[str, np.ndarray]:
        """The samples kept, by the names of Record's arrays."""
        index, rows, b = (np.concatenate(x, axis=-1) for x in zip(*self.kept, strict=True))
        t = index * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        q, p, v, fh, tau, delta = (rows[j : j + 2].T.copy() for j in range(0, 12, 2))
        r1, r2 = arm.joint_velocity(v[:, 0], v[:, 1], arm.jacobians(q[:, 0], q[:, 1]), 1.0)
        qd = np.column_stack((r1, r2 - r1))
        b = b.T.copy()
        fe = np.column_stack(viscous_force(*b.T, *v.T))
        return dict(t=t, p=p, v=v, fh=fh, fe=fe, b=b, q=q, qd=qd, tau=tau, delta=delta)

    def brief(self) -> tuple[Any, ...]:
        """The end of the run: outcome, steps, crossings, the last p, v, fh, fe and b, energy."""
        arrays = self.arrays()
        final = (arrays[name] for name in ("p", "v", "fh", "fe", "b"))
        last = [x[-1] if len(x) else (np.nan, np.nan) for x in final]
        return self.outcome, self.steps, tuple(self.crossings), last, self.balance()


def _build_signal(multisine: Multisine | None) -> Any:
    if multisine is None:
        return None
    from ..model.signals import Signal  # only a run that has one pays for it

    return Signal(multisine)


def shared_view(
    a: np.ndarray, b: np.ndarray
) -> tuple[memoryview, Callable[..., tuple[float, ...]]]:
    """A view of the engine's memory that spans two arrays of two floats.

    Args:
        a: the first array in memory.
        b: the second.

    Returns:
        The view, and a function that reads all four numbers from it.
    """
    first, second = a.ctypes.data, b.ctypes.data
    gap = second - first - a.nbytes
    view = memoryview((ctypes.c_char * (a.nbytes + gap + b.nbytes)).from_address(first))
    return view, struct.Struct(f"2d{gap}x2d").unpack_from


def command_view(ctrl: np.ndarray, push: np.ndarray) -> tuple[memoryview, Callable[..., None]]:
    """A view of the engine's memory from ctrl on, and a function that writes a command into it.

    ctrl holds the motors and, where there is clay, two dampers. Its first 32 bytes are its own in
    either case if the next array begins 64 bytes on (the engine aligns arrays so); one call then
    writes both arrays. Otherwise two calls do.

    Args:
        ctrl: the engine's controls.
        push: the engine's applied joint torques.

    Returns:
        The view, and the function.
    """
    first, second = ctrl.ctypes.data, push.ctypes.data
    if second - first == 64:
        view = memoryview((ctypes.c_char * 80).from_address(first))
        return view, struct.Struct("4d32x2d").pack_into

    def write(view, offset, t1, t2, bx, by, p1, p2):
        ctrl[:] = (t1, t2, bx, by)[: len(ctrl)]
        push[:] = p1, p2

    return memoryview(ctrl), write  # type: ignore[arg-type]


def next_sample(t: float, i: int, last: int, dt: float, t_max: float) -> tuple[float, float, bool]:
    """The next sample of a run; the numbers of Run.target.

    Args:
        t: now [s].
        i: index of the sample at or before now.
        last: number of whole steps.
        dt: step [s].
        t_max: end of the run [s].

    Returns:
        (time of the next sample [s], length of the step to it [s], whether now is a sample).
    """
    on_grid = t == i * dt
    if i > last:
        return t, 0.0, on_grid
    target = (i + 1) * dt if i < last else t_max
    after = dt if on_grid and i < last else target - t
    return target, after if after > 1e-9 * dt else 0.0, on_grid


def find_root(f: Callable[..., float], b: float, fb: float, *args: Any) -> float:
    """Root of f between 0 and b, to rounding (false position, Illinois).

    f may vanish at 0 itself, as when a handle enters stiff clay, stops and returns; the root of f/x
    is then found. Where f does not change its sign, the result lies next to 0.

    Args:
        f: function of (x, *args).
        b: end of the interval, b > 0.
        fb: f at b.
        args: further arguments of f.

    Returns:
        The root.
    """
    first, end = 1e-9 * b, b
    a, fa = first, f(first, *args)
    leaves = fa == 0.0 or (fa > 0.0) == (fb > 0.0)
    if leaves:
        while fa == 0.0 or (fa > 0.0) == (fb > 0.0):
            a *= 8.0
            if a > 0.5 * b:
                return first
            fa = f(a, *args)
        fa, fb = fa / a, fb / b
    for _ in range(60):
        h = b - fb * (b - a) / (fb - fa)
        fh = f(h, *args)
        small = abs(fh) < 4e-16  # rounding of a position
        if leaves:
            fh /= h
        if (fh > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = h, fh
        if abs(b - a) <= 1e-12 * end or small:
            break
    return b
