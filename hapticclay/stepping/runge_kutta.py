"""The accurate run: the engine's fourth-order Runge-Kutta, with the controller among its states.

`march` is the same method on numbers alone, for many steps at a time; `compiled` compiles it. There
the engine gives the acceleration of the arm at each stage, and the states are integrated here.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError
from ..model import arm
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from . import energy, loop
from .engine import CHUNK, TOUCH, Run, find_root, mujoco
from .stride import call_engine, load_double, store_double, write_command

STABLE_STEP = 0.5  # fastest rate times step up to which an explicit step is trusted
SUBSTEPS = 1000  # most of them for one sample


class RungeKutta(Run):
    """The loop as a differential equation; steps end on borders. Explicit.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.

    Raises:
        ParameterError: the scene is so stiff that a sample would take more than 1000 steps.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        th = scenario.operator or NO_HAND
        b = max((*scenario.clay.x.values, *scenario.clay.y.values)) if scenario.clay else 0.0
        fastest = (b + th.damper) * arm.TRACE_W + math.sqrt(th.spring * arm.TRACE_W)
        self.substeps = max(1, math.ceil(scenario.dt * fastest / STABLE_STEP))
        if self.substeps > SUBSTEPS:
            bound = f"explicit: would take {self.substeps} steps a sample in so stiff a scene"
            bound += "; choose 'fast'"
            raise ParameterError("integrator", scenario.integrator, bound)
        data = self.data
        self.c = loop.ode_parameters(scenario)
        self.drive: Any = memoryview(data.ctrl)
        self.push: Any = memoryview(data.qfrc_applied)
        self.act: Any = memoryview(data.act)
        self.first = len(data.ctrl) - len(data.act)  # of the states among the actuators
        data.act[:8] = loop.initial_state(scenario.start, scenario.velocity)[:8]
        self.rows: list[tuple[float, ...]] = []
        self.b: list[tuple[float, float]] = []
        self.start = self._stored()

    def _derivative(self, t: float):
        """loop.vector_field at time t [s], at the state of the engine."""
        (q1, q2), (w1, w2) = self.angles, self.rates
        state = tuple(self.act[:8])
        if self.command:
            cx, cy = self.shift(0.0, t)
            state = (state[0] + cx, state[1] + cy, *state[2:])
        (bx, by), (uhx, uhy) = self.regions.b(t), self.uh(t, t)
        return loop.vector_field(self.c, bx, by, uhx, uhy, q1, q2, w1, w2, state)

    def _control(self, model, data) -> None:
        command, rates, _ = self._derivative(data.time)
        drive, push, first = self.drive, self.push, self.first
        drive[0], drive[1], push[0], push[1] = command
        if first == 4:
            drive[2], drive[3] = self.regions.b(data.time)
        for i, x in enumerate(rates, first):
            drive[i] = x

    def go(self, progress) -> None:
        """As Run.go, with the controller in the engine's callback.

        Args:
            progress: as in Run.go.
        """
        mujoco.set_mjcb_control(self._control)
        try:
            super().go(progress)
        finally:
            mujoco.set_mjcb_control(None)

    def advance(self) -> bool:
        target, after, on_grid = self.target()
        if on_grid or not after:
            self._keep()
        if not after:
            self.finish("time limit")
            return True
        n = self.substeps
        for j in range(n):
            if self._step(after / n if j < n - 1 else target - self.t, target, j == n - 1):
                return True
            if self.t == target:
                break
        return len(self.rows) >= CHUNK

    def _step(self, h: float, target: float, last: bool) -> bool:
        """One engine step of h, or to the border in its way; True at the end of the path."""
        before = (tuple(self.angles), tuple(self.rates), tuple(self.act))

        def there(h: float) -> tuple[float, float]:
            self.angles[0], self.angles[1] = before[0]
            self.rates[0], self.rates[1] = before[1]
            for i, x in enumerate(before[2]):
                self.act[i] = x
            self._leap(h)
            self.steps += 1
            return self.position(self.angles, self.rates, 0.0)

        p = there(h)
        hit = [i for i in (0, 1) if not self.inside(i, p[i])]
        if not hit:
            if last:
                self.i, self.t = self.i + 1, target
            else:
                self.t += h
            return False
        spans = {}
        for i in hit:
            up = p[i] > self.regions.high[i]
            border = self.regions.high[i] if up else self.regions.low[i]
            spans[i] = (
                find_root(lambda x, i=i, border=border: there(x)[i] - border, h, p[i] - border),
                up,
            )
        i = min(spans, key=lambda i: spans[i][0])
        h, up = spans[i]
        there(h)
        self.t += h
        if target - self.t <= 1e-9 * self.scenario.dt:
            self.i, self.t = self.i + 1, target
        speed = self._derivative(self.t)[2][2 + i]
        if self.cross(i, up, speed):
            self._keep()
            self.finish("finished")
            return True
        return False

    def _leap(self, h: float) -> None:
        """One step of h [s] from the state that the engine holds."""
        self.model.opt.timestep, self.data.time = h, self.t
        mujoco.mj_step(self.model, self.data)

    def _keep(self) -> None:
        command, _, sample = self._derivative(self.t)
        cx, cy = self.shift(0.0, self.t)
        self.rows.append((*self.angles, *sample, *command[:2], self.act[0] + cx, self.act[1] + cy))
        self.b.append(self.regions.b(self.t))

    def flush(self) -> None:
        rows, b = np.array(self.rows).reshape(-1, 12).T.copy(), np.array(self.b).reshape(-1, 2).T
        self.rows, self.b = [], []
        self.judge(rows, lambda: b)

    def _stored(self) -> tuple[float, float]:
        """Energy of the arm, and of mass and spring of the hand [J]."""
        w1, w2 = self.rates
        px, py, vx, vy, *_ = self._derivative(self.t)[2]
        return energy.stored_energy(
            self.scenario.operator or NO_HAND, w1, w1 + w2, (px, py), (vx, vy)
        )

    def balance(self) -> dict[str, float]:
        return energy.energy_balance(self.act[8:13].tolist(), self.start, self._stored())


