"""`hapticclay device`: the arm as a device for other programs, and reports of their loops."""

from __future__ import annotations

import logging
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError, number, number_in
from ..files import writable
from . import console, walls
from .arm_options import ArmOptions
from .device_options import deliver_loops, write_report
from .options import Loose
from .run import deliver_record
from .unused import Unused

if TYPE_CHECKING:
    from ..ports.device import Trajectory
    from ..ports.server import DeviceServer
    from ..ports.service import Service
    from ..scene.scenario import Scenario

WAIT = 0.1  # [s] between two looks at whether the session is to end
LONGEST = 1e9  # [s] longest session
PERIOD = 0.005  # [s] of a message, by default
RATE = 1000.0  # [Hz] of the control of an arm from a file, by default
OF_ARM = tuple(x.name for x in fields(ArmOptions))  # its options
LINES = {5: 2, 7: 3}  # axes of a line from point to point, by its number of words with the speed


@dataclass(frozen=True)
class DeviceCommand:
    """Serve a simulated arm as a haptic device, or report on the loop of a client.

    Programs for a real device connect over a WebSocket, read the position of the handle and send
    forces. The forces move the arm together with a simulated hand. `device serve` runs until
    Ctrl-C. It then writes the record, the exchanged messages and a report: what the client
    rendered, and which stiffness its rate, its delay and this hand allow. `device report FOLDER`
    makes the report again.

    Attributes:
        action: serve or report.
        source: To serve: a scenario file, whose arm, hand and hardware are used; by default the
            paper's arm and hand. To report: the folder of a session.
        arm: MJCF or URDF file of an arm to serve, or the name of one of the package: planar_2r,
            five_bar, haptic_3, leader_7. Its handle moves along x, y and z of its world.
        pair: TOML or JSON file of a leader and a follower to serve, in place of one arm: a program
            at the leader is the hand, one at the follower the environment.
        end: The one end of --pair to serve; by default both, the follower on the next port.
        rate: Control rate of that arm [Hz], by default 1000.
        operator: Mass, damper and spring of the hand that holds the handle [kg, N.s/m, N/m]; by
            default those of the paper, 0.25 2 6, and 0.25 5 200 at the arm of a file.
        protocol: inverse is that of a Haply Inverse3; rosbridge has topics of CRTK and of a Touch's
            drivers, as JSON for ROS programs.
        port: Port to listen on, 0 for a free one; by default that of the protocol, 10001 or 9090.
        host: Address to listen on. Any address but that of this machine needs a token.
        origin: Web pages that may drive the device, as http://localhost:8000; by default none.
        clock: wall moves the arm in real time; tick moves it by --period at each message, so the
            same messages give the same run.
        period: Simulated time that one message advances the arm, with --clock tick [s]; by default
            5 ms, or the whole control samples nearest to it.
        hand: Target of the hand from the start: x y, or x y z [m]; or two such points and a speed
            [m/s] for a line; or a CSV file with the columns t, x, y, and perhaps z. By default the
            hand rests at the start.
        plane: Plane of the device in which the two-link arm moves.
        buttons: CSV file with the columns t, a, b, c, home (0 or 1): buttons over time.
        clay: Add the clay of the scenario to the client's force.
        device_id: Identifier of the Inverse3, hexadecimal.
        grip_id: Identifier of the grip, hexadecimal.
        largest_force: Larger forces are limited to this [N].
        duration: End after this time on the computer's clock [s]; by default at Ctrl-C.
        out: Folder for the record, the exchanges and the report; by default out/device, for a
            report out/loop.
        plots: Draw the plots.
        mechanism: The arm of --arm.
        figures: Formats and style of the plots.
    """

    action: Loose[Literal["serve", "report"]]
    source: Loose[Path | None] = None
    arm: str | None = None
    pair: Path | None = None
    end: Literal["leader", "follower"] | None = None
    rate: Annotated[float | None, Bound(1.0, 1e5, "Hz")] = None
    operator: walls.Hand | None = None
    protocol: Literal["inverse", "rosbridge"] = "inverse"
    port: int | None = None
    host: str = "127.0.0.1"
    origin: tuple[str, ...] = ()
    clock: Literal["wall", "tick"] = "wall"
    period: Annotated[float | None, Bound(unit="s")] = None
    hand: tuple[str, ...] = ()
    plane: Literal["xy", "xz"] = "xy"
    buttons: Path | None = None
    clay: bool = False
    device_id: str = "04EA"
    grip_id: str = "F00D"
    largest_force: Annotated[float, Bound(unit="N")] = 10.0
    duration: Annotated[float | None, Bound(0.0, LONGEST, "s")] = None
    out: Path | None = None
    plots: bool = True
    mechanism: ArmOptions = ArmOptions()
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("period",), "is for --clock tick: give it too", (), ("clock=tick",)),
        Unused(("arm", "operator"), "is in the scenario file: give one of the two", ("source",)),
        Unused(("arm", "operator", "hand", "clay"), "is in the file of the pair", ("pair",)),
        Unused(("pair",), "is in place of a scenario file: give one of the two", ("source",)),
        Unused(("end",), "is of a pair: give --pair", (), ("pair",)),
        Unused(("rate", *OF_ARM), "is of an arm from a file: give --arm", (), ("arm",)),
    )

    def __call__(self) -> int:
        out = self.out or Path("out", "loop" if self.action == "report" else "device")
        if self.action == "report":
            return self._report(out)
        writable(out)
        if self.pair is not None:
            return self._serve_pair(self.pair, out)
        with self._server() as server, console.ctrl_c() as stop:
            print(f"{self._shown} listens at {server.url}; Ctrl-C ends the session", flush=True)
            self._wait(stop, lambda: server.service.ended)
            planned = not stop.is_set()
            server.close()
            return self._deliver(server, out, planned)

    @property
    def _shown(self) -> str:
        return "an Inverse3" if self.protocol == "inverse" else "a device of ROS"

    def _wait(self, stop: threading.Event, ended: Callable[[], str]) -> None:
        """Waits for Ctrl-C, for the end of the duration or for that of the run."""
        duration = math.inf if self.duration is None else self.duration
        end = time.monotonic() + duration
        while not stop.wait(WAIT) and time.monotonic() < end:
            if why := ended():
                print(f"hapticclay: the arm stopped: {why}", file=sys.stderr)
                return

    def _serve_pair(self, file: Path, out: Path) -> int:
        """Serves one end of a pair, or both, then writes the record and the exchanges."""
        from ..ports.exchanges import FILE
        from ..ports.pair_ends import serve_pair
        from ..ports.server import every_of
        from ..scene.pair import Pair

        pair = Pair.load(file)
        given = self._how(pair.Ts)
        every = every_of(self.clock)
        with serve_pair(pair, end=self.end, every=every, **given) as ends, console.ctrl_c() as stop:
            for name, server in ends.served.items():
                print(f"{name}: {self._shown} listens at {server.url}", flush=True)
            print("Ctrl-C ends the session", flush=True)
            self._wait(stop, lambda: ends.ended)
            ends.close()
            if not ends.recorded:
                print("nothing was recorded")
                return 0
            console.deliver(ends.record(), out, self.figures if self.plots else None)
            for name, server in ends.served.items():
                _tell_skipped(server.service)
                talks = sorted(server.exchanges, key=len, reverse=True)
                if talks and len(talks[0]) > 1:
                    talks[0].save(out / name / FILE)
        return 0

    def _server(self) -> Any:
        from ..ports.server import serve

        hand, scenario = trajectory_of(self.hand), self._scenario()
        return serve(scenario, hand=hand, clay=self.clay, **self._how(scenario.Ts))

    def _how(self, Ts: float | None) -> dict[str, Any]:
        """Where to listen, the clock, and what the device says that it is."""
        from ..ports.buttons import ButtonScript
        from ..ports.sessions import PORTS, Inverse3

        logging.basicConfig(format="hapticclay: %(message)s", level=logging.WARNING)
        shown = Inverse3(
            self.device_id,
            self.grip_id,
            self.plane,
            ButtonScript.of_file(self.buttons) if self.buttons else ButtonScript(),
            self.largest_force,
            self.protocol,
            self.origin,
        )
        return {
            "host": self.host,
            "port": PORTS[self.protocol] if self.port is None else self.port,
            "clock": self.clock,
            "period": self._period(Ts) if self.clock == "tick" else None,
            "inverse3": shown,
        }

    def _period(self, Ts: float | None) -> float:
        """Simulated time of a message [s]: by default whole control samples, if they are given."""
        if self.period is not None or Ts is None:
            return PERIOD if self.period is None else self.period
        return max(1, round(PERIOD / Ts)) * Ts

    def _scenario(self) -> Scenario:
        """What is served: a scenario file, an arm from a file, or the paper's arm and hand."""
        from ..model.operator import Operator
        from ..ports.device import held_scenario
        from ..scene.scenario import Scenario

        if self.source is not None:
            return Scenario.load(self.source)
        hand = walls.operator_of(self.operator)
        if self.arm is not None:
            arm = self.mechanism.arm(self.arm)
            return held_scenario(arm, 1.0 / (self.rate or RATE), hand)
        return Scenario(name="device", operator=hand or Operator(), force=(0.0, 0.0), length=None)

    def _deliver(self, server: DeviceServer, out: Path, planned: bool) -> int:
        """Writes and prints what happened; `planned` where the session lasted its duration."""
        from ..ports.device import ended_as_planned

        service = server.service
        if not service.device.t:
            print("nothing was recorded")
            return 0
        record = ended_as_planned(server.record()) if planned else server.record()
        deliver_record(record, out, self.figures if self.plots else None, paced=True)
        _tell_skipped(service)
        figures = self.figures if self.plots else None
        deliver_loops(server.exchanges, record.scenario, out, figures)
        return 0

    def _report(self, out: Path) -> int:
        from ..ports.exchanges import FILE, Exchanges
        from ..simulation.record import Record

        if self.source is None:
            raise ParameterError("source", "", "give the folder that a session wrote")
        if not (os.path.isfile(self.source) or os.path.isfile(self.source / FILE)):
            bound = f"must be the folder of a session that a program took part in (no {FILE} there)"
            raise ParameterError("source", str(self.source), bound)
        exchanges = Exchanges.load(self.source)
        writable(out)
        scenario = Record.load(self.source).scenario
        write_report(exchanges, scenario, out, self.figures if self.plots else None)
        return 0


