"""Drake: MultibodyPlant and the controller as a LeafSystem in Python, under Simulator.

"runge_kutta3", "runge_kutta5", "radau3": continuous plant, error-controlled; the borders of the
clay are witness functions, which Drake isolates in time, and b is a discrete state that their
events switch. "discrete": plant and controller sampled every dt, torques held between samples,
crossings interpolated.
"""

from __future__ import annotations

import time

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import (
    DiagramBuilder,
    EventStatus,
    LeafSystem,
    UnrestrictedUpdateEvent,
    ValueProducer,
    WitnessFunctionDirection,
)

from . import common
from .common import C_POLE, EDGES, I2, IZZ1, L1, MASS1, MASS2, Job, Result

NAME = "Drake"
# [s]; with the default 0.1 a trial step of runge_kutta5 in clay meets NaN, which Drake does not
# reject
MAX_STEP = 0.03


def methods() -> dict[str, list[float]]:
    """Method -> accuracy (dt [s] for "discrete"), coarse to fine."""
    continuous = [1e-3, 1e-5, 1e-7, 1e-9]
    return {
        "runge_kutta3": continuous,
        "runge_kutta5": continuous,
        "radau3": continuous[:3],
        "implicit_euler": continuous[:2],
        "discrete": [2e-3, 1e-3, 3.6e-4],
    }


class Controller(LeafSystem):
    """Servo, compensator and hand: plant state to torques of motors and hand.

    States are delta, delta', y, y', a pair each (continuous, or discrete if dt > 0), and for dt ==
    0 the region of the clay, a discrete state; `crossings` then collects the times of the borders.
    """

    def __init__(self, job: Job, dt: float):
        super().__init__()
        self._law, self._job, self._dt = common.law(job), job, dt
        self._step = common.advance(job, dt)
        self._borders = []
        self.crossings: list[float] = []
        self.end = float("inf")  # time.perf_counter() at which to give up
        self._plant = self.DeclareVectorInputPort("plant_state", 4)
        if dt:
            self.DeclareDiscreteState(8)
            self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._advance)
        else:
            self.DeclareContinuousState(8)
            self.DeclareDiscreteState(1)
            event = UnrestrictedUpdateEvent(system_callback=self._pass)
            up = WitnessFunctionDirection.kNegativeThenNonNegative
            for edge in EDGES:
                gap = self._gap(edge)
                self._borders.append(
                    self.MakeWitnessFunction(f"border at {edge} m", up, gap, event)
                )
        self._now = self.DeclareCacheEntry(
            "law", ValueProducer(lambda: AbstractValue.Make(()), self._calc)
        )
        self.DeclareVectorOutputPort(
            "motors", 2, lambda context, out: out.SetFromVector(self.now(context)[8:10])
        )
        self.DeclareVectorOutputPort(
            "hand", 2, lambda context, out: out.SetFromVector(self.now(context)[10:12])
        )

    def now(self, context) -> tuple:
        """Everything common.law gives; computed once for a context's state."""
        return self._now.Eval(context)

    def _calc(self, context, value):
        if time.perf_counter() > self.end:
            raise TimeoutError(f"more than {common.WALL_LIMIT:g} s of wall time")
        if self._dt:
            c, b = context.get_discrete_state_vector().value(), None
        else:
            c = context.get_continuous_state_vector().CopyToVector()
            b = self._job.b[
                min(int(context.get_discrete_state_vector().value()[0]), len(self._job.b) - 1)
            ]
        value.set_value(self._law(*self._plant.Eval(context).tolist(), *c.tolist(), b))

    def DoCalcTimeDerivatives(self, context, derivatives):
        if self._dt:
            return
        _, _, ex, ey, _, _, rx, ry = context.get_continuous_state_vector().CopyToVector().tolist()
        _, _, _, _, fx, fy, ax, ay = self.now(context)[:8]
        Kx, Ky = self._job.K
        derivatives.SetFromVector(
            (ex, ey, Kx * fx - C_POLE * ex, Ky * fy - C_POLE * ey, rx, ry, ax, ay)
        )

    def _advance(self, context, state):
        c = context.get_discrete_state_vector().value().tolist()
        self._step(c, *self.now(context)[4:8])
        state.set_value(c)

    def _gap(self, edge: float):
        return lambda context: self.now(context)[0] - edge

    def _pass(self, system, context, event, state):
        self.crossings.append(context.get_time())
        region = context.get_discrete_state_vector().value()[0]
        state.get_mutable_discrete_state().set_value([region + 1.0])
        return EventStatus.Succeeded()

    def DoGetWitnessFunctions(self, context):
        region = int(context.get_discrete_state_vector().value()[0]) if self._borders else 0
        return self._borders[region : region + 1]


