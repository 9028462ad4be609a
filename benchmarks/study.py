"""A study of one problem: what it is, who solves it, and the section of its figures on the page.

A problem is a value of `Problem`: scene, reference solution and methods. The error of a run is that
of the handle position at given times.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from hapticclay.kernel import native

from . import common, diagrams, ranking
from .turns import take_turns

POSITION, UNIT = "position", "m"
ERRORS = {POSITION: f"largest error of the handle position [{UNIT}]"}
NATIVE = ", native"  # end of the name of a method that is compiled
THROUGHOUT = ", native throughout"  # in figures of releases that left some steps to Python


@dataclass(frozen=True)
class Run:
    """What a method made of a problem.

    Attributes:
        p: handle position at the problem's times [m], (n, 2); fewer rows if the run failed.
        wall: run time of the integration alone [s].
        note: why it failed, if it did.
    """

    p: np.ndarray
    wall: float
    note: str = ""


@dataclass(frozen=True)
class Method:
    """A way to solve a problem.

    Attributes:
        package: that it belongs to.
        name: of the method.
        settings: steps [s] or tolerances, coarse to fine; texts where a setting has two numbers.
        solve: one run with a setting.
    """

    package: str
    name: str
    settings: tuple[float | str, ...]
    solve: Callable[[Any], Run]


@dataclass(frozen=True)
class Problem:
    """One problem.

    Attributes:
        name: of the problem; its figure is named after it.
        about: the paragraph that states it.
        scene: as hapticclay solves it, but for its step.
        times: at which positions are compared, evenly spaced [s], (n,).
        reference: returns positions there [m], (n, 2), and the sentences on their own error.
        methods: returns the ways to solve it; what they compile, it compiles first.
    """

    name: str
    about: str
    scene: hc.Scenario
    times: np.ndarray
    reference: Callable[[], tuple[np.ndarray, str]]
    methods: Callable[[], list[Method]]


# ---- hapticclay ----------------------------------------------------------------------------------


def ours(scene: hc.Scenario, times: np.ndarray, name: str, dt: float) -> Run:
    """One run of hapticclay.

    Args:
        scene: of the problem.
        times: samples of the run at which positions are compared [s].
        name: of the method, see `our_methods`.
        dt: step [s].
    """
    integrator, _, how = name.partition(", ")
    s = replace(scene, dt=dt, integrator=integrator)
    r = hc.simulate(s, engine="native" if how else "python")
    first, every = round(times[0] / dt), round((times[1] - times[0]) / dt)
    note = "" if r.outcome.code == "time limit" else r.status
    return Run(r.p[first::every][: len(times)], r.wall_time, note)


def our_methods(
    scene: hc.Scenario, times: np.ndarray, ladders: dict[str, tuple[float, ...]]
) -> list[Method]:
    """hapticclay's methods; those that are compiled, only where the kernel is.

    Args:
        scene: of the problem.
        times: of the positions [s].
        ladders: steps [s] by method: an integrator, then nothing or NATIVE.
    """
    out = []
    if native.is_there():
        common.warm()
    for name, steps in ladders.items():
        if name.endswith(NATIVE) and not native.is_there():
            continue
        solve = functools.partial(ours, scene, times, name)
        out.append(Method("hapticclay", name, steps, solve))
    return out


# ---- figures of a problem ------------------------------------------------------------------------


def error(run: Run, exact: np.ndarray) -> float | None:
    """Largest error of the position [m]; None for a run that failed."""
    if run.note or len(run.p) < len(exact) or not np.isfinite(run.p).all():
        return None
    return float(np.max(np.linalg.norm(run.p - exact, axis=1)))


def measure(problem: Problem, quick: bool, rounds: int) -> tuple[list[dict[str, Any]], str]:
    """All rows of a problem, and what its reference says of its own error.

    Run times are medians over rounds, in which all methods and settings take turns.

    Args:
        problem: the problem.
        quick: two settings of each method alone.
        rounds: how often each setting is run.
    """
    exact, notes = problem.reference()
    jobs = [(m, x) for m in problem.methods() for x in m.settings[: 2 if quick else None]]
    runs = [(f"{m.package} {m.name}", functools.partial(m.solve, x)) for m, x in jobs]
    first, walls = take_turns(runs, rounds)
    rows = [
        {
            "problem": problem.name,
            "package": m.package,
            "method": m.name,
            "setting": x,
            POSITION: error(r, exact),
            "wall": wall / problem.scene.t_max,
            "note": r.note,
        }
        for (m, x), r, wall in zip(jobs, first, walls, strict=True)
    ]
    return rows, notes


def figure_name(problem: str) -> str:
    """File of a problem's figure."""
    return f"{problem.replace(' ', '_')}.png"


