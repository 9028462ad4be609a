"""Stiff clay up to 1e9 N.s/m at one step, beside plain MuJoCo.

A position can be right whatever the impulse was: a hit and its rebound (hits.py) tell whether the
clay gave it in full.

    python -m benchmarks.stiffness [--dt 3.6e-4] [--out DIR]

The reference is the arm in joint space under Radau. Writes stiffness.json; benchmarks.pages makes
the page.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

import hapticclay as hc
from hapticclay.kernel.engine import warnings_caught
from hapticclay.model.constants import S

from . import common, hits
from .peers import mujoco_plain, ours
from .problems import EDGES, PROBLEMS, nonlinear_pieces

T = 2.0  # [s] simulated
SWEEP = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
BROKEN = (
    1e-3  # [m] of error in the final position, or ten times the exact peak of energy: broken down
)


def row(b: float, dt: float) -> dict[str, Any]:
    """Final position and peak of v^2 along x for one b:

    error against, and ratio to, the reference.
    """
    name = f"b = {b:g}"
    PROBLEMS[name] = s = hc.constant_cut(b=b, t_max=T, gain=(1.0, 0.1))
    try:
        exact = nonlinear_pieces(
            (0.0, b, 0.0), EDGES, s.gain, s.force, None, False, T, 1e-8, 1e-12, method="Radau"
        )
        p, _ = exact(np.array([T - 1e-9]))
        _, v = exact(np.linspace(0.0, T, 4001)[:-1])
        out: dict[str, Any] = {"b": b, "b dt/Lambda": b * dt * S[0].gain}
        hit = hits.row("hit", b, "fast", dt)
        out |= {"rebound": hit["leaves"], "felt": hit["force"]}
        for label, solve in (
            ("default", lambda: ours.solve(name, "fast", dt)),
            ("plain, implicitfast", lambda: mujoco_plain.solve(name, "implicitfast", dt)),
            ("plain, Euler", lambda: mujoco_plain.solve(name, "Euler", dt)),
        ):
            with warnings_caught():  # of a blow-up, which is a result
                r = solve()
            good = len(r.p) and abs(r.t[-1] - T) < 2.0 * dt and np.isfinite(r.p).all()
            error = abs(float(r.p[-1, 0] - p[0, 0])) if good else None
            energy = float(np.max(r.v**2) / np.max(v[:, 0] ** 2)) if good else None
            broken = error is None or energy is None or error > BROKEN or energy > 10.0
            out[label] = {"error": error, "energy": energy, "broken": broken}
        return out
    finally:
        del PROBLEMS[name]


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    rows = data["rows"]
    labels = [k for k in rows[0] if isinstance(rows[0][k], dict)]
    head = ["b [N.s/m]", "b dt/Lambda"] + [
        f"{k}: {x}" for k in labels for x in ("error [m]", "energy")
    ]
    head += ["default: rebound [s]", f"default: force after {hits.FELT:g} s"]
    cells = []
    for r in rows:
        line = [format(r["b"], "g"), format(r["b dt/Lambda"], ".3g")]
        for k in labels:
            x = r[k]
            line += (
                ["broken", "broken"]
                if x["broken"]
                else [common.number(x["error"]), format(x["energy"], ".3f")]
            )
        line += [common.number(r["rebound"]), common.number(r["felt"])]
        cells.append(line)
    return [
        f"The handle runs into clay of damping b at 0.1 m/s, in steps of {data['dt']:g} s. "
        f"Position error after {T:g} s, and peak of v² over that of the exact motion (1 is "
        "exact), against the arm solved by Radau. Broken: an error above 1 mm, ten times the "
        "energy, or not a number. Rebound: error of the time at which a handle that hit the clay "
        "at 0.2 m/s leaves it; force: relative error of the clay's force after the hit; both "
        "against the matrix exponential.",
        common.table(cells, head),
    ]


def conclusions(data: dict[str, Any]) -> list[str]:
    """Up to which damping hapticclay and plain MuJoCo hold."""
    rows = data["rows"]
    labels = [k for k in rows[0] if isinstance(rows[0][k], dict)]

    def largest(label: str) -> str:
        held = itertools.takewhile(lambda r: not r[label]["broken"], rows)
        return common.plain(format(max((r["b"] for r in held), default=0.0), "g"))

    def again(label: str) -> str:
        """From where on it holds again, after it broke."""
        held = list(itertools.takewhile(lambda r: not r[label]["broken"], reversed(rows)))
        if not held or len(held) == len(rows):
            return ""
        return f", again from {common.plain(format(held[-1]['b'], 'g'))} on"

    others = " and ".join(
        f"{largest(x)} N.s/m ({x.removeprefix('plain, ')}{again(x)})"
        for x in labels
        if x != "default"
    )
    return [
        f"Stiff clay. At a step of {1e3 * data['dt']:g} ms hapticclay's default method holds to "
        f"{largest('default')} N.s/m, MuJoCo alone to {others}; the stiffest clay tried has "
        f"{common.plain(format(rows[-1]['b'], 'g'))} N.s/m."
    ]


def main(out: Path = Path("out/bench"), quick: bool = False, dt: float = 3.6e-4) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    return common.write(
        out,
        "stiffness",
        {"dt": dt, "rows": [row(b, dt) for b in (SWEEP[1::3] if quick else SWEEP)]},
    )


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--dt", type=float, default=3.6e-4)
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, dt=args.dt))))
