"""`hapticclay pair`: what a leader and a follower carry, and what the log of a pair says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from . import console
from .log_options import NAMES as LOG_NAMES
from .log_options import LogOptions, column_names
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..results import Result
    from ..scene.pair import Pair
    from ..simulation.pair_record import PairRecord

OF_PAIR = ("map", "compare", "cells", "feel", "run", "push", "film")
OF_THEORY = ("delay", "kind", "Ts", "view", *OF_PAIR)
OF_LOGS = ("columns", "band", "level", *LOG_NAMES)


@dataclass(frozen=True)
class PairCommand:
    """Judge a leader and a follower with the link between them, or identify them from a log.

    Of a file of the pair: whether it is stable, the motion that turns unstable first, the largest
    one-way delay, what the torque from the other arm is late by, cause by cause, the friction that
    may be fed forward at each joint, and what to change first. Exact for small motions about the
    pose; --run shows the motion of both arms.

    Of a log, with --data: gains, delays, friction, inertia and stiffness with intervals; the
    follower is then simulated behind the measured leader, and its error compared with the measured
    one.

    Attributes:
        file: TOML or JSON file of the pair: tables leader, follower, law, link, and more.
        delay: One-way delay of the link [s], or two: there and back; by default the file's.
        kind: Kind of the link; by default the file's.
        Ts: Control sample [s]; by default the file's.
        map: Also map stability over this: delay and a common factor of all gains Kp.
        compare: Also compare the kinds of link.
        cells: Gains and delays of the map.
        feel: Also say what the hand feels along this axis of the world, and with which hands and
            objects the pair is stable.
        run: Also run the pair for this time [s], under the muscle of the hand that the file gives;
            by default a push of 1 N for 50 ms.
        push: In the run, push with this force along x for 50 ms, in place of the muscle [N].
        film: Film of that run, of at least 8 s, in which small motion is magnified: .mp4, .webp or
            .gif.
        view: Show the pair in a browser, with the mouse as the leader's hand and sliders for delay
            and gains, until Ctrl-C; the record is then written.
        host: Address of that page. Any address but that of this machine needs a token.
        port: Port of that page; 0 for a free one.
        data: Log of one axis, in place of a file of the pair, in any format that is read, or a
            scope of Simulink: time [s], both positions [rad], torques of both motors and the force
            on the follower [N.m].
        columns: Names in the log, as in leader=q1 follower=q2 leader_torque=-u1 force=f; a minus
            is for a column that holds the negative.
        band: Highest frequency of the fits of laws [Hz].
        level: Confidence level of the intervals.
        out: Folder for the numbers and figures; by default out/pair/NAME.
        log: Units of the columns of a log.
        figures: Format and style of the figures.
    """

    file: Loose[Path | None] = None
    delay: Annotated[tuple[float, ...], Bound(0.0, 10.0, "s")] = ()
    kind: Literal["position-position", "position-force", "four-channel", "waves"] | None = None
    Ts: Annotated[float | None, Bound(1e-6, 1.0, "s")] = None
    map: Literal["delay-gain"] | None = None
    compare: bool = False
    cells: Annotated[tuple[int, int], Bound(2, 200, names=("gains", "delays"))] = (20, 20)
    feel: Literal["x", "y", "z"] | None = None
    run: Annotated[float | None, Bound(0.0, 1e4, "s", above=True)] = None
    push: Annotated[float | None, Bound(0.0, 1e6, "N", above=True)] = None
    film: Path | None = None
    view: bool = False
    host: str = "127.0.0.1"
    port: int = 8080
    data: Path | None = None
    columns: tuple[str, ...] = ()
    band: Annotated[float, Bound(0.1, 1e5, "Hz")] = 80.0
    level: Annotated[float, Bound(0.5, 0.999)] = 0.95
    out: Path | None = None
    log: LogOptions = LogOptions()
    figures: console.FigureLook = console.FigureLook()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("data",), "is in place of a file of the pair: give one of the two", ("file",)),
        Unused(OF_THEORY, "is for a file of the pair, not for a log", ("data",)),
        Unused(OF_LOGS, "is for a log: give --data", (), ("data",)),
        Unused(OF_PAIR, "is left out where the pair is shown: leave out --view", ("view",)),
        Unused(("film", "push"), "is of a run: give --run too", (), ("run",)),
        Unused(("host", "port"), "is of the page: give --view too", (), ("view",)),
        Unused(("cells",), "is for a map: give --map delay-gain", (), ("map",)),
    )

    def __call__(self) -> int:
        if self.data is not None:
            return self._identified(self.data)
        if self.file is None:
            bound = "must be given: the file of a pair, or --data, the log of a leader and follower"
            raise ParameterError("file", None, bound)
        pair = self._pair(self.file)
        out = self.out or Path("out", "pair", self.file.stem)
        writable(out)
        if self.view:
            return self._viewed(pair, out)
        if self.film is not None:
            from ..views.film import ready

            writable(self.film.parent)
            ready(self.film)
        answers = list(self._answers(pair))  # all is computed before a file is written
        for found in answers:
            console.deliver(found, out, self.figures)
        self._print_disagreement(answers)
        if self.film is not None:
            self._filmed(answers, self.film)
        return 0

    def _viewed(self, pair: Pair, out: Path) -> int:
        """Shows the pair until Ctrl-C, then writes the record."""
        from .view import show_pair

        session = show_pair(pair, self.host, self.port)
        if not session.recorded:
            print("nothing was recorded")
            return 0
        console.deliver(session.record(), out, self.figures)
        return 0

    def _filmed(self, answers: Sequence[Result], file: Path) -> None:
        from ..simulation.pair_record import PairRecord
        from ..views import film, pair_stage

        for record in answers:
            if isinstance(record, PairRecord):
                options = film.FilmOptions(**pair_stage.look_of(record))
                print(f"written to {film.film(record, file, options, console.film_progress)}")

    def _identified(self, data: Path) -> int:
        from ..studies.pair_identification import identify_pair
        from ..studies.pair_log import COLUMNS, PairLog, logged

        example = "leader=q1 follower=q2 leader_torque=-u1"
        names = column_names(self.columns, COLUMNS, example)
        if self.log == LogOptions():
            log = PairLog.load(data, names)
        else:
            log = logged(self.log.log(data, "data"), names)
        out = self.out or console.default_folder("pair", log)
        writable(out)
        found = identify_pair(log, band=self.band, level=self.level)
        console.deliver(found, out, self.figures)
        return 0

    def _answers(self, pair: Pair) -> Iterator[Result]:
        from ..theory import pair_maps, pair_ports, pair_verdict

        yield pair_verdict.pair_limits(pair)
        if self.compare:
            yield pair_maps.compare_links(pair)
        if self.feel:
            yield pair_ports.pair_transparency(pair, self.feel)
        if self.run:
            yield self._run(pair, self.run)
        if self.map:
            yield pair_maps.pair_map(pair, *map(int, self.cells))

    def _run(self, pair: Pair, seconds: float) -> PairRecord:
        from ..simulation.simulate import simulate
        from ..studies.pair_disagreement import push

        muscle = pair.muscle if self.push is None else push(self.push)
        return simulate(replace(pair, t_max=seconds, muscle=muscle))

    def _print_disagreement(self, answers: Sequence[Any]) -> None:
        """Why a run and theory differ, if they do, and what shows it."""
        from ..simulation.pair_record import PairRecord
        from ..studies.pair_disagreement import disagreement

        for record in answers:
            if isinstance(record, PairRecord) and record.pair is not None:
                if words := disagreement(record.pair, answers[0], record):
                    print(f"note: {words}")

    def _pair(self, file: Path) -> Pair:
        """The pair of a file, with what the options change."""
        from ..scene.pair import Pair

        pair = Pair.load(file)
        delay = self.delay[0] if len(self.delay) == 1 else self.delay
        changes = {"delay": delay} if self.delay else {}
        kind = {"kind": self.kind} if self.kind else {}
        link = replace(pair.link, **changes, **kind)
        return replace(pair, link=link, **({"Ts": self.Ts} if self.Ts else {}))
