"""Which column is meant: by its name where one alone fits, else by its unit."""

from __future__ import annotations

import re

from ..errors import ParameterError, nearest
from .heads import COPY, powers_of
from .log import Log

# of which a whole name, without its unit, is made
TIMES = "t time times timestamp timestamps stamp zeit clock elapsed second seconds sec secs"
FORCES = (
    "f fh fe force forces kraft load loadcell f_h f_hand f_ext hand_force contact_force tip_force "
    "external_force measured_force force_h force_hand force_ext force_meas force_measured "
    "force_sensor torque tau moment drehmoment effort fx fy fz f_x f_y f_z force_x force_y force_z "
    "fh_x fh_y fhx fhy input"
)
PLACES = (
    "p q x y z pos position positions weg angle theta phi displacement output handle p_x p_y p_z "
    "px py pz pos_x pos_y pos_z position_x position_y position_z pos_meas pos_act pos_actual "
    "position_measured position_actual q_meas q_act x_meas x_act"
)
COMMANDS = (
    "cmd command commands delta u ref setpoint set_point target input pos_cmd position_cmd x_cmd "
    "q_cmd pos_ref x_ref q_ref q_des x_des pos_des position_command cmd_pos command_position"
)
TIMES += " elapsed_time sample_time rel_time host_time log_time sim_time device_time t_rel t_host"
VECTORS = {  # by which parts of vectors are meant, beside these names
    "force": "effort efforts torques wrench",
    "position": "qpos state joint_pos joint_position joint_positions positions",
    "command": "action actions",
}
VECTORS["force or command"] = " ".join((VECTORS["force"], VECTORS["command"]))
VECTOR_PART = re.compile(r"\[\d+\]$")
NO_TIME = (
    ", or the file has no time: then state the rate of its rows, as --rate 50 (in Python rate=50)"
)
NAMES = {
    "time": TIMES,
    "force": FORCES,
    "position": PLACES,
    "command": COMMANDS,
    "force or command": f"{FORCES} {COMMANDS}",
}
UNITS = {"time": ("s",), "force": ("N", "N.m"), "position": ("m", "rad"), "command": ("m", "rad")}
UNITS["force or command"] = ("N", "N.m")


def candidates(log: Log, meaning: str) -> list[str]:
    """Names of the columns that can be meant: by name; if none is, by unit; else by a part of it.

    A part is the name of a group or of a vector, as in "observations.qpos[0]".
    """
    if meaning == "time" and log.clock:
        return [log.clock]
    known, heads = frozenset(NAMES[meaning].split()), log.table.heads
    if names := [h.text for h in heads if any(_plain(x) in known for x in (h.name, *h.stems))]:
        return names
    wanted = powers_of(UNITS[meaning])
    stated = [bool(head.unit) or i in log.sizes for i, head in enumerate(heads)]
    if names := [h.text for i, h in enumerate(heads) if stated[i] and log.powers(i) in wanted]:
        return names
    known |= frozenset(VECTORS.get(meaning, "").split())
    return [h.text for h in heads if any(_plain(x) in known for x in _parts(h.name))]


def find(log: Log, field: str, key: str, meaning: str, hint: str = "") -> str:
    """The name of the one column that is meant; refused where none is, or several are."""
    names = [head.text for head in log.table.heads]
    if key in names and not (meaning == "time" and log.clock):
        return key
    some = candidates(log, meaning)
    if len(some) == 1:
        return some[0]
    bound = f"must name the column of {meaning}, one of {', '.join(some or names)}"
    if meaning == "time" and not some:
        bound += NO_TIME
    near = [] if some else nearest(key, names)
    more = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(field, key, f"{bound}{more}{hint}")


def _parts(name: str) -> list[str]:
    """The last name of a path, and that of the vector of which it is a part."""
    *groups, last = re.split(r"[./]", VECTOR_PART.sub("", name))
    return [last, *groups[-1:]]


def _plain(name: str) -> str:
    return re.sub(r"[\s.\-]+", "_", COPY.sub("", name).strip().lower()).strip("_")
