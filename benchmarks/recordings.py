"""Other people's recordings: published numbers, and what hapticclay finds in the data.

    python -m benchmarks.recordings --data FOLDER [--fetch] [--out DIR]

FOLDER holds the recordings, as their addresses name them, or with --fetch gets what is missing.
Each file is checked by its SHA-256. Writes recordings.md and recordings.json; a minute or two of
processor time. The recordings themselves are no part of this project.
"""

from __future__ import annotations

import hashlib
import math
import re
import statistics
import urllib.request
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay import files
from hapticclay.results import json_ready
from hapticclay.studies.coulomb_axis import Axis, follow
from hapticclay.studies.pair_laws import PairLaw

from . import common

RIG = "Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments"
COMMIT = "2ae23ed4f6e6b9726be4153a1f094085124c0c57"
ADDRESS = f"https://raw.githubusercontent.com/{RIG}/{COMMIT}/"
SUMS = Path(__file__).with_name("recordings_rig.sha256")
PATIENCE = 60.0  # [s] for an answer
NAME = re.compile(r"(m[12])_question1/(?:m2_)?question1([a-f])_(free_motion|rigid|spring|foam)")


class Published(NamedTuple):
    """The rig's settings for a letter: P [N.m/rad], D [N.m.s/rad], how the leader is driven."""

    P: float
    D: float
    architecture: str


LETTERS = {
    letter: Published(P, D, architecture)
    for letters, architecture in (("abc", "position-position"), ("def", "position-force"))
    for letter, P, D in zip(letters, (8.0, 15.0, 25.0), (0.1, 0.1, 0.15), strict=True)
}
INERTIA = 1.0 / 631.36  # [kg.m^2], of the rig's parameter file
FILTER = 2.0 * math.pi * 100.0 / 2000.0  # share that the filter takes of each new error
COULOMB = 0.0325  # [N.m], in the middle of what the levers of the rig have
SETTLED = 0.2  # [s] after which errors count, as in identify_pair
LAG = (1.0 - FILTER) / FILTER / 2000.0  # its mean delay [s]
NOT_HAD = (
    (
        "[EMPS](https://www.nonlinearbenchmark.org), a position drive; its authors find 95.11 kg, "
        "203.5 N·s/m, Coulomb 20.39 N, offset -3.16 N",
        "none stated",
        "the package nonlinear-benchmarks brings no data: it loads them from Google Drive when "
        "they are used, which could not be reached from where this page was made",
    ),
    (
        "[Franka Panda](https://github.com/marcocognetti/FrankaEmikaPandaDynModel), exciting "
        "motions with torques of seven joints",
        "GPL-3.0",
        "can be had; hapticclay identifies one axis, not seven that are coupled",
    ),
    (
        "[dVRK](https://github.com/WPI-AIM/dvrk_dynamics_identification), MTM and PSM",
        "none stated",
        "not checked: without a licence; coupled joints as well",
    ),
    (
        "[BAM](https://github.com/Rhoban/bam), servos on a pendulum; for the STS3215 of 7.4 V its "
        "authors find 0.0284 kg·m² and Coulomb 0.0524 N·m",
        "Apache-2.0",
        "the logs are at Hugging Face, which could not be reached",
    ),
    (
        "[HSM150](https://github.com/malik-robert/HSM150-data), two motors on one shaft",
        "none stated",
        "not checked: without a licence",
    ),
    (
        "[Cluster Haptic Texture Database]"
        "(https://github.com/cluster-lab/Cluster-Haptic-Texture-Database), sliding on textures",
        "see there",
        "the recordings are at Google Drive, which could not be reached",
    ),
    (
        "recordings of textures and hands by Penn and Stanford; UR10e",
        "see there",
        "on servers of their own that could not be reached; no copy with a licence was found",
    ),
)


# ---- files


def sums(file: Path = SUMS) -> dict[str, str]:
    """SHA-256 of each recording by its path at its address."""
    rows = (line.split() for line in file.read_text().splitlines())
    return {path: digest for digest, path in rows}


def had(folder: Path, path: str, digest: str, address: str = "") -> Path | None:
    """The file of a recording, in its folder or beside the others; got from an address if given.

    Raises:
        SystemExit: a file is another one than the address had.
    """
    for file in (folder / path, folder / Path(path).name):
        if file.is_file():
            return _checked(file, file.read_bytes(), digest)
    if not address:
        return None
    with urllib.request.urlopen(address + path, timeout=PATIENCE) as answer:
        data = answer.read()
    file = folder / path
    _checked(file, data, digest)
    file.parent.mkdir(parents=True, exist_ok=True)
    with files.atomic(file) as f:
        f.write(data)
    return file


def _checked(file: Path, data: bytes, digest: str) -> Path:
    found = hashlib.sha256(data).hexdigest()
    if found != digest:
        raise SystemExit(f"recordings: {file} is another file: SHA-256 {found}, must be {digest}")
    return file


# ---- what is found


