"""Stiff and extreme scenes, each beside the reference solution and the reference's own verdict.

    python -m benchmarks.extremes [--quick] [--only TEXT] [--out DIR]

Writes extremes.json; benchmarks.pages makes the page. A scene that fails is a row.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.model.operator import Operator
from hapticclay.model.signals import Multisine
from hapticclay.scene.scenario import Scenario
from tests.oracles import I1, I2

from . import common, reference

# Ours is right if the reference says one of these; "diverged" ends a run where the reference may go
# on into the limits
AGREE = {"diverged": ("unstable", "limit cycle"), "limit cycle": ("limit cycle",)}
ARRAYS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta")
NOTHING = 1e-20  # [J] of rounding
SAMPLES = 2000  # of position, compared with the reference


@dataclass(frozen=True)
class Case:
    """One scene. every: as simulate(). quick: part of the quick half."""

    group: str
    name: str
    scenario: Scenario
    quick: bool = False
    every: int = 1


def cut(velocity=(0.0, 0.0), **kw) -> Scenario:
    """The constant cut; fields that constant_cut() does not take are replaced."""
    apart = {"operator", "clay", "length", "stop_when_unstable", "muscle", "gain"} & kw.keys()
    own = {k: kw.pop(k) for k in apart}
    return replace(hc.constant_cut(**kw), velocity=velocity, **own)


NONE = Profile((), (0.0,))
WALL = Clay(
    Profile((0.0,), (0.0, 90.0), along="y"), Profile((0.0,), (0.0, 90.0), along="y")
)  # clay for y > 0
CORNER = Clay(
    Profile((0.05,), (0.0, 200.0)), Profile((0.02,), (0.0, 200.0), along="y")
)  # own borders on each axis
EVERYWHERE = Clay(Profile((), (100.0,)), Profile((), (100.0,)))
STRIPES = Clay(
    *[Profile(tuple(0.02 + 1e-3 * i for i in range(100)), (50.0, 100.0) * 50 + (50.0,))] * 2
)
HEAVY, STRONG = Operator(100.0, 0.0, 0.0), Operator(0.0, 0.0, 1e7)


def cases() -> list[Case]:
    """The registry, in the order of the page."""
    out: list[Case] = []

    def add(group: str, name: str, scenario: Scenario, quick: bool = False, every: int = 1) -> None:
        out.append(Case(group, name, replace(scenario, name=name), quick, every))

    g = "clay b"
    add(g, "b = 0", cut(b=0.0), True)
    add(g, "b = 1", cut(b=1.0))
    add(g, "b = 1e3", cut(b=1e3, t_max=4.0))
    add(g, "b = 1e4", cut(b=1e4, t_max=2.0), True)
    add(g, "b = 1e6", cut(b=1e6, t_max=2.0))
    add(g, "b = 1e9", cut(b=1e9, t_max=2.0), True)

    g = "speed"
    add(g, "b = 90 hit at 2 m/s", cut((2.0, 0.0), t_max=1.0), True)
    add(g, "b = 1e4 hit at 2 m/s", cut((2.0, 0.0), b=1e4, t_max=1.0))
    add(g, "b = 1e9 hit at 2 m/s", cut((2.0, 0.0), b=1e9, t_max=1.0), True)
    add(g, "b = 1e9 hit at 2 m/s aslant", cut((1.6, 1.2), b=1e9, t_max=1.0))
    add(
        g,
        "b = 1e9 hit at 2 m/s, motors of 0.1 N.m",
        cut((2.0, 0.0), b=1e9, t_max=1.5, torque_limit=(0.1, 0.1)),
    )
    add(
        g, "b = 1e9 hit at 2 m/s, hand of 100 kg", cut((2.0, 0.0), b=1e9, t_max=1.0, operator=HEAVY)
    )
    add(g, "b = 1e9 hit at 2 m/s, shaped", cut((2.0, 0.0), b=1e9, t_max=1.0, inertia_shaping=True))

    g = "hand"
    add(
        g,
        "mass 0, spring 6 N/m",
        cut(t_max=4.0, operator=Operator(0.0, 2.0, 6.0), force=(2.0, 0.0)),
    )
    add(g, "mass 100 kg", cut(t_max=6.0, operator=HEAVY, gain=(0.02, 0.02), b=0.0), True)
    add(g, "spring 1e7 N/m, mass 0", cut(t_max=0.5, operator=STRONG, gain=(1e-3, 1e-3)), True)
    add(
        g,
        "spring 1e7 N/m, mass 100 kg",
        cut(t_max=1.0, operator=Operator(100.0, 0.0, 1e7), gain=(1e-3, 1e-3)),
    )
    add(g, "spring 1e7 N/m, mass 0, K = (1, 0.5)", cut(t_max=0.5, operator=STRONG))
    add(
        g,
        "spring 1e7 N/m, mass 100 kg, moving at 0.2 m/s",
        cut((0.2, 0.0), t_max=1.0, operator=Operator(100.0, 0.0, 1e7), gain=(1e-3, 1e-3)),
    )
    add(
        g,
        "spring 1e7 N/m, mass 100 kg, damper 1e3 N.s/m, moving at 2 m/s",
        cut((2.0, 0.0), t_max=1.0, operator=Operator(100.0, 1e3, 1e7), gain=(1e-3, 1e-3)),
    )
    add(
        g,
        "spring 1e7 N/m, damper 1e5 N.s/m",
        cut(t_max=2.0, operator=Operator(0.25, 1e5, 1e7), gain=(1e-3, 1e-3)),
    )

    g = "gain K"
    add(g, "K = 1e-6", cut(gain=(1e-6, 1e-6), t_max=5.0), True)
    add(g, "K = 1 on y, unstable", cut(gain=(1.0, 1.0)), True)
    add(
        g,
        "K = 1 on y, goes on",
        cut(
            gain=(1.0, 1.0),
            stop_when_unstable=False,
            t_max=8.0,
            force=(0.1, 0.02),
            start=(0.06, 0.0),
            length=None,
        ),
    )
    add(
        g,
        "K = 3 on x, hand, shaped",
        cut(gain=(3.0, 0.3), b=100.0, operator=hc.Operator(), inertia_shaping=True, t_max=5.0),
        True,
    )
    add(
        g,
        "K = 25 on x, goes on",
        cut(
            gain=(25.0, 0.3),
            b=100.0,
            operator=hc.Operator(),
            stop_when_unstable=False,
            t_max=4.0,
            length=None,
            start=(0.1, 0.0),
            clay=EVERYWHERE,
        ),
    )
    add(g, "K = 1e4", cut(gain=(1e4, 1e4)), True)
    add(g, "K = 1e4 in free space", cut(gain=(1e4, 1e4), b=0.0, force=(1e-3, 0.0)))

    g = "step dt"
    add(g, "dt = 1e-5", cut(dt=1e-5, t_max=1.0, force=(1.5, 0.0)))
    add(g, "dt = 1e-2", cut(dt=1e-2))
    add(g, "dt = 1e-2, b = 1e9 hit at 2 m/s", cut((2.0, 0.0), b=1e9, dt=1e-2, t_max=1.0), True)
    add(
        g,
        "dt = 1e-2, spring 1e7 N/m, mass 0",
        cut(dt=1e-2, t_max=1.5, operator=STRONG, gain=(1e-3, 1e-3)),
    )

    g = "torque limits"
    add(g, "0.1 N.m, 1 N", cut(torque_limit=(0.1, 0.1)))
    add(g, "0.1 N.m, 3 N aslant", cut(torque_limit=(0.1, 0.1), force=(3.0, 1.0), t_max=8.0))
    add(
        g,
        "0.1 N.m, held by the motors' limit",
        cut(torque_limit=(0.1, 0.1), force=(0.0, 5.0), b=1e3, t_max=1.5),
        True,
    )
    add(
        g,
        "0.1 N.m, b = 1e4 hit at 2 m/s",
        cut((2.0, 0.0), torque_limit=(0.1, 0.1), b=1e4, t_max=1.0),
    )

    g = "start"
    add(g, "at rest inside b = 90", cut(start=(0.1, 0.0)))
    add(g, "at rest inside b = 1e9", cut(start=(0.1, 0.0), b=1e9, t_max=2.0))
    add(g, "on the near border", cut(start=(0.05, 0.0), t_max=4.0))
    add(g, "on the far border", cut(start=(0.15, 0.0), t_max=4.0))

    g = "borders"
    add(
        g, "along the border, from on it", cut(start=(0.05, 0.0), force=(0.0, 1.0), t_max=1.5), True
    )
    add(
        g,
        "along the border, onto it from both sides",
        cut(clay=WALL, start=(0.0, -1e-4), force=(1.0, 0.05), t_max=3.0),
        True,
    )
    add(
        g,
        "along the border, at a shallow angle",
        cut(clay=WALL, start=(0.0, -5e-4), force=(1.0, -0.02), t_max=4.0),
    )
    add(
        g,
        "along the border of b = 1e4",
        cut(
            clay=Clay(NONE, Profile((0.0,), (0.0, 1e4), along="y")),
            start=(0.0, -1e-4),
            force=(1.0, 0.5),
            t_max=2.0,
        ),
    )
    add(
        g,
        "against the border, swinging through it",
        cut(
            clay=Clay(Profile((0.0,), (0.0, 500.0)), NONE),
            start=(0.0, 0.0),
            force=(0.0, 0.0),
            t_max=6.0,
            length=None,
            muscle=Multisine(rms=(2.0, 0.0), low=1.0, high=3.0, period=4.0, seed=3),
        ),
        True,
    )
    add(g, "grazing a corner", cut(clay=CORNER, force=(1.0, 0.8), t_max=5.0), True)
    add(g, "through the corner itself", cut((0.5, 0.2), clay=CORNER, force=(0.0, 0.0), t_max=1.0))
    add(g, "100 layers of 1 mm", cut(clay=STRIPES, force=(3.0, 0.0)), True)

    g = "reach"
    add(g, "stretched along x", hc.free(force=(-1.0, 0.0), gain=(0.5, 0.5), t_max=120.0), True)
    add(g, "stretched along y", hc.free(force=(0.0, 1.0), gain=(0.5, 0.5), t_max=120.0))
    add(g, "folded", hc.free(force=(-2.0, -3.0), gain=(0.5, 0.5), t_max=120.0), True)
    far = math.sqrt(0.588**2 - 0.24**2)
    add(g, "path up to 2 mm from stretched", cut(origin=(far - 0.2, 0.24)))

    g = "force"
    add(g, "none", cut(force=(0.0, 0.0), t_max=2.0), True)
    add(g, "none, moving at 0.5 m/s", cut((0.5, 0.0), force=(0.0, 0.0), t_max=3.0), True)
    add(g, "against the motion", cut((0.5, 0.0), force=(-1.0, 0.0), t_max=1.5))
    add(g, "backwards out of the clay", cut(start=(0.055, 0.0), force=(-0.5, 0.0), t_max=1.5), True)

    g = "time"
    add(
        g,
        "1 h in b = 1e6, dt = 1e-2",
        cut(b=1e6, t_max=3600.0, dt=1e-2, force=(5.0, 0.0), start=(0.1, 0.0)),
        True,
        100,
    )
    add(
        g,
        "1 h in b = 1e6, dt = 2e-3",
        cut(b=1e6, t_max=3600.0, dt=2e-3, force=(20.0, 0.0), start=(0.06, 0.0)),
        False,
        1000,
    )
    add(
        g,
        "1 h on the hand's spring",
        cut(b=1.0, t_max=3600.0, dt=1e-2, operator=hc.Operator(), force=(0.5, 0.0)),
        False,
        100,
    )

    g = "sampled"
    add(g, "held", cut(control="sampled", t_max=1.5), True)
    add(
        g, "held, hand", cut(control="sampled", t_max=1.5, operator=hc.Operator(), force=(2.0, 0.0))
    )
    add(
        g,
        "held, b = 8e3, goes on",
        cut(
            control="sampled",
            b=8e3,
            start=(0.06, 0.0),
            t_max=2.0,
            gain=(1.0, 0.1),
            stop_when_unstable=False,
        ),
    )
    add(
        g,
        "implicit, b = 8e3",
        cut(
            control="sampled",
            render="physical",
            b=8e3,
            start=(0.06, 0.0),
            t_max=0.5,
            gain=(1.0, 0.1),
        ),
    )
    add(
        g,
        "implicit, b = 1e9 hit at 2 m/s",
        cut(
            (2.0, 0.0),
            control="sampled",
            render="physical",
            b=1e9,
            t_max=0.3,
            torque_limit=(1e4, 1e4),
        ),
    )

    g = "accurate"
    add(g, "cut, dt = 2e-3", cut(integrator="accurate", dt=2e-3), True)
    add(g, "b = 1e4 hit at 2 m/s", cut((2.0, 0.0), integrator="accurate", b=1e4, t_max=0.5))
    add(g, "K = 1 on y, unstable", cut(integrator="accurate", gain=(1.0, 1.0), dt=1e-3))
    add(
        g,
        "grazing a corner",
        cut(integrator="accurate", clay=CORNER, force=(1.0, 0.8), t_max=5.0, dt=1e-3),
    )
    return out


def run(case: Case, solve: Callable[..., Any] = reference.solve) -> dict[str, Any]:
    """Return one row: what became of the scene, here and in the reference.

    Args:
        case: the scene.
        solve: the reference.
    """
    row: dict[str, Any] = {
        "group": case.group,
        "name": case.name,
        "ours": "raised",
        "reference": "",
        "agree": False,
    }
    row |= dict.fromkeys(
        ("position", "energy", "residual", "nan", "sigma", "wall", "reference wall")
    )
    row |= {"warnings": 0, "slides": 0, "note": ""}
    home = os.getcwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        os.chdir(folder)  # where the engine would leave its log
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", hc.Warning)  # extremes are hardly meant
        try:
            r = hc.simulate(case.scenario, every=case.every)
        except Exception as error:  # noqa: BLE001  a row, whatever it is
            return row | {"note": f"{type(error).__name__}: {error}"}
        finally:
            left = os.listdir(folder)
            os.chdir(home)
    row |= {
        "ours": r.outcome.code,
        "nan": int(sum(np.sum(~np.isfinite(getattr(r, name))) for name in ARRAYS)),
        "residual": abs(r.energy["residual"]) / r.energy["throughput"]
        if r.energy["throughput"]
        else 0.0,
        "warnings": len(caught) + len(left),
        "wall": r.wall_time,
        "note": r.outcome.cause,
    }
    index = np.unique(np.linspace(0, len(r.t) - 1, SAMPLES).astype(int))[:-1]
    begin = time.perf_counter()
    try:
        x = solve(case.scenario, r.t[index])
    except Exception as error:  # noqa: BLE001
        return row | {"reference": "raised", "note": f"{type(error).__name__}: {error}"}
    row |= {
        "reference": x.code,
        "sigma": x.sigma if math.isfinite(x.sigma) else None,
        "slides": len(x.slides),
        "agree": x.code in AGREE.get(r.outcome.code, (r.outcome.code,)),
        "reference wall": time.perf_counter() - begin,
    }
    if x.code not in ("unstable", "limit cycle"):
        n = min(len(x.p), len(index))
        kinetic = 0.5 * (I1 * r.qd[:, 0] ** 2 + I2 * (r.qd[:, 0] + r.qd[:, 1]) ** 2)
        row["position"] = float(np.max(np.linalg.norm(r.p[index[:n]] - x.p[:n], axis=1)))
        if max(np.max(kinetic), x.kinetic) > NOTHING:
            row["energy"] = float(np.max(kinetic) / x.kinetic) if x.kinetic else None
    return row


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    rows = data["rows"]
    cells = [
        [
            r["group"],
            r["name"],
            r["ours"],
            r["reference"],
            "yes" if r["agree"] else "NO",
            common.number(r["position"]),
            r["note"],
        ]
        for r in rows
    ]
    head = ["group", "scene", "hapticclay", "reference", "agree", "position error [m]", "note"]
    return [
        f"{verdicts(rows)}: the arm in joint space, "
        "solved by DOP853, or by LSODA if stiff (1e-10), with border events in both directions, "
        "Filippov's sliding motion where a border holds the handle, and clipped torques; sampled "
        "scenes as the hybrid system. The reference has its own verdict: the poles of the loop "
        "linearised along the path (sigma, the largest real part of an oscillating one), and the "
        "speeds and torques of the last second. Where hapticclay ends an unstable run as "
        "diverged, the reference may say unstable or limit cycle, because it continues into the "
        "torque limits. The position error is for stable scenes. The CSV file also has the peak of "
        "kinetic energy (over that of the reference), the residual of the run's energy balance "
        "(over the energy put through), sigma, warnings and run times.",
        common.table(cells, head),
    ]


def verdicts(rows: list[dict[str, Any]]) -> str:
    """How many verdicts are those of the reference."""
    agreed = sum(r["agree"] for r in rows)
    return f"{agreed} of {len(rows)} verdicts agree with the reference"


def conclusions(data: dict[str, Any]) -> list[str]:
    """How many verdicts are right."""
    return [f"Stiff and extreme scenes. {verdicts(data['rows'])}."]


def tables(data: dict[str, Any]) -> list[dict[str, Any]]:
    """All measured rows, for the CSV file."""
    return data["rows"]


def main(out: Path = Path("out/bench"), quick: bool = False, only: str = "") -> dict[str, Any]:
    """Runs the scenes, writes the data; returns it."""
    chosen = [c for c in cases() if (c.quick or not quick) and only in f"{c.group}: {c.name}"]
    rows = []
    for case in tqdm(chosen, delay=2.0, disable=None, leave=False):
        rows.append(run(case))
    return common.write(out, "extremes", {"rows": rows})


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="half of the scenes")
    parser.add_argument("--only", default="", help="scenes whose 'group: name' holds this text")
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, args.quick, args.only))))
