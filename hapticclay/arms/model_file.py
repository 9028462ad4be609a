"""From a file, or a spec, to a compiled model: what is read, what of it is left out, and warnings.

Nothing of a file is run. Of its geometry only that stays from which inertia is computed.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..display import one_line
from ..errors import ParameterError, choice
from . import content, file_kinds, geometry, includes, model_text, urdf_text
from .joint_names import name_joints

UNNAMED = "MuJoCo Model"  # MuJoCo's name of a model without one
MOST_OF_FAULT = 300  # characters of what MuJoCo says
LEAST = 2e-15  # [kg, kg.m^2] of links without any: MuJoCo wants more than 1e-15 of what moves


class Opened(NamedTuple):
    """A model from a file.

    Attributes:
        spec: of it, without geometry that is of no use.
        model: compiled.
        name: of the model.
        notes: what was left out, and what MuJoCo warned of.
        guessed: links whose inertia the file does not state.
        lacking: links whose inertia comes from a mesh that is not there, and its file.
        tensors: inertia that MuJoCo refuses, by link, in its frame [kg.m^2], shape (3, 3).
    """

    spec: Any
    model: Any
    name: str
    notes: tuple[str, ...]
    guessed: tuple[str, ...] = ()
    lacking: Mapping[str, str] = {}
    tensors: Mapping[str, np.ndarray] = {}

    def finish(self, model: Any) -> None:
        """Gives links of a compiled model the inertia that MuJoCo refuses to read."""
        from ..physics import mujoco

        bodies = {model.body(i).name: i for i in range(model.nbody)}
        for link in self.tensors.keys() & bodies.keys():
            moments, axes = np.linalg.eigh(self.tensors[link])
            axes[:, 0] *= np.linalg.det(axes)  # a rotation
            body = bodies[link]
            model.body_inertia[body] = moments
            mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
            model.body_simple[body] = 0  # its axes may be those of no joint
            model.body_sameframe[body] = 0


def opened(file: Any) -> Opened:
    """Reads and compiles a file, the name of an arm of the package, or a spec.

    Raises:
        ParameterError: it is not there, or no model; the message says what to do.
    """
    from ..physics import warnings_caught

    with warnings_caught() as caught, warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        try:
            read = _read(file)
            model, more = compiled(read.spec)
        except (ValueError, RuntimeError, MemoryError) as error:
            if isinstance(error, ParameterError):
                raise
            raise bad_file(file, one_line(error, MOST_OF_FAULT)) from None
    content.check_numbers(model, lambda why: bad_file(file, why))
    told = [one_line(x, MOST_OF_FAULT) for x in (*caught, *(w.message for w in shown))]
    heard = [f"MuJoCo warns: {x}" for x in dict.fromkeys(told) if not _is_of_saving(x)]
    read.finish(model)
    return read._replace(model=model, notes=(*read.notes, *more, *heard))


def spec_of(file: Any) -> tuple[Any, str]:
    """The spec of a file, or a copy of a spec, and the name of its model.

    Raises:
        ParameterError: as `opened`.
    """
    read = _read(file)
    return read.spec, read.name


def kept(file: Any) -> Any:
    """A path as text, which files can hold; of a spec, which its owner may change, a copy."""
    if isinstance(file, os.PathLike):
        return os.fspath(file)
    return file if isinstance(file, str) else file.copy()


def bad_file(file: Any, why: str) -> ParameterError:
    shown = str(file) if isinstance(file, str | os.PathLike) else "MjSpec"
    return ParameterError("file", shown, f"must be a file that MuJoCo loads ({why})")


def _read(file: Any) -> Opened:
    """A file that is not compiled yet."""
    from ..physics import mujoco

    if isinstance(file, mujoco.MjSpec):
        spec, name = file.copy(), file.modelname
        name_joints(spec)
        notes, lacking = geometry.drop(spec, None)
        return Opened(spec, None, name, notes, lacking=lacking)
    path, more = _path(file), dict[str, Any]()
    if file_kinds.is_urdf(path):
        text, guessed, notes, armature, tensors = urdf_text.prepared(path)
        spec = mujoco.MjSpec.from_string(text)
        for joint in spec.joints:
            joint.armature = armature.get(joint.name, joint.armature)
        more = {"guessed": guessed, "tensors": tensors}
    else:
        model_text.check(path)
        spec, notes = includes.spec_of(path)
    spec.compiler.fusestatic = False  # a URDF's tool keeps its name
    name = spec.modelname if spec.modelname != UNNAMED else path.stem
    name_joints(spec)
    absent, lacking = geometry.drop(spec, path)
    return Opened(spec, None, name, (*notes, *absent), lacking=lacking, **more)


def compiled(spec: Any) -> tuple[Any, list[str]]:
    """The model of a spec, and notes on inertia that is of no body.

    Raises:
        ValueError: MuJoCo refuses it.
    """
    notes: list[str] = []
    for _ in range(3):
        try:
            return spec.compile(), notes
        except ValueError as error:
            fault, compiler = str(error), spec.compiler
            if "mjMINVAL" in fault and not compiler.boundmass >= LEAST:
                compiler.boundmass = LEAST
                compiler.boundinertia = max(compiler.boundinertia, LEAST)
            elif "A + B >= C" in fault and not compiler.balanceinertia:
                compiler.balanceinertia = True
                notes = ["inertia of no body (A + B < C): the mean of its three moments is taken"]
            else:
                _refuse_mesh(spec, fault)
                raise
    raise AssertionError


def _refuse_mesh(spec: Any, fault: str) -> None:
    """Refuses a mesh that MuJoCo cannot take, with the link whose inertia comes from it."""
    named = re.search(r"Element name '([^']+)'", fault)
    for mesh in [x for x in spec.meshes if named and x.name == named[1]]:
        geom = next(x for x in spec.geoms if x.meshname == mesh.name)
        link = geom.parent.name or "a body"
        what = one_line(fault.removeprefix("Error: ").partition("Element name")[0], MOST_OF_FAULT)
        bound = (
            f"must be one that MuJoCo reads ({what.strip()}): the inertia of {link} comes from it; "
            f"or state <inertial> for {link}"
        )
        raise ParameterError("mesh", mesh.file, bound)


def _is_of_saving(text: str) -> bool:
    return "from being saved correctly" in text


def _path(file: Any) -> Path:
    """The path of a file, or of an arm of the package by its name."""
    from ..physics import mjcf_folder

    if not isinstance(file, str | os.PathLike):
        raise ParameterError("file", file, "must be an MJCF or URDF file, or an mujoco.MjSpec")
    path = Path(file)
    is_name = isinstance(file, str) and not path.suffix and os.sep not in file
    if is_name and not os.path.lexists(path):  # one of the package's
        own = {x.stem: x for x in sorted((mjcf_folder() / "arms").glob("*.xml"))}
        path = own[choice("file", file, tuple(own))]
    if not os.path.isfile(path):
        bound = f"must be an MJCF or URDF file ({_lacks(path)})"
        raise ParameterError("file", str(path), bound)
    return path


def _lacks(path: Path) -> str:
    """Why a path is no file."""
    if str(path).lstrip().startswith("<"):
        return "this is a model's text: give mujoco.MjSpec.from_string of it"
    return "this is a folder" if os.path.isdir(path) else "there is none"