def judged(path: str, file: Path) -> dict[str, Any]:
    """One log of the rig: settings of its letter, and what is found."""
    log = hc.studies.PairLog.load(file)
    found = hc.studies.identify_pair(log)
    parts = NAME.match(path)
    assert parts is not None
    free = not math.isnan(found.simulated_rms)
    return {
        "log": Path(path).stem,
        "path": path,
        "day": parts[1],
        "letter": parts[2],
        "touches": parts[3].replace("_", " "),
        "architecture": found.architecture,
        "rms": found.rms,
        "simulated_rms": None if math.isnan(found.simulated_rms) else found.simulated_rms,
        "set_rms": set_rms(log, LETTERS[parts[2]]) if free else None,
        "numbers": {x.name: json_ready([x.value, x.low, x.high]) for x in found.numbers},
        "warnings": list(found.warnings),
    }


def set_rms(log: hc.studies.PairLog, letter: Published) -> float:
    """Error of a follower with the numbers that are set, behind the measured leader, rms [rad]."""
    law = PairLaw(letter.P, letter.D, LAG, 0.0)
    begin = (
        float(log.follower[0]),
        float(np.polyfit(log.t[:60] - log.t[0], log.follower[:60], 1)[0]),
    )
    error = float(log.leader[0]) - begin[0]
    axis = Axis(INERTIA, 0.0, COULOMB)
    q = follow(axis, log.leader.tolist(), lambda: law.start(log.Ts, error), begin, log.Ts)
    return float(np.std((log.leader - q)[log.t >= log.t[0] + SETTLED]))


def wide(rows: Iterable[dict[str, Any]], name: str) -> list[float]:
    """The values of a number in the logs that have it."""
    return [r["numbers"][name][0] for r in rows if name in r["numbers"]]


