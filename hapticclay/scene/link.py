"""What goes between a leader and a follower, and how late it is."""

from __future__ import annotations

from typing import Annotated, Literal

from ..arguments import part
from ..errors import Bound, ParameterError, Real

ENDS = ("leader", "follower")
WAYS = ("there", "back")  # leader to follower, follower to leader
KINDS = ("position-position", "position-force", "four-channel", "waves")
RESERVE = 0.01  # [J]


@part("link.")
class Link:
    """The link of a pair: what is sent at each control sample, and when it arrives.

    Attributes:
        kind: "position-position": each arm follows the other; "position-force": the follower
            follows, the leader feels the force measured at the follower's handle; "four-channel":
            positions and forces both ways; "waves": wave variables, with the follower's joint law
            behind them.
        delay: one-way delays (there, back) [s], 0 to 10; one number for both. Waves are read at
            control samples: their delay counts as the next whole number of samples, at least one.
        jitter: largest further delay of a packet [s], 0 to 10; in theory the receiver waits for it,
            in runs it takes the newest packet that is there.
        loss: share of packets that is lost, 0 to 0.9; the receiver holds the last one.
        scale: (motion, force): the follower's motion per leader's, and the leader's force per
            follower's; > 0, at most 1e6.
        rates: whether rates are sent with positions.
        local_force: (leader, follower) gains of the own measured force, fed to the own motors, 0 to
            1e6: how much lighter each arm is made; with force sensors alone.
        impedance: wave impedance of each joint [N.m.s/rad], > 0, at most 1e9; one number for all;
            None for the follower's Kd, which matches it: then Kp alone reflects.
        passivity: whether, in runs, an observer and a controller at each end let out no more energy
            than came in at the other one (Ryu, Kwon, Hannaford 2004); theory leaves them out.
        energy: reserve E0 that each of them may let out besides [J], 0 to 1e6; None for 0.01 J.
        seed: of jitter and losses, 0 to 2^32 - 1.
    """

    kind: Literal["position-position", "position-force", "four-channel", "waves"] = KINDS[0]
    delay: Annotated[Real | tuple[Real, Real], Bound(0.0, 10.0, "s", names=WAYS)] = 0.0
    jitter: Annotated[Real, Bound(0.0, 10.0, "s")] = 0.0
    loss: Annotated[float, Bound(0.0, 0.9)] = 0.0
    scale: Annotated[
        tuple[float, float], Bound(0.0, 1e6, above=True, names=("motion", "force"))
    ] = (1.0, 1.0)
    rates: bool = True
    local_force: Annotated[tuple[float, float], Bound(0.0, 1e6, names=ENDS)] = (
        0.0,
        0.0,
    )
    impedance: Annotated[
        Real | tuple[Real, ...] | None, Bound(0.0, 1e9, "N.m.s/rad", above=True)
    ] = None
    passivity: bool = False
    energy: Annotated[Real | None, Bound(0.0, 1e6, "J")] = None
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0

    def __post_init__(self):
        felt = self.kind in ("position-force", "four-channel")
        if any(self.local_force) and not felt:
            bound = "must be 0 but for position-force and four-channel, which have force sensors"
            raise ParameterError("link.local_force", self.local_force, bound)
        if self.impedance is not None and self.kind != "waves":
            raise ParameterError("link.impedance", self.impedance, "must be None without waves")
        if self.energy is not None and not self.passivity:
            raise ParameterError("link.energy", self.energy, "must be None without passivity")
        if self.kind == "waves" and not self.rates:
            raise ParameterError("link.rates", self.rates, "must be True: a wave is made of rates")
        if self.kind == "position-position" and self.scale[1] != 1.0:
            bound = "must be 1 for position-position: the gains of the leader's law set its force"
            raise ParameterError("link.scale.force", self.scale[1], bound)

    @property
    def delays(self) -> tuple[float, float]:
        """Delays there and back, without jitter and loss [s]."""
        return self.delay if isinstance(self.delay, tuple) else (self.delay, self.delay)

    @property
    def reserve(self) -> float:
        """Energy E0 that the passivity controller of an end may let out besides [J]."""
        return RESERVE if self.energy is None else self.energy

    def further_delay(self, Ts: float) -> dict[str, float]:
        """What jitter and loss add to the delay each way [s], by cause.

        The receiver waits for the latest packet; a lost one holds the last for loss/(1 - loss)
        samples in the mean.

        Args:
            Ts: control sample [s].
        """
        return {"jitter": self.jitter, "loss": Ts * self.loss / (1.0 - self.loss)}
