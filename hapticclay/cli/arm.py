"""`hapticclay arm`: which gains, rate and delay the joints of an arm from a file carry."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound
from ..files import writable
from . import console, walls
from .arm_options import ArmOptions
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..arms.joint_law import JointPD
    from ..arms.mjcf_arm import MjcfArm


@dataclass(frozen=True)
class ArmCommand:
    """Judge the joints of an arm from its MJCF or URDF file, under the gains of its controller.

    Prints the least and largest gain of each joint, all coupled, the frequency at which it buzzes,
    the delay and rate left, and what to change first; if the gains feed friction forward, its limit
    cycles; with --wall the stiffest wall at the handle; with --poses the same over the workspace.
    Exact for small motions about the pose. With --run it also runs the arm, at its gains and at
    0.5 % to either side of their common limit, and says whether the runs agree.

    Attributes:
        file: MJCF or URDF file of the arm, or the name of one of the package: planar_2r, five_bar,
            haptic_3, leader_7.
        gains: File of the gains, .toml, .json or .yaml, as projects keep them, FILE:TABLE for one
            of several tables; by default those of the actuators of the arm's file.
        Kp: Stiffness of each joint, or one for all [N.m/rad], in place of the file's.
        Kd: Damping of each joint, or one for all [N.m.s/rad], likewise.
        rate: Control rate [Hz], by default 1000.
        Ts: Control sample [s], in place of --rate.
        delay: Latency from a sample to the torque computed from it [s].
        velocity: How the rate of a joint is had, by default as the file of gains says, or exact.
        cutoff: Cutoff of --velocity filter [rad/s].
        runs: Where the gains act: in the host's loop at the rate, or in the drives' own.
        drive_rate: Rate at which drives measure and hold [Hz]; by default they are continuous.
        arm: The arm of the file.
        counts: Encoder counts a turn behind the friction that the gains feed forward.
        wall: Axis of the world along which a wall at the handle pushes.
        B: Damping of that wall [N.s/m].
        hand: Mass, damper and spring of a hand at the handle [kg, N.s/m, N/m].
        poses: Number of poses, drawn within the ranges of the joints; 0 for the one pose alone.
        seed: Seed of their draw.
        run: Run the arm too, at its gains and beside their limit; as_built.toml is the scenario of
            a run with friction and torque limits, for hapticclay run.
        film: Film of the buzz beyond the limit, slowed and magnified: .mp4, .webp or .gif.
        out: Folder for the numbers and figures; by default out/arm/NAME.
        figures: Format and style of the figures.
    """

    file: Loose[str]
    gains: Path | None = None
    Kp: Annotated[tuple[float, ...], Bound(unit="N.m/rad")] = ()
    Kd: Annotated[tuple[float, ...], Bound(unit="N.m.s/rad")] = ()
    rate: Annotated[float | None, Bound(0.0, unit="Hz", above=True)] = None
    Ts: Annotated[float | None, Bound(0.0, unit="s", above=True)] = None
    delay: Annotated[float, Bound(0.0, 10.0, unit="s")] = 0.0
    velocity: Literal["exact", "difference", "filter"] | None = None
    cutoff: Annotated[float | None, Bound(0.0, unit="rad/s", above=True)] = None
    runs: Literal["host", "drive"] | None = None
    drive_rate: Annotated[float | None, Bound(10.0, 1e6, "Hz")] = None
    arm: ArmOptions = ArmOptions()
    counts: Annotated[int | None, Bound(1, 10**9)] = None
    wall: Literal["x", "y", "z"] | None = None
    B: Annotated[float, Bound(0.0, unit="N.s/m")] = 0.0
    hand: walls.Hand | None = None
    poses: Annotated[int, Bound(0, 100_000)] = 0
    seed: Annotated[int, Bound(0, 2**63 - 1)] = 0
    run: bool = False
    film: Path | None = None
    out: Path | None = None
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("rate",), "is 1/Ts: give --Ts or --rate", ("Ts",)),
        Unused(("Kp", "Kd"), "is in the file of --gains: give one of the two", ("gains",)),
        Unused(("film",), "shows a run: give --run", (), ("run",)),
        Unused(("seed",), "is of the draw of --poses", (), ("poses",)),
        Unused(("B", "hand"), "is of the wall: give --wall", (), ("wall",)),
        Unused(("counts",), "is of friction that a file of --gains feeds forward", (), ("gains",)),
    )

    def __call__(self) -> int:
        arm = self.arm.arm(self.file)
        out = self.out or console.default_folder("arm", arm)
        writable(out)
        self._film_ready()
        for found in list(self._answers(arm)):  # all is computed before a file is written
            console.deliver(found, out, self.figures)
        if self.run:
            self._after_runs(arm, out)
        return 0

    def _film_ready(self) -> None:
        if self.film is not None:
            from ..views.film import ready

            writable(self.film.parent)
            ready(self.film)

    def _after_runs(self, arm: MjcfArm, out: Path) -> None:
        """The scenario of the run as built, and the film of the buzz."""
        from ..studies.joint_runs import built_scenario, buzz

        law, timing = self._law(arm), (self._Ts, self.delay)
        built = built_scenario(arm, law, *timing)
        print(f"to run it as built: hapticclay run {built.save(out / 'as_built.toml')}")
        if self.film is None:
            return
        from ..views import buzz_film, film

        record, mode = buzz(arm, law, *timing)
        shown, options = buzz_film.buzz_of(record, mode.frequency)

        print(f"written to {film.film(shown, self.film, options, console.film_progress)}")

    def _answers(self, arm: MjcfArm) -> Any:
        """The limits of the gains, of a wall, and over poses: those that are asked for."""
        from ..theory import fed_friction, joint_gains, joint_poses, joint_walls

        if self._is_judged(arm):
            law = self._law(arm)
            timing = self._Ts, self.delay
            yield joint_gains.joint_limits(arm, law, *timing)
            if self.run:
                from ..studies.joint_runs import joint_runs

                yield joint_runs(arm, law, *timing, self._shown_runs)
            if law.friction or self.counts:
                yield fed_friction.friction_cycle(arm, law, *timing, self.counts)
            if self.poses:
                yield joint_poses.over_poses(arm, law, *timing, self.poses, self.seed)
        if self.wall:
            hand = walls.operator_of(self.hand)
            velocity = "difference" if self.velocity == "difference" else "exact"
            timing = self._Ts, self.delay
            yield joint_walls.wall_limit(arm, self.wall, self.B, hand, *timing, velocity)

    def _shown_runs(self, factors: Any) -> Any:
        return console.progress_bar(factors, desc="runs")

    @property
    def _Ts(self) -> float:
        return self.Ts if self.Ts is not None else 1.0 / (self.rate or 1000.0)

    def _is_judged(self, arm: MjcfArm) -> bool:
        """Whether gains are judged: of a file without any, a wall alone may be."""
        wanted = self.gains or self.Kp or self.Kd or self.run or self.poses
        return bool(wanted or arm.servo.taken or not self.wall)

    def _law(self, arm: MjcfArm) -> JointPD:
        from ..arms.joint_law import JointPD

        given: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("velocity", "cutoff", "runs", "drive_rate")
            if getattr(self, name) is not None
        }
        if self.gains:
            return JointPD.load(self.gains, arm.names, **given)
        n = max(len(self.Kp), len(self.Kd)) if len(self.Kp) + len(self.Kd) > 2 else len(arm.names)
        for name in ("Kp", "Kd"):
            if values := getattr(self, name):
                given[name] = values * n if len(values) == 1 else values
        if {"Kp", "Kd"} <= given.keys():
            return JointPD(**given)
        return JointPD.of(arm, **given)
