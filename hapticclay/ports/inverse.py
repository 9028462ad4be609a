"""Messages of the Haply Inverse service, versions 3.1 to 3.5 as one union, without sockets.

Whatever arrives is read to a `Message`: what cannot be used is left out and told in its notices.
Vectors are (x, y, z) in metre, metre per second and newton, z up.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

Vector = tuple[float, float, float]

NOTHING: Vector = (0.0, 0.0, 0.0)
AXES = ("x", "y", "z")
LARGEST_MESSAGE = 65_536  # bytes
FORCE_KEYS = ("vector", "values")  # of 3.5, of 3.1 to 3.4
PROBES = ("probe_position", "probe_orientation")
DEVICES = ("inverse3", "minverse", "verse_grip", "wireless_verse_grip", "custom_verse_grip")
BUTTONS = ("a", "b", "c", "home", "button_0", "button_1", "button_2", "button_3")
ALIASES = {"button_0": "a", "button_1": "b", "button_2": "c", "button_3": "home"}
UNTURNED = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}


@dataclass(frozen=True)
class Force:
    """A force that a client asks of a device.

    Attributes:
        device_id: of the device.
        vector: the force [N].
    """

    device_id: str
    vector: Vector


@dataclass(frozen=True)
class Message:
    """What a client sent.

    Attributes:
        forces: in the order of their entries; those for one device add up.
        devices: ids of the devices that the message names.
        full: whether the answer is to hold the configuration.
        profile: name that the client gives its session; "" for none.
        notices: what was left out, and why.
    """

    forces: tuple[Force, ...] = ()
    devices: tuple[str, ...] = ()
    full: bool = False
    profile: str = ""
    notices: tuple[str, ...] = ()

    def force_on(self, device_id: str) -> Vector | None:
        """Sum of the forces on a device [N]; None if there are none.

        Args:
            device_id: of the device.
        """
        asked = [f.vector for f in self.forces if f.device_id == device_id]
        if not asked:
            return None
        return sum(f[0] for f in asked), sum(f[1] for f in asked), sum(f[2] for f in asked)


@dataclass(frozen=True)
class Cursor:
    """State of the handle of an Inverse3.

    Attributes:
        position: [m].
        velocity: [m/s].
        force: that the device applies [N].
        driven: whether a client commands it.
    """

    position: Vector
    velocity: Vector = NOTHING
    force: Vector = NOTHING
    driven: bool = False


@dataclass(frozen=True)
class Frame:
    """What the service sends: an Inverse3 and a wireless grip.

    Attributes:
        device_id: of the Inverse3, hexadecimal.
        cursor: its handle.
        grip_id: of the grip, hexadecimal.
        buttons: names of those pressed, of "a", "b", "c", "home".
        session_id: of the client's session.
        full: whether it holds the configuration.
    """

    device_id: str
    cursor: Cursor
    grip_id: str = ""
    buttons: frozenset[str] = field(default_factory=frozenset)
    session_id: int = 1
    full: bool = False


# ---- what clients send ---------------------------------------------------------------------------


def read_message(data: str | bytes) -> Message:
    """Reads what a client sent.

    Args:
        data: a frame, text or binary.

    Returns:
        The message; of rubbish one without forces, with a notice.
    """
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return Message(notices=("not JSON",))
    if not isinstance(tree, dict):
        return Message(notices=("not an object",))
    notices = [f"unknown key {name}" for name in tree if name not in ("session", *DEVICES)]
    full, profile = _session(tree.get("session", {}), notices)
    forces, devices = [], []
    for kind in DEVICES:
        for entry in _entries(tree.get(kind, []), kind, notices):
            name = entry.get("device_id")
            if not isinstance(name, str):
                notices.append(f"{kind} without device_id")
                continue
            devices.append(name)
            vector = _commanded(entry, notices)
            if vector is not None:
                forces.append(Force(name, vector))
    return Message(tuple(forces), tuple(devices), full, profile, tuple(dict.fromkeys(notices)))


def _session(part: Any, notices: list[str]) -> tuple[bool, str]:
    """Whether a full frame is asked for, and the name of the profile."""
    if not isinstance(part, Mapping):
        notices.append("session is no object")
        return False, ""
    notices += [
        f"unknown key session.{name}"
        for name in part
        if name not in ("force_render_full_state", "configure")
    ]
    profile: Any = part.get("configure")
    for name in ("profile", "name"):
        profile = profile.get(name) if isinstance(profile, Mapping) else None
    return "force_render_full_state" in part, profile if isinstance(profile, str) else ""


def _entries(part: Any, kind: str, notices: list[str]) -> Iterator[Mapping[str, Any]]:
    if not isinstance(part, list):
        notices.append(f"{kind} is no array")
        return
    for entry in part:
        if isinstance(entry, Mapping):
            yield entry
        else:
            notices.append(f"entry of {kind} is no object")


def _commanded(entry: Mapping[str, Any], notices: list[str]) -> Vector | None:
    """The force that the entry of a device asks for; None for none."""
    notices += [
        f"unknown key {name} of a device"
        for name in entry
        if name not in ("device_id", "commands", "configure")
    ]
    if "configure" in entry:
        notices.append("configure is not simulated")
    commands = entry.get("commands", {})
    if not isinstance(commands, Mapping):
        notices.append("commands is no object")
        return None
    vector = None
    for name, body in commands.items():
        if name == "set_cursor_force":
            vector = _force(body, notices)
        elif name not in PROBES:
            notices.append(f"command {name} is not simulated")
    return vector


def _force(body: Any, notices: list[str]) -> Vector:
    """The vector of a force; nothing where it is none, or not finite."""
    given = None
    if isinstance(body, Mapping):
        given = next((body[key] for key in FORCE_KEYS if key in body), None)
    if not isinstance(given, Mapping):
        notices.append("set_cursor_force without vector")
        return NOTHING
    values = [_finite(given.get(axis, 0.0)) for axis in AXES]
    if None in values:
        notices.append("force is not finite")
        return NOTHING
    x, y, z = (v for v in values if v is not None)
    return x, y, z


def _finite(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None


def message_text(message: Message) -> str:
    """A message as a client sends it, with the key of 3.1 to 3.4, which all versions take.

    Args:
        message: what to send; its notices are not.
    """
    tree: dict[str, Any] = {}
    session: dict[str, Any] = {"force_render_full_state": {}} if message.full else {}
    if message.profile:
        session["configure"] = {"profile": {"name": message.profile}}
    if session:
        tree["session"] = session
    named = [f.device_id for f in message.forces]
    entries: list[dict[str, Any]] = [
        {
            "device_id": f.device_id,
            "commands": {"set_cursor_force": {"values": _axes(f.vector)}},
        }
        for f in message.forces
    ]
    entries += [
        {"device_id": name, "commands": {"probe_position": {}}}
        for name in message.devices
        if name not in named
    ]
    if entries:
        tree["inverse3"] = entries
    return json.dumps(tree, allow_nan=False)


# ---- what the service sends ----------------------------------------------------------------------


def frame_data(frame: Frame) -> dict[str, Any]:
    """A frame as the service sends it, as plain data.

    Args:
        frame: what to send.
    """
    device: dict[str, Any] = {"device_id": frame.device_id}
    if frame.full:
        device["config"] = _device_config(frame.device_id)
    device |= {"state": _cursor_state(frame.cursor), "status": dict(DEVICE_STATUS)}
    grips: list[dict[str, Any]] = []
    if frame.grip_id:
        grip: dict[str, Any] = {"device_id": frame.grip_id}
        if frame.full:
            grip["config"] = {"type": "wireless_verse_grip", "port": "SIM1"}
        grips.append(grip | {"state": _grip_state(frame.buttons), "status": dict(GRIP_STATUS)})
    out: dict[str, Any] = {"session_id": frame.session_id}
    found = {"inverse3": [device], "wireless_verse_grip": grips}
    return out | {kind: found.get(kind, []) for kind in DEVICES}


DEVICE_STATUS = {
    "calibrated": True,
    "in_use": True,
    "power_supply": True,
    "ready": True,
    "started": True,
}
GRIP_STATUS = {"connected": True, "awake": True, "ready": True}


def frame_text(frame: Frame) -> str:
    """A frame as the service sends it.

    Args:
        frame: what to send.
    """
    return json.dumps(frame_data(frame), allow_nan=False)


def _axes(v: Vector) -> dict[str, float]:
    return dict(zip(AXES, v, strict=True))


def _joints() -> dict[str, float]:
    return {"a0": 0.0, "a1": 0.0, "a2": 0.0}


def _transform() -> dict[str, Any]:
    unit = {"x": 1.0, "y": 1.0, "z": 1.0}
    return {"position": _axes(NOTHING), "rotation": dict(UNTURNED), "scale": unit}


def _cursor_state(cursor: Cursor) -> dict[str, Any]:
    mode = "force" if cursor.driven else "idle"
    return {
        "cursor_position": _axes(cursor.position),
        "cursor_velocity": _axes(cursor.velocity),
        "angular_position": _joints(),
        "angular_velocity": _joints(),
        "body_orientation": dict(UNTURNED),
        "current_cursor_force": _axes(cursor.force),
        "current_cursor_position": _axes(cursor.position),
        "current_angular_torques": _joints(),
        "current_angular_position": _joints(),
        "control_domain": "cartesian" if cursor.driven else "undefined",
        "control_mode": mode,
        "mode": mode,
        "transform": _transform(),
    }


def _grip_state(pressed: frozenset[str]) -> dict[str, Any]:
    return {
        "orientation": dict(UNTURNED),
        "buttons": {name: ALIASES.get(name, name) in pressed for name in BUTTONS},
        "button": bool(pressed),
        "hall": 0,
        "battery_level": 1.0,
        "transform": _transform(),
    }


def _device_config(device_id: str) -> dict[str, Any]:
    serial = int(device_id, 16)
    return {
        "type": "inverse3",
        "port": "SIM0",
        "device_info": {
            "major_version": 12,
            "minor_version": 0,
            "id": serial,
            "device_type": 4,
            "model": 4,
            "uuid": f"00000000-0000-0000-0000-{serial:012X}",
        },
        "extended_device_id": f"{serial:016X}",
        "extended_firmware_version": "hapticclay",
        "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
        "handedness": "right",
        "streaming_mode": "usb",
        "torque_scaling": {"enabled": True},
        "home_return": {"enabled": False},
        "preset": "defaults",
        "basis": {"permutation": "XYZ"},
        "mount": _transform(),
        "filters": {"force_gate": {"gain": 0.0}, "damping": {"scalar": 0.0}},
    }


def read_frame(data: str | bytes) -> Frame | None:
    """Reads what a service sent: its first Inverse3, and its first wireless grip.

    Args:
        data: a frame, text or binary.

    Returns:
        The frame; None if there is no Inverse3 with a finite position in it.
    """
    try:
        tree = json.loads(data)
        device = tree["inverse3"][0]
        state = device["state"]
        position = _vector(state["cursor_position"])
        grip = next(iter(tree.get("wireless_verse_grip") or []), {})
        pressed = grip.get("state", {}).get("buttons", {})
        cursor = Cursor(
            position,
            _vector(state.get("cursor_velocity", {})),
            _vector(state.get("current_cursor_force", {})),
            state.get("control_mode", state.get("mode", "idle")) != "idle",
        )
        return Frame(
            str(device["device_id"]),
            cursor,
            str(grip.get("device_id", "")),
            frozenset(ALIASES.get(str(n), str(n)) for n, on in pressed.items() if on is True),
            int(tree.get("session_id", 0)),
            "config" in device,
        )
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        return None


def _vector(given: Mapping[str, Any]) -> Vector:
    x, y, z = (_finite(given.get(axis, 0.0)) for axis in AXES)
    if x is None or y is None or z is None:
        raise ValueError("not finite")
    return x, y, z
