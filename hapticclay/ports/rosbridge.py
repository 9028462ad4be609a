"""Messages of rosbridge v2, JSON over a WebSocket, without sockets, and the ROS messages in them.

Every input is read into an `Operation`; its `error` says why it cannot be used, such as an id that
is too long to be kept. Type names of both ROS 1 and ROS 2 are accepted, and stamps have the fields
of both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .commands import (
    AXES,
    FORCE,
    LONGEST_TEXT,
    NOTHING,
    POSITION,
    TORQUE,
    Command,
    Joints,
    Vector,
    by_axis,
    finite,
    read_numbers,
    short_text,
)
from .inverse import Cursor

FRAME = "base"
IDENTITY = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
LEVELS = ("none", "error", "warning", "info")  # each includes those before it
PUBLISHED = {  # type of a topic, by the last part of its name
    "measured_cp": "geometry_msgs/PoseStamped",
    "measured_cv": "geometry_msgs/TwistStamped",
    "measured_js": "sensor_msgs/JointState",
    "operating_state": "crtk_msgs/operating_state",
    "phantom/pose": "geometry_msgs/PoseStamped",
    "phantom/state": "omni_msgs/OmniState",
    "phantom/joint_states": "sensor_msgs/JointState",
    "phantom/button": "omni_msgs/OmniButtonEvent",
}
TAKEN = {
    "body/servo_cf": "geometry_msgs/WrenchStamped",
    "spatial/servo_cf": "geometry_msgs/WrenchStamped",
    "servo_cf": "geometry_msgs/WrenchStamped",
    "servo_cp": "geometry_msgs/PoseStamped",
    "servo_jf": "sensor_msgs/JointState",
    "phantom/force_feedback": "omni_msgs/OmniFeedback",
}
PLACES = {"geometry_msgs/WrenchStamped": ("wrench", "force")}  # keys of the vector in a message
PLACES |= {"geometry_msgs/PoseStamped": ("pose", "position"), "omni_msgs/OmniFeedback": ("force",)}
MOST_JOINTS = 64  # of a message
OPTIONAL = ("type", "compression")  # anything but a text counts as none
LONGEST_THROTTLE = 1e9  # [ms]


@dataclass(frozen=True)
class Operation:
    """An operation from a client."""

    op: str = ""  # "" if it is unreadable
    id: str | int | None = None  # repeated in the answer
    topic: str = ""  # name of the topic, or of a service
    type: str = ""  # that of the topic, without "msg"; "" for none
    # the ROS message, or the arguments of a service
    msg: Mapping[str, Any] = field(default_factory=dict)
    throttle: float = 0.0  # [s] least time between two messages of a subscription
    compression: str = "none"  # asked for by a subscription
    error: str = ""  # why the operation cannot be used; "" if it can


# ---- what clients send ---------------------------------------------------------------------------


def read_operation(data: str | bytes) -> Operation:
    """Reads what a client sent."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return Operation(error="not JSON")
    if not isinstance(tree, dict) or not isinstance(tree.get("op"), str):
        return Operation(error="no object with an op")
    texts = {key: tree.get(key, "") for key in ("op", "type", "compression")}
    texts["topic"] = tree.get("topic", tree.get("service", tree.get("level", "")))
    name, throttle = tree.get("id"), 0.0
    if texts["op"] == "subscribe":
        throttle = finite(tree.get("throttle_rate", 0))
    error = next((e for e in (_text_error(*item) for item in texts.items()) if e), "")
    if not _is_id(name):
        name = None
        error = error or f"id is no text of {LONGEST_TEXT} characters or whole number of 64 bits"
    if throttle is None or abs(throttle) > LONGEST_THROTTLE:
        error = error or f"throttle_rate is no number of milliseconds up to {LONGEST_THROTTLE:g}"
    op, kind, compression, topic = (short_text(x) or "" for x in texts.values())
    msg = tree.get("msg", tree.get("args", {}))
    return Operation(
        op,
        name,
        topic,
        plain_type(kind),
        msg if isinstance(msg, Mapping) else {},
        1e-3 * max(0.0, throttle or 0.0),
        compression or "none",
        error,
    )


def _text_error(key: str, value: Any) -> str:
    """Why a text of an operation cannot be used; "" if it can."""
    if short_text(value) is not None or (key in OPTIONAL and not isinstance(value, str)):
        return ""
    what = f"longer than {LONGEST_TEXT} characters" if isinstance(value, str) else "no text"
    return f"{key} is {what}"


def _is_id(value: Any) -> bool:
    """Whether an id can be repeated and kept: a short text, a number of 64 bits, or none."""
    if isinstance(value, int):
        return abs(value) < 2**63
    return value is None or short_text(value) is not None


