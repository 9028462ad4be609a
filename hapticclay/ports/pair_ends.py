"""Leader and follower as devices for other programs, one or both, in step."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked
from ..errors import Bound, Real, integer
from ..scene.link import ENDS
from ..scene.pair import Pair
from ..scene.scenario import Scenario
from ..simulation.pair_record import PairRecord
from ..simulation.pair_run import PairRun
from .commands import Numbers
from .device import samples_of
from .driven_arm import LIMP, Device, Drive, Sensed, force_at
from .server import Clock, DeviceServer
from .service import Service
from .sessions import PLAIN, Inverse3

LONGEST = 1e4  # [s] longest session
End = Literal["leader", "follower"]


class PairPlant:
    """Both arms, their law and link, pressed by programs at their handles.

    The muscle of the pair does not act: programs take its place.
    """

    def __init__(self, pair: Pair, period: float | None, largest_force: float, every: int):
        """Takes the time between two messages with the clock "tick" [s]; None for a sample."""
        self.run = PairRun(replace(pair, muscle=None, t_max=LONGEST), every=every)
        self.largest_force = largest_force
        self.samples = samples_of(period, pair.Ts)
        self.asked = [LIMP, LIMP]
        self.sensed = [self._seen(i) for i in range(2)]

    def _seen(self, i: int) -> Sensed:
        """What an end measures now."""
        state = self.run.hosts[i].run.state
        values = (tuple(x.tolist()) for x in (state.p, state.v, state.q, state.qd))
        return Sensed(self.run.t, *values)

    def force(self, i: int) -> Numbers:
        """What presses a handle now [N]."""
        return force_at(self.asked[i], self.sensed[i], self.largest_force)

    @property
    def ended(self) -> str:
        """What ended the run, "" while nothing has."""
        return self.run.ended or ("time limit" if self.run.t >= LONGEST else "")

    def advance(self, samples: int) -> None:
        """Advances both arms."""
        for _ in range(samples):
            if self.ended:
                return
            self.run.forces = [self.force(i) for i in range(2)]
            self.run.advance()
            seen = [self._seen(i) for i in range(2)]
            if all(np.isfinite(x).all() for each in seen for x in each):
                self.sensed = seen


class PairEnd(Device):
    """One end of a pair as the device of a service."""

    takes_torques = False

    def __init__(self, plant: PairPlant, i: int, paced: bool):
        """Makes an end; paced where the other one advances both."""
        self._plant, self._i, self.paced = plant, i, paced
        run = plant.run.hosts[i].run
        self._scenario = replace(run.scenario, Ts=plant.run.pair.Ts)

    @property
    def scenario(self) -> Scenario:
        return self._scenario

    @property
    def t(self) -> float:
        return self._plant.run.t

    @property
    def sensed(self) -> Sensed:
        return self._plant.sensed[self._i]

    @property
    def force(self) -> Numbers:
        return self._plant.force(self._i)

    @property
    def torques(self) -> Numbers:
        """None: the motors are those of the pair."""
        return (0.0,) * len(self.scenario.joints)

    @property
    def ended(self) -> str:
        return self._plant.ended

    def drive(self, drive: Drive) -> Numbers:
        self._plant.asked[self._i] = drive
        return self.force

    def advance(self, samples: int | None = None) -> None:
        if not self.paced:
            self._plant.advance(self._plant.samples if samples is None else samples)


@checked
class PairServers:
    """Servers of the ends of a pair that are served.

    Attributes:
        leader: server of the leader; None if it is not served.
        follower: server of the follower; None if it is not served.
    """

    def __init__(self, plant: PairPlant, servers: dict[str, DeviceServer]):
        self._plant = plant
        self.leader, self.follower = (servers.get(end) for end in ENDS)

    @property
    def served(self) -> dict[str, DeviceServer]:
        """The servers by end."""
        both = zip(ENDS, (self.leader, self.follower), strict=True)
        return {end: server for end, server in both if server is not None}

    @property
    def ended(self) -> str:
        """What ended the run, "" while nothing has."""
        faults = [server.service.ended for server in self.served.values()]
        return next(filter(None, faults), self._plant.ended)

    @property
    def recorded(self) -> bool:
        """Whether the pair has run."""
        return bool(self._plant.run.rows)

    def close(self) -> None:
        """Closes all connections and stops the clock."""
        for server in self.served.values():
            server.close()

    def record(self) -> PairRecord:
        """Stops the pair and returns its record so far.

        Raises:
            RuntimeError: it has not run.
        """
        self.close()
        if not self.recorded:
            raise RuntimeError("the pair has not run")
        return self._plant.run.record()


@checked
@contextlib.contextmanager
def serve_pair(
    pair: Pair,
    *,
    end: End | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    clock: Clock = "tick",
    period: Annotated[Real | None, Bound(1e-5, 1.0, "s")] = None,
    every: Annotated[int, Bound(1, 1_000_000)] = 1,
    inverse3: Inverse3 = PLAIN,
) -> Iterator[PairServers]:
    """Serves the ends of a pair as devices while the `with` block runs.

    A program at the leader is the hand, one at the follower the environment: each reads the
    handle of its arm, and its force presses that handle beside what the pair has there.

    Args:
        pair: both arms; its muscle does not act.
        end: "leader" or "follower"; None for both.
        host: address to listen on; addresses other than this machine's need a token, part of the
            servers' `url`.
        port: of the leader, or of the one end; the follower of both has the next one; 0 for free
            ones.
        clock: "tick": each message of the leader's first client, or of the one end's, advances both
            arms by a period; "wall": they run in real time.
        period: between two messages with the clock "tick" [s], 1e-5 to 1; None for the control
            sample.
        every: keep each every-th control sample in the record.
        inverse3: identity and protocol of the devices.

    Yields:
        The servers.

    Raises:
        ParameterError: a value is out of its bounds, no part of the control sample divides the
            delays, the address is none of this machine, a port is taken, or websockets is not
            installed.
    """
    plant = PairPlant(pair, period, inverse3.largest_force, every)
    ends = ENDS if end is None else (end,)
    servers: dict[str, DeviceServer] = {}
    with contextlib.ExitStack() as stack:
        for k, name in enumerate(ends):
            device: Any = PairEnd(plant, ENDS.index(name), paced=k > 0)
            service = Service(device, clock=clock, inverse3=inverse3)
            at = port and integer("port", port + k, 1, 65_535)
            servers[name] = stack.enter_context(DeviceServer(service, host, at))
        yield PairServers(plant, servers)
