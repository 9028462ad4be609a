"""Devices beside a session of `hapticclay view`, and reports of loops."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound
from . import console, walls
from .unused import Unused

if TYPE_CHECKING:
    from ..live.session import Session
    from ..ports.exchanges import Exchanges
    from ..scene.scenario import Scenario
    from ..studies.removal import Tool


@dataclass(frozen=True)
class DeviceOptions:
    """A device beside the session: one that is your hand, or the arm as one for programs.

    Attributes:
        device: Address of an Inverse service, as ws://127.0.0.1:10001: its device is your hand, and
            gets the force of the clay.
        device_server: Serve the arm of the session as an Inverse3, which programs drive while the
            mouse is the hand; compensator and servo do not act.
        device_port: Port of that server; 0 for a free one.
        device_plane: Plane of the device in which the arm moves.
        device_force: Longer forces are shortened to this [N]; by default 3 on your hand, 10 on the
            arm.
        device_rate: Exchanges with your device in a second [Hz].
        coupling: Stiffness [N/m] and damping [N.s/m] between your device and the arm; the damping
            must be K Ts/2 at least.
    """

    device: str | None = None
    device_server: bool = False
    device_port: int = 10_001
    device_plane: Literal["xy", "xz"] = "xy"
    device_force: Annotated[float | None, Bound(unit="N")] = None
    device_rate: Annotated[float, Bound(unit="Hz")] = 1000.0
    coupling: tuple[walls.Spring, walls.Damper] = (300.0, 5.0)

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(
            ("device",),
            "is for one's own hand: the arm cannot be served beside it",
            ("device-server",),
        ),
    )

    @property
    def given(self) -> bool:
        """Whether there is a device."""
        return bool(self.device or self.device_server)

    @contextlib.contextmanager
    def session(
        self, scenario: Scenario, stiffness: float, tool: Tool, every: int
    ) -> Iterator[Session]:
        """The session, beside its device if there is one."""
        if self.device:
            with self._hand(scenario) as hand:
                from ..live.device_sessions import DeviceSession

                yield DeviceSession(scenario, hand, tool, every)
        elif self.device_server:
            from ..live.device_sessions import ServedSession

            force = {} if self.device_force is None else {"largest_force": self.device_force}
            session = ServedSession(scenario, stiffness, tool, every, **force)
            with self._server(session):
                yield session
        else:
            from ..live.session import Session

            yield Session(scenario, stiffness, tool, every)

    @contextlib.contextmanager
    def _hand(self, scenario: Scenario) -> Iterator[Any]:
        from ..ports.client import DeviceClient
        from ..ports.coupled import Coupled, DeviceHand
        from ..ports.limits import Limits

        K, B = self.coupling
        coupling, limits = Coupled(K, B, self.device_plane), Limits(rate=self.device_rate)
        if self.device_force is not None:
            limits = Limits(self.device_force, rate=self.device_rate)
        coupling.check(limits.Ts)
        assert self.device
        with DeviceClient(self.device, limits) as client:
            start = float(scenario.start[0]), float(scenario.start[1])
            hand = DeviceHand(client, coupling, start)
            print(f"device {client.device_id} is the hand", flush=True)
            if hand.coupling.K < K:
                print(f"its rate carries a coupling of {hand.coupling.K:.4g} N/m only", flush=True)
            yield hand

    @contextlib.contextmanager
    def _server(self, session: Any) -> Iterator[None]:
        from ..live.device_sessions import LiveDevice
        from ..ports.server import DeviceServer
        from ..ports.service import Service
        from ..ports.sessions import Inverse3

        logging.basicConfig(format="hapticclay: %(message)s", level=logging.WARNING)
        shown = Inverse3(plane=self.device_plane)
        session.service = Service(LiveDevice(session), clock="wall", inverse3=shown)
        with DeviceServer(session.service, port=self.device_port) as server:
            print(f"an Inverse3 listens at {server.url}", flush=True)
            yield

    def deliver(self, session: Session, out: Path, figures: console.FigureOptions | None) -> None:
        """Writes what the device exchanged, beside the record."""
        if self.device:
            from ..ports.client_log import FILE

            log = session.hand.client.log  # type: ignore[attr-defined]
            if len(log) > 1:
                log.save(out / FILE)
                print(timing_line(log.timing().summary()))
        elif self.device_server:
            service = session.service  # type: ignore[attr-defined]
            deliver_loops([log.exchanges() for log in service.logs], session.scenario, out, figures)


def timing_line(timing: dict[str, Any]) -> str:
    """How regular the exchanges with a device were, in a line."""
    late, later = (1e3 * x for x in timing["latency_p50_p99_s"])
    line = (
        f"{timing['exchanges']} exchanges at {timing['rate_hz']:.4g} Hz, {timing['missed']} lost; "
        f"latency {late:.3g} ms, 99 % within {later:.3g} ms; jitter {1e3 * timing['jitter_s']:.3g} "
        "ms"
    )
    counts = {"skipped": "frames skipped", "withheld": "forces withheld at a frozen position"}
    return "; ".join([line, *(f"{timing[key]} {x}" for key, x in counts.items() if timing[key])])


def deliver_loops(
    talks: list[Exchanges], scenario: Scenario, out: Path, figures: console.FigureOptions | None
) -> None:
    """Writes the exchanges of the client with the most messages, and the report of its loop."""
    from ..ports.exchanges import FILE

    talks = sorted(talks, key=len, reverse=True)
    if not talks:
        print("no program connected: there is no loop to report on")
    if len(talks) > 1:
        print(f"{len(talks)} clients; the report is of the one with the most messages")
    if talks and len(talks[0]) > 1:
        talks[0].save(out / FILE)
        write_report(talks[0], scenario, out, figures)


def write_report(
    exchanges: Exchanges, scenario: Scenario, folder: Path, figures: console.FigureOptions | None
) -> None:
    from ..ports.report import loop_report

    console.deliver(loop_report(exchanges, scenario), folder, figures)
