"""Work-precision diagrams: error against run time, at most six lines, down and left is better."""

from __future__ import annotations

import math

from .ranking import SAMPLED

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222")
MARKERS = "osD^v<>"
LINES = 6  # of a diagram


def front(points: list[dict], kind: str) -> list[dict]:
    """The points that no other one beats in both error and run time, by run time.

    Args:
        points: rows, see `ranking`.
        kind: of the error.
    """
    out: list[dict] = []
    for r in sorted(points, key=lambda r: (r["wall"], r[kind])):
        if not out or r[kind] < out[-1][kind]:
            out.append(r)
    return out


def line(points: list[dict], kind: str) -> list[dict]:
    """The points of a line: in order of their settings, or the front where a method has two."""
    return front(points, kind) if isinstance(points[0]["setting"], str) else points


def lines(rows: list[dict], kinds: list[str]) -> dict[str, list[dict]]:
    """The rows of each line of a diagram, by its label.

    A line is a method; where there are more than six, it is the best of all methods of a package,
    for the six packages that keep an error of 1e-3 in the least time. Left out are hardware's
    methods, and those of hapticclay that compute the same numbers more slowly.
    """
    names = {r["method"] for r in rows if r["package"] == "hapticclay"}
    doubled = {x.removesuffix(end) for x in names for end in (" throughout", ", native")
               if x.endswith(end)}  # fmt: skip
    kept = [
        r
        for r in rows
        if not r["method"].startswith(SAMPLED)
        and not (r["package"] == "hapticclay" and r["method"] in doubled)
    ]
    out: dict[str, list[dict]] = {}
    for r in kept:
        out.setdefault(f"{r['package']}, {r['method']}".removesuffix(" throughout"), []).append(r)
    if len(out) <= LINES:
        return out
    packages: dict[str, list[dict]] = {}
    for r in kept:
        packages.setdefault(r["package"], []).append(r)

    def fastest(package: str) -> float:
        good = [r["wall"] for r in packages[package] if r[kinds[0]] and r[kinds[0]] <= 1e-3]
        return min(good, default=math.inf)

    return {name: packages[name] for name in sorted(packages, key=fastest)[:LINES]}


def draw(rows: list[dict], problem: str, labels: dict[str, str]):
    """The work-precision diagrams of a job, one for each kind of error that it has.

    Args:
        rows: see `ranking`.
        problem: the job.
        labels: of the axis of error, by kind.
    """
    import matplotlib
    from matplotlib.figure import Figure

    from hapticclay.views.captions import unit_text
    from hapticclay.views.style import STYLE

    mine = [r for r in rows if r["problem"] == problem]
    kinds = [k for k in labels if any(r[k] is not None for r in mine)]
    shown = lines(mine, kinds)
    whole = any(len({r["method"] for r in x}) > 1 for x in shown.values())  # packages
    high, wide = math.ceil(len(kinds) / 2), min(2, len(kinds))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.2 * wide if wide > 1 else 6.4, 3.4 * high + (high < 2)))
        axes = figure.subplots(high, wide, squeeze=False).ravel()
        for ax, kind in zip(axes, kinds, strict=False):
            for (label, found), color, marker in zip(shown.items(), COLORS, MARKERS, strict=False):
                points = [r for r in found if r[kind]]
                if points:
                    best = front(points, kind) if whole else line(points, kind)
                    ours = label.startswith("hapticclay")
                    x, y = [1e3 * r["wall"] for r in best], [r[kind] for r in best]
                    style = dict(lw=2.6, zorder=5) if ours else dict(lw=1.1, zorder=2)
                    ax.plot(x, y, marker=marker, color=color, ms=4, label=label, **style)
            ax.set(xscale="log", yscale="log", xlabel="run time per simulated second [ms]")
            ax.set_ylabel(unit_text(labels[kind]).replace(" [", "\n["), fontsize=9)
        for ax in axes[len(kinds) :]:
            ax.remove()
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=wide + 1, fontsize=8)
        figure.suptitle(f"{problem}: down and left is better", fontsize=11)
    return figure
