"""First results on a fresh machine, beside the release before: install, first run, kinds of scene.

    python -m benchmarks.first_results --before PYTHON --now PYTHON [--wheels OLD NEW] [--out DIR]

Both are interpreters of environments of their own, outside the checkout, in which a wheel of the
one and of the other release is installed (the one before with its extra `fast`). With --wheels, the
installation into fresh environments is timed, too; the packages come from pip's cache. Every job is
a process of its own in an empty home folder, and is then repeated in the same one: what the first
process leaves there, as compiled code, is at hand. Counted is processor time from the start of the
process to its end. Writes first_results.md and first_results.json; some ten minutes.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import Any

from hapticclay import files

from . import common, provenance

LIMIT = 120.0  # [s] of wall time of a job
# names that have changed since the release before
PRELUDE = """
from dataclasses import replace
import hapticclay as hc
names = dir(hc)
was = "Interface" in names
Hardware, window = (hc.Interface, "window") if was else (hc.Hardware, "velocity_window")
hardware, shaping = ("interface", "shaping") if was else ("hardware", "inertia_shaping")
physical = "implicit" if was else "physical"
theory, zwidth = (hc, hc.zwidth) if was else (hc.theory, hc.walls.zwidth)
cut = hc.constant_cut()
"""
LAW = """
def law(t, q, qd, fh, state, params):
    return (-0.1 * qd[0], -0.1 * qd[1]), state
"""
SLAB = "hc.Profile((0.05, 0.1), (0.0, 20.0, 0.0), {})"
ARM = """
arm = hc.MjcfArm("leader_7")
law = hc.JointPD((240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2))
"""
PAIR = f"{ARM}\npair = hc.Pair(arm, arm, law, hc.Link(delay=4e-3), Ts=2e-3, t_max=0.5)"
SCENES = {
    "constant cut": "hc.simulate(cut)",
    "variable cut": "hc.simulate(hc.variable_cut())",
    "free space": "hc.simulate(hc.free())",
    "stability test": "hc.simulate(hc.stability_test())",
    "hand in the loop": "hc.simulate(replace(cut, operator=hc.Operator(), force=(2.0, 0.0)))",
    "inertia shaping": "hc.simulate(replace(cut, **{shaping: True}))",
    "sampled control": "hc.simulate(replace(cut, control='sampled', render='held'))",
    "hardware": "io = Hardware(encoder=65536, velocity='difference', delay=1e-3, adc_bits=12,"
    " dac_bits=12, **{window: 4})\n"
    "hc.simulate(replace(cut, control='sampled', **{hardware: io}))",
    "own controller": f"{LAW}\nhc.simulate(replace(cut, control='sampled', render=physical,"
    " controller=hc.Controller(law), force=(1.0, 0.0), t_max=2.0))",
    "accurate method": "hc.simulate(replace(cut, integrator='accurate'))",
    "clay that yields": f"p = {SLAB.format('Fy=(0.0, 2.0, 0.0)')}\n"
    "hc.simulate(replace(cut, clay=hc.Clay(p, p)))",
    "clay with springs": "springs = (hc.Spring(), hc.Spring(k=50.0, limit=1.0), hc.Spring())\n"
    f"p = {SLAB.format('springs=springs')}\n"
    "hc.simulate(replace(cut, clay=hc.Clay(p, p)))",
    "groove that stays": "block = hc.Groove(x=(0.02, 0.08), y=(-0.02, 0.02), pressure=20e3,"
    " tool=hc.Tool(width=0.01, depth=0.005), cells=(72, 48))\n"
    "hc.simulate(hc.Scenario(clay=hc.Clay.of_groove(block), gain=(1.0, 0.0), force=(2.0, 0.0),"
    " length=0.1, dt=1e-3, **{shaping: True}))",
    "smooth clay": "p = hc.Smooth((0.0, 0.2), (-0.1, 0.1),"
    " ((20.0, 90.0, 20.0), (20.0, 90.0, 20.0), (20.0, 90.0, 20.0)))\n"
    "hc.simulate(replace(cut, clay=hc.Clay(p, p)))",
    "muscle force as a chirp": "hc.simulate(replace(cut, operator=hc.Operator(),"
    " muscle=hc.Chirp((2.0, 0.0), 0.5, 5.0, 10.0)))",
    "step by step": "s = hc.Simulation(cut)\nfor _ in range(1000): s.step()",
    "batch of 200 runs": "hc.simulate_batch([hc.constant_cut(b=10.0 + i, t_max=1.0)"
    " for i in range(200)], keep='summaries')",
    "gain limit of a loop": "theory.gain_limit('x', 90.0, hc.Operator())",
    "Z-width of a wall": "wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5))\n"
    "zwidth(wall, quick=True)",
    "`hapticclay run constant`": ("run", "constant"),
    "identification of a block": "hc.studies.identify('x', 'G', periods=1, lines=20, period=2.5,"
    " band=(0.3, 20.0))",
    "`hapticclay video constant`":
    ("video", "constant", "--out", "film.gif", "--size", "320", "160"),
    "limits of an arm from a file": f"{ARM}\nprint(hc.theory.joint_limits(arm, law, 1e-3, 1e-3))",
    "run of an arm from a file": f"{ARM}\nhc.simulate(hc.Scenario(arm=arm, controller=law,"
    " Ts=1e-3, force=(0.0, 0.0), t_max=1.0))",
    "limits of leader and follower": f"{PAIR}\nprint(hc.theory.pair_limits(pair))",
    "run of leader and follower": f"{PAIR}\nhc.simulate(pair)",
}  # fmt: skip
NEW = tuple(SCENES)[-4:]  # which the release before lacks
FIRST: dict[str, Any] = {
    "import hapticclay": "import hapticclay",
    "`hapticclay --help`": ("--help",),
}


def clean() -> dict[str, str]:
    """The environment without what leads Python elsewhere."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "XDG_"))}


