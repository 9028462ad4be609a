"""The engine that moves an arm from a file, as the kernel calls it."""

from __future__ import annotations

import ctypes
from typing import Any, ClassVar

import numpy as np

from ..physics import mujoco
from ..scene.scenario import Scenario
from . import joint_scene, mover
from .mover import Mover, address, addresses_of

CALLS = mover.CALLS | {
    "inertia": "mj_makeM",
    "full": "mj_fullM",
    "move": "mj_step2",
    "jacobian_rate": "mj_jacDot",
}
CALLED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
JACOBIANS = {"site": "mj_jacSite", "body": "mj_jacBody"}


class JointMover(Mover):
    """An arm of the engine: models and data for the pose of a run, and for poses that are tried."""

    calls: ClassVar = CALLS

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        arm: Any = scenario.file_arm
        mechanism = arm.mechanism
        self.home = mechanism.pose
        self.kind, self.site = mechanism.site
        model, self.scratch = self.model, mujoco.MjData(self.model)
        self.body = int(model.site_bodyid[self.site]) if self.kind == "site" else self.site
        place = "site_xpos" if self.kind == "site" else "xpos"
        self.places |= joint_scene.scratch(len(arm.names), model.nv)
        self.places["handle"] = getattr(self.data, place)[self.site]
        self.places["scratch_handle"] = getattr(self.scratch, place)[self.site]
        self.places["scratch_q"] = self.scratch.qpos
        self.pivots = np.zeros(len(arm.names), dtype=np.int64)
        self.computed: Any = (None, None, None)
        self.terms: Any = None
        if mechanism.is_computed:
            self.compute(scenario)

    def compute(self, scenario: Scenario) -> None:
        """Functions that compute the terms of a closed chain, or of laws that are not linear."""
        from .computed_terms import ComputedTerms  # imported only for one

        terms = ComputedTerms(scenario, self.places)
        self.places["handle"], self.places["scratch_handle"] = terms.handle, terms.scratch_handle
        self.computed = terms.at_pose, terms.at_rates, terms.at_scratch
        self.terms, self.calls_python = terms, True

    def build(self, scenario: Scenario) -> Any:
        return scenario.file_arm.mechanism.runnable()

    def fill_plain(self, made: Any) -> None:
        super().fill_plain(made)
        model = self.model
        made.scratch, made.site, made.body = self.scratch, self.site, self.body
        made.freedoms = model.nv
        made.pivots = memoryview(self.pivots)  # pyright: ignore[reportArgumentType]
        whole = self.places["M"].reshape(model.nv, model.nv)
        J, Jdot = (self.places[name].reshape(3, model.nv) for name in ("J", "Jdot"))
        of = getattr(mujoco, JACOBIANS[self.kind])

        def bias(model: Any, data: Any, accelerated: int, out: Any) -> None:
            at = data.qfrc_bias if data is self.data else self.places["scratch_forces"]
            mujoco.mj_rne(model, data, accelerated, at)

        def jacobian(model: Any, data: Any, out: Any, none: Any, site: int) -> None:
            of(model, data, J, None, site)

        def jacobian_rate(model: Any, data: Any, out: Any, none: Any, at: Any, body: int) -> None:
            mujoco.mj_jacDot(model, data, Jdot, None, self.places["handle"], body)

        made.bias, made.jacobian, made.jacobian_rate = bias, jacobian, jacobian_rate
        made.full = lambda model, data, out: mujoco.mj_fullM(model, data, whole)
        made.at_pose, made.at_rates, made.at_scratch = self.computed

    def fill_row(self, made: Any) -> None:
        super().fill_row(made)
        made["jacobian"] = address(JACOBIANS[self.kind])
        made["scratch"] = addresses_of(self.model, self.scratch)[1]
        made["site"], made["body"], made["freedoms"] = self.site, self.body, self.model.nv
        made["pivots"] = self.pivots.ctypes.data
        self.called = [CALLED(x) for x in self.computed if x is not None]
        for name, x in zip(("at_pose", "at_rates", "at_scratch"), self.called, strict=False):
            made[name] = ctypes.cast(x, ctypes.c_void_p).value

    def rest(self, scenario: Scenario) -> None:
        for data in (self.data, self.scratch):
            mujoco.mj_resetData(self.model, data)
            data.qpos[:] = self.home
        self.forgive()

    def failures(self) -> list[BaseException]:
        if self.terms is None:
            return []
        self.terms.note_dropped()
        return self.terms.failed

    def forgive(self) -> None:
        if self.terms is not None:
            self.terms.forgive()
