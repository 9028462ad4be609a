"""Drake: a MultibodyPlant under a Simulator moves an arm from a file under held torques.

"discrete": the plant steps by itself. "runge_kutta3": a continuous plant, fixed steps.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

import hapticclay as hc

NAME = "Drake"
# it names what it does not read: torque limits, joint friction and sites, which take no part
logging.getLogger("drake").setLevel(logging.ERROR)
CASES = (
    *(("discrete", n) for n in (1, 4, 16, 64)),
    *(("runge_kutta3", n) for n in (1, 4)),
)


class DrakeArm:
    """A serial arm; its armature enters by a rotor of gear ratio 1 at each joint.

    Args:
        file: MJCF file.
        method: of `CASES`.
        Ts: control sample [s].
        substeps: steps in it.
    """

    def __init__(self, file: Path, method: str, Ts: float, substeps: int):
        self.step, self.substeps, self.steps = Ts / substeps, substeps, 0
        self.plant = MultibodyPlant(time_step=self.step if method == "discrete" else 0.0)
        Parser(self.plant).AddModels(str(file))
        arm = hc.MjcfArm(file)
        for name, armature in zip(arm.names, arm.armature, strict=True):
            drive = self.plant.AddJointActuator(name, self.plant.GetJointByName(name))
            drive.set_default_rotor_inertia(armature)
            drive.set_default_gear_ratio(1.0)
        self.plant.Finalize()
        self.simulator = Simulator(self.plant)
        if method != "discrete":
            config = SimulatorConfig(
                integration_scheme=method, max_step_size=self.step, use_error_control=False
            )
            ApplySimulatorConfig(config, self.simulator)
        self.context = self.simulator.get_mutable_context()
        self.port = self.plant.get_applied_generalized_force_input_port()

    def start(self, q: np.ndarray) -> None:
        """At rest at positions q."""
        self.context.SetTime(0.0)
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, np.zeros(len(q)))
        self.port.FixValue(self.context, np.zeros(len(q)))
        self.simulator.Initialize()
        self.steps = 0

    @property
    def q(self) -> np.ndarray:
        """Positions of the joints [rad]."""
        return self.plant.GetPositions(self.context)

    def weight(self) -> np.ndarray:
        """Torques against the arm's weight [N.m]."""
        return -self.plant.CalcGravityGeneralizedForces(self.context)

    def hold(self, torque: np.ndarray, samples: int = 1) -> None:
        """Goes on for control samples under a torque."""
        self.port.FixValue(self.context, torque)
        self.steps += samples * self.substeps
        self.simulator.AdvanceTo(self.steps * self.step)

    def mass_matrix(self) -> np.ndarray:
        """M(q) [kg.m^2], armature included."""
        return self.plant.CalcMassMatrix(self.context)


make = DrakeArm
