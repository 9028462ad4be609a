"""Runs that take turns: every setting once a round, so that a slow minute slows all alike."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import Any

from tqdm import tqdm

LONG = 5.0  # [s] of run time, of all repetitions, from which a run is not repeated


def take_turns(
    jobs: Sequence[tuple[str, Callable[[], Any]]], rounds: int
) -> tuple[list[Any], list[float]]:
    """Runs all jobs once a round, with a bar.

    Args:
        jobs: a name to show and the run, which returns a result with its run time `wall` [s].
        rounds: how often each is run, until its runs have taken LONG.

    Returns:
        The results of the first round, and for each job the median of its run times [s].
    """
    first: list[Any] = []
    walls: list[list[float]] = [[] for _ in jobs]
    with tqdm(total=rounds * len(jobs), delay=2.0, disable=None, leave=False) as bar:
        for n in range(rounds):
            for i, (name, run) in enumerate(jobs):
                bar.set_description(name)
                if sum(walls[i]) < LONG:
                    r = run()
                    walls[i].append(r.wall)
                    if n == 0:
                        first.append(r)
                bar.update()
    return first, [statistics.median(x) for x in walls]
