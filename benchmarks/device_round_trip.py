"""Round trips to the simulated device in real time: how fast a program's loop can be.

    python -m benchmarks.device_round_trip [--seconds 60] [--rate 1000] [--out DIR]

Server and client are two processes, as in use. Writes device_round_trip.json, .md and .png.
"""

from __future__ import annotations

import multiprocessing
import time
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

import hapticclay as hc
from hapticclay import files
from hapticclay.ports import Limits, connect

from . import common

SCENE = hc.Scenario(operator=hc.Operator(), force=(0.0, 0.0), length=None)
PATIENCE = 1.0  # [s] a late answer is late here, not lost
BINS = 60


def serve(pipe: Any) -> None:
    """The server's process: sends its address, and at the end how well it kept real time."""
    with hc.ports.serve(SCENE, clock="wall") as server:
        begin = time.perf_counter()
        pipe.send(server.url)
        pipe.recv()
        real, service = time.perf_counter() - begin, server.service
        skipped, samples = service.skipped, service.samples
    found = {"simulated_s": service.device.t, "real_s": real}
    pipe.send({**found, "skipped": skipped, "samples": samples})


def measure(seconds: float, rate: float) -> tuple[dict[str, Any], np.ndarray]:
    """Exchanges for so long.

    Args:
        seconds: of the clock.
        rate: exchanges in a second, at most.

    Returns:
        The figures, and each round trip [s].
    """
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    server = multiprocessing.get_context("spawn").Process(target=serve, args=(theirs,), daemon=True)
    server.start()
    url = ours.recv()
    with connect(url, Limits(rate=rate, ramp=0.0, patience=PATIENCE)) as device:
        end = time.perf_counter() + seconds
        while time.perf_counter() < end and not device.lost:
            device.exchange((0.5, 0.0, 0.0))
        timing, rows = device.log.timing(), device.log.rows
    ours.send("end")
    kept = ours.recv()
    server.join()
    trips = np.array([r.received - r.sent for r in rows])
    figures = {"seconds": seconds, "asked_rate_hz": rate, **timing.summary(), **kept}
    figures["real_time_factor"] = kept["simulated_s"] / kept["real_s"]
    figures["skipped_share"] = kept["skipped"] / max(1, kept["skipped"] + kept["samples"])
    return figures, trips


def table(f: dict[str, Any]) -> list[tuple[str, str]]:
    """The figures as rows."""
    p50, p99 = (1e3 * x for x in f["latency_p50_p99_s"])
    i50, i99 = (1e3 * x for x in f["interval_p50_p99_s"])
    return [
        ("asked rate", f"{f['asked_rate_hz']:g} Hz"),
        ("rate", f"{f['rate_hz']:.4g} Hz"),
        ("round trip, median", f"{p50:.3g} ms"),
        ("round trip, 99th percentile", f"{p99:.3g} ms"),
        ("interval, median", f"{i50:.3g} ms"),
        ("interval, 99th percentile", f"{i99:.3g} ms"),
        ("control samples skipped", f"{f['skipped']} of {f['skipped'] + f['samples']}"),
        ("real-time factor", f"{f['real_time_factor']:.4f}"),
    ]


def draw(trips: np.ndarray, figures: dict[str, Any], file: Path) -> None:
    """The histogram of the round trips, over the logarithm of time."""
    from matplotlib.figure import Figure

    from hapticclay.views.palette import BLACK, BLUE, VERMILION
    from hapticclay.views.style import figure_size, figure_style, stroke

    with figure_style():
        figure = Figure(figsize=figure_size(1, 3.6))
        ax = figure.add_subplot()
        ms = 1e3 * trips
        edges = np.geomspace(0.8 * ms.min(), 1.2 * ms.max(), BINS)
        ax.hist(ms, edges, color=BLUE, alpha=0.75)
        for q, color in ((0.5, BLACK), (0.99, VERMILION)):
            at = float(np.quantile(ms, q))
            name = "median" if q == 0.5 else "99th percentile"
            ax.axvline(at, color=color, lw=stroke(1.5), label=f"{name} {at:.3g} ms")
        ax.set(xscale="log", yscale="log", xlabel="round trip [ms]", ylabel="exchanges")
        ax.set_ylim(bottom=0.7)
        ax.legend(frameon=False)
        figure.savefig(file, dpi=100)


def report(figures: dict[str, Any]) -> str:
    """The page."""
    lines = [
        f"# Round trips to the simulated device, {figures['seconds']:g} s",
        tabulate(table(figures), ("", ""), "github", disable_numparse=True),
        "![Round trips](device_round_trip.png)",
        "\n".join(f"- {x}" for x in common.foot()),
    ]
    return "\n\n".join(lines) + "\n"


def main(out: Path | None, seconds: float = 60.0, rate: float = 1000.0) -> dict[str, Any]:
    """Measure; write page, data and histogram if a folder is given.

    Args:
        out: the folder.
        seconds: of the clock.
        rate: exchanges in a second, at most.
    """
    figures, trips = measure(seconds, rate)
    if out:
        common.write(out, "device_round_trip", figures)
        draw(trips, figures, out / "device_round_trip.png")
        with files.atomic(out / "device_round_trip.md") as f:
            f.write(report(figures).encode())
    return figures


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    words = parser.parse_args()
    for name, value in table(main(words.out, words.seconds, words.rate)):
        print(f"{name:30} {value}")
