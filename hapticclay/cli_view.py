"""What the commands `view` and `video` do: windows, pages and films around sessions, scenarios and records."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .errors import ParameterError, choice
from .experiments import SCENARIOS
from .params import Scenario
from .player import Replay, stoppable
from .record import Record
from .removal import Tool
from .session import Session

COMMANDS = ("view", "video")


def complete(words: list[str]) -> list[str]:
    """Command line words with what may be left out: the experiment ("constant"), the word "record" before a path.

    Raises:
        ParameterError: a word is neither an experiment nor a file.
    """
    if words[:1] not in [[c] for c in COMMANDS] or "--help" in words[:2] or "-h" in words[:2]:
        return words
    command, *rest = words
    if not rest or rest[0].startswith("-"):
        late = [w for before, w in zip(rest, rest[1:], strict=False) if w in SCENARIOS and before != "--out"]
        if late:
            raise ParameterError("arguments", "", f"the experiment comes first: hapticclay {command} {late[0]} ...")
        return [command, "constant", *rest]
    if rest[0] in SCENARIOS or rest[0] == "record":
        return words
    if not Path(rest[0]).exists() and os.sep not in rest[0]:
        try:
            choice("experiment", rest[0], tuple(SCENARIOS))
        except ParameterError as error:
            raise ParameterError(error.field, error.value, f"{error.bound}; or the folder of a record") from None
    return [command, "record", *rest]


def look(
    scenario: Scenario, stiffness: float, tool: Tool, every: int, web: bool, host: str, port: int
) -> Record | None:
    """A session in a window or a browser, until it is closed; what was recorded, None if nothing was.

    Raises:
        ParameterError: there is no display, no OpenGL, or no viser.
    """
    session = Session(scenario, stiffness, tool, every)
    with stoppable() as stop:
        if web:
            _serve(session, host, port, stop.is_set)
        else:
            from .view import Window

            Window(session).show(stop.is_set)
    return session.record() if session.recorded else None


def replay(record: Record, tool: Tool) -> None:
    """Shows a record in a window, in real time, until it is closed.

    Raises:
        ParameterError: there is no display, no OpenGL, or nothing in the record.
    """
    if not len(record.t):
        raise ParameterError("record", record.scenario.name, "holds no samples")
    from .view import Window

    with stoppable() as stop:
        Window(Replay(record, tool)).show(stop.is_set)


def film(
    record: Callable[[], Record], out: Path, camera: str, speed: float, size: tuple[int, int], plots: bool, tool: Tool,
    smooth: bool,
) -> Path:  # fmt: skip
    """Writes a film, under a progress bar, of a record that is made once it is sure that it can be filmed.

    Raises:
        ParameterError: as video.film.
    """
    from tqdm import tqdm

    from . import video

    def progress(images: Iterator[np.ndarray], count: int) -> Iterator[np.ndarray]:
        return iter(tqdm(images, total=count, desc=out.name, unit="frame", disable=None, leave=False))

    video.ready(out, speed, size)
    return video.film(record(), out, camera, speed, size, plots, tool, progress, smooth)


def _serve(session: Session, host: str, port: int, until: Callable[[], bool]) -> None:
    from .gate import LOCAL
    from .web import Page

    page = Page(session, host, port)
    if host not in LOCAL:
        print(
            f"warning: {host} can be reached from other machines, unencrypted; only this address lets anyone in:",
            file=sys.stderr,
        )
    print(f"open {page.url} in a browser; Ctrl-C ends the session", flush=True)
    page.serve(until)
