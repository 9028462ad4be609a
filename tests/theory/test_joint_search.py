"""Random arms under random laws: no limit is wrong, and nothing is passed over up to it."""

import functools
import math

import numpy as np
import pytest

from tests.hunt import HUNTS, some
from tests.oracles.random_arms import drawn

BESIDE = 1e-5  # of a limit: the other map turns unstable between both sides
SCANNED = 40 if HUNTS else 12  # values up to a limit
EXACT_STATES = 60  # of a map whose eigenvalues are computed to 50 digits
TOP = 1e4  # of a present value, where no limit is stated
WITHIN = 1e-6  # of an interval's end: there nothing is scanned


class Judge:
    """What the other map says of a case."""

    def __init__(self, case):
        self.case = case

    def agrees(self, grows, **changes):
        """Whether it does; so it does where it cannot tell."""
        held = self.case.held(**changes)
        answer = held.grows()
        if answer is None or answer is grows:
            return True
        if len(held.map()) > EXACT_STATES:
            return False
        return held.grows_exactly() in (None, grows)


def one(values, j, x):
    return np.where(np.arange(len(values)) == j, x, values)


def one_of(kind, gains, j, x):
    return {kind: one(gains, j, x)}


def all_of(kind, gains, x):
    return {kind: x * gains}


def wrong_interval(judge, name, of, present, ends, size):
    """Where the other map contradicts an interval (least, largest) of a gain; "" for nowhere."""
    low, high = ends
    spread = np.random.default_rng(0).uniform(0.9, 1.1, SCANNED)
    values = [0.0, *(np.geomspace(1e-3, TOP, SCANNED) * spread * size).tolist()]
    if math.isnan(high):
        return next(
            (f"{name} {x} is stable" for x in values if not judge.agrees(True, **of(x))), ""
        )
    sides = [(high, 1.0 - BESIDE, False), (high, 1.0 + BESIDE, True)]
    sides += [(low, 1.0 + BESIDE, False), (low, 1.0 - BESIDE, True)]
    for end, share, grows in sides:
        x = share * end
        outside = not low <= x <= high
        if 1e-9 * size < end < math.inf and outside is grows and not judge.agrees(grows, **of(x)):
            return f"{name} {x}, beside {end}, grows: not {grows}"
    inside = [x for x in values if low * (1.0 + WITHIN) < x < high * (1.0 - WITHIN)]
    for x in inside:
        if not judge.agrees(False, **of(x)):
            return f"{name} {x} grows, in {low} to {high}"
    here = low <= present * (1.0 + WITHIN) and present * (1.0 - WITHIN) <= high
    return "" if bool(here) is judge.stable else f"{name} {present} is in {low} to {high}: {here}"


def wrong_intervals(judge, found, j):
    """Gains of joint j, and common factors."""
    law, case = judge.case.law, judge.case
    for kind, factors in (("Kp", (found.least_scale, found.scale)), ("Kd", found.Kd_scale)):
        gains = np.array(getattr(law, kind))
        if gains.any():
            of = functools.partial(all_of, kind, gains)
            yield wrong_interval(judge, f"factor of {kind}", of, 1.0, factors, 1.0)
        size = gains[j] or gains.max() or case.arm.mass_matrix()[j, j] / case.Ts
        of = functools.partial(one_of, kind, gains, j)
        yield wrong_interval(judge, kind, of, gains[j], getattr(found, kind)[j], size)


def wrong_slope(judge, found, j):
    """The largest slope of friction at joint j: stable up to it, not beyond."""
    slopes, most = np.array(judge.case.law.slopes), float(found.friction_slope[j])
    if math.isnan(most):
        return ""
    size = slopes[j] + judge.case.law.Kd[j] + float(judge.case.arm.damping[j])
    size = size or judge.case.arm.mass_matrix()[j, j] / judge.case.Ts
    if math.isfinite(most):
        for x, grows in ((most - BESIDE * size, False), (most + BESIDE * size, True)):
            if not judge.agrees(grows, slopes=one(slopes, j, x)):
                return f"slope {x}, beside {most}, grows: not {grows}"
    if not judge.stable:
        return ""
    top = most if math.isfinite(most) else slopes[j] + TOP * size
    for share in np.geomspace(1e-3, 1.0 - WITHIN, SCANNED).tolist():
        x = slopes[j] + share * (top - slopes[j])
        if not judge.agrees(False, slopes=one(slopes, j, x)):
            return f"slope {x} grows, below {most}"
    return ""


def wrong_timing(judge, found):
    """The delay left, and the lowest rate."""
    case, left, Ts = judge.case, found.delay_left, 1.0 / found.slowest_rate
    far = min(left, max(3.0, 60.0 / len(case.law)) * case.Ts)
    for x in np.linspace(0.0, far, SCANNED)[:-1].tolist():
        if not judge.agrees(False, delay=case.delay + x):
            return f"{x / case.Ts} samples more grow, of {left / case.Ts}"
    if left == far:
        for x, grows in ((left - BESIDE * case.Ts, False), (left + BESIDE * case.Ts, True)):
            if not judge.agrees(grows, delay=case.delay + max(x, 0.0)):
                return f"{x / case.Ts} samples more, of {left / case.Ts}, grow: not {grows}"
    for x in np.geomspace(case.Ts, Ts, 5 * SCANNED)[:-1].tolist():
        if not judge.agrees(False, Ts=x):
            return f"{1.0 / x} Hz grows, above {found.slowest_rate}"
    if Ts < 1.0 - WITHIN:
        for share, grows in ((1.0 - BESIDE, False), (1.0 + BESIDE, True)):
            if not judge.agrees(grows, Ts=share * Ts):
                return f"{share} of {Ts} s grows: not {grows}"
    return ""


def disagreements(case, j):
    """What the other map contradicts, a line each."""
    found, judge = case.limits(), Judge(case)
    judge.stable = found.stable
    if case.held().grows() is None:
        return []
    if not judge.agrees(not found.stable):
        return [f"the verdict: {found.headline()}"]
    out = [*wrong_intervals(judge, found, j), wrong_slope(judge, found, j)]
    out.append(wrong_timing(judge, found) if found.stable else "")
    return [x for x in out if x]


@pytest.mark.parametrize("seed", some(range(400), 5))
def test_another_map_agrees_with_every_limit(seed):
    case = drawn(seed, 7 if HUNTS else 2)
    assert not disagreements(case, seed % len(case.law))