def _build(job: Job, dt: float):
    """(diagram, plant, controller)."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=dt))
    if (
        dt
    ):  # with sampled ports the plant steps before, not with, the discrete update of the controller
        plant.SetUseSampledOutputPorts(False)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    parent, frame = plant.world_frame(), np.zeros(3)
    for name, mass, inertia in (("shoulder", MASS1, IZZ1), ("elbow", MASS2, I2)):
        moments = RotationalInertia(inertia, inertia, inertia)
        body = plant.AddRigidBody(
            name + "_link", SpatialInertia.MakeFromCentralInertia(mass, np.zeros(3), moments)
        )
        at = plant.AddFrame(FixedOffsetFrame(name + "_at", parent, RigidTransform(frame)))
        joint = plant.AddJoint(RevoluteJoint(name, at, body.body_frame(), [0.0, 0.0, 1.0]))
        plant.AddJointActuator(name, joint)
        parent, frame = body.body_frame(), np.array([L1, 0.0, 0.0])
    plant.Finalize()
    controller = builder.AddSystem(Controller(job, dt))
    builder.Connect(plant.get_state_output_port(), controller.get_input_port())
    builder.Connect(controller.GetOutputPort("motors"), plant.get_actuation_input_port())
    builder.Connect(
        controller.GetOutputPort("hand"), plant.get_applied_generalized_force_input_port()
    )
    return builder.Build(), plant, controller


def solve(problem: str, method: str, setting: float) -> Result:
    """One run with accuracy `setting`, or with steps of `setting` for "discrete"."""
    job = Job.of(problem)
    dt = setting if method == "discrete" else 0.0
    diagram, plant, controller = _build(job, dt)
    simulator = Simulator(diagram)
    if not dt:
        config = SimulatorConfig(
            integration_scheme=method,
            max_step_size=MAX_STEP,
            accuracy=setting,
            use_error_control=True,
        )
        ApplySimulatorConfig(config, simulator)
    root = simulator.get_mutable_context()
    root.SetAccuracy(setting)  # to which the borders are isolated, in units of 10 ms
    plant.SetPositions(plant.GetMyMutableContextFromRoot(root), job.q)
    mine = controller.GetMyContextFromRoot(root)
    samples, note, last = [], "", EDGES[-1]

    def monitor(context):
        now = controller.now(mine)
        samples.append((context.get_time(), now[0], now[1], now[2], now[12]))
        if (now[0] >= last) if dt else (len(controller.crossings) == len(EDGES)):
            return EventStatus.ReachedTermination(diagram, "end of the path")
        return EventStatus.DidNothing()

    simulator.set_monitor(monitor)
    begin = time.perf_counter()
    controller.end = begin + common.WALL_LIMIT
    try:
        simulator.Initialize()
        simulator.AdvanceTo(job.t_max)
    except Exception as error:  # noqa: BLE001  a result, not a crash
        note = f"{type(error).__name__}: {error}"
    wall = time.perf_counter() - begin
    a = np.array(samples, float).reshape(-1, 5)
    crossings = common.linear(a[:, 0], a[:, 1]) if dt else controller.crossings
    if not note and len(crossings) < len(EDGES):
        note = "x < last edge at t_max"
    note = note or (common.blown_up(a[:, 1]) if dt else "")
    return Result(crossings, a[:, 0], a[:, 1:3], a[:, 4] * a[:, 3], a[:, 3], wall, note)
