"""Messages of the Haply Inverse service, versions 3.1 to 3.5 as one union, without sockets.

Every input is read into a `Message`. Unusable content is dropped and reported in its notices: among
it numbers that are not finite or beyond the bounds of `commands`, in messages and in frames.
Vectors are (x, y, z) in metre, metre per second and newton, z up.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from .commands import (
    ANGLE,
    AXES,
    FORCE,
    LONGEST_TEXT,
    NOTHING,
    POSITION,
    RATE,
    TORQUE,
    VELOCITY,
    Command,
    Numbers,
    Quantity,
    Vector,
    by_axis,
    finite,
    read_numbers,
    short_text,
)

LARGEST_MESSAGE = 65_536  # bytes
JOINTS = ("a0", "a1", "a2")
COMMANDS = {  # keys of a command's body, that of version 3.5 first; its quantity, and their names
    "set_cursor_force": (("vector", "values"), FORCE, AXES),
    "set_cursor_position": (("position", "values"), POSITION, AXES),
    "set_angular_torques": (("torques", "values"), TORQUE, JOINTS),
}
PROBES = ("probe_position", "probe_orientation")
DEVICES = ("inverse3", "minverse", "verse_grip", "wireless_verse_grip", "custom_verse_grip")
BUTTONS = ("a", "b", "c", "home", "button_0", "button_1", "button_2", "button_3")
ALIASES = {"button_0": "a", "button_1": "b", "button_2": "c", "button_3": "home"}
UNTURNED = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}


@dataclass(frozen=True)
class Force:
    """A force that a client commands."""

    device_id: str
    vector: Vector  # [N]


@dataclass(frozen=True)
class Target:
    """A position at which a client wants the cursor held."""

    device_id: str
    vector: Vector  # [m]


@dataclass(frozen=True)
class Torques:
    """Torques that a client commands."""

    device_id: str
    torques: Vector  # [N.m] on the joints a0, a1 and a2


@dataclass(frozen=True)
class Message:
    """A message from a client; commands are in the order of their entries."""

    forces: tuple[Force, ...] = ()  # those for the same device add up
    devices: tuple[str, ...] = ()  # ids that the message names
    full: bool = False  # whether the answer must include the configuration
    profile: str = ""  # name that the client gives its session
    notices: tuple[str, ...] = ()  # what was dropped, and why
    targets: tuple[Target, ...] = ()  # the last one for a device counts
    torques: tuple[Torques, ...] = ()  # those for the same device add up

    def command(self, device_id: str) -> Command:
        """The command in the message for a device."""
        forces = [f.vector for f in self.forces if f.device_id == device_id]
        targets = [x.vector for x in self.targets if x.device_id == device_id]
        torques = [x.torques for x in self.torques if x.device_id == device_id]
        force = tuple(map(sum, zip(*forces, strict=True))) if forces else None
        torque = tuple(map(sum, zip(*torques, strict=True))) if torques else None
        return Command(force, targets[-1] if targets else None, torque)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Cursor:
    """State of the handle of an Inverse3."""

    position: Vector  # [m]
    velocity: Vector = NOTHING  # [m/s]
    force: Vector = NOTHING  # [N] that the device applies
    mode: str = "idle"  # what a client drives: "force", "position", "torque" or "idle"
    angles: Vector = NOTHING  # [deg] of the joints a0, a1 and a2, [m] of one that slides
    rates: Vector = NOTHING  # [deg/s], [m/s]
    torques: Vector = NOTHING  # [N.m] or [N] on these joints


@dataclass(frozen=True)
class Frame:
    """A state frame of the service: an Inverse3 and a wireless grip."""

    device_id: str  # hexadecimal
    cursor: Cursor
    grip_id: str = ""  # hexadecimal
    # names of the pressed buttons, from "a", "b", "c", "home"
    buttons: frozenset[str] = field(default_factory=frozenset)
    session_id: int = 1
    full: bool = False  # whether it includes the configuration


# ---- what clients send ---------------------------------------------------------------------------


def read_message(data: str | bytes) -> Message:
    """Reads what a client sent."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return Message(notices=("not JSON",))
    if not isinstance(tree, dict):
        return Message(notices=("not an object",))
    found = _Contents()
    found.notices += [f"unknown key {name}" for name in tree if name not in ("session", *DEVICES)]
    full, profile = _session(tree.get("session", {}), found.notices)
    for kind in DEVICES:
        for entry in _entries(tree.get(kind, []), kind, found.notices):
            name = entry.get("device_id")
            if not isinstance(name, str):
                found.notices.append(f"{kind} without device_id")
                continue
            found.devices.append(name)
            _read_commands(name, entry, found)
    return Message(
        tuple(found.forces),
        tuple(found.devices),
        full,
        profile,
        tuple(dict.fromkeys(found.notices)),
        tuple(found.targets),
        tuple(found.torques),
    )