class Home:
    """A user's empty folder, in which processes of an interpreter run."""

    def __init__(self, python: str, folder: str, limit: float):
        self.python, self.folder, self.limit = python, folder, limit
        self.env = {**clean(), "HOME": folder, "TMPDIR": folder, "MPLBACKEND": "Agg"}

    def spent(self, *arguments: str) -> float | None:
        """Processor time of a process [s]; None beyond the limit.

        Raises:
            RuntimeError: it failed.
        """
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            made = subprocess.run(
                [self.python, *arguments], cwd=self.folder, env=self.env, capture_output=True,
                text=True, timeout=self.limit,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return None
        if made.returncode:
            raise RuntimeError(f"{self.python} {arguments}:\n{made.stderr}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def said(self, code: str) -> str:
        """What a program prints."""
        return subprocess.run(
            [self.python, "-c", code], cwd=self.folder, env=self.env, capture_output=True,
            text=True, check=True,
        ).stdout.strip()  # fmt: skip


def arguments_of(job: str | Sequence[str], prelude: str = PRELUDE) -> tuple[str, ...]:
    """The command line of a job: a program, or a command of hapticclay."""
    return ("-c", prelude + job) if isinstance(job, str) else ("-m", "hapticclay", *job)


def twice(python: str, arguments: Sequence[str], limit: float) -> dict[str, Any]:
    """Processor time of a job in an empty home folder, and again in the same one [s].

    A job that fails has a note in place of times.
    """
    with tempfile.TemporaryDirectory() as folder:
        home = Home(python, folder, limit)
        try:
            return {"first": home.spent(*arguments), "again": home.spent(*arguments)}
        except RuntimeError as error:
            return {"note": str(error)[-300:]}


VERSIONS = """
from importlib.metadata import version, PackageNotFoundError
for name in ("hapticclay", "mujoco", "numpy", "scipy", "numba"):
    try: print(name, version(name), end=", ")
    except PackageNotFoundError: pass
"""
SIZES = """
import pathlib, sysconfig
root = pathlib.Path(sysconfig.get_path("purelib"))
def size(folders): return sum(f.stat().st_size for x in folders for f in x.rglob("*")
    if f.is_file() and "__pycache__" not in f.parts)
without = ("pip", "setuptools", "pkg_resources", "_distutils_hack")
others = [x for x in root.iterdir() if not x.name.startswith(without)]
print(size([root / "hapticclay"]), size(others))
"""


def described(python: str) -> dict[str, Any]:
    """Versions of an environment, and its size without pip [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        home = Home(python, folder, LIMIT)
        own, whole = map(int, home.said(SIZES).split())
        return {
            "versions": home.said(VERSIONS).rstrip(", "),
            "MB": own / 1e6,
            "all_MB": whole / 1e6,
        }


def installed(wheel: str) -> float:
    """Time of the installation of a wheel into a fresh environment, from pip's cache [s]."""
    took = []
    for _ in range(2):  # the first fills the cache
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True)
            pip = [f"{folder}/bin/python", "-m", "pip", "install", "--quiet", wheel]
            begin = time.perf_counter()
            subprocess.run(pip, check=True, capture_output=True, env=clean())
            took.append(time.perf_counter() - begin)
    return took[-1]


def measure(
    pythons: dict[str, str], wheels: dict[str, str], limit: float, tell: Callable[[str], None]
) -> dict[str, Any]:
    """All numbers of both environments."""
    data: dict[str, Any] = {"limit": limit, "environments": {}, "rows": []}
    for name, python in pythons.items():
        data["environments"][name] = described(python)
        if name in wheels:
            data["environments"][name]["install"] = installed(wheels[name])
    for what, job in {**FIRST, **SCENES}.items():
        row: dict[str, Any] = {"job": what}
        for name, python in pythons.items():
            if name == "before" and what in NEW:
                row[name] = None
                continue
            arguments = arguments_of(job, "" if what in FIRST else PRELUDE)
            row[name] = twice(python, arguments, limit)
        data["rows"].append(row)
        tell(f"{what}: {row}")
    return data


# ---- page ----------------------------------------------------------------------------------------


def seconds(found: dict[str, Any] | None, which: str, limit: float) -> str:
    """A processor time of the table."""
    if found is None:
        return "not there"
    if "note" in found:
        return "failed"
    value = found[which]
    return f"> {limit:g}" if value is None else format(float(f"{value:.2g}"), "g")


def page(data: dict[str, Any]) -> str:
    """The page."""
    before, now = (data["environments"][x] for x in ("before", "now"))
    places = [
        ["packages", before["versions"], now["versions"]],
        ["hapticclay [MB]", *(f"{x['MB']:.1f}" for x in (before, now))],
        ["with all packages [MB]", *(f"{x['all_MB']:.0f}" for x in (before, now))],
    ]
    if "install" in now and "install" in before:
        places.append(["`pip install`, time [s]", *(f"{x['install']:.0f}" for x in (before, now))])
    cells = [
        [
            r["job"],
            *(
                seconds(r[x], y, data["limit"])
                for x in ("before", "now")
                for y in ("first", "again")
            ),
        ]
        for r in data["rows"]
    ]
    text = [
        "# First results on a fresh machine",
        "What a new user waits for, with the release before (0.2.0, with numba) and with this one. "
        "Wheels are installed into environments of their own; packages come from pip's cache.",
        common.table(places, ["", "before", "now"]),
        "Processor time [s] from the start of a process to its end, imports included: *first* in "
        "an empty home folder, *again* in the same one. The release before made single runs in "
        "Python, compiled a kind of scene where that paid, and kept the code in the home folder; "
        "this one is compiled when it is installed. *Not there*: the release before lacks it. "
        f"A job that is not done after {data['limit']:g} s on the clock is stopped.",
        common.table(cells, ["job", "before, first", "before, again", "now, first", "now, again"]),
        "## Data and machine",
        "All numbers: [first_results.json](first_results.json).",
        "\n".join(f"- {x}" for x in (made_words(data["made"]), data["machine"][0])),
    ]
    return "\n\n".join(text) + "\n"


def made_words(made: dict[str, Any]) -> str:
    """When and on which code it was measured."""
    load = " and ".join(map(str, made["load"]))
    return (
        f"commit `{made['commit']}`, {made['date']}, in {made['took']:.0f} s; load average {load}, "
        "before and after"
    )


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Measures, writes data and page; returns the data."""
    parser = common.parser(__doc__)
    parser.add_argument("--before", required=True, help="interpreter with the release before")
    parser.add_argument("--now", required=True, help="interpreter with this release")
    parser.add_argument(
        "--wheels", nargs=2, metavar=("OLD", "NEW"), help="to time their installation"
    )
    parser.add_argument("--limit", type=float, default=LIMIT, help="of a job [s]")
    options = parser.parse_args(argv)
    pythons = {"before": options.before, "now": options.now}
    wheels = dict(zip(pythons, options.wheels or (), strict=False))
    watch = provenance.Stopwatch("first_results")
    found = measure(pythons, wheels, options.limit, lambda text: print(text, flush=True))
    data = common.write(options.out, "first_results", {**found, "made": watch.stamp()})
    with files.atomic(options.out / "first_results.md") as f:
        f.write(page(data).encode())
    return data


if __name__ == "__main__":
    main()
