"""Robot files of others: which are answered as they are, and whether MuJoCo has the same numbers.

    python -m benchmarks.robot_files --data FOLDER [--fetch] [--only TEXT] [--out DIR]

robot_files.tsv lists the files: repository, commit, path, SHA-256, and the site or body that a user
would name as the handle (- for none; + for a file that the one above includes). FOLDER holds them
as OWNER+NAME/PATH; meshes that lie there are used, and with --fetch the files that are missing are
got, without meshes. Each is loaded in a process of its own, as it is and without any option; if the
answer is that the handle must be named, once more with it. Writes robot_files.md and
robot_files.json; some five minutes of processor time. The files are no part of this project.
"""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay import files
from hapticclay.errors import ParameterError
from hapticclay.results import json_ready
from hapticclay.theory.joint_gains import Study, first_joint

from . import common
from .peers.held_arm import FEWEST, HeldArm, urdf_inertia
from .recordings import had

LIST = Path(__file__).with_suffix(".tsv")
ADDRESS = "https://raw.githubusercontent.com/{repository}/{commit}/"
PATIENCE = 120.0  # [s] for one file
TS = 1e-3  # [s] control sample, and delay
FREQUENCY, RATIO = 5.0, 0.7  # [Hz] and damping ratio of each joint alone under its gains
BESIDE = 0.005  # share of the common limit, to either side
ROUNDING = 1e-12  # relative, of M
MOST_NAMES = 4  # in a cell
MOST_STEPS = 1000  # of MuJoCo in a sample


class RobotFile(NamedTuple):
    """A line of the list."""

    repository: str
    commit: str
    path: str
    digest: str
    handle: str

    @property
    def is_part(self) -> bool:
        """Whether it is only there to be included."""
        return self.handle == "+"

    @property
    def place(self) -> str:
        return f"{self.repository.replace('/', '+')}/{self.path}"


def listed(file: Path = LIST) -> list[RobotFile]:
    """The files of the list."""
    return [RobotFile(*line.split("\t")) for line in file.read_text().splitlines()]


def at_hand(folder: Path, robot: RobotFile, fetch: bool) -> Path | None:
    """Where a robot's file lies, got from its address if it is missing and asked for."""
    here = folder / robot.repository.replace("/", "+")
    address = ADDRESS.format(repository=robot.repository, commit=robot.commit)
    return had(here, robot.path, robot.digest, address * fetch)


# ---- one file


def gains(arm: hc.MjcfArm) -> hc.JointPD:
    """The same frequency and damping for each joint if the others are free."""
    inertia = 1.0 / np.diag(np.linalg.inv(arm.mass_matrix()))
    omega = 2.0 * math.pi * FREQUENCY
    return hc.JointPD(tuple(omega**2 * inertia), tuple(2.0 * RATIO * omega * inertia))


def loaded(file: Path, handle: str) -> tuple[hc.MjcfArm, str]:
    """An arm from a file without any option, or with its handle if that must be named."""
    try:
        return hc.MjcfArm(file), "answered"
    except ParameterError:
        if handle == "-":
            raise
    return hc.MjcfArm(file, site=handle), "answered, handle named"


def judged(file: Path, handle: str) -> dict[str, Any]:
    """What becomes of a file: its result in a word, limits, and agreement with MuJoCo."""
    begin = time.perf_counter()
    try:
        arm, result = loaded(file, handle)
    except ParameterError as error:
        return {"result": "refused", "why": str(error), "seconds": time.perf_counter() - begin}
    law = gains(arm)
    family = Study(arm, law, TS, TS).family("Kp")
    limit = family.limit()
    return {
        "result": result,
        "seconds": time.perf_counter() - begin,
        "joints": list(arm.names),
        "handle": arm.site,
        "notes": list(arm.notes),
        "scale": limit.high,
        "joint": arm.names[first_joint(family, limit)],
        "buzz": limit.frequency(TS),
        **compared(file, arm, law, limit.high),
    }


def compared(file: Path, arm: hc.MjcfArm, law: hc.JointPD, scale: float) -> dict[str, Any]:
    """Error of M(q) and radii beside the limit, by MuJoCo's model of the file as it is."""
    try:
        plain = HeldArm(file, arm)
    except ValueError as error:
        stated = not any(x.startswith("no inertia in the file") for x in arm.notes)
        other = urdf_inertia(file, arm) if stated else None
        found = {"oracle": "" if other is None else "Pinocchio", "without": str(error)}
        return found if other is None else {**found, "inertia": _off(arm, other)}
    found = {"oracle": "MuJoCo", "inertia": _off(arm, plain.inertia(arm.q)), "radii": []}
    if math.isfinite(scale) and plain.steps_of(TS) <= MOST_STEPS:
        sides = 1.0 - BESIDE, 1.0 + BESIDE
        found["radii"] = [plain.radius(law, f * scale, TS) for f in sides]
    return found


def _off(arm: hc.MjcfArm, other: np.ndarray) -> float:
    return float(np.abs(arm.mass_matrix() - other).max() / np.abs(other).max())


# ---- each in a process of its own


def _send(pipe: Any, file: Path, handle: str) -> None:
    try:
        pipe.send(judged(file, handle))
    except Exception as error:  # what was not foreseen is a row as well
        pipe.send({"result": "fault", "why": f"{type(error).__name__}: {error}"})


def alone(file: Path, handle: str, patience: float = PATIENCE) -> dict[str, Any]:
    """`judged` in a process that may crash or take too long."""
    kinds = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in kinds else "spawn")
    context.set_forkserver_preload([__spec__.name])  # imported once for all
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(there, file, handle))
    process.start()
    there.close()
    try:
        return here.recv() if here.poll(patience) else {"result": "too slow"}
    except EOFError:
        process.join()
        return {"result": "fault", "why": f"the process ended with {process.exitcode}"}
    finally:
        process.kill()
        process.join()


