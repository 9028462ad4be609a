"""`hapticclay view`: windows and pages around sessions and records."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ..errors import ParameterError
from ..files import writable
from ..model.scenario import Scenario
from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from ..views.session import Replay, Session, stoppable
from .run import Experiment, deliver


def recorded(path: tyro.conf.Positional[Path]) -> Record:
    """A saved record.

    Args:
        path: its folder, or its record.npz.
    """
    return Record.load(path)


Recorded = Annotated[Record, tyro.conf.subcommand("record", constructor=recorded)]


@dataclass(frozen=True)
class View:
    """Take part: pull the handle with the mouse, in a window or a browser; or replay a record (its folder).

    The person is the muscle: force, length and t_max of the experiment do not count. On exit the record, its
    summary and its plots are written.
    """

    scenario: Experiment | Recorded
    stiffness: float = 10.0
    """Of the hand, as a multiple of the spring of Th (Eq. 19): 1 is the paper's arm at rest."""
    tool_width: float = TOOL.width
    """Width of the tool [m]."""
    tool_depth: float = TOOL.depth
    """Depth of the cut [m]."""
    out: Annotated[
        Path | None, tyro.conf.arg(help_behavior_hint="(default: out/view/EXPERIMENT)")
    ] = None
    """Folder for record.npz, summary.json and the plots."""
    every: int = 10
    """Keep every n-th sample in the record."""
    plots: bool = True
    """Draw the plots."""
    web: bool = False
    """Show it in a browser, without a display of our own."""
    host: str = "127.0.0.1"
    """Address to serve the browser on; other than this machine's, a token guards it."""
    port: int = 8080
    """Port to serve the browser on."""

    def __call__(self) -> int:
        tool = Tool(self.tool_width, self.tool_depth)
        if isinstance(self.scenario, Record):
            if self.web:
                raise ParameterError(
                    "web",
                    True,
                    "shows sessions only: make a film of a record with hapticclay video",
                )
            replay(self.scenario, tool)
            return 0
        writable(self.out or Path("out/view"))
        record = look(
            self.scenario, self.stiffness, tool, self.every, self.web, self.host, self.port
        )
        if record is None:
            print("nothing was recorded")
            return 0
        deliver(record, self.out or Path("out/view", record.scenario.name), self.plots)
        return 0


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
            from ..views.window import Window

            Window(session).show(stop.is_set)
    return session.record() if session.recorded else None


def replay(record: Record, tool: Tool) -> None:
    """Shows a record in a window, in real time, until it is closed.

    Raises:
        ParameterError: there is no display, no OpenGL, or nothing in the record.
    """
    if not len(record.t):
        raise ParameterError("record", record.scenario.name, "holds no samples")
    from ..views.window import Window

    with stoppable() as stop:
        Window(Replay(record, tool)).show(stop.is_set)


def _serve(session: Session, host: str, port: int, until: Callable[[], bool]) -> None:
    from ..views.page import LOCAL, Page

    page = Page(session, host, port)
    if host not in LOCAL:
        print(
            f"warning: {host} can be reached from other machines, unencrypted; only this address lets anyone in:",
            file=sys.stderr,
        )
    print(f"open {page.url} in a browser; Ctrl-C ends the session", flush=True)
    page.serve(until)