STATES = 17  # q, q', then the states of loop.vector_field and the works
MARCH_ROW = 12  # floats of a row, as Run.judge takes them


class MarchEngine(NamedTuple):
    """Addresses in the engine.

    Attributes:
        forward: of mj_forward.
        model: of the model.
        data: of the data.
        q: of the joint angles.
        w: of the joint rates.
        acceleration: of the joint accelerations.
        ctrl: of the controls.
        push: of the applied joint torques.
    """

    forward: int
    model: int
    data: int
    q: int
    w: int
    acceleration: int
    ctrl: int
    push: int


def _stage_derivative(c, b, uh, dampers, engine, y, dy):
    """Writes the derivative of all states y into dy, shape (STATES,); returns (command, sample)."""
    state = (y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11])
    command, rates, sample = loop.vector_field(
        c, b[0], b[1], uh[0], uh[1], y[0], y[1], y[2], y[3], state
    )
    store_double(engine.q, y[0])
    store_double(engine.q + 8, y[1])
    store_double(engine.w, y[2])
    store_double(engine.w + 8, y[3])
    write_command(engine, dampers, (command[0], command[1], b[0], b[1], command[2], command[3]))
    call_engine(engine.forward, engine.model, engine.data)
    dy[0], dy[1] = y[2], y[3]
    dy[2], dy[3] = load_double(engine.acceleration), load_double(engine.acceleration + 8)
    for j in range(13):
        dy[4 + j] = rates[j]
    return command, sample


def _one_step(c, b, uh, dampers, engine, h, y, k):
    """Carries y over one step of h [s]. k: (5, STATES), workspace; k[0] is the slope at y."""
    for stage in range(1, 4):
        ahead = h if stage == 3 else 0.5 * h
        for j in range(STATES):
            k[4, j] = y[j] + ahead * k[stage - 1, j]
        _stage_derivative(c, b, uh, dampers, engine, k[4], k[stage])
    for j in range(STATES):
        y[j] += h / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])


def march(c, b, uh, dampers, engine, dt, substeps, low, high, origin, y, k, rows):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Steps from sample to sample until rows is full, or before a step that leaves the region.

    Args:
        c: from loop.ode_parameters.
        b: clay, (x, y) [N.s/m].
        uh: muscle force, (x, y) [N].
        dampers: whether the engine has clay.
        engine: addresses in the engine.
        dt: from sample to sample [s].
        substeps: steps a sample.
        low: lower borders of the region, (x, y) [m].
        high: upper borders of the region, (x, y) [m].
        origin: as in Scenario [m].
        y: state, shape (STATES,), which is advanced.
        k: workspace, shape (6, STATES).
        rows: to fill, shape (n, MARCH_ROW).

    Returns:
        Number of samples passed and rows filled.
    """
    h = dt / substeps
    for i in range(len(rows)):
        for j in range(STATES):
            k[5, j] = y[j]
        for part in range(substeps):
            command, sample = _stage_derivative(c, b, uh, dampers, engine, y, k[0])
            if part == 0:
                row = rows[i]
                row[0], row[1] = y[0], y[1]
                for j in range(6):
                    row[2 + j] = sample[j]
                row[8], row[9], row[10], row[11] = command[0], command[1], y[4], y[5]
            _one_step(c, b, uh, dampers, engine, h, y, k)
            px, py = arm.handle_position(y[0], y[1])
            px, py = px - origin[0], py - origin[1]
            inside = (
                low[0] - TOUCH <= px <= high[0] + TOUCH and low[1] - TOUCH <= py <= high[1] + TOUCH
            )
            if not (inside and abs(y[2]) + abs(y[3]) < np.inf):
                for j in range(STATES):
                    y[j] = k[5, j]
                return i
    return len(rows)


def march_once(c, b, uh, dampers, engine, h, y, k):
    """One step.

    Args:
        c: from loop.ode_parameters.
        b: clay, (x, y) [N.s/m].
        uh: muscle force, (x, y) [N].
        dampers: whether the engine has clay.
        engine: addresses in the engine.
        h: length of the step [s].
        y: state, shape (STATES,), which is advanced.
        k: workspace, shape (6, STATES).
    """
    _stage_derivative(c, b, uh, dampers, engine, y, k[0])
    _one_step(c, b, uh, dampers, engine, h, y, k)


COMPILED_STAGES = (_one_step, _stage_derivative)  # by `compiled`, beside `march` and `march_once`
