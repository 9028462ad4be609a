"""URDF as ROS writes it, as text that MuJoCo loads.

Links keep their inertia and joints their limits and dynamics; geometry stays where no inertia is
stated, since MuJoCo computes it from there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from ..errors import ParameterError
from . import file_kinds, geometry
from .places import place_of

KEPT = ("mujoco", "link", "joint")  # children of <robot> that MuJoCo reads
ZERO = 1e-9  # [kg.m^2] moments of rounding
ROUNDING = 1e-6  # of moments: files have some six digits
POINT = 2e-14  # [kg.m^2] moments of a mass in a point: MuJoCo wants more than 1e-14
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
HELD = ("floating", "planar")


class Prepared(NamedTuple):
    """A URDF.

    Attributes:
        text: what MuJoCo loads.
        guessed: links whose inertia is computed from geometry.
        notes: what was changed, and what it says of reductions.
        armature: reflected inertia of rotors that transmissions state [kg.m^2], by joint.
        tensors: inertia that MuJoCo refuses, by link, in its frame [kg.m^2], shape (3, 3).
    """

    text: str
    guessed: tuple[str, ...]
    notes: tuple[str, ...]
    armature: dict[str, float]
    tensors: dict[str, np.ndarray]


def prepared(path: Path) -> Prepared:
    """The text of a URDF file that MuJoCo loads.

    Raises:
        ParameterError: it is no XML, or holds xacro that was not expanded, or no joints.
    """
    robot = file_kinds.tree(path)
    _refuse_xacro(path, robot)
    if robot.find("joint") is None:
        raise ParameterError("file", str(path), "must have joints: the file has none")
    notes, armature = _transmissions(robot)
    for element in [x for x in robot if x.tag not in KEPT]:
        robot.remove(element)
    notes = [*_undeclared(robot), *notes]
    static = _static(robot)
    tensors = _tensors(robot)
    guessed, absent = _drop_geometry(robot, static, path)
    odd = [name for name, (_, is_odd) in tensors.items() if is_odd]
    if odd:
        notes.append(f"inertia of no body (A + B < C), taken as the file has it: {', '.join(odd)}")
    notes = [*_joints(robot), *notes, *geometry.absent_words(absent)]
    text = ElementTree.tostring(robot, encoding="unicode")
    own = {name: tensor for name, (tensor, _) in tensors.items()}
    return Prepared(text, tuple(guessed), tuple(notes), armature, own)


def _refuse_xacro(path: Path, robot: Element) -> None:
    for element in robot.iter():
        unread = [x for x in element.attrib.values() if "${" in x or "$(" in x]
        if element.tag.startswith("xacro:") or unread:
            what = f"<{element.tag}>" if element.tag.startswith("xacro:") else unread[0]
            bound = f"holds xacro that was not expanded ({what}): {file_kinds.xacro_words(path)}"
            raise ParameterError("file", str(path), bound)


# ---- links ---------------------------------------------------------------------------------------


def _static(robot: Element) -> set[str]:
    """Links that no joint moves."""
    parents = {
        _name(joint.find("child"), "link"): joint
        for joint in robot.findall("joint")
        if joint.find("child") is not None
    }

    def moves(link: str) -> bool:
        seen = set[str]()
        while link in parents and link not in seen:
            seen.add(link)
            if parents[link].get("type") not in ("fixed", *HELD):
                return True
            link = _name(parents[link].find("parent"), "link")
        return False

    return {x for x in (_name(link) for link in robot.findall("link")) if not moves(x)}


def _name(element: Element | None, attribute: str = "name") -> str:
    return "" if element is None else element.get(attribute, "")


def _undeclared(robot: Element) -> Iterator[str]:
    """Declares links that joints name and the file does not have. Yields notes."""
    names = {_name(link) for link in robot.findall("link")}
    ends = [(x.find("parent"), x.find("child")) for x in robot.findall("joint")]
    lacking = {_name(end, "link") for pair in ends for end in pair if end is not None} - names
    for name in sorted(lacking):
        ElementTree.SubElement(robot, "link", name=name)
    if shown := ", ".join(sorted(lacking - {"world"})):
        yield f"links that joints name and the file does not have, taken as empty: {shown}"


def _drop_geometry(robot: Element, static: set[str], path: Path) -> tuple[list[str], list[str]]:
    """Drops geometry that gives no inertia; links that it gives it to, files that are not there."""
    guessed, dropped = [], list[str]()
    for link in robot.findall("link"):
        name = _name(link)
        if link.find("inertial") is not None or name in static:
            for element in link.findall("visual") + link.findall("collision"):
                dropped += [x.get("filename", "") for x in element.iter("mesh")]
                link.remove(element)
        elif link.find("collision") is not None:
            guessed.append(name)
    absent = [x for x in dict.fromkeys(dropped) if x and place_of(x, path, path.parent) is None]
    return guessed, [x.rpartition("/")[2] for x in absent]


def _tensors(robot: Element) -> dict[str, tuple[np.ndarray, bool]]:
    """Inertia that MuJoCo refuses, by link, with a sphere's in its place; whether it is no body's.

    Links of mass 0 may have inertia, and masses in a point have none: both are bodies.
    """
    out = dict[str, tuple[np.ndarray, bool]]()
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is not None and inertial.find("mass") is None:
            link.remove(inertial)
        elif inertial is not None and (tensor := _refused_tensor(inertial)) is not None:
            turn, (least, middle, most) = _turn(inertial), np.linalg.eigvalsh(tensor)
            is_odd = least < -ROUNDING * most or least + middle < (1.0 - ROUNDING) * most
            out[_name(link)] = turn @ tensor @ turn.T, bool(is_odd and most > ZERO)
    return out


def _refused_tensor(inertial: Element) -> np.ndarray | None:
    """The tensor of an inertia if MuJoCo refuses it, which then is a sphere's in the element."""
    inertia = inertial.find("inertia")
    if inertia is None:
        inertia = ElementTree.SubElement(inertial, "inertia")
    try:
        xx, yy, zz, xy, xz, yz = (float(inertia.get(name, 0.0)) for name in MOMENTS)
    except ValueError:  # MuJoCo says which
        return None
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not np.isfinite(tensor).all():
        return None
    least, middle, most = np.linalg.eigvalsh(tensor).tolist()
    if (least >= POINT and least + middle >= most) or most < -ZERO:
        return None
    for name in MOMENTS:
        inertia.set(name, repr(max(most, POINT)) if name[1] == name[2] else "0")
    return tensor


