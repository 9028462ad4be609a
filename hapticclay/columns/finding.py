"""Which column is meant: by its name where one alone fits, else by its unit."""

from __future__ import annotations

import re

from ..errors import ParameterError, nearest
from .heads import powers_of
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
    """Names of the columns that can be meant, by name; if none is, by unit."""
    known, heads = frozenset(NAMES[meaning].split()), log.table.heads
    named = [h.text for h in heads if any(_plain(x) in known for x in (h.name, *h.stems))]
    if named:
        return named
    wanted = powers_of(UNITS[meaning])
    return [head.text for i, head in enumerate(heads) if head.unit and log.powers(i) in wanted]


def find(log: Log, field: str, key: str, meaning: str, hint: str = "") -> str:
    """The name of the one column that is meant; refused where none is, or several are."""
    names = [head.text for head in log.table.heads]
    if key in names:
        return key
    found = candidates(log, meaning)
    if len(found) == 1:
        return found[0]
    bound = f"must name the column of {meaning}, one of {', '.join(found or names)}"
    near = [] if found else nearest(key, names)
    more = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(field, key, f"{bound}{more}{hint}")


def _plain(name: str) -> str:
    return re.sub(r"[\s.\-]+", "_", name.strip().lower())
