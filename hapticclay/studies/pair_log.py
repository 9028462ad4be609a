"""A log of a leader and its follower, one axis each: positions, torques, force on the follower."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..columns.log import Log, Reading, open_log
from ..columns.stamps import times_of
from ..display import brief, one_line
from ..errors import ParameterError, choice
from .even_columns import unwrapped_where, wrap_note
from .measurement import check_sampling, column_of
from .missing_cells import even_rows

COLUMNS = {  # columns of a log and their contents
    "t": "time [s]",
    "leader": "position of the leader [rad]",
    "follower": "position of the follower [rad]",
    "leader_torque": "torque of the leader's motor [N.m]",
    "follower_torque": "torque of the follower's motor [N.m]",
    "force": "torque of the follower on what it touches [N.m]",
}
UNITS = {"t": ("s",), "leader": ("rad",), "follower": ("rad",)} | {
    name: ("N.m",) for name in ("leader_torque", "follower_torque", "force")
}
SPELLINGS = {  # of a column's name in lower case without its sign
    "t": ("t", "time", "timestamp"),
    "leader": ("leader", "master", "x_m", "q_m", "x_l", "q_l"),
    "follower": ("follower", "slave", "x_s", "q_s", "x_f", "q_f"),
    "leader_torque": ("leader_torque", "tau_rm", "tau_m", "tau_l"),
    "follower_torque": ("follower_torque", "tau_rs", "tau_s", "tau_f"),
    "force": ("force", "f_e", "fe", "tau_e"),
}
OUTPUT = {"follower": "output"}  # the motion by which it is judged whether stamps are late
OPTIONAL = ("follower_torque", "leader_torque", "force")
SIDES = (("leader", "master"), ("follower", "slave"))  # names that are those of a pair alone


@named
@dataclass(frozen=True, eq=False)
class PairLog:
    """A measured leader and its follower, one axis each, evenly sampled.

    Torques count along the positions: a torque of 1 N.m pushes its side forward.

    Attributes:
        t: time [s], (n,), n >= 100; no step differs from the mean one by more than 5 %.
        leader: position of the leader [rad], (n,).
        follower: position of the follower [rad], (n,).
        follower_torque: torque of the follower's motor [N.m], (n,); None if it was not logged.
        leader_torque: torque of the leader's motor [N.m], (n,); None if it was not logged.
        force: torque of the follower on what it touches [N.m], (n,); None without a sensor.
        name: name in titles and files.
        notes: what was done to the rows of a file, one sentence each.

    Raises:
        ParameterError: a column is not such an array, is too short or not finite; the motion is
            constant; the sampling is uneven.
    """

    def __repr__(self) -> str:
        return brief(self)

    t: np.ndarray
    leader: np.ndarray
    follower: np.ndarray
    follower_torque: np.ndarray | None = None
    leader_torque: np.ndarray | None = None
    force: np.ndarray | None = None
    name: str = "pair"
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        for column in COLUMNS:
            value = getattr(self, column)
            if value is not None or column not in OPTIONAL:
                object.__setattr__(self, column, column_of(column, value, self.t))
        check_sampling(self.t)
        for column in ("leader", "follower", "follower_torque"):
            value = getattr(self, column)
            if value is not None and np.ptp(value) == 0.0:
                raise ParameterError(column, float(value[0]), "must change; it is constant")

    @property
    def Ts(self) -> float:
        """Mean step [s]."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def torque(self) -> np.ndarray:
        """Torque of the follower's motor [N.m], (n,)."""
        if self.follower_torque is None:
            bound = f"must have the {COLUMNS['follower_torque']}"
            raise ParameterError("follower_torque", None, bound)
        return self.follower_torque

    @classmethod
    @checked
    def load(
        cls,
        path: str | Path,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        counts: Mapping[str, Any] | None = None,
        rate: float | None = None,
    ) -> PairLog:
        """Reads a log: text, a binary format of docs/logs.md, or a scope of Simulink.

        A column is found by its name: leader or master, follower or slave, tau_rm and tau_rs for
        the torques, F_e for the force, and `COLUMNS`. A minus ahead of a name means that the column
        holds the negative, as "-tau_rm" in a plot of forces against each other. Rows at uneven
        times are resampled, with a note.

        Args:
            path: the file.
            columns: names in the file of t, leader, follower, leader_torque, follower_torque and
                force, with a minus for a column that holds the negative.
            units: unit of a column by name, in place of what the file says, as {"q1": "deg"}.
            counts: of an encoder's column by name: counts a turn, or the size of a count.
            rate: rows in a second [Hz], of a file without a time or in place of its own.

        Raises:
            ParameterError: the file cannot be read, a column is missing, or as `PairLog`.
        """
        given = dict(columns or {})
        for key in given:
            choice("columns", key, tuple(COLUMNS))
        reading = Reading(units or {}, counts or {}, rate=rate)
        return logged(open_log("path", path, reading), given)


