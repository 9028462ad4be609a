"""The engine that moves the arm, as the kernel calls it: from CPython, and by address."""

from __future__ import annotations

import ctypes
import functools
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from ..errors import ParameterError
from ..scene.scenario import Scenario
from . import dynamics, engine, layout, records
from .engine import mujoco

CALLS = {  # fields of Engine, and functions of the engine
    "kinematics": "mj_kinematics",
    "com_pos": "mj_comPos",
    "inertia": "mj_crb",  # all of mj_makeM where no tendon has a mass
    "factor": "mj_factorM",
    "transmission": "mj_transmission",
    "com_vel": "mj_comVel",
    "bias": "mj_rne",
    "at_velocity": "mj_fwdVelocity",
    "actuation": "mj_fwdActuation",
    "acceleration": "mj_fwdAcceleration",
    "integrate": "mj_implicit",
}
ARRAYS = {  # fields of Engine, and arrays of the engine's data
    "q": "qpos",
    "w": "qvel",
    "ctrl": "ctrl",
    "applied": "qfrc_applied",
    "M": "M",
    "forces": "qfrc_bias",
}
_asking = threading.Lock()
_asked: dict[int, tuple[int, int]] = {}  # addresses, by the thread that asks for them


@functools.cache
def library() -> ctypes.CDLL:
    """The engine's library, which the package mujoco has loaded."""
    folder = Path(mujoco.__file__).parent
    (file,) = (x for x in folder.glob("*mujoco.*") if x.name.startswith(("lib", "mujoco.dll")))
    return ctypes.CDLL(str(file))


def address(name: str) -> int:
    """Address of a function of the engine."""
    found = ctypes.cast(getattr(library(), name), ctypes.c_void_p).value
    assert found is not None
    return found


@ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
def _note(model: int, data: int) -> None:
    """Notes the addresses with which the engine calls it, for the thread that asks for them.

    Other threads may step meanwhile, and call it too.
    """
    if threading.get_ident() in _asked:
        _asked[threading.get_ident()] = model, data


def addresses_of(model: Any, data: Any) -> tuple[int, int]:
    """Addresses of a model and its data: the engine passes them to a callback."""
    me = threading.get_ident()
    with _asking:
        before = mujoco.get_mjcb_passive()
        _asked[me] = 0, 0
        mujoco.set_mjcb_passive(_note)
        try:
            mujoco.mj_passive(model, data)
        finally:
            mujoco.set_mjcb_passive(before)
        found = _asked.pop(me)
        assert all(found)
        return found


def check_pieces(model: Any) -> None:
    """Checks that the pieces of a step give the bits of the engine's own, in any release of it.

    Raises:
        RuntimeError: they do not.
    """
    whole, parts = mujoco.MjData(model), mujoco.MjData(model)
    for data in (whole, parts):
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = (1.9, -1.7), (0.4, -0.9), (0.3, -0.2)
        data.ctrl[:] = 0.6
    calls = {name: getattr(mujoco, function) for name, function in CALLS.items()}
    dynamics.step(SimpleNamespace(model=model, data=parts, **calls))
    mujoco.mj_step(model, whole)
    after = [np.concatenate((x.qpos, x.qvel)).tobytes() for x in (whole, parts)]
    if after[0] != after[1]:
        bound = "steps an arm otherwise than by the pieces that are known: install mujoco 4.0"
        raise RuntimeError(f"mujoco {mujoco.__version__} {bound}")


_checked: set[int] = set()


class Mover:
    """An arm of the engine: its model and data, and the records by which rows call it.

    Attributes:
        calls_python: whether steps call functions of Python.
    """

    calls: ClassVar = CALLS

    def __init__(self, scenario: Scenario):
        self.calls_python = False
        self.model = self.build(scenario)
        self.data = mujoco.MjData(self.model)
        self.out = np.zeros(2)
        self.places: dict[str, np.ndarray] = {
            name: getattr(self.data, of).reshape(-1) for name, of in ARRAYS.items()
        }
        self.places["timestep"] = engine.timestep_view(self.model)
        self.places["ranges"] = self.model.actuator_ctrlrange.reshape(-1)
        self.places["out"] = self.out
        self._plain: Any = None
        self._row: Any = None

    def build(self, scenario: Scenario) -> Any:
        """The engine's model."""
        model = engine.build(scenario)
        if model.nu not in _checked:  # with the dampers of clay, and without
            check_pieces(model)
            _checked.add(model.nu)
        return model

    @property
    def plain(self) -> Any:
        """The record for CPython."""
        if self._plain is None:
            self._plain = records.Engine()
            self.fill_plain(self._plain)
        return self._plain

    def fill_plain(self, made: Any) -> None:
        """Fills the record for CPython."""
        for name, function in self.calls.items():
            setattr(made, name, getattr(mujoco, function))
        made.bias = bias
        made.model, made.data = self.model, self.data
        for name, array in self.places.items():
            setattr(made, name, memoryview(array))  # pyright: ignore[reportArgumentType]

    @property
    def row(self) -> np.ndarray:
        """The record for compiled code, shape (1,)."""
        if self._row is None:
            self._row = np.zeros(1, layout.dtype_of(records.Engine))
            self.fill_row(self._row)
        return self._row

    def fill_row(self, made: Any) -> None:
        """Fills the record for compiled code."""
        for name, function in self.calls.items():
            made[name] = address(function)
        made["model"], made["data"] = addresses_of(self.model, self.data)
        for name, array in self.places.items():
            made[name] = array.ctypes.data

    def failures(self) -> list[BaseException]:
        """Ctrl-C and its like that functions of Python have raised in steps."""
        return []

    def forgive(self) -> None:
        """Begins anew after them."""

    def rest(self, scenario: Scenario) -> None:
        """Puts the engine to a scenario, at rest."""
        engine.rotate_dampers(self.model, scenario)
        mujoco.mj_resetData(self.model, self.data)


def refuse_callbacks() -> None:
    """Refuses a control callback of the engine, which would interfere."""
    if mujoco.get_mjcb_control() is not None:
        bound = "the engine must be free of control callbacks"
        raise ParameterError("mjcb_control", mujoco.get_mjcb_control(), bound)


def bias(model: Any, data: Any, accelerated: int, _: Any) -> None:
    """mj_rne, into data.qfrc_bias."""
    mujoco.mj_rne(model, data, accelerated, data.qfrc_bias)