def main(
    name: str, problems: list[Problem], omissions: list[str], out: Path, quick: bool
) -> dict[str, Any]:
    """Measures problems, writes the data; returns it.

    Args:
        name: of the part of the page.
        problems: its problems.
        omissions: what it leaves out, and why.
        out: the folder.
        quick: two settings of each method, two rounds.
    """
    rows, texts = [], {}
    for x in problems:
        found, reference = measure(x, quick, 2 if quick else 5)
        rows += found
        texts[x.name] = [x.about, reference]
    return common.write(out, name, {"omissions": omissions, "texts": texts, "rows": rows})


# ---- the page ------------------------------------------------------------------------------------


def least_errors(rows: list[dict[str, Any]]) -> dict[str, float]:
    """The least error that each package reached at any run time."""
    least: dict[str, float] = {}
    for r in rows:
        if r[POSITION] is not None:
            least[r["package"]] = min(r[POSITION], least.get(r["package"], np.inf))
    return least


def who_goes_further(least: dict[str, float]) -> str:
    """A sentence, after a space, on the packages that went below hapticclay's least error."""
    mine = least.get("hapticclay", np.inf)
    further = [package for package, x in least.items() if x < mine]
    only = " and ".join(further)
    return f" Only {only} went below {common.number(mine)} {UNIT}." if further else ""


def ranked(rows: list[dict[str, Any]]) -> list[str]:
    """Who leads at each asked error: a line and a table."""
    found = ranking.leaders(rows, POSITION)
    return [ranking.who_leads(found, UNIT), ranking.table_of_leaders(found, UNIT)]


def shown(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of the table: of methods with two numbers to set, those on the front alone."""
    out = []
    for key in dict.fromkeys((r["problem"], r["package"], r["method"]) for r in rows):
        mine = [r for r in rows if (r["problem"], r["package"], r["method"]) == key]
        known = [r for r in mine if r[POSITION] is not None]
        out += diagrams.line(known, POSITION) if isinstance(mine[0]["setting"], str) else mine
    return out


def is_of_both(data: dict[str, Any]) -> bool:
    """Whether figures tell runs that are compiled throughout from others."""
    return any(str(r.get("method", "")).endswith(THROUGHOUT) for r in data.get("rows", ()))


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page, a section a problem."""
    text = []
    for problem, about in data["texts"].items():
        rows = [r for r in data["rows"] if r["problem"] == problem]
        text += [f"## {problem.capitalize()}", *about]
        text += [f"![work-precision diagram]({figure_name(problem)})", *ranked(rows)]
        least = least_errors(rows)
        reached = (f"{package} {common.number(x)} {UNIT}" for package, x in least.items())
        further = who_goes_further(least)
        single = [r for r in rows if not r["method"].endswith(THROUGHOUT)]
        if len(single) < len(rows):
            text += [
                "The release measured here made the first steps of a process that cross a border "
                "or stop in Python; later releases compile all steps ahead. Its runs with such "
                "steps (methods without `throughout`):",
                *ranked(single),
            ]
        text += [
            "hapticclay's fastest setting for each requested error:",
            ranking.table_of_settings(ranking.recommend(rows, {"hapticclay"}, POSITION), UNIT),
            f"Least error with any of the settings: {', '.join(reached)}.{further}",
        ]
    return text


def conclusions(data: dict[str, Any]) -> list[str]:
    """A sentence for each problem: who is fastest, by requested error."""
    out = []
    for problem in data["texts"]:
        rows = [r for r in data["rows"] if r["problem"] == problem]
        lead = ranking.who_leads(ranking.leaders(rows, POSITION), UNIT)
        out.append(f"{problem.capitalize()}. {lead}{who_goes_further(least_errors(rows))}")
    return out


def figures(data: dict[str, Any]) -> dict[str, Any]:
    """The diagram of each problem, by file."""
    return {figure_name(x): diagrams.draw(data["rows"], x, ERRORS) for x in data["texts"]}


def tables(data: dict[str, Any]) -> list[dict[str, Any]]:
    """All measured rows, for the CSV file."""
    return shown(data["rows"])