def gains(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Cells of the table of gains: a row a letter."""
    out = []
    for letter, set_ in LETTERS.items():
        mine = [r for r in rows if r["letter"] == letter]
        if not mine:
            continue
        P, D = wide(mine, "P"), wide(mine, "D")
        same = sum(r["architecture"] == set_.architecture for r in mine)
        scale = wide(mine, "force scale") if set_.architecture == "position-force" else []
        lags = [1e3 * x for name in ("filter lag", "delay") for x in wide(mine, name)]
        out.append(
            [
                letter,
                f"{same} of {len(mine)}",
                f"{set_.P:g}",
                _range(P, ".4g"),
                f"{100.0 * max(abs(x / set_.P - 1.0) for x in P):.2f} %",
                f"{set_.D:g}",
                _range(D, ".3g"),
                _range(lags, ".3g"),
                _range(scale, ".4f") if scale else "",
            ]
        )
    return out


def _range(values: list[float], form: str) -> str:
    """Median and range."""
    low, middle, high = min(values), statistics.median(values), max(values)
    return f"{middle:{form}} ({low:{form}} to {high:{form}})"


def _interval(number: list[float | None], scale: float, form: str) -> str:
    """A number with its interval, if it has one."""
    value, low, high = ("-" if x is None else f"{scale * x:{form}}" for x in number)
    return value if low == "-" else f"{value} ({low} to {high})"


def free(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Cells of the table of free followers."""
    out = []
    for r in rows:
        if r["simulated_rms"] is None:
            continue
        J, dry, wet = (
            r["numbers"][name] for name in ("inertia", "Coulomb friction", "viscous friction")
        )
        slow = any("inertia makes" in x for x in r["warnings"])
        out.append(
            [
                f"{r['day']}, {r['letter']}",
                f"{1e3 * r['rms']:.3f}",
                f"{1e3 * r['simulated_rms']:.3f}",
                f"{1e3 * r['set_rms']:.3f}",
                _interval(J, 1e3, ".2f") + (" *" if slow else ""),
                _interval(dry, 1e3, ".1f"),
                f"{1e3 * wet[0]:.1f}",
            ]
        )
    return out


def springs(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Cells of the table of what a follower on a spring makes the leader feel."""
    out = []
    for r in rows:
        n, P = r["numbers"], r["numbers"]["P"][0]
        if r["touches"] != "spring" or "contact stiffness" not in n:
            continue
        felt = next((n[x] for x in n if x.startswith("felt, ") and "P" in x), None)
        cells = [n.get(x) for x in ("contact stiffness", "contact stiffness, motor")]
        k = cells[0][0]
        shown = [_interval(x, 1.0, ".2f") if x else "" for x in (*cells, felt)]
        measured = _interval(n["felt, measured"], 1.0, ".2f") if "felt, measured" in n else ""
        out.append([f"{r['day']}, {r['letter']}", *shown, measured, f"{k * P / (k + P):.2f}"])
    return out


# ---- the page


def page(rows: list[dict[str, Any]], missing: int) -> str:
    """The Markdown page."""
    strong = [r for r in rows if r["simulated_rms"] and not _slow(r)]
    J = [1e3 * x for x in wide(strong, "inertia")] or [math.nan]
    text = [
        "# Recordings of others",
        "What hapticclay finds in public recordings, beside the numbers that their authors "
        "published. The recordings are no part of this project: a program gets them by address "
        "and checks each by its SHA-256. Made by `benchmarks/recordings.py`.",
        "    python -m benchmarks.recordings --data recordings --fetch --out out/bench",
        "| recording | licence | what is judged | outcome |\n|---|---|---|---|\n"
        f"| [one-axis pair, TU/e](https://github.com/{RIG}), {len(rows)} logs of 5 s at 2 kHz | "
        "MIT | [`hapticclay pair --data`](../pair_log.md) | P within "
        f"{100.0 * max(_off(r) for r in rows):.2g} % of that set, in every log |",
        "## The rig",
        "Two equal levers of 75 mm with a motor, an encoder and a force sensor each; a hand moves "
        "one. Letters a to c are position-position, d to f position-force, each with three gains "
        "P and D on the error behind e⁺ = (1 - κ) e + κ x with κ = 2π·100 Hz·Ts, whose mean delay "
        f"is {1e3 * LAG:.3f} ms. The days m1 and m2 differ in the hand's place and the sensors.",
        "### Gains, delays, architecture",
        common.table(
            gains(rows),
            [
                "letter",
                "architecture as set",
                "P set [N·m/rad]",
                "P found",
                "worst",
                "D set [N·m·s/rad]",
                "D found",
                "lag [ms]",
                "force scale",
            ],
        ),
        "Median and range over the logs of a letter; set is what the authors state. The force "
        "scale is the leader's torque over the follower's force, set to 1. The intervals of P in "
        "a log, some 0.02 %, are those of noise: they leave out how the software forms its "
        "difference and its filter, which moves P by the tenths of a percent in the table.",
        "### Free motion",
        common.table(
            free(rows),
            [
                "log",
                "leader less follower, measured [mrad rms]",
                "simulated as identified",
                "as set",
                "J [1e-3 kg·m²]",
                "Coulomb [mN·m]",
                "viscous [mN·m·s/rad]",
            ],
        ),
        f"As set: J = {1e3 * INERTIA:.3f}e-3 kg·m² of the rig's parameter file (from the slope of "
        "a frequency response), P and D of the letter, a filter of 100 Hz; friction has no "
        f"published number, and {1e3 * COULOMB:.1f} mN·m of Coulomb's was taken. Where inertia "
        f"makes a quarter of the torque or more, J here is {min(J):.2f}e-3 to {max(J):.2f}e-3. "
        "\\* marks logs where it makes less: friction that is not Coulomb's is then read as "
        "inertia, and the interval does not cover that.",
        "### Springs",
        common.table(
            springs(rows),
            [
                "log",
                "k, by sensor [N·m/rad]",
                "K, by motor",
                "felt, by k, K and P",
                "felt, measured",
                "k P/(k + P)",
            ],
        ),
        "k is the slope of the follower's force over its position, K that of its motor's torque; "
        "were both of one scale, and friction and inertia nothing, they would be equal. "
        "The follower is behind by K q/P, so the leader should feel kP/(K + P) under "
        "position-force, KP/(K + P) under position-position; measured is its motor's torque over "
        "its position. kP/(k + P) is what one feels if both scales agree. On day m1 the sensor "
        "reads about twice what the motor pushes.",
        "## What these data do not tell",
        "- **The hand**, which moves the leader: its force is measured by a sensor of unknown "
        "gain, its impedance not at all. On day m1 the sensor of letters d to f reads nearly "
        "nothing.\n"
        "- **Which side leads.** On day m1, letters a to c, the hand is at the follower.\n"
        "- **Stability.** No log is unstable; the limits of such a pair are theory.\n"
        "- **Friction beyond Coulomb's**, on which a slow motion depends.",
        "## What could not be had, or was not checked",
        common.table([list(x) for x in NOT_HAD], ["recording", "licence", "why"]),
        "## Data and machine",
        "All numbers: [recordings.json](recordings.json).",
        "\n".join(f"- {x}" for x in common.foot()[:3]),
    ]
    if missing:
        text.insert(4, f"{missing} logs were not at hand.")
    return "\n\n".join(text) + "\n"


def _slow(row: dict[str, Any]) -> bool:
    return any("inertia makes" in x for x in row["warnings"])


def _off(row: dict[str, Any]) -> float:
    return abs(row["numbers"]["P"][0] / LETTERS[row["letter"]].P - 1.0)


def main(data: Path, fetch: bool = False, out: Path | None = None) -> list[dict[str, Any]]:
    """Judges the recordings at hand, prints the page and, with a folder, writes both files."""
    address = ADDRESS if fetch else ""
    at = {path: had(data, path, digest, address) for path, digest in sums().items()}
    rows = [judged(path, file) for path, file in tqdm(at.items(), disable=None) if file]
    if not rows:
        raise SystemExit(f"recordings: none in {data}; get them with --fetch from {ADDRESS}")
    text = page(rows, sum(x is None for x in at.values()))
    print(text)
    if out:
        common.write(out, "recordings", {"source": ADDRESS, "rows": rows})
        with files.atomic(out / "recordings.md") as f:
            f.write(text.encode())
    return rows


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--fetch", action="store_true")
    parser.set_defaults(out=None)
    args = parser.parse_args()
    main(args.data, args.fetch, args.out)
