"""`hapticclay view`: windows and pages around sessions and records."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from ..errors import ParameterError
from ..files import writable
from ..model.tool import Tool
from . import console
from .device_options import DeviceOptions
from .options import Prefixed, RecordWord
from .run import deliver_record
from .unused import FIGURE_WORDS, Unused

if TYPE_CHECKING:
    from ..live.pair_session import PairSession
    from ..live.replay import Replay
    from ..live.session import Session
    from ..scene.pair import Pair
    from ..simulation.record import Record
    from ..views.live_page import LivePage


HAND, SERVER = ("device",), ("device-server",)


@dataclass(frozen=True)
class ViewCommand:
    """Pull the handle with the mouse, in a window or a browser; or replay a saved record.

    The mouse sets the muscle force; force, length and t_max of the experiment do not apply. At the
    end the record, its summary and its plots are written.

    Attributes:
        scenario: The experiment, a scenario file, or the folder of a record.
        stiffness: Stiffness of the hand as a multiple of the spring of Th (Eq. 19); 1 is the
            paper's arm at rest.
        tool: The tool.
        out: Folder for record.npz, summary.json and the plots; by default out/view/EXPERIMENT.
        every: Keep every n-th sample in the record.
        plots: Draw the plots.
        web: Show the session in a browser; no display is needed on this machine.
        host: Address of the browser page. Any address but that of this machine needs a token.
        port: Port of the browser page.
        figures: Formats and style of the plots.
        devices: A device that is the hand, or a server for programs.
        stream: Send the session as JSON over UDP to HOST:PORT, 60 times per second, as in
            localhost:9870, for PlotJuggler.
    """

    scenario: RecordWord = "constant"
    stiffness: float = 10.0
    tool: Prefixed[Tool] = Tool()
    out: Path | None = None
    every: int = 10
    plots: bool = True
    web: bool = False
    host: str = "127.0.0.1"
    port: int = 8080
    figures: console.FigureOptions = console.FigureOptions()
    devices: DeviceOptions = DeviceOptions()
    stream: str | None = None

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("force", "muscle", "length", "t-max"), "does not apply to a session: leave it out"),
        Unused(
            ("stiffness", "every", "out", "plots", "no-plots", "host", "port")
            + ("device", "device-server", *FIGURE_WORDS),
            "is for sessions: leave it out with a record",
            ("scenario=record",),
        ),
        Unused(
            ("web",),
            "shows sessions only: make a film of a record with hapticclay video",
            ("scenario=record",),
        ),
        Unused(("host", "port"), "is of the page: give --web too", (), ("web",)),
        Unused(("device-port",), "is of the server: give --device-server too", (), SERVER),
        Unused(("device-rate", "coupling"), "is of your device: give --device too", (), HAND),
        Unused(("device-plane", "device-force"), "is of a device: give one too", (), HAND + SERVER),
        Unused(("stiffness",), "is of the hand at the mouse: your device is the hand", HAND),
    )

    def __call__(self) -> int:
        from ..simulation.record import Record

        if isinstance(self.scenario, Record):
            replay(self.scenario, self.tool, self.stream)
            return 0
        writable(self.out or Path("out/view"))
        with self.devices.session(self.scenario, self.stiffness, self.tool, self.every) as session:
            self._play(session)
        if not session.recorded:
            print("nothing was recorded")
            return 0
        record = session.record()
        out = self.out or console.default_folder("view", record.scenario)
        figures = self.figures if self.plots else None
        deliver_record(record, out, figures, paced=True)
        self.devices.deliver(session, out, figures)
        return 0

    def _play(self, session: Session) -> None:
        """Plays a session until its window or page is closed."""
        with console.ctrl_c() as stop, streaming(session, self.stream):
            if self.web:
                from ..views.page import Page

                serve_page(Page(session, self.host, self.port), self.host, stop.is_set)
            else:
                from ..views.window import Window

                Window(session).show(stop.is_set)


@contextlib.contextmanager
def streaming(play: Session | Replay, address: str | None) -> Iterator[None]:
    """Sends what is played over UDP meanwhile."""
    if address is None:
        yield
        return
    from ..live.stream import UdpStream

    play.stream = UdpStream(address)
    try:
        yield
    finally:
        play.stream.close()


def replay(record: Record, tool: Tool, stream: str | None = None) -> None:
    """Shows a record in a window, in real time, until it is closed."""
    if not len(record.t):
        raise ParameterError("record", record.scenario.name, "holds no samples")
    if not record.scenario.is_closed_form:
        bound = "must be of the arm in closed form: hapticclay video films arms from files"
        raise ParameterError("record", record.scenario.name, bound)
    from ..live.replay import Replay
    from ..views.window import Window

    play = Replay(record, tool)
    with console.ctrl_c() as stop, streaming(play, stream):
        Window(play).show(stop.is_set)


def serve_page(page: LivePage, host: str, until: Callable[[], bool]) -> None:
    """Serves a page until it is to end, and says where it is."""
    from ..ports.guard import LOCAL

    if host not in LOCAL:
        print(
            f"warning: other machines can reach {host}, unencrypted; only this address grants "
            "access:",
            file=sys.stderr,
        )
    print(f"open {page.url} in a browser; Ctrl-C ends the session", flush=True)
    page.serve(until)


def show_pair(pair: Pair, host: str = "127.0.0.1", port: int = 8080) -> PairSession:
    """Serves the page of a pair until Ctrl-C, and returns its session."""
    from ..live.pair_session import PairSession
    from ..views.pair_page import PairPage

    session = PairSession(pair)
    with console.ctrl_c() as stop:
        serve_page(PairPage(session, host, port), host, stop.is_set)
    return session
