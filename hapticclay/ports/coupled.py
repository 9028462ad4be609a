"""A device as the hand of a simulated arm, through a virtual coupling of spring and damper.

The spring force is computed at the samples of the device and held between them. To motions far
slower than the sampling a hold of Ts acts like a damper of -K Ts/2; a damper B >= K Ts/2 makes up
for it. That is no passivity, which needs physical damping in the device: docs/connect.md.
Coupling: J. E. Colgate, M. C. Stanley, J. M. Brown, IROS 1995.
"""

from __future__ import annotations

import statistics
from dataclasses import replace
from typing import Annotated, NamedTuple

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from ..model.operator import Operator
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.stepwise import Simulation
from .client import DeviceClient, DeviceSample
from .client_log import ClientLog, Timing
from .commands import NOTHING, Pair, Vector
from .device import ended_as_planned
from .limits import PLAIN, Limits
from .planes import Plane, to_plane, to_space

SETTLING = 50  # exchanges without force to measure the period of the device
LONGEST = 3600.0  # [s] longest session


@part("coupling.")
class Coupled:
    """A spring and a damper between the hand of a device and a simulated handle.

    Attributes:
        K: stiffness [N/m], 0 to 1e5.
        B: damping [N.s/m], 0 to 1e3, at least K Ts/2 at the rate of the device.
        plane: "xy" or "xz", plane of the device in which the arm moves.
    """

    K: Annotated[Real, Bound(0.0, 1e5, "N/m", above=True)] = 300.0
    B: Annotated[Real, Bound(0.0, 1e3, "N.s/m", above=True)] = 5.0
    plane: Plane = "xy"

    def check(self, Ts: float) -> None:
        """Refuses a coupling whose damper is too small for the hold of its spring.

        Args:
            Ts: time between two samples of the device [s].

        Raises:
            ParameterError: B < K Ts/2.
        """
        if self.B < 0.5 * self.K * Ts * (1.0 - 1e-9):
            bound = f"must be K Ts/2 = {0.5 * self.K * Ts:.4g} N.s/m at least, at {1 / Ts:.4g} Hz"
            raise ParameterError("coupling.B", self.B, bound)

    def at(self, Ts: float) -> Coupled:
        """The coupling, with K lowered to what the damper makes up for.

        Args:
            Ts: between two samples of the device [s].
        """
        return replace(self, K=min(self.K, 2.0 * self.B / Ts))

    def force(self, hand: Pair, rate: Pair, p: Pair, v: Pair) -> Pair:
        """Force on the simulated handle; the device gets the opposite.

        Args:
            hand: position of the device's handle, in the plane of the arm [m].
            rate: velocity of the device's handle [m/s].
            p: position of the simulated handle [m].
            v: velocity of the simulated handle [m/s].
        """
        K, B = self.K, self.B
        return (
            K * (hand[0] - p[0]) + B * (rate[0] - v[0]),
            K * (hand[1] - p[1]) + B * (rate[1] - v[1]),
        )

    @property
    def operator(self) -> Operator:
        """The coupling as the operator of a scenario; the hand enters as a muscle force."""
        return Operator(0.0, self.B, self.K)

    def pull(self, hand: Pair, rate: Pair) -> Pair:
        """The muscle force of that operator [N].

        Args:
            hand: place of the device's handle [m].
            rate: its velocity [m/s].
        """
        return self.K * hand[0] + self.B * rate[0], self.K * hand[1] + self.B * rate[1]


PLAIN_COUPLING = Coupled()


