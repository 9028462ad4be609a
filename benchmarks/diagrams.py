"""Work-precision diagrams: error against run time, a line a method, down and left is better."""

from __future__ import annotations

import math

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222")
MARKERS = "osD^v<>P"


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


def draw(rows: list[dict], problem: str, labels: dict[str, str]):
    """The work-precision diagrams of a job, one for each kind of error that it has.

    Args:
        rows: see `ranking`.
        problem: the job.
        labels: of the axis of error, by kind.
    """
    import matplotlib
    from matplotlib.figure import Figure

    from hapticclay.views.style import STYLE

    mine = [r for r in rows if r["problem"] == problem]
    kinds = [k for k in labels if any(r[k] is not None for r in mine)]
    packages = list(dict.fromkeys(r["package"] for r in rows))
    lines, columns = math.ceil(len(kinds) / 2), min(2, len(kinds))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.8 * columns if columns > 1 else 6.4, 3.9 * lines + (lines < 2)))
        axes = figure.subplots(lines, columns, squeeze=False).ravel()
        for ax, kind in zip(axes, kinds, strict=False):
            for package, method in dict.fromkeys((r["package"], r["method"]) for r in mine):
                methods = list(dict.fromkeys(r["method"] for r in mine if r["package"] == package))
                points = [
                    r for r in mine if (r["package"], r["method"]) == (package, method) and r[kind]
                ]
                if not points:
                    continue
                points = line(points, kind)
                label = package if len(methods) == 1 else f"{package}, {method}"
                ax.plot(
                    [r["wall"] for r in points],
                    [r[kind] for r in points],
                    color=COLORS[packages.index(package) % len(COLORS)],
                    marker=MARKERS[methods.index(method) % 8],
                    ls=("-", "--", ":", "-.")[methods.index(method) % 4],
                    ms=4,
                    label=label,
                    lw=2.6 if package == "hapticclay" else 1.1,
                    zorder=5 if package == "hapticclay" else 2,
                )
            ax.set(xscale="log", yscale="log", xlabel="run time per simulated second [s]")
            ax.set_ylabel(labels[kind].replace(" [", "\n["), fontsize=9)
        for ax in axes[len(kinds) :]:
            ax.remove()
        handles, names = axes[0].get_legend_handles_labels()
        figure.legend(
            handles,
            names,
            loc="outside lower center",
            ncols=2 * columns,
            fontsize=8,
            handlelength=4.0,
        )
        figure.suptitle(f"{problem}: down and left is better", fontsize=11)
    return figure
