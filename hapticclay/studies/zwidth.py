"""The Z-width of a virtual wall: the stiffness and damping that it renders stably, by runs.

Z-width: Colgate, Brown, Factors affecting the Z-width of a haptic display, ICRA 1994.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..display import brief
from ..errors import ParameterError, choice, number
from ..results import Result
from ..scene.changes import with_fields
from ..scene.scenario import Scenario
from ..theory.hand_boxes import Box
from . import boundary
from .wall import STILL, Subject, Wall, as_wall
from .wall_lines import (
    Limit,
    exact_limit,
    softest,
    theoretical_damping,
    theory_limits,
    worst_hand,
)
from .wall_runs import BY_DEFAULT, Press, Share, most_damping, stiffest, unshown

LETTERS = {
    "gain": "Kc",
    "damper": "b",
    "friction": "fc",
    "mass": "m",
    "quantum": "Delta",
    "velocity_window": "window",
}  # in labels
POINTS, QUICK_POINTS = 13, 7  # values of B of a region
TOP_SHARES = (0.72, 0.88, 0.97)  # shares of the largest B: points where the boundary falls
REST_RESOLVED = 0.01  # share of K to which decay separates stable from unstable
FALLEN = 0.01  # share of the largest K below which a boundary has fallen to nothing
BY_GROWTH, BY_REST = "growth rate", "rest after a push"
NO_VIOLATION = "no run was unstable below a line that is sufficient"


@named
@dataclass(frozen=True)
class ZRegion:
    """The walls that one device renders stably: below K(B), found by runs.

    Attributes:
        name: name of the region in its family, "" for a single region.
        wall: device, hand and timing; its own K and B (for an arm, k and b) are ignored.
        verdict: how a run was judged, "growth rate" (linear loops) or "rest after a push".
        B: virtual damping [N.s/m], ascending.
        K: largest stable stiffness found by runs, for each B [N/m]; 0 for none. Every softer wall
            tested was stable.
        exact: the same for the linear loop by its eigenvalues [N/m]; friction, quantum and surface
            are ignored.
        most_B: largest stable B found by runs [N.s/m], at K = 0, or at the softest K tested if runs
            are judged by rest; NaN if B was given.
        limits: lines of theory.
        box: hands of a second region; None for none.
        box_K: largest stable K of runs with the worst hand of the box, for each B [N/m].
        box_exact: the same for the linear loop.
    """

    def __repr__(self) -> str:
        return brief(self)

    name: str
    wall: Subject
    verdict: str
    B: tuple[float, ...]
    K: tuple[float, ...]
    exact: tuple[float, ...]
    most_B: float
    limits: tuple[Limit, ...]
    box: Box | None = None
    box_K: tuple[float, ...] = ()
    box_exact: tuple[float, ...] = ()

    @property
    def linear(self) -> bool:
        """Whether the loop is linear, so that its eigenvalues predict the result of the runs."""
        return self.verdict == BY_GROWTH

    @property
    def largest_K(self) -> float:
        """Largest K of the region at the tested B [N/m]; see `top_between`."""
        return max(self.K)

    @property
    def top_B(self) -> float:
        """The tested B of the largest K [N.s/m]."""
        return self.B[int(np.argmax(self.K))]

    @property
    def top_between(self) -> tuple[float, float]:
        """Values of B next to that of the largest K; the boundary in between may be higher."""
        i = int(np.argmax(self.K))
        return self.B[max(i - 1, 0)], self.B[min(i + 1, len(self.B) - 1)]

    @property
    def largest_B(self) -> float:
        """Largest B of the region [N.s/m]: found by runs, or the largest given B."""
        inside = [B for B, K in zip(self.B, self.K, strict=True) if K > 0.0]
        return max([*inside, 0.0 if math.isnan(self.most_B) else self.most_B], default=0.0)

    @property
    def area(self) -> float:
        """Area of the region in the plane of B and K [N^2.s/m^2], by trapezoids."""
        B, K = list(self.B), list(self.K)
        if B[-1] < self.most_B:
            B, K = [*B, self.most_B], [*K, 0.0]
        return float(np.trapezoid(K, B))

    def gap(self) -> float:
        """Largest gap between runs and the exact linear loop; NaN if it is not linear.

        The gap is a share of K or, where the boundary falls to zero, of 1 % of the largest K.
        """
        if not self.linear:
            return math.nan
        gaps = []
        for runs, exact in ((self.K, self.exact), (self.box_K, self.box_exact)):
            least = FALLEN * max(exact, default=0.0)
            gaps += [
                abs(a - b) / max(b, least) for a, b in zip(runs, exact, strict=True) if b > 0.0
            ]
        return max(gaps, default=math.nan)

    def violations(self) -> list[str]:
        """Points at which a run was unstable below a sufficient line, in words."""
        out = []
        close = boundary.BRACKET if self.linear else REST_RESOLVED
        for limit in self.limits:
            for B, K in zip(self.B, self.K, strict=True):
                line = limit.at(B)
                if limit.kind == "sufficient" and K < (1.0 - close) * line:
                    out.append(f"{limit.name}: B = {B:.4g}, K = {K:.4g} < {line:.4g}")
        return out


@named
@dataclass(frozen=True, repr=False)
class ZWidth(Result):
    """Regions of stable walls: one, or a family.

    Attributes:
        regions: in the order of the values.
        vary: what differs between them, "" for nothing.
        press: the push of runs judged by rest.
    """

    drawn_by = "hapticclay.views.wall_plots:zwidth_plot"
    printed = {
        "regions": (
            "region",
            "K at the least B [N/m]",
            "largest K [N/m]",
            "largest B [N.s/m]",
            "area [N^2.s/m^2]",
            "verdict",
            "gap to exact",
        )
    }
    formats = {"gap to exact": ".2g %"}

    regions: tuple[ZRegion, ...]
    vary: str = ""
    press: Press = Press()

    def headline(self) -> str:
        """Largest stiffness and damping of each region, in one line."""
        regions = (
            f"{f'{r.name}: ' if r.name else ''}K to {r.largest_K:.4g} N/m at B = {r.top_B:.4g}, "
            f"B to {r.largest_B:.4g} N.s/m"
            for r in self.regions
        )
        return "; ".join(regions)

    def gap(self) -> float:
        """Largest relative gap between runs and exact lines; NaN if no loop is linear."""
        gaps = [g for r in self.regions if not math.isnan(g := r.gap())]
        return max(gaps, default=math.nan)

    def violations(self) -> list[str]:
        """Unstable runs below a sufficient line, in words; empty if theory and runs agree."""
        return [x for r in self.regions for x in r.violations()]

    def tables(self) -> dict[str, dict[str, list]]:
        """The numbers of the figure: "runs", "lines", and "regions" with one row per region."""
        runs: dict[str, list] = {"region": [], "B [N.s/m]": [], "K [N/m]": [], "exact K [N/m]": []}
        if boxed := any(r.box for r in self.regions):
            runs |= {"worst hand: K [N/m]": [], "worst hand: exact K [N/m]": []}
        lines: dict[str, list] = {
            n: [] for n in ("region", "line", "kind", "B [N.s/m]", "K [N/m]", "note")
        }
        for r in self.regions:
            columns: list[Sequence] = [[r.name] * len(r.B), r.B, r.K, r.exact]
            if boxed:
                columns += [r.box_K, r.box_exact]
            for column, more in zip(runs.values(), columns, strict=True):
                column.extend(more)
            for limit in r.limits:
                n = len(limit.B)
                whole = ([r.name] * n, [limit.name] * n, [limit.kind] * n)
                for column, more in zip(
                    lines.values(), (*whole, limit.B, limit.K, [limit.note] * n), strict=True
                ):
                    column.extend(more)
        regions = {
            "region": [r.name for r in self.regions],
            "verdict": [r.verdict for r in self.regions],
            "K at the least B [N/m]": [r.K[0] for r in self.regions],
            "largest K [N/m]": [r.largest_K for r in self.regions],
            "may be larger from B [N.s/m]": [r.top_between[0] for r in self.regions],
            "to B [N.s/m]": [r.top_between[1] for r in self.regions],
            "largest B [N.s/m]": [r.largest_B for r in self.regions],
            "area [N^2.s/m^2]": [r.area for r in self.regions],
            "gap to exact": [r.gap() for r in self.regions],
        }
        return {"runs": runs, "lines": lines, "regions": regions}

    def remarks(self) -> list[str]:
        """Where K may be larger, how runs were judged, and whether they agree with theory."""
        lines = []
        for r in self.regions:
            if len(r.B) > 1:  # between the tested dampings it is not known
                name, (low, high) = f"{r.name}: " if r.name else "", r.top_between
                between = f"between B = {low:.4g} and {high:.4g}"
                lines.append(f"{name}{between}, of {len(r.B)} tried, K may be larger")
        if not math.isnan(self.gap()):
            lines.append(f"runs against the exact linear loop: within {100.0 * self.gap():.2g} %")
        if rough := [r for r in self.regions if not r.linear]:
            lines.append(
                f"rest: back and forth by {self.rest_words()} at most, after a push of "
                f"{self.press.force:g} N at {1e3 * self.press.speed:g} mm/s"
                f" ({len(rough)} of {len(self.regions)} regions)"
            )
        return lines + (self.violations() or [NO_VIOLATION])

    def rest_words(self) -> str:
        """The motion that counts as rest, and what the encoder sees of it."""
        quanta = [as_wall(r.wall).quantum for r in self.regions if not r.linear]
        rests = sorted({1e6 * self.press.rest(q) for q in quanta})
        words = f"{rests[0]:g} um" if len(rests) == 1 else f"{rests[0]:g} to {rests[-1]:g} um"
        if self.press.still is None:
            return f"{words} (a count of the encoder)" if max(quanta) > STILL else words
        unseen = max(quanta) > self.press.still
        return f"{words} (less than a count, {1e6 * max(quanta):g} um)" if unseen else words

    def contents(self) -> dict[str, Any]:
        """Push, tables, and the differences between theory and runs."""
        violations = {"violations": self.violations()}
        return {"press": self.press, "tables": self.tables(), "gap": self.gap(), **violations}


@checked
def zwidth(
    wall: Subject | Scenario,
    vary: str = "",
    values: Iterable[Any] = (),
    *,
    B: Iterable[float] | None = None,
    box: Box | None = None,
    press: Press = BY_DEFAULT,
    quick: bool = False,
    progress: Share = unshown,
) -> ZWidth:
    """Finds the walls that a device renders stably, by runs and by theory.

    A linear loop is stable if the oscillation of a run decays. Its growth rate is that of the least
    damped mode, exact up to the step of the engine. With friction, an encoder or a surface the loop
    is not linear, and a wall is stable if it comes to rest after a push: see `Press` and
    `docs/zwidth.md`.

    Args:
        wall: device, hand and timing; its own K and B are ignored. Or the arm with its servo and
            compensator, or a scenario, of which it uses x (for y pass
            `PushedLoop.of(scenario, "y")`): the plane is then that of the clay's b and k, at the
            gain of the loop.
        vary: parameter of a family: "Ts", "delay", "quantum", "damper", "friction", "mass",
            "filter" or "velocity_window", for an arm "Ts", "delay" or "gain"; "" for one region.
        values: values of the parameter [SI]; for "filter" None means no filter.
        B: virtual damping to test [N.s/m], ascending; None for 0 and others up to the largest
            stable B.
        box: hands that replace the wall's own in a second set of runs.
        press: push and criterion of rest for a loop that is not linear.
        quick: 7 values of B instead of 13.
        progress: called with the completed share of the work.

    Raises:
        ParameterError: wall is not a wall, an unknown name, a value out of its bounds, no values,
            or an arm in continuous time.
    """
    device = as_wall(wall)
    if not device.Ts:
        raise ParameterError("Ts", None, "is needed: the walls are rendered at samples")
    if box is not None and not isinstance(box, Box):
        raise ParameterError("box", box, "must be a Box")
    some = None if B is None else _dampings(B)
    family = _family_walls(device, vary, tuple(values))
    regions = []
    for i, (name, each) in enumerate(family):

        def show(share: float, i: int = i) -> None:
            progress((i + share) / len(family))

        regions.append(_region(name, each, some, box, press, quick, show))
    return ZWidth(tuple(regions), vary, press)


def _dampings(B: Iterable[float]) -> tuple[float, ...]:
    out = tuple(number("B", x, -1e9, 1e9, unit="N.s/m") for x in B)
    if not out or any(b <= a for a, b in zip(out, out[1:], strict=False)):
        raise ParameterError("B", out, "must ascend, and not be empty")
    return out


def _family_walls(wall: Wall, vary: str, values: tuple[Any, ...]) -> list[tuple[str, Wall]]:
    """Names and walls of the regions."""
    if isinstance(vary, str) and not vary:
        if values:
            raise ParameterError("values", values, "must be given with the name that they vary")
        return [("", wall)]
    field, unit, factor = wall.varied[choice("vary", vary, tuple(wall.varied))]
    if not values:
        raise ParameterError("values", values, f"must contain at least one value of {vary}")
    subjects = [with_fields(wall.subject, {field: x}) for x in values]
    return [(_value_name(vary, attrgetter(field)(x), unit, factor), as_wall(x)) for x in subjects]


def _value_name(vary: str, value: float | None, unit: str, factor: float) -> str:
    if value is None:
        return f"no {vary}"
    return f"{LETTERS.get(vary, vary)} = {factor * value:g} {unit}"


def _region(
    name: str,
    wall: Wall,
    B: tuple[float, ...] | None,
    box: Box | None,
    press: Press,
    quick: bool,
    show: Share,
) -> ZRegion:
    wall = wall.at(0.0, 0.0)
    linear = wall.linear
    top = theoretical_damping(wall)
    soft = softest(wall, top)
    most_B = math.nan
    if B is None:
        most_B = most_damping(wall, top, 0.0 if linear else soft, press)
        top = top if linear or math.isinf(most_B) else min(top, most_B)
    grid = _grid(wall, top, QUICK_POINTS if quick else POINTS) if B is None else B
    walls = [wall.at(0.0, x) for x in grid]
    exact = [exact_limit(w) for w in walls]
    limits = theory_limits(wall, max(grid[-1], top if B is None else 0.0), grid)
    half = 1.0 if box is None else 0.5

    def find(walls: Sequence[Wall], exact: Sequence[float], begin: float) -> list[float]:
        return stiffest(walls, exact, soft, press, lambda s: show(begin + half * s))

    K = find(walls, exact, 0.0)
    box_K: list[float] = []
    box_exact: list[float] = []
    if box:
        held = [w.changed(operator=worst_hand(w, box)) for w in walls]
        box_exact = [exact_limit(w) for w in held]
        box_K = find(held, box_exact, half)
        note = "worst hand of the box, linear loop"
        limits.append(Limit("worst hand tried of the box", "exact", grid, tuple(box_exact), note))
    show(1.0)
    verdict, given = BY_GROWTH if linear else BY_REST, (tuple(grid), tuple(K), tuple(exact))
    boxed = (box, tuple(box_K), tuple(box_exact))
    return ZRegion(name, wall.subject, verdict, *given, most_B, tuple(limits), *boxed)


def _grid(wall: Wall, top: float, points: int) -> tuple[float, ...]:
    """0, then evenly spaced in log B up to half of the largest B, then where the boundary falls."""
    if top == 0.0:
        return (0.0,)
    first = min(max(0.5 * wall.damper, 1e-3 * top), 0.1 * top)
    rising = np.geomspace(first, 0.5 * top, points - 1 - len(TOP_SHARES)).tolist()
    return (0.0, *rising, *(share * top for share in TOP_SHARES))