@dataclass
class _Contents:
    """Contents of a message, as it is read."""

    devices: list[str] = field(default_factory=list)
    forces: list[Force] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    torques: list[Torques] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)


def _session(part: Any, notices: list[str]) -> tuple[bool, str]:
    """Whether the client requests a full frame, and the name of the profile."""
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
    if isinstance(profile, str) and short_text(profile) is None:
        notices.append(f"the name of the profile is longer than {LONGEST_TEXT} characters")
    return "force_render_full_state" in part, short_text(profile) or ""


def _entries(part: Any, kind: str, notices: list[str]) -> Iterator[Mapping[str, Any]]:
    if not isinstance(part, list):
        notices.append(f"{kind} is no array")
        return
    for entry in part:
        if isinstance(entry, Mapping):
            yield entry
        else:
            notices.append(f"entry of {kind} is no object")


def _read_commands(device: str, entry: Mapping[str, Any], found: _Contents) -> None:
    """Adds the commands in a device's entry to the contents found so far."""
    found.notices += [
        f"unknown key {name} of a device"
        for name in entry
        if name not in ("device_id", "commands", "configure")
    ]
    if "configure" in entry:
        found.notices.append("configure is not simulated")
    commands = entry.get("commands", {})
    if not isinstance(commands, Mapping):
        found.notices.append("commands is no object")
        return
    for name, body in commands.items():
        if name == "set_cursor_force":
            x, y, z = _numbers(name, body, found.notices) or NOTHING
            found.forces.append(Force(device, (x, y, z)))
        elif name == "set_cursor_position":
            if place := _numbers(name, body, found.notices):  # no position, no target
                found.targets.append(Target(device, (place[0], place[1], place[2])))
        elif name == "set_angular_torques":
            given = _numbers(name, body, found.notices) or NOTHING
            found.torques.append(Torques(device, first_three(given)))
        elif name not in PROBES:
            found.notices.append(f"command {name} is not simulated")


def _numbers(command: str, body: Any, notices: list[str]) -> tuple[float, ...] | None:
    """The numbers of a command's body; 0 if missing, None if one is unusable."""
    keys, quantity, names = COMMANDS[command]
    given = None
    if isinstance(body, Mapping):
        given = next((body[key] for key in keys if key in body), None)
    if not isinstance(given, Mapping):
        notices.append(f"{command} without {keys[0]}")
        return None
    values, dropped = read_numbers(given, names, quantity)
    if dropped:
        notices.append(dropped)
    return values


def message_text(message: Message) -> str:
    """The text of a client's message, with the key of 3.1 to 3.4, which all versions accept."""
    tree: dict[str, Any] = {}
    session: dict[str, Any] = {"force_render_full_state": {}} if message.full else {}
    if message.profile:
        session["configure"] = {"profile": {"name": message.profile}}
    if session:
        tree["session"] = session
    commands = *message.forces, *message.targets, *message.torques
    entries = [_entry(x.device_id, *_body(x)) for x in commands]
    named = {entry["device_id"] for entry in entries}
    entries += [_entry(name, "probe_position", {}) for name in message.devices if name not in named]
    if entries:
        tree["inverse3"] = entries
    return json.dumps(tree, allow_nan=False)