def _tell_skipped(service: Service) -> None:
    """Says how many control samples a busy computer has skipped."""
    if service.skipped:
        share = service.skipped / (service.skipped + service.samples)
        text = f"{service.skipped} control samples ({share:.1%}) were skipped"
        why = "the computer was late; --clock tick skips none"
        print(f"hapticclay: {text}: {why}", file=sys.stderr)


def trajectory_of(words: tuple[str, ...]) -> Trajectory | None:
    """Where the hand wants to be, from the words of an option."""
    from ..ports.device import FASTEST, Trajectory

    if not words:
        return None
    if len(words) == 1 and Path(words[0]).suffix.lower() == ".csv":
        return Trajectory.of_file(words[0])
    axes = LINES.get(len(words), 0)
    units = ("m",) * 2 * axes + ("m/s",) if axes else ("m",) * len(words)
    try:
        x = [number_in("hand", w, unit) for w, unit in zip(words, units, strict=True)]
    except ParameterError:  # a wrong unit
        raise
    except ValueError:
        x = []
    if len(x) in (2, 3):
        return Trajectory.to(tuple(x))
    begin, end = tuple(x[:axes]), tuple(x[axes:-1])
    if axes and begin != end:
        speed = x[-1]
        number("hand speed", speed, 1e-6, FASTEST, unit="m/s")
        return Trajectory((0.0, math.dist(begin, end) / speed), (begin, end))
    bound = "must be x y, or x0 y0 x1 y1 and a speed above 0, with z for three axes; or a CSV file"
    raise ParameterError("hand", " ".join(words), bound)
