"""Geometry of a spec that is of no use: an arm needs inertia, and most files state it."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..display import names_words
from .places import place_of

READ = (".stl", ".obj", ".msh")  # endings of meshes that MuJoCo reads


def drop(spec: Any, path: Path | None) -> tuple[tuple[str, ...], dict[str, str]]:
    """Deletes meshes, height fields and pictures of a spec, but for those that give inertia.

    Args:
        spec: changed.
        path: its file; None for none.

    Returns:
        Notes on what is not there; links whose inertia comes from a mesh that is not there, and
        its file.
    """
    meshes = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes}
    places = {name: _place(mesh, spec, path) for name, mesh in meshes.items() if mesh.file}
    gone, lacking = {name for name, place in places.items() if place is None}, dict[str, str]()
    for body, moves in _bodies(spec):
        dropped = []
        for geom in [g for g in body.geoms if g.meshname or g.hfieldname]:
            gives = moves or spec.compiler.settotalmass > 0.0
            gives = gives and geom.meshname in meshes and _gives_inertia(body, geom)
            if not gives or geom.meshname in gone:
                dropped.append(geom)
            if gives and geom in dropped:
                body.name = body.name or _free_name(spec, "unnamed body")
                lacking[body.name] = meshes[geom.meshname].file
        delete(spec, body, dropped + [g for g in body.geoms if _is_flat(g)])
    absent = [Path(meshes[x].file.replace("\\", "/")).name for x in places if x in gone]
    for name, place in places.items():
        if place is not None:
            meshes[name].file = str(place)
    absent += _drop_pictures(spec, path)
    used = {g.meshname for g in spec.geoms} | {g.hfieldname for g in spec.geoms}
    for mesh in [*spec.meshes, *spec.hfields]:
        if (mesh.name or Path(mesh.file).stem) not in used:
            spec.delete(mesh)
    return tuple(absent_words(absent)), lacking


def delete(spec: Any, body: Any, elements: list[Any]) -> None:
    """Deletes elements of a body with all that refers to them, as MuJoCo does with a frame's."""
    if elements:
        frame = body.add_frame()
        for element in elements:
            element.set_frame(frame)
        spec.delete(frame)


def _bodies(spec: Any) -> Iterator[tuple[Any, bool]]:
    """Bodies, and whether joints move them."""
    rest = [(spec.worldbody, False)]
    while rest:
        body, moves = rest.pop()
        yield body, moves
        rest += [(x, moves or bool(x.joints)) for x in body.bodies]


def _gives_inertia(body: Any, geom: Any) -> bool:
    """Whether the inertia of a body is computed from a geom."""
    from ..physics import mujoco

    compiler = body.compiler
    by_geoms = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if body.explicitinertial and compiler.inertiafromgeom != by_geoms:
        return False
    low, high = compiler.inertiagrouprange
    return low <= geom.group <= high and geom.mass != 0.0 and geom.density != 0.0


def _is_flat(geom: Any) -> bool:
    """Whether a geom has no volume, nor a mass of its own; MuJoCo refuses it."""
    from ..physics import mujoco

    kinds = mujoco.mjtGeom
    sizes = {kinds.mjGEOM_SPHERE: 1, kinds.mjGEOM_ELLIPSOID: 3, kinds.mjGEOM_BOX: 3}
    ends = 2 if np.isnan(geom.fromto[0]) else 1  # sizes of what lies between two points
    sizes |= {kinds.mjGEOM_CAPSULE: ends, kinds.mjGEOM_CYLINDER: ends}
    count = 0 if geom.mass > 0.0 else sizes.get(geom.type, 0)
    return any(x == 0.0 for x in geom.size[:count])


def _free_name(spec: Any, name: str) -> str:
    """A name that no body has."""
    taken = {body.name for body in spec.bodies}
    numbers = (f"{name} {i}" for i in itertools.count(2))
    return next(x for x in itertools.chain([name], numbers) if x not in taken)


def _place(mesh: Any, spec: Any, path: Path | None) -> Path | None:
    """The file of a mesh; None if it is not there, or none that MuJoCo reads."""
    if mesh is None or not mesh.file or Path(mesh.file).suffix.lower() not in READ:
        return None
    return _found(mesh.file, mesh.compiler.meshdir, spec, path)


def _found(file: str, folder: str, spec: Any, path: Path | None) -> Path | None:
    """A file that a spec names, in its folder of such files or elsewhere."""
    start = Path(spec.modelfiledir or (path.parent if path else "."))
    name = os.path.basename(file) if spec.strippath else file
    if spec.assets and {name, file, os.path.join(folder or "", name)} & spec.assets.keys():
        return Path(file)  # in memory
    return place_of(name, path or start / "model.xml", start / (folder or ""), start)


def _drop_pictures(spec: Any, path: Path | None) -> list[str]:
    """Deletes textures, materials and skins; names of files that are not there."""
    absent = [
        Path(x.file).name
        for x in spec.textures
        if x.file and _found(x.file, x.compiler.texturedir, spec, path) is None
    ]
    for element in [*spec.geoms, *spec.sites, *spec.tendons]:
        element.material = ""
    for element in [*spec.skins, *spec.materials, *spec.textures]:
        spec.delete(element)
    return absent


def absent_words(absent: list[str]) -> Iterator[str]:
    """A sentence about files that are not there."""
    names = list(dict.fromkeys(absent))
    if names:
        yield f"not there, and take no part: {names_words(names)}"
