"""`hapticclay pair`: how much delay, gain and friction a leader and a follower carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from ..errors import Bound
from ..files import writable
from . import console
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..results import Result
    from ..scene.pair import Pair


@dataclass(frozen=True)
class PairCommand:
    """Judge a leader and a follower with the link between them.

    Prints whether the pair is stable, the motion that turns unstable first, the largest one-way
    delay, what the torque from the other arm is late by, cause by cause, the friction that may be
    fed forward at each joint, and what to change first. Exact for small motions about the pose: no
    runs.

    Attributes:
        file: TOML or JSON file of the pair: tables leader, follower, law, link, and more.
        delay: One-way delay of the link [s], or two: there and back; by default the file's.
        kind: Kind of the link; by default the file's.
        Ts: Control sample [s]; by default the file's.
        map: Also map stability over this: delay and a common factor of all gains Kp.
        compare: Also compare the kinds of link.
        cells: Gains and delays of the map.
        out: Folder for the numbers and figures; by default out/pair/NAME.
        figures: Format and style of the figures.
    """

    file: Loose[Path]
    delay: Annotated[tuple[float, ...], Bound(0.0, 10.0, "s")] = ()
    kind: Literal["position-position", "position-force", "four-channel", "waves"] | None = None
    Ts: Annotated[float | None, Bound(1e-6, 1.0, "s")] = None
    map: Literal["delay-gain"] | None = None
    compare: bool = False
    cells: Annotated[tuple[int, int], Bound(2, 200, names=("gains", "delays"))] = (20, 20)
    out: Path | None = None
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("cells",), "is for a map: give --map delay-gain", (), ("map",)),
    )

    def __call__(self) -> int:
        pair = self._pair()
        out = self.out or Path("out", "pair", self.file.stem)
        writable(out)
        for found in list(self._answers(pair)):  # all is computed before a file is written
            console.deliver(found, out, self.figures)
        return 0

    def _answers(self, pair: Pair) -> Iterator[Result]:
        from ..theory import pair_maps, pair_verdict

        yield pair_verdict.pair_limits(pair)
        if self.compare:
            yield pair_maps.compare_links(pair)
        if self.map:
            yield pair_maps.pair_map(pair, *map(int, self.cells))

    def _pair(self) -> Pair:
        from ..scene.pair import Pair

        pair = Pair.load(self.file)
        delay = self.delay[0] if len(self.delay) == 1 else self.delay
        changes = {"delay": delay} if self.delay else {}
        kind = {"kind": self.kind} if self.kind else {}
        link = replace(pair.link, **changes, **kind)
        return replace(pair, link=link, **({"Ts": self.Ts} if self.Ts else {}))
