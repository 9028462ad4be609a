"""The user's own controller as a C function that compiled steps call."""

from __future__ import annotations

import contextlib
import ctypes
import dis
import functools
import math
import re
import sys
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import types
from numba.extending import overload, register_jitable

from ..model.sampled_controller import BUFFER, TORQUE, LawCaller
from .parts import Parts

CALL = ctypes.CFUNCTYPE(None, ctypes.c_size_t)
LET: set[Any] = set()  # functions that compiled code may call


def called(parts: Parts) -> Parts:
    """The parts for compiled steps, with the user's own law as a C function.

    Args:
        parts: a scene.
    """
    if parts.sampler is None or parts.sampler.own is None:
        return parts
    own = parts.sampler.own
    law = c_function(own.law)
    own = own._replace(law=law, buffer=own.buffer.ctypes.data)
    return parts._replace(sampler=parts.sampler._replace(own=own))


def c_function(caller: LawCaller) -> Any:
    """The law of a controller, compiled if possible, else run by Python at each call.

    Args:
        caller: of the law.
    """
    if caller.called is None:
        controller = caller.controller
        n, m = len(controller.state), len(controller.params)
        compiled = _compile_law(caller.law, n, m, _outside(caller.law))
        if compiled is None:
            caller.called = caller.pointer = CALL(caller)  # lives as long as its run
        else:
            caller.called = CALL(compiled.address)
    return caller.called


@functools.lru_cache(maxsize=64)
def _compile_law(law: Any, n: int, m: int, outside: tuple[Any, ...]) -> Any:
    """A C function that reads the buffer, calls the law and writes what it returns.

    None if numba cannot compile it; a line reports this. Variables `outside` of the law are
    frozen when it is compiled.
    """
    names = [f"buffer[{j}]" for j in range(BUFFER + 2 * n + m)]
    state, after, params = (
        names[BUFFER : BUFFER + n],
        names[BUFFER + n :][:n],
        names[BUFFER + 2 * n :],
    )
    returned = [f"{x} = state[{j}]" for j, x in enumerate(after)]
    lines = [
        f"buffer = carray(pointer, {len(names)})",
        f"buffer[{TORQUE}] = buffer[{TORQUE + 1}] = nan",  # what a law that raises leaves behind
        "try:",
        " torque, state = law(buffer[0], (buffer[1], buffer[2]), (buffer[3], buffer[4]), "
        f"(buffer[5], buffer[6]), {_tuple_of(state)}, {_tuple_of(params)})",
        f" assert_length(state, {n})",
        f" buffer[{TORQUE}], buffer[{TORQUE + 1}] = torque",
        *(f" {x}" for x in returned),
        "except Exception:",
        " pass",
    ]
    options: Any = {"error_model": "numpy"}
    try:
        _let_call(law)
        if changed := _changed_outside(law):
            raise TypeError(f"it changes {changed}, a variable outside of it")
        scope: dict[str, Any] = {
            "carray": numba.carray,
            "nan": math.nan,
            "law": law if hasattr(law, "py_func") else numba.njit(**options)(law),
            "assert_length": _assert_length,
        }
        exec("def call(pointer):\n    " + "\n    ".join(lines), scope)  # tuples of fixed length
        kind = types.void(types.CPointer(types.float64))
        return numba.cfunc(kind, **options)(scope["call"])
    except Exception as error:  # of the law, or of numba
        said = re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines()  # without colour codes
        said = [x.strip() for x in said if x.strip()]
        reason = next((x for x in said if not x.startswith("Failed in nopython mode")), "no reason")
        name = getattr(law, "__qualname__", repr(law))
        print(f"hapticclay: Python runs the controller {name}: {reason}", file=sys.stderr)
        return None


def _outside(law: Any) -> tuple[Any, ...]:
    """Values of the numbers, words and arrays that a law uses from outside itself."""
    function = getattr(law, "py_func", law)
    code, scope = getattr(function, "__code__", None), getattr(function, "__globals__", {})
    if code is None:
        return ()
    found = [scope.get(x) for x in code.co_names]
    with contextlib.suppress(ValueError):  # a variable that has no value yet
        found += [cell.cell_contents for cell in function.__closure__ or ()]
    arrays = [(x.dtype.str, x.shape, x.tobytes()) for x in found if isinstance(x, np.ndarray)]
    return *(repr(x) for x in found if isinstance(x, int | float | str | tuple)), *arrays


def _changed_outside(law: Any) -> str:
    """The first variable of a function around it that a law changes; "" for none."""
    code = getattr(getattr(law, "py_func", law), "__code__", None)
    free = code.co_freevars if code else ()
    steps = dis.get_instructions(code) if free and code else ()
    return next((x.argval for x in steps if x.opname == "STORE_DEREF" and x.argval in free), "")


def _let_call(law: Any) -> None:
    """Lets compiled code call the plain functions that a law uses, as Python does."""
    code, scope = getattr(law, "__code__", None), getattr(law, "__globals__", {})
    for name in code.co_names if code else ():
        found = scope.get(name)
        ours = getattr(found, "__module__", "").startswith("hapticclay.")  # registered above
        if not isinstance(found, FunctionType) or ours or found in LET:
            continue
        if not _changed_outside(found):
            LET.add(found)
            register_jitable(error_model="numpy")(found)
            _let_call(found)


def _tuple_of(names: list[str]) -> str:
    """Source of a tuple; a display of more than 30 items would be a list, which numba refuses."""
    parts = (names[i : i + 16] for i in range(0, len(names), 16))
    return " + ".join(f"({', '.join(part)},)" for part in parts) or "()"


def _assert_length(state, n):
    raise NotImplementedError


@overload(_assert_length)
def _typed_length(state, n):
    if not isinstance(state, types.BaseTuple) or not isinstance(n, types.IntegerLiteral):
        raise numba.core.errors.TypingError("state must be a tuple")
    if len(state) != n.literal_value:
        raise numba.core.errors.TypingError(
            f"state must have {n.literal_value} numbers, not {len(state)}"
        )
    return lambda state, n: None