# ---- the page


def cells(row: dict[str, Any]) -> list[str]:
    """Cells of the table: one file."""
    name = f"[{row['repository']}](https://github.com/{row['repository']}/blob/{row['commit']}/"
    file = f"{name}{row['path'].replace(' ', '%20')}) {Path(row['path']).name}"
    if "joints" not in row:
        why = row.get("why", "").replace("|", "\\|")
        return [file, row["result"], "", "", "", "", why]
    first = f"{row['scale']:.3g} x: {row['joint']}, {row['buzz']:.3g} Hz"
    return [
        file,
        row["result"],
        str(len(row["joints"])),
        first if row["scale"] and math.isfinite(row["scale"]) else "none",
        _inertia(row),
        _limit(row),
        "; ".join(_short(x) for x in row["notes"] if "locked" in x or "held" in x),
    ]


def _short(note: str) -> str:
    """A note without the most of a long list of names."""
    names = note.split(", ")
    return (
        note
        if len(names) <= MOST_NAMES
        else ", ".join(names[:MOST_NAMES]) + f", ... ({len(names)})"
    )


def _inertia(row: dict[str, Any]) -> str:
    if "inertia" not in row:
        return "-"
    exact = "" if row["inertia"] < ROUNDING else f": {row['inertia']:.1e} off"
    return f"{row['oracle']}{exact}"


def _limit(row: dict[str, Any]) -> str:
    if not row.get("radii"):
        return "-"
    low, high = row["radii"]
    return "yes" if low < 1.0 < high else f"no: {low:.5f}, {high:.5f}"


def page(rows: list[dict[str, Any]], missing: int) -> str:
    """The Markdown page."""
    answered = [r for r in rows if "joints" in r]
    named = [r for r in answered if r["result"] != "answered"]
    xacro = [r for r in rows if "xacro" in r.get("why", "")]
    exact = [r for r in answered if "inertia" in r]
    held = [r for r in answered if r.get("radii")]
    text = [
        "# Robot files of others",
        "Robots as their repositories have them, loaded without any edit and without any option. "
        "The files are no part of this project: a program gets them by address and checks each "
        "by its SHA-256. Made by `benchmarks/robot_files.py`.",
        "    python -m benchmarks.robot_files --data robots --fetch --out out/bench",
        f"{len(rows)} files of {len({r['repository'] for r in rows})} repositories: "
        f"{len(answered)} are answered ({100.0 * len(answered) / len(rows):.0f} %), {len(named)} "
        "of them once the handle is named, since they hold several arms or tools. The others are "
        f"refused in the line that the table shows; {len(xacro)} of them are xacro, a program that "
        f"makes a URDF ({100.0 * len(answered) / max(1, len(rows) - len(xacro)):.0f} % without).",
        f"Of {len(exact)} there is another M(q), MuJoCo's own of the file as it is, or where "
        "MuJoCo does not load the file, Pinocchio's: "
        f"{sum(r['inertia'] < ROUNDING for r in exact)} agree within {ROUNDING:g} of the largest "
        f"entry. Of {len(held)} the common limit of all Kp was tried by MuJoCo at "
        f"{100.0 * BESIDE:g} % to either side: {sum(_limit(r) == 'yes' for r in held)} are "
        "stable below and unstable above.",
        common.table(
            [cells(r) for r in rows],
            ["file", "result", "joints", "all Kp may rise by", "M(q)", "limit", "locked, or why"],
        ),
        f"Gains: {FREQUENCY:g} Hz and a damping ratio of {RATIO:g} for each joint if the others "
        f"are free, at 1 kHz, torques a sample late, rates exact. Limit: the map of a sample is "
        "measured with MuJoCo's M(q), bias and passive forces under held torques, by RK4 in steps "
        f"of Ts/{FEWEST} or less and central differences; its radius must be below 1 at "
        f"{100.0 * (1.0 - BESIDE):g} % and above at {100.0 * (1.0 + BESIDE):g} %.",
        "## Data and machine",
        "All numbers, names and notes: [robot_files.json](robot_files.json).",
        "\n".join(f"- {x}" for x in common.foot()),
    ]
    if missing:
        text.insert(4, f"{missing} files were not at hand.")
    return "\n\n".join(text) + "\n"


def main(
    data: Path,
    fetch: bool = False,
    only: str = "",
    out: Path | None = None,
    listing: Path = LIST,
) -> list[dict[str, Any]]:
    """Judges the files at hand, prints the page and, with a folder, writes both files."""
    robots = [x for x in listed(listing) if only in x.place]
    at = {x: at_hand(data, x, fetch) for x in robots}
    rows = judge_all((x, file) for x, file in at.items() if file and not x.is_part)
    if not rows:
        raise SystemExit(f"robot_files: none in {data}; get them with --fetch")
    text = page(rows, sum(x is None for x in at.values()))
    print(text)
    if out:
        common.write(out, "robot_files", {"rows": json_ready(rows)})
        with files.atomic(out / "robot_files.md") as f:
            f.write(text.encode())
    return rows


def judge_all(pairs: Iterable[tuple[RobotFile, Path]]) -> list[dict[str, Any]]:
    """Rows of the files, with their addresses."""
    of = ("repository", "commit", "path")
    return [
        {**{x: getattr(robot, x) for x in of}, **alone(file.resolve(), robot.handle)}
        for robot, file in tqdm(list(pairs), disable=None)
    ]


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--fetch", action="store_true")
    parser.add_argument("--only", default="")
    parser.set_defaults(out=None)
    args = parser.parse_args()
    main(args.data, args.fetch, args.only, args.out)