def _body(command: Force | Target | Torques) -> tuple[str, dict[str, Any]]:
    """Name and body of a command."""
    if isinstance(command, Torques):
        return "set_angular_torques", {"torques": _joints(command.torques)}
    name = "set_cursor_force" if isinstance(command, Force) else "set_cursor_position"
    return name, {"values": by_axis(command.vector)}


def _entry(device_id: str, command: str, body: dict[str, Any]) -> dict[str, Any]:
    return {"device_id": device_id, "commands": {command: body}}


# ---- what the service sends ----------------------------------------------------------------------


def frame_data(frame: Frame) -> dict[str, Any]:
    """A frame of the service as plain data."""
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
    return json.dumps(frame_data(frame), allow_nan=False)


def _joints(values: Vector) -> dict[str, float]:
    return dict(zip(JOINTS, values, strict=True))


def first_three(values: Numbers) -> Vector:
    """Numbers of the three joints that a message has: those that an arm lacks are 0."""
    a0, a1, a2 = (*values, *NOTHING)[:3]
    return a0, a1, a2


def _transform() -> dict[str, Any]:
    unit = {"x": 1.0, "y": 1.0, "z": 1.0}
    return {"position": by_axis(NOTHING), "rotation": dict(UNTURNED), "scale": unit}


def _cursor_state(cursor: Cursor) -> dict[str, Any]:
    mode = cursor.mode
    domains = {"idle": "undefined", "torque": "angular"}
    return {
        "cursor_position": by_axis(cursor.position),
        "cursor_velocity": by_axis(cursor.velocity),
        "angular_position": _joints(cursor.angles),
        "angular_velocity": _joints(cursor.rates),
        "body_orientation": dict(UNTURNED),
        "current_cursor_force": by_axis(cursor.force),
        "current_cursor_position": by_axis(cursor.position),
        "current_angular_torques": _joints(cursor.torques),
        "current_angular_position": _joints(cursor.angles),
        "control_domain": domains.get(mode, "cartesian"),
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
    """Reads the first Inverse3 and the first wireless grip from a service's frame."""
    try:
        tree = json.loads(data)
        device = tree["inverse3"][0]
        state = device["state"]
        grip = next(iter(tree.get("wireless_verse_grip") or []), {})
        pressed = grip.get("state", {}).get("buttons", {})
        position = state["cursor_position"]
        vectors = (
            _vector(position, POSITION),
            _vector(state.get("cursor_velocity", {}), VELOCITY),
            _vector(state.get("current_cursor_force", {}), FORCE),
        )
        name = short_text(device["device_id"])
        if name is None or not position or None in vectors:
            return None
        place, rate, force = (v or NOTHING for v in vectors)
        cursor = Cursor(
            place,
            rate,
            force,
            short_text(state.get("control_mode", state.get("mode"))) or "idle",
            _of_joints(state.get("angular_position", {}), ANGLE),
            _of_joints(state.get("angular_velocity", {}), RATE),
            _of_joints(state.get("current_angular_torques", {}), TORQUE),
        )
        return Frame(
            name,
            cursor,
            short_text(grip.get("device_id")) or "",
            frozenset(ALIASES.get(n, n) for n in BUTTONS if pressed.get(n) is True),
            int(finite(tree.get("session_id")) or 0),
            "config" in device,
        )
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        return None


def _vector(given: Mapping[str, Any], quantity: Quantity) -> Vector | None:
    values, _ = read_numbers(given, AXES, quantity)
    return None if values is None else (values[0], values[1], values[2])


def _of_joints(given: Mapping[str, Any], quantity: Quantity) -> Vector:
    values, _ = read_numbers(given, JOINTS, quantity)
    return first_three(values or ())  # no loop depends on it
