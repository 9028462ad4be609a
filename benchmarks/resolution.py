"""Force over velocity in the clay through real hardware.

Its error against the resolution of encoder and converters.

    python -m benchmarks.resolution [--out DIR]

The constant cut with sampling, hold and a delay of one sample; writes resolution.md and
resolution.json, whose every figure comes from the runs.
"""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

import hapticclay as hc
from hapticclay import files
from hapticclay.model.constants import B_CONSTANT, L2, TS
from hapticclay.theory import linear_loop

from . import common

FORCE = 5.0  # [N] of the hand: 5 cm/s in the clay
END = 0.20  # [m] of the cut
WITHIN = (0.08, 0.14)  # [m] where the cut is steady
COUNTS = (4096, 16384, 65536, 262144, 1048576)
WINDOWS = (1, 16)
BITS = 12  # of both converters


def run(
    counts: int | None, window: int, bits: int | None = BITS, delay: float = TS
) -> dict[str, Any]:
    """One cut: what its clay felt like. Errors are relative to b."""
    velocity = "exact" if counts is None else "difference"
    span = window if counts else 1
    parts = hc.Hardware(
        encoder=counts,
        velocity=velocity,
        velocity_window=span,
        adc_bits=bits,
        dac_bits=bits,
        delay=delay,
    )
    s = dataclasses.replace(
        hc.constant_cut(force=(FORCE, 0.0), inertia_shaping=True, control="sampled", length=END),
        hardware=parts,
    )
    r = hc.simulate(s)
    mine = (r.p[:, 0] > WITHIN[0]) & (r.p[:, 0] < WITHIN[1])
    out: dict[str, Any] = {
        "counts": counts,
        "window": window if counts else None,
        "bits": bits,
        "delay": delay,
        "status": r.outcome.code,
        "mean": None,
        "rms": None,
        "least": None,
    }
    if mine.sum() > 100:
        b = r.b[mine, 0].mean()
        v, fe = r.v[mine, 0], r.fe[mine, 0]
        out["mean"] = float(fe.mean() / v.mean() / b - 1.0)
        out["rms"] = float(np.sqrt(np.mean((fe / v / b - 1.0) ** 2)))
    if counts:  # one in the window, at the handle, over the cut's own speed
        speed = linear_loop.steady_speed(s.gain[0], FORCE, B_CONSTANT)
        out["least"] = L2 * math.tau / counts / (window * TS) / speed
    return out


def measure(
    counts: tuple[int, ...] = COUNTS, windows: tuple[int, ...] = WINDOWS
) -> list[dict[str, Any]]:
    """All rows: ideal hardware, converters alone, then encoders."""
    rows = [run(None, 1, None, 0.0), run(None, 1, None), run(None, 1)]
    return rows + [run(c, w) for c in counts for w in windows]


def page(rows: list[dict[str, Any]]) -> str:
    """The Markdown page."""
    head = [
        "encoder [counts/turn]",
        "window [samples]",
        "A/D, D/A [bits]",
        "delay [ms]",
        "a count [share of v]",
        "mean error of fe/v",
        "rms error of fe/v",
        "status",
    ]
    cells = []
    for r in rows:
        text = [
            r["counts"] or "exact",
            r["window"] or "-",
            r["bits"] or "exact",
            f"{1e3 * r['delay']:g}",
        ]
        figures = ["-" if r[k] is None else common.number(r[k]) for k in ("least", "mean", "rms")]
        cells.append([str(x) for x in text] + figures + [r["status"]])
    return (
        "\n\n".join(
            [
                "# Force over velocity against resolution",
                f"The constant cut at {FORCE:g} N, with inertia shaping, sampled and held every "
                f"{1e3 * TS:g} ms: fe as the motors hold it over the true velocity, from "
                f"{100 * WITHIN[0]:g} to {100 * WITHIN[1]:g} cm, against b. Velocity is the "
                "difference of encoder angles over the window; the fifth column is the velocity "
                "of one count over the window as a share of the speed. The mean error is that of "
                "mean fe over mean v. Made by `benchmarks/resolution.py`.",
                tabulate(cells, head, tablefmt="github", disable_numparse=True),
                "## Machine",
                "\n".join(f"- {x}" for x in common.foot()),
            ]
        )
        + "\n"
    )


def main(out: Path | None, **kw: Any) -> list[dict[str, Any]]:
    """Measures, prints and, with a folder, writes both files."""
    rows = measure(**kw)
    print(page(rows))
    if out:
        with files.atomic(out / "resolution.json") as f:
            f.write((json.dumps({"rows": rows}, indent=1, allow_nan=False) + "\n").encode())
        with files.atomic(out / "resolution.md") as f:
            f.write(page(rows).encode())
    return rows


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.set_defaults(out=None)
    main(parser.parse_args().out)