def plain_type(given: Any) -> str:
    """Name of a type as ROS 1 has it: geometry_msgs/PoseStamped."""
    return given.replace("/msg/", "/") if isinstance(given, str) else ""


def kind_of(topic: str, kinds: Mapping[str, str]) -> str:
    """The kind of topic with which a name ends, in any namespace; "" for none."""
    found = [kind for kind in kinds if f"/{topic.lstrip('/')}".endswith(f"/{kind}")]
    return max(found, key=len, default="")


def command_of(kind: str, msg: Mapping[str, Any]) -> tuple[Command, str]:
    """The command in a message on a command topic."""
    if kind == "servo_jf":
        return _joint_command(msg.get("effort"))
    part: Any = msg
    for name in PLACES[TAKEN[kind]]:
        part = part.get(name) if isinstance(part, Mapping) else None
    if not isinstance(part, Mapping):
        return _command(kind, None), f"{kind} without a vector"
    given, dropped = read_numbers(part, AXES, POSITION if kind == "servo_cp" else FORCE)
    if given is None:
        return _command(kind, None), f"{kind}: {dropped}"
    return _command(kind, (given[0], given[1], given[2])), ""


def _joint_command(given: Any) -> tuple[Command, str]:
    """The torques of all joints."""
    if not isinstance(given, list) or len(given) > MOST_JOINTS:
        return Command(), f"servo_jf without an effort of {MOST_JOINTS} joints at most"
    places = tuple(map(str, range(len(given))))
    torques, dropped = read_numbers(dict(zip(places, given, strict=True)), places, TORQUE)
    return Command(torques=torques), dropped and f"servo_jf: {dropped}"


def _command(kind: str, vector: Vector | None) -> Command:
    if kind == "servo_cp":
        return Command(target=vector)
    return Command(force=vector or NOTHING)


# ---- what the server sends -----------------------------------------------------------------------


def publish_text(topic: str, msg: Mapping[str, Any]) -> str:
    return json.dumps({"op": "publish", "topic": topic, "msg": msg}, allow_nan=False)


def status_text(level: str, text: str, to: Operation) -> str:
    name = {} if to.id is None else {"id": to.id}
    return json.dumps({"op": "status", **name, "level": level, "msg": text})


def response_text(to: Operation, values: Any, result: bool) -> str:
    name = {} if to.id is None else {"id": to.id}
    body = {"service": to.topic, "values": values, "result": result}
    return json.dumps({"op": "service_response", **name, **body}, allow_nan=False)


def ros_time(t: float) -> dict[str, int]:
    """A time, with the fields of ROS 1 and ROS 2."""
    whole = math.floor(t)
    parts = int(1e9 * (t - whole))
    return {"secs": whole, "nsecs": parts, "sec": whole, "nanosec": parts}


def ros_message(
    kind: str, cursor: Cursor, joints: Joints, pressed: frozenset[str], t: float
) -> dict[str, Any]:
    """The message of a published topic."""
    stamped: dict[str, Any] = {"header": {"stamp": ros_time(t), "frame_id": FRAME}}
    if kind == "phantom/button":
        return {"grey_button": int("a" in pressed), "white_button": int("b" in pressed)}
    if kind == "operating_state":
        return stamped | {"state": "ENABLED", "is_homed": True, "is_busy": False}
    if kind in ("measured_js", "phantom/joint_states"):
        return stamped | _joint_state(joints)
    if kind == "measured_cv":
        twist = {"linear": by_axis(cursor.velocity), "angular": by_axis(NOTHING)}
        return stamped | {"twist": twist}
    if kind == "phantom/state":
        return stamped | _omni_state(cursor, pressed)
    return stamped | {"pose": _pose(cursor.position)}


def _pose(place: Vector) -> dict[str, Any]:
    return {"position": by_axis(place), "orientation": dict(IDENTITY)}


def _joint_state(joints: Joints) -> dict[str, Any]:
    return {
        "name": list(joints.names),
        "position": list(joints.positions),
        "velocity": list(joints.rates),
        "effort": list(joints.torques),
    }


def _omni_state(cursor: Cursor, pressed: frozenset[str]) -> dict[str, Any]:
    """State in millimetres, the default unit of the drivers."""
    x, y, z = (1e3 * a for a in cursor.position)
    u, v, w = (1e3 * a for a in cursor.velocity)
    return {
        "locked": False,
        "close_gripper": "a" in pressed,
        "pose": _pose((x, y, z)),
        "current": by_axis(NOTHING),
        "velocity": by_axis((u, v, w)),
    }