class DeviceHand:
    """The handle of a device as a hand: its `place` [m] and `rate` [m/s] in the plane of the arm.

    It starts at the simulated handle, wherever the device is. K of `coupling` is lowered if the
    exchanges are slow; `held` says whether the newest sample, at `t` [s], came in time.
    """

    def __init__(self, client: DeviceClient, coupling: Coupled, start: Pair):
        """Measures the period of the device, without force."""
        coupling.check(client.limits.Ts)
        self.client, self.plane = client, coupling.plane
        self.coupling = coupling.at(max(client.limits.Ts, self._settle()))
        self._offset = 0.0, 0.0
        self.place, self.rate, self.held, self.t = start, (0.0, 0.0), False, 0.0
        if sample := client.exchange():
            self.held = True
            self._take(sample)
        self.begin_at(start)

    def begin_at(self, p: Pair) -> None:
        """Takes the present position of the device for a place; forces rise from zero."""
        (x, y), (dx, dy) = self.place, self._offset
        self._offset, self.place = (dx + p[0] - x, dy + p[1] - y), p
        self.client.restart_ramp()

    def _settle(self) -> float:
        """Median of the time between two answers [s]."""
        seen = [self.client.exchange() for _ in range(SETTLING)]
        t = [x.t for x in seen if x is not None]
        if len(t) < 2:
            raise ParameterError("device", self.client.url, "must answer in time")
        return statistics.median(b - a for a, b in zip(t[:-1], t[1:], strict=True))

    def exchange(self, p: Pair, v: Pair) -> bool:
        """Sends the coupling force to the device and reads its position."""
        push = NOTHING
        if self.held:
            x, y = self.coupling.force(self.place, self.rate, p, v)
            push = to_space((-x, -y), self.plane)
        return self._send(push)

    def read_position(self) -> None:
        """Reads the position of the device, without force; the next forces rise from zero."""
        self._send(NOTHING)
        self.client.restart_ramp()

    def _send(self, force: Vector) -> bool:
        """Sends a force and takes the answer, if there is one."""
        sample = self.client.exchange(force)
        self.held = sample is not None
        if sample is not None:
            self._take(sample)
        return self.held

    def _take(self, sample: DeviceSample) -> None:
        x, y = to_plane(sample.position, self.plane)
        self.place = x + self._offset[0], y + self._offset[1]
        self.rate, self.t = to_plane(sample.velocity, self.plane), sample.t

    def notes(self) -> dict[str, object]:
        return {
            "url": self.client.url,
            "device_id": self.client.device_id,
            "lost": self.client.lost,
            "coupling_K": self.coupling.K,
            "coupling_B": self.coupling.B,
            **self.client.log.timing().summary(),
        }


class Rendered(NamedTuple):
    """Result of a session with a device.

    Attributes:
        record: record of the simulated arm.
        log: exchanges with the device.
        timing: timing of the exchanges.
    """

    record: Record
    log: ClientLog
    timing: Timing


@checked
def render(
    scenario: Scenario,
    url: str,
    duration: Annotated[Real, Bound(0.0, LONGEST, "s", above=True)] = 10.0,
    *,
    coupling: Coupled = PLAIN_COUPLING,
    limits: Limits = PLAIN,
    engine: str = "auto",
) -> Rendered:
    """Replaces the hand of a scenario by a device, real or simulated, without a window.

    Between two samples of the device, the simulation advances by the time between them. It then
    sends the coupling force to the device. If a sample is lost, the hand lets go.

    Args:
        scenario: arm, clay and control; its operator, muscle force, length and t_max are ignored.
        url: of an Inverse service, as ws://127.0.0.1:10001.
        duration: length of the session [s], > 0, at most 3600.
        coupling: between device and simulated handle.
        limits: of force and time.
        engine: as in `simulate`.

    Returns:
        Record, exchanges and their timing. The notes of the record also contain the timing.

    Raises:
        ParameterError: there is no device, the coupling has B < K Ts/2 at its rate, or a value is
            out of its bounds.
    """
    coupling.check(limits.Ts)
    with DeviceClient(url, limits) as client:
        start = float(scenario.start[0]), float(scenario.start[1])
        hand = DeviceHand(client, coupling, start)
        simulation = Simulation(held_by(scenario, hand.coupling), engine=engine)
        begin = hand.t
        while hand.t - begin < duration and not client.lost and simulation.outcome is None:
            p, v = simulation.handle()
            before = hand.t
            if not hand.exchange(p, v):
                continue
            steps = round((hand.t - begin - simulation.t) / scenario.dt)
            if steps > 0:
                simulation.advance(steps, force=_muscle(hand, p, v, hand.t - before))
        if not simulation.t:
            raise ParameterError("device", url, "must answer in time")
        record = simulation.record()
        if not client.lost:
            record = ended_as_planned(record)
        notes = {**record.notes, "device": hand.notes()}
    return Rendered(replace(record, notes=notes), client.log, client.log.timing())


def _muscle(hand: DeviceHand, p: Pair, v: Pair, passed: float) -> Pair:
    """Muscle force of the hand [N]; the hand lets go after a lost sample."""
    if passed > hand.client.limits.patience:
        return hand.coupling.pull(p, v)
    return hand.coupling.pull(hand.place, hand.rate)


def held_by(scenario: Scenario, coupling: Coupled) -> Scenario:
    """A scenario whose hand is a device."""
    return replace(
        scenario,
        operator=coupling.operator,
        force=(0.0, 0.0),
        muscle=None,
        command=None,
        length=None,
        t_max=LONGEST,
        stop_when_unstable=False,
    )