def logged(log: Log, columns: Mapping[str, str]) -> PairLog:
    """The pair in the columns of a log, at even times."""
    columns = {"t": log.clock, **columns} if log.clock else columns
    wanted = {_plain(w): key for key, words in SPELLINGS.items() for w in words}
    wanted |= {_plain(w): key for key, w in columns.items()}
    found: dict[str, np.ndarray] = {}
    names: dict[str, str] = {}
    notes: list[str] = []
    for i, head in enumerate(log.table.heads):
        if key := wanted.get(_plain(head.text), wanted.get(_plain(head.name))):
            found[head.name] = log.size(i, UNITS[key])[0] * log.table.numbers(i, holes=True)
            names[key] = head.text
    cells = _chosen(log.path, found, columns, log.names)
    cells["t"], more = times_of(log, names["t"], holes=True)
    for side in ("leader", "follower"):
        cells[side], turn, at = unwrapped_where(cells[side])
        notes += [wrap_note(turn, at, cells["t"])] if len(at) else []
    rows = {OUTPUT.get(key, key): x for key, x in cells.items()}
    names = {OUTPUT.get(key, key): x for key, x in names.items()}
    made = even_rows(log, rows, names, "spline")
    own = {new: key for key, new in OUTPUT.items()}
    even: dict[str, Any] = {own.get(key, key): x for key, x in made.columns.items()}
    return PairLog(**even, name=log.path.stem, notes=(*more, *notes, *made.notes))


def is_pair(log: Log, unfit: Collection[str] = ()) -> bool:
    """Whether columns of a log are those of a pair, by their names; not those that are unfit."""
    names = {_plain(head.name) for head in log.table.heads if head.text not in unfit}
    names |= {"t"} if log.clock else set()
    wanted = [SPELLINGS[key] for key in COLUMNS if key not in OPTIONAL]
    sure = names.intersection(SPELLINGS["follower_torque"]) or all(map(names.intersection, SIDES))
    return bool(sure) and all(map(names.intersection, wanted))


# ---- files ---------------------------------------------------------------------------------------


def _chosen(
    file: Path, table: Mapping[str, np.ndarray], columns: Mapping[str, str], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Columns of a log from those of a file, whose names are told, each with its sign."""
    plain = {_plain(name): name for name in table}
    out = {}
    for key in COLUMNS:
        words = (columns[key],) if key in columns else SPELLINGS[key]
        found = next((w for w in words if _plain(w) in plain), None)
        if found is None and key in columns:
            choice(f"columns.{key}", columns[key], tuple(names))
        if found is None and key not in OPTIONAL:
            bound = f"must have the {COLUMNS[key]}; name its column {key}=NAME of"
            raise ParameterError("columns", str(file), f"{bound} {one_line(', '.join(names), 200)}")
        if found is not None:
            own = plain[_plain(found)]
            negative = found.startswith("-") if key in columns else own.startswith("-")
            out[key] = -table[own] if negative else table[own]
    return out


def _plain(name: str) -> str:
    return name.strip().lstrip("-").strip().lower()
