"""The Z-width of a virtual wall: the stiffness and damping that it renders stably, by runs.

Z-width: Colgate, Brown, Factors affecting the Z-width of a haptic display, ICRA 1994.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..errors import Bound, ParameterError, check_fields, choice, number
from ..model.constants import AXES, TS
from ..model.operator import Operator
from ..model.shapes import Constant
from ..model.spring import STIFFNESS_MAX
from ..results import Result
from ..scene.changes import with_fields
from ..scene.scenario import Scenario
from ..scene.virtual_wall import VirtualWall
from ..simulation.batch import simulate_batch
from ..simulation.record import Record
from ..theory import gain_crossings, gain_limits, wall_limits
from ..theory.roots import bisect
from ..theory.stability_margins import Box
from . import boundary, growth

VARIED_DEVICE = {  # what a family may vary: its field, unit, factor of the unit that a label shows
    "Ts": ("Ts", "ms", 1e3),
    "delay": ("delay", "ms", 1e3),
    "quantum": ("device.quantum", "um", 1e6),
    "damper": ("device.damper", "N.s/m", 1.0),
    "friction": ("device.friction", "N", 1.0),
    "mass": ("device.mass", "kg", 1.0),
    "filter": ("velocity_filter", "Hz", 1.0),
    "velocity_window": ("velocity_window", "samples", 1.0),
}
VARIED_ARM = {
    "Ts": VARIED_DEVICE["Ts"],
    "delay": VARIED_DEVICE["delay"],
    "gain": ("K", "1/kg", 1.0),
}
LETTERS = {
    "gain": "Kc",
    "damper": "b",
    "friction": "fc",
    "mass": "m",
    "quantum": "Delta",
    "velocity_window": "window",
}  # in labels
POINTS, QUICK_POINTS = 13, 7  # values of B of a region
LIMIT_POINTS = 61  # of a line of theory
TOP_SHARES = (0.72, 0.88, 0.97)  # of the largest B: points where the boundary falls
FEWEST_SAMPLES, MOST_SAMPLES = 300, 6000  # samples of a run whose growth is read
READ_SWINGS = 4.0  # periods of device and wall in such a run, at least
READ = 400  # samples of it that are read, about
SLOWEST = 1e-3  # modes slower than this share of sqrt(K/m) are no oscillation
GROWTH_STEPS, REST_STEPS = 16, 4  # engine steps a sample, at least
STEP_DECAY = 0.1  # largest share of its speed that the damper takes in a step
DEEPEST = 5e-3  # [m] into the wall that the force presses, so that the arm moves straight
REST_SAMPLES = 1000  # of the first run that is judged by its rest
REST_SWINGS = 10.0  # its periods, at least
REST_SPANS = (1.0, 4.0, 16.0, 64.0)  # longer while a swing decays, or the device creeps
REST_MOST = 20_000  # samples of that first run, at most
WINDOWS = ((0.4, 0.6), (0.8, 1.0))  # parts of a run whose swings are compared
KEPT = 0.97  # a swing that keeps so much of itself from one to the other is sustained
ROUGH_KEPT = 0.8  # the same of one within ROUGH quanta, whose size is not even
ROUGH = 10.0
SOFTEST = 0.03  # K of the ladder's first rung over that of the linear loop at B = 0, and
SOFT_BOUNDS = (1e-4, 1e-3)  # its bounds over the largest K of the linear loop
RUNG = 3.0  # ratio of the K of one rung to that of the one below
EDGE_CLOSE = 5e-3  # a boundary between rest and swing is found to this share
REST_RESOLVED = 0.01  # share of K to which the decay of a swing tells stable from unstable
FALLEN = 0.01  # share of the largest K below which a boundary has fallen to nothing
BY_GROWTH, BY_REST = "growth rate", "rest after a push"

# on a bare device, or clay of k and b on this arm
Wall = VirtualWall | boundary.PushedLoop
Search = Generator[float, Any, float]
Share = Callable[[float], None]


def unshown(share: float) -> None:
    """Shows no progress.

    Args:
        share: of the work that is done.
    """


@named
@dataclass(frozen=True)
class Press:
    """The push by which a wall is tried whose loop is not linear, and what counts as rest.

    Attributes:
        force: that presses into the wall from the start [N], 0 to 1e3: no deeper than 5 mm, and to
            the middle between two forces that the encoder can tell, where the wall rests least.
        speed: at which the device meets the wall [m/s], 0 to 1.
        still: largest motion back and forth that counts as rest [m], 1e-9 to 1e-2. A hand that
            grips feels about 1 um at 100 to 300 Hz.
    """

    force: Annotated[float, Bound(0.0, 1e3, "N")] = 1.0
    speed: Annotated[float, Bound(0.0, 1.0, "m/s")] = boundary.LARGE_PUSH
    still: Annotated[float, Bound(1e-9, 1e-2, "m")] = 1e-6

    def __post_init__(self):
        check_fields(self, "press.")


@named
@dataclass(frozen=True)
class Limit:
    """A published or exact line in the plane of B and K.

    Attributes:
        name: authors and year, or "exact".
        kind: "exact" (of the linear loop), "sufficient" (for every passive hand), or "rule" (an
            approximation, or for another question).
        B: [N.s/m].
        K: [N/m], of the length of B; 0 where there is none.
        note: where it holds.
    """

    name: str
    kind: str
    B: tuple[float, ...]
    K: tuple[float, ...]
    note: str = ""

    def at(self, B: float) -> float:
        """K of the line at B, between its points [N/m]; NaN beyond its ends.

        Args:
            B: virtual damping [N.s/m].
        """
        return float(np.interp(B, self.B, self.K, math.nan, math.nan))


@named
@dataclass(frozen=True)
class ZRegion:
    """Walls that one device renders stably: those below K(B), found by runs.

    Attributes:
        name: of the region in its family, "" for one alone.
        wall: what renders them, whose own K and B (of an arm, k and b) do not matter.
        verdict: how a run was judged, "growth rate" (linear loops) or "rest after a push".
        B: virtual damping [N.s/m], ascending.
        K: largest stable stiffness found by runs, for each B [N/m]; 0 for none. All that is softer
            was found stable as far as it was tried.
        exact: the same of the linear loop by its eigenvalues [N/m]; friction, quantum and surface
            are left out.
        most_B: largest stable B found by runs [N.s/m], at K = 0; at the softest K tried if the
            verdict is that of rest; NaN if B was given.
        limits: lines of theory.
        box: hands for which the region was found once more; None for none.
        box_K: largest stable K of runs with the worst hand of the box, for each B [N/m].
        box_exact: the same of the linear loop.
    """

    name: str
    wall: Wall
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
        """Whether the loop is linear, so that its eigenvalues tell what the runs must find."""
        return self.verdict == BY_GROWTH

    @property
    def largest_K(self) -> float:
        """Largest K of the region [N/m]."""
        return max(self.K)

    @property
    def largest_B(self) -> float:
        """Largest B of the region [N.s/m]: that of the runs, or of the points where B was given."""
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

        As a share of K, and, where the boundary falls to nothing, of 1 % of the largest K.
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
        """Points at which a run was unstable below a line that is sufficient, in words."""
        out = []
        close = boundary.BRACKET if self.linear else REST_RESOLVED
        for limit in self.limits:
            for B, K in zip(self.B, self.K, strict=True):
                asked = limit.at(B)
                if limit.kind == "sufficient" and K < (1.0 - close) * asked:
                    out.append(f"{limit.name}: B = {B:.4g}, K = {K:.4g} < {asked:.4g}")
        return out


@named
@dataclass(frozen=True, repr=False)
class ZWidth(Result):
    """Regions of stable walls: one, or a family.

    Attributes:
        regions: in the order of the values.
        vary: what differs between them, "" for nothing.
        press: the push where the verdict is that of rest.
    """

    regions: tuple[ZRegion, ...]
    vary: str = ""
    press: Press = Press()

    def headline(self) -> str:
        """Largest stiffness and damping of each region, in one line."""
        told = (
            f"{f'{r.name}: ' if r.name else ''}K to {r.largest_K:.4g} N/m, B to "
            f"{r.largest_B:.4g} N.s/m"
            for r in self.regions
        )
        return "; ".join(told)

    def gap(self) -> float:
        """Largest relative gap between runs and exact lines; NaN if no loop is linear."""
        gaps = [g for r in self.regions if not math.isnan(g := r.gap())]
        return max(gaps, default=math.nan)

    def violations(self) -> list[str]:
        """What was unstable below a line that is sufficient, in words; empty as it should be."""
        return [x for r in self.regions for x in r.violations()]

    def tables(self) -> dict[str, dict[str, list]]:
        """What the figure shows: "runs", "lines", and "regions" with a row each."""
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
            "largest B [N.s/m]": [r.largest_B for r in self.regions],
            "area [N^2.s/m^2]": [r.area for r in self.regions],
            "gap to exact": [r.gap() for r in self.regions],
        }
        return {"runs": runs, "lines": lines, "regions": regions}


@checked
def zwidth(
    wall: Wall | Scenario,
    vary: str = "",
    values: Iterable[Any] = (),
    *,
    B: Iterable[float] | None = None,
    box: Box | None = None,
    press: Press = Press(),
    quick: bool = False,
    progress: Share = unshown,
) -> ZWidth:
    """Find the walls that a device renders stably, by runs, beside what theory says.

    A linear loop is stable where the oscillation of a run decays: its growth rate is that of its
    least damped mode, exact but for the step of the engine. With friction, an encoder or a surface
    it is not linear, and a wall is stable if it comes to rest after a push: see `Press` and
    `docs/zwidth.md`.

    Args:
        wall: device, hand and timing; its own K and B do not matter. Or the arm with its servo and
            compensator, or a scenario, of which it takes x (y is `PushedLoop.of(scenario, "y")`):
            the plane is then that of the clay's b and k, under the gain of the loop.
        vary: what differs in a family: "Ts", "delay", "quantum", "damper", "friction", "mass",
            "filter" or "velocity_window", of an arm "Ts", "delay" or "gain"; "" for one region.
        values: of what differs [SI]; None among those of "filter" is no filter.
        B: virtual damping to try [N.s/m], ascending; None for 0 and others up to the largest that
            is stable.
        box: hands at the handle, in the place of the wall's own for a second set of runs.
        press: the push and the rest of a loop that is not linear.
        quick: 7 values of B instead of 13.
        progress: called with the share of the work that is done.

    Raises:
        ParameterError: wall is none, an unknown name, a value out of its bounds, no values, or an
            arm in continuous time.
    """
    wall = boundary.of_scenario(wall, AXES[0])
    if isinstance(wall, boundary.PushedLoop) and not wall.Ts:
        raise ParameterError("Ts", None, "must be given: the walls are rendered at samples")
    if box is not None and not isinstance(box, Box):
        raise ParameterError("box", box, "must be a Box")
    some = None if B is None else _dampings(B)
    family = _family_walls(wall, vary, tuple(values))
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
    varied = VARIED_DEVICE if isinstance(wall, VirtualWall) else VARIED_ARM
    field, unit, factor = varied[choice("vary", vary, tuple(varied))]
    if not values:
        raise ParameterError("values", values, f"must hold a value of {vary} at least")
    walls = [with_fields(wall, {field: x}) for x in values]
    return [(_value_name(vary, attrgetter(field)(w), unit, factor), w) for w in walls]


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
    wall = _at(wall, 0.0, 0.0)
    linear = is_linear(wall)
    top = theoretical_damping(wall)
    soft = _softest(wall, top)
    most_B = math.nan
    if B is None:
        most_B = _most_damping(wall, top, 0.0 if linear else soft, press)
        top = top if linear or math.isinf(most_B) else min(top, most_B)
    grid = _grid(wall, top, QUICK_POINTS if quick else POINTS) if B is None else B
    walls = [_at(wall, 0.0, x) for x in grid]
    exact = [_exact(w) for w in walls]
    limits = _theory_limits(wall, max(grid[-1], top if B is None else 0.0), grid)
    half = 1.0 if box is None else 0.5

    def find(walls: Sequence[Wall], exact: Sequence[float], begin: float) -> list[float]:
        return _stiffest(walls, exact, soft, press, lambda s: show(begin + half * s))

    K = find(walls, exact, 0.0)
    box_K: list[float] = []
    box_exact: list[float] = []
    if box:
        held = [replace(w, operator=worst_hand(w, box)) for w in walls]
        box_exact = [_exact(w) for w in held]
        box_K = find(held, box_exact, half)
        note = "worst hand of the box, linear loop"
        limits.append(Limit("any hand of the box", "exact", grid, tuple(box_exact), note))
    show(1.0)
    verdict, given = BY_GROWTH if linear else BY_REST, (tuple(grid), tuple(K), tuple(exact))
    boxed = (box, tuple(box_K), tuple(box_exact))
    return ZRegion(name, wall, verdict, *given, most_B, tuple(limits), *boxed)


def _at(wall: Wall, K: float, B: float) -> Wall:
    """The wall with another K and B."""
    if isinstance(wall, VirtualWall):
        return replace(wall, K=K, B=B)
    return replace(wall, k=K, b=B)


def is_linear(wall: Wall) -> bool:
    """Whether the loop of a wall is linear: no friction, no encoder, no surface.

    Args:
        wall: the wall; the arm's loop is linear in a small motion.
    """
    if isinstance(wall, boundary.PushedLoop):
        return True
    return not (wall.unilateral or wall.device.friction or wall.device.quantum)


def theoretical_damping(wall: Wall) -> float:
    """Largest B of the linear loop that is stable at K = 0 [N.s/m]; 0 for none.

    Args:
        wall: all but K and B.
    """
    unit = _mass(wall) / _sample(wall)

    def stable(B: float) -> bool:
        tried = _at(wall, 0.0, B)
        if isinstance(tried, VirtualWall):
            return wall_limits.stable_wall(tried)
        return gain_crossings.is_stable(tried.linear)

    grid = np.geomspace(1e-5 * unit, 1e3 * unit, 120).tolist()
    low = next((i for i, B in enumerate(grid) if stable(B)), None)
    if low is None:
        return 0.0
    high = next((B for B in grid[low + 1 :] if not stable(B)), None)
    return grid[-1] if high is None else bisect(stable, grid[low], high, 1e-9)[0]


def worst_hand(wall: Wall, box: Box) -> Operator:
    """The hand of a box with which the least K is stable, among those at its ends and middles.

    Args:
        wall: all but K and the hand, which do not matter.
        box: the hands.
    """
    sides = [
        sorted({low, 0.5 * (low + high), high}) for low, high in (box.mass, box.damper, box.spring)
    ]
    hands = [Operator(m, d, k) for m in sides[0] for d in sides[1] for k in sides[2]]
    return min(hands, key=lambda hand: _exact(replace(wall, operator=hand)))


@functools.lru_cache(maxsize=2048)  # asked for as a line, as a guess, and beside the runs
def _exact(wall: Wall) -> float:
    """Largest stable K of the linear loop."""
    if isinstance(wall, VirtualWall):
        return wall_limits.stiffness_band(wall)[1]
    return gain_limits.stiffness_limit(wall.linear)


def _softest(wall: Wall, top: float) -> float:
    """Least K at which a wall is tried."""
    first, scale = (_exact(_at(wall, 0.0, share * top)) for share in (0.0, 0.5))
    scale = max(first, scale) or wall.hand.spring + _mass(wall) / _sample(wall) ** 2
    return min(max(SOFTEST * first, SOFT_BOUNDS[0] * scale), SOFT_BOUNDS[1] * scale)


def _mass(wall: Wall) -> float:
    """Mass of device and hand [kg]."""
    if isinstance(wall, VirtualWall):
        return wall.device.mass + wall.hand.mass
    return 1.0 / wall.servo.S.gain + wall.hand.mass


def _sample(wall: Wall) -> float:
    return wall.Ts or TS


def _grid(wall: Wall, top: float, points: int) -> tuple[float, ...]:
    """0, then even on a logarithm up to half of the largest B, then where the boundary falls."""
    if top == 0.0:
        return (0.0,)
    b = wall.hand.damper + (wall.device.damper if isinstance(wall, VirtualWall) else 0.0)
    first = min(max(0.5 * b, 1e-3 * top), 0.1 * top)
    rising = np.geomspace(first, 0.5 * top, points - 1 - len(TOP_SHARES)).tolist()
    return (0.0, *rising, *(share * top for share in TOP_SHARES))


def _theory_limits(wall: Wall, top: float, grid: Sequence[float]) -> list[Limit]:
    """Lines of theory, from the least B up to top."""
    first = next((B for B in grid if B > 0.0), 1.0)
    fine = [*np.linspace(min(grid[0], 0.0), first, 5)[:-1]]
    if top > first:
        fine += [*np.geomspace(first, top, LIMIT_POINTS), *np.linspace(0.5 * top, top, 17)]
    if isinstance(wall, boundary.PushedLoop):  # whose limit is a scan
        fine = []
    B = np.unique([*fine, *grid]).tolist()
    walls = [_at(wall, 0.0, x) for x in B]
    parts: list[Limit] = []

    def line(name: str, kind: str, law: Callable[[Any], float], note: str) -> None:
        K = [law(w) for w in walls]
        if any(x > 0.0 for x in K):
            parts.append(Limit(name, kind, tuple(B), tuple(K), note))

    if isinstance(wall, boundary.PushedLoop):
        line("exact, linear loop", "exact", _exact, "sampled loop at the nominal pose")
        return parts
    left_out = [n for n in ("friction", "quantum") if getattr(wall.device, n)]
    left_out += ["surface"] if wall.unilateral else []
    note = f"of the linear loop: {' and '.join(left_out)} left out" if left_out else "eigenvalues"
    line("exact, linear loop", "exact", _exact, note)
    line(
        "Colgate, Schenkel 1997",
        "rule" if wall.device.quantum else "sufficient",
        wall_limits.colgate_schenkel_limit,
        "passive: stable in every passive hand"
        + (", but for the quantum" * bool(wall.device.quantum)),
    )
    if wall.velocity == "difference" and wall.velocity_window == 1 and wall.velocity_filter is None:
        note = "linear rule, for (b + B) Ts and K Ts^2 far below the mass"
        line("Hulin et al. 2006", "rule", wall_limits.hulin_limit, note)
    if wall.delay == 0.0 and wall.M == 0.0:
        K = wall_limits.abbott_okamura_limit(wall)
        if 0.0 < K < math.inf:
            note = "passive, for B = 0: friction outweighs the encoder"
            parts.append(Limit("Abbott, Okamura 2005", "sufficient", (0.0,), (K,), note))
    return parts


# ---- runs ----------------------------------------------------------------------------------------


def _stiffest(
    walls: Sequence[Wall],
    exact: Sequence[float],
    softest: float,
    press: Press,
    show: Share,
) -> list[float]:
    """Largest stable K of each wall, by runs."""
    if is_linear(walls[0]):
        searches = [
            boundary.crossing_search(K if 0.0 < K < math.inf else softest, 0.1 * STIFFNESS_MAX)
            for K in exact
        ]
        return _side_by_side(
            searches, lambda i, K: _at(walls[i], K, _damping(walls[i])), growth_rates, show
        )
    top = 0.3 * STIFFNESS_MAX
    return _side_by_side(
        [_rung_search(softest, top) for _ in walls],
        lambda i, K: _at(walls[i], K, _damping(walls[i])),
        lambda tried: come_to_rest(tried, press),
        show,
    )


def _damping(wall: Wall) -> float:
    return wall.B if isinstance(wall, VirtualWall) else wall.b


def _most_damping(wall: Wall, top: float, K: float, press: Press) -> float:
    """Largest stable B at a K, by runs."""
    if top == 0.0:
        return 0.0

    def tried(i: int, B: float) -> Wall:
        return _at(wall, K, B)

    if K == 0.0:
        search = boundary.crossing_search(top, 100.0 * top)
        return _side_by_side([search], tried, growth_rates)[0]
    search = _rung_search(1e-3 * top, 10.0 * top)
    return _side_by_side([search], tried, lambda walls: come_to_rest(walls, press))[0]


def _side_by_side(
    searches: Sequence[Search],
    wall: Callable[[int, float], Any],
    judge: Callable[[Sequence[Any]], Sequence[Any]],
    show: Share = unshown,
) -> list[float]:
    """Results of searches that each ask for one run at a time; a batch has one of each."""
    results = [math.nan] * len(searches)
    asked = {i: next(search) for i, search in enumerate(searches)}
    while asked:
        answers = judge([wall(i, x) for i, x in asked.items()])
        going = {}
        for i, answer in zip(asked, answers, strict=True):
            try:
                going[i] = searches[i].send(answer)
            except StopIteration as end:
                results[i] = end.value
        asked = going
        show(1.0 - len(asked) / len(searches))
    return results


def _rung_search(start: float, most: float) -> Search:
    """Yields x from start upwards, takes whether it rests, and returns the largest that does.

    The first rung of the ladder that does not rest ends it; a bisection follows.
    """
    low, high = 0.0, start
    while (yield high):
        low, high = high, RUNG * high
        if low > most:
            return math.inf
    while low and high / low > 1.0 + EDGE_CLOSE:
        middle = math.sqrt(low * high)
        if (yield middle):
            low = middle
        else:
            high = middle
    return low


def growth_rates(walls: Sequence[Wall]) -> list[float]:
    """Rate at which the oscillation of each wall's linear loop grows, from a run of each [1/s].

    Args:
        walls: the walls.
    """
    arms = [w for w in walls if isinstance(w, boundary.PushedLoop)]
    if arms:
        records = simulate_batch(w.scenario() for w in arms)
        how = growth.GROWTH_SAMPLE, growth.SLOWEST_MODE
        return [growth.growth_of_run(r, *how, w.axis) for r, w in zip(records, arms, strict=True)]
    bare = [w for w in walls if isinstance(w, VirtualWall)]
    steps = growth_steps(bare[0]) if bare else 1
    read = [growth_reading(w) for w in bare]
    records = simulate_batch(
        (
            w.scenario(n * w.Ts, push=boundary.SMALL_PUSH, steps=steps)
            for w, (n, *_) in zip(bare, read, strict=True)
        ),
        every=steps,
    )
    return [
        growth.growth_of_run(r, sample, slowest)
        for r, (_, sample, slowest) in zip(records, read, strict=True)
    ]


def growth_steps(wall: VirtualWall) -> int:
    """Engine steps a sample of a run whose growth is read.

    Args:
        wall: the wall.
    """
    return _engine_steps([wall], GROWTH_STEPS)


def growth_reading(wall: VirtualWall, span: float = 1.0) -> tuple[int, float, float]:
    """How the growth of a wall's oscillation is read from a run, on the scale of its own samples.

    Args:
        wall: the wall.
        span: length of the run, in those of the shortest that tells most walls.

    Returns:
        Samples of the run; about the time between those that are read [s]; modes slower than the
        third do not count [rad/s, 1/s].
    """
    omega = math.sqrt((wall.K + wall.hand.spring) / _mass(wall))
    order = wall.velocity_window + wall.delay / wall.Ts
    n = max(
        FEWEST_SAMPLES + 12.0 * order,
        READ_SWINGS * math.tau / max(omega * wall.Ts, 1e-9) if omega else 0.0,
    )
    n = math.ceil(span * min(n, MOST_SAMPLES + 12.0 * order))
    kept = max(READ, 6.0 * order)
    return n, wall.Ts * max(1.0, n / kept), SLOWEST * omega


def come_to_rest(walls: Sequence[VirtualWall], press: Press = Press()) -> list[bool]:
    """Whether each wall comes to rest after a push, by a run of each.

    At rest is what moves back and forth by `press.still` at most in the last fifth of the run. What
    swings more is tried for longer, up to 64 times, as long as the swing decays. Without an encoder
    a swing that still decays at the end is stable, too; with one it may end in a limit cycle of
    about a quantum, so it must have come to rest.

    Args:
        walls: the walls.
        press: the push, and what counts as rest.
    """
    rests: dict[int, bool] = {}
    steps = _engine_steps(walls, REST_STEPS)
    for span in REST_SPANS:
        left = [i for i in range(len(walls)) if i not in rests]
        jobs = [_pressed(walls[i], press, span, steps) for i in left]
        for i, record in zip(left, simulate_batch(jobs, every=steps), strict=True):
            (early, _), (late, creep) = (_swing(record, *window) for window in WINDOWS)
            quantum, last = walls[i].device.quantum, span == REST_SPANS[-1]
            chatters = late < ROUGH * quantum and span > 1.0
            keeps = late >= (ROUGH_KEPT if chatters else KEPT) * early
            if record.outcome.code in ("diverged", "out of reach", "singular"):
                rests[i] = False
            elif late <= press.still:
                rests[i] = True
            elif quantum and (last or (keeps and creep < late)):
                rests[i] = False
            elif not quantum and (last or late >= early):
                rests[i] = not keeps
    return [rests[i] for i in range(len(walls))]


def _pressed(wall: VirtualWall, press: Press, span: float, steps: int) -> Any:
    """The scenario of a wall that a hand pushes."""
    stiffness, quantum = wall.K + wall.hand.spring, wall.device.quantum
    force = min(press.force, DEEPEST * stiffness)
    if quantum and wall.K:
        force = (max(0, round(force / (wall.K * quantum) - 0.5)) + 0.5) * wall.K * quantum
    omega = math.sqrt(stiffness / _mass(wall))
    n = max(REST_SAMPLES, REST_SWINGS * math.tau / (omega * wall.Ts)) if omega else REST_SAMPLES
    n = math.ceil(span * min(n + wall.delay / wall.Ts, REST_MOST))
    muscle = Constant((force, 0.0)) if force else None
    return wall.scenario(n * wall.Ts, push=press.speed, muscle=muscle, steps=steps)


def _swing(record: Record, begin: float, end: float) -> tuple[float, float]:
    """Largest motion back and forth in a part of a run, and how far it creeps one way [m]."""
    n = len(record.p)
    x = record.p[int(begin * n) : max(int(end * n), int(begin * n) + 1), 0]
    back = np.max(np.maximum.accumulate(x) - x)
    forth = np.max(x - np.minimum.accumulate(x))
    return float(min(back, forth)), float(abs(x[-1] - x[0]))


def _engine_steps(walls: Sequence[VirtualWall], least: int) -> int:
    """Engine steps a sample, at least so many, and such that dampers take little in each."""
    w = walls[0]
    decay = (w.device.damper + w.hand.damper) / _mass(w) * w.Ts
    most = max(1, math.floor(w.Ts / 1e-6))  # dt is 1 us at least
    return min(max(least, math.ceil(decay / STEP_DECAY), math.ceil(w.Ts / 0.02)), most)