def _turn(inertial: Element) -> np.ndarray:
    """Rotation from the frame of an inertia to that of its link, shape (3, 3)."""
    origin = inertial.find("origin")
    words = "0 0 0" if origin is None else origin.get("rpy", "0 0 0")
    roll, pitch, yaw = (float(x) for x in words.split())
    (a, b), (c, d), (e, f) = ((math.cos(x), math.sin(x)) for x in (roll, pitch, yaw))
    x = np.array([[1, 0, 0], [0, a, -b], [0, b, a]])
    y = np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]])
    z = np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]])
    return z @ y @ x


# ---- joints --------------------------------------------------------------------------------------


def _joints(robot: Element) -> Iterator[str]:
    """Fixes joints that a controller does not turn, drops limits that are none. Yields notes."""
    names = {_name(joint) for joint in robot.findall("joint")}
    held, crossed = [], []
    for joint in robot.findall("joint"):
        if joint.get("type") in HELD:
            held.append(f"{_name(joint)} ({joint.get('type')})")
            joint.set("type", "fixed")
        limit, mimic = joint.find("limit"), joint.find("mimic")
        if limit is not None and _crossed(limit):
            crossed.append(_name(joint))
            for end in ("lower", "upper"):
                limit.attrib.pop(end, None)
        if mimic is not None and mimic.get("joint") not in names:
            yield f"{_name(joint)} follows {mimic.get('joint')}, which the file does not have"
        elif mimic is not None and joint.get("type") == "fixed":
            joint.remove(mimic)
    if held:
        yield f"held where it is: {', '.join(held)}"
    if crossed:
        yield f"limits whose lower end is above the upper take no part: {', '.join(crossed)}"


def _crossed(limit: Element) -> bool:
    try:
        return float(limit.get("lower", 0.0)) > float(limit.get("upper", 0.0))
    except ValueError:
        return False


# ---- transmissions -------------------------------------------------------------------------------


def _transmissions(robot: Element) -> tuple[list[str], dict[str, float]]:
    """A note on reductions; reflected inertia of rotors, where both are stated."""
    reductions, armature = dict[str, float](), dict[str, float]()
    for transmission in robot.findall("transmission"):
        joint = _name(transmission.find("joint"))
        ratio = _number(transmission, "mechanicalReduction", "gear_ratio")
        rotor = _number(transmission, "rotor_inertia", "rotorInertia")
        if not joint:
            continue
        if abs(ratio) not in (0.0, 1.0) and math.isfinite(ratio):
            reductions[joint] = ratio
        if rotor > 0.0:
            armature[joint] = rotor * (ratio if math.isfinite(ratio) and ratio else 1.0) ** 2
    shown = ", ".join(f"{joint} {ratio:g}" for joint, ratio in reductions.items())
    note = (
        f"reductions of transmissions: {shown}; armature is the rotor's inertia times their square"
    )
    return [note] if shown and not armature else [], armature


def _number(element: Element, *names: str) -> float:
    """The number of the first descendant of one of these names, without prefix; NaN for none."""
    for x in element.iter():
        if re.sub(r"^.*:", "", x.tag) in names:
            try:
                return float(x.get("value", x.text or ""))
            except ValueError:
                continue
    return math.nan
