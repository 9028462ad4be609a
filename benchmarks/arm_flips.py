"""Limits of an arm by theory, and by runs half a percent on either side of each.

    python -m benchmarks.arm_flips [arm.xml --Kp 20 20 --Kd 1 1 --rate 1000 --delay 1e-3 --wall 5]

By default the leader of mjcf/arms under its gains.

A run begins a microradian off, or under 0.1 mN, so that it stays linear; it grows if the third
differences of its joints from sample to sample do, which hardly see slow motion, in its last
quarter against the one before.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

import hapticclay as hc

LEADER = (
    "leader_7 --Kp 240 240 240 240 24 31 25 --Kd 3 3 3 3 .2 .2 .2 --rate 500 --delay 2e-3 "
    "--cutoff 90 --wall 5"
)
SHARE = 5e-3
OFF = 1e-6  # [rad]
PUSH = 1e-4  # [N]
SECONDS = 20.0
HAND = hc.Operator(0.25, 2.0, 6.0)


def growth(scenario: hc.Scenario) -> float:
    """Growth of the motion in a run [1/s]."""
    r, Ts = hc.simulate(scenario), scenario.Ts or scenario.dt
    steps = np.diff(r.q[:: round(Ts / scenario.dt)], n=3, axis=0)
    n = len(steps) // 4
    smooth = np.hanning(n)[:, None]  # that the phase at the ends of a quarter does not count
    before, after = (
        np.sqrt((smooth * x**2).sum()) for x in (steps[2 * n : 3 * n], steps[3 * n : 4 * n])
    )
    return math.log(after / before) / (n * Ts)


def free_run(
    arm: hc.MjcfArm, law: hc.JointPD, Ts: float, delay: float, **changes: Any
) -> hc.Scenario:
    """A run a little off its reference."""
    law = replace(law, reference=tuple(arm.q + OFF))
    common: dict[str, Any] = dict(force=(0.0, 0.0), t_max=SECONDS, stop_when_unstable=False, dt=Ts)
    io = hc.Hardware(delay=delay) if delay else None
    return hc.Scenario(arm=arm, controller=law, Ts=Ts, hardware=io, **(common | changes))


def wall_run(
    arm: hc.MjcfArm,
    axis: str,
    K: float,
    B: float,
    hand: hc.Operator | None,
    Ts: float,
    delay: float,
    velocity: Literal["exact", "difference"],
    **changes: Any,
) -> hc.Scenario:
    """A handle that sticks in a held wall along one axis, under a slight push."""
    others = [c for c in arm.axes if c != axis]
    plane = axis + (others[0] if others else next(c for c in "xyz" if c != axis))
    wall = hc.Clay(hc.Profile((), (B,), springs=(hc.Spring(k=K),)), hc.Profile((), (0.0,)))
    none = (0.0,) * len(arm.names)
    return free_run(
        replace(arm, plane=plane), hc.JointPD(none, none, velocity=velocity), Ts, delay,
        clay=wall, operator=hand, force=(PUSH, PUSH), **changes,
    )  # fmt: skip


def limits(
    arm: hc.MjcfArm, law: hc.JointPD, Ts: float, delay: float
) -> Iterator[tuple[str, float, bool, hc.JointPD, float]]:
    """Each limit: name, value, whether it is an upper one, and law and delay at it."""
    found = hc.theory.joint_limits(arm, law, Ts, delay)
    for kind, over in (("Kp", found.Kp), ("Kd", found.Kd)):
        for j, name in enumerate(arm.names):
            for i, value in enumerate(over[j].tolist()):
                if math.isfinite(value) and value > 0.0:
                    gains = list(getattr(law, kind))
                    gains[j] = value
                    yield f"{kind} of {name}", value, bool(i), replace(law, **{kind: gains}), delay
    for kind, values in (("Kp", (0.0, found.scale)), ("Kd", found.Kd_scale)):
        for i, value in enumerate(values):
            if math.isfinite(value) and value > 0.0:
                gains = [value * x for x in getattr(law, kind)]
                yield f"all {kind} times", value, bool(i), replace(law, **{kind: gains}), delay
    if math.isfinite(found.delay_left) and found.delay_left > 0.0:
        yield "delay left", found.delay_left, True, law, delay + found.delay_left


def beside(law: hc.JointPD, at: hc.JointPD, delay: float, late: float, share: float) -> Any:
    """Law and delay a share beyond a limit; what is not at it stays."""
    changed = {}
    for kind in ("Kp", "Kd"):
        pairs = zip(getattr(law, kind), getattr(at, kind), strict=True)
        changed[kind] = [x if x == y else y * (1.0 + share) for x, y in pairs]
    return replace(law, **changed), delay + (late - delay) * (1.0 + share)


def flips(
    arm: hc.MjcfArm, law: hc.JointPD, Ts: float, delay: float, **changes: Any
) -> Iterator[tuple[str, float, float, float]]:
    """Name and value of each limit, and growth in runs on its stable and unstable side [1/s]."""
    for name, value, upper, at, late in limits(arm, law, Ts, delay):
        shares = (-SHARE, SHARE) if upper else (SHARE, -SHARE)
        runs = (free_run(arm, *_timed(beside(law, at, delay, late, x), Ts), **changes)
                for x in shares)  # fmt: skip
        inside, outside = map(growth, runs)
        yield name, value, inside, outside


def _timed(given: tuple[hc.JointPD, float], Ts: float) -> tuple[hc.JointPD, float, float]:
    law, delay = given
    return law, Ts, delay


def wall_flips(
    arm: hc.MjcfArm,
    B: float,
    hand: hc.Operator | None,
    Ts: float,
    delay: float,
    velocity: Literal["exact", "difference"] = "exact",
    **changes: Any,
) -> Iterator[tuple[str, float, float, float]]:
    """As `flips`, of the stiffest wall along each axis of the handle."""
    axes: Any = arm.axes
    for axis in axes:
        K = hc.theory.wall_limit(arm, axis, B, hand, Ts, delay, velocity).K
        if math.isfinite(K) and K > 0.0:
            runs = (wall_run(arm, axis, K * (1.0 + x), B, hand, Ts, delay, velocity, **changes)
                    for x in (-SHARE, SHARE))  # fmt: skip
            inside, outside = map(growth, runs)
            yield f"wall along {axis}", K, inside, outside


def main(given: Sequence[str]) -> int:
    """Prints the table; 1 if a run is not on the side where theory says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("arm")
    parser.add_argument("--site")
    parser.add_argument("--pose", nargs="*", type=float)
    parser.add_argument("--Kp", nargs="*", type=float, default=[])
    parser.add_argument("--Kd", nargs="*", type=float, default=[])
    parser.add_argument("--cutoff", type=float)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--steps", type=int, default=4, help="engine steps in a sample")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="length of a run")
    parser.add_argument("--wall", type=float, help="damping of walls along all axes [N.s/m]")
    parser.add_argument("--difference", action="store_true", help="rates of walls by difference")
    x = parser.parse_args(given)
    bare = hc.MjcfArm(x.arm, site=x.site, pose=x.pose)
    arm = replace(bare, friction=[0.0] * len(bare.names))
    rows: list[tuple[str, float, float, float]] = []
    changes = dict(dt=1.0 / x.rate / x.steps, t_max=x.seconds)
    if x.Kp:
        velocity = "filter" if x.cutoff else "exact"
        law = hc.JointPD(x.Kp, x.Kd, velocity=velocity, cutoff=x.cutoff)
        rows += flips(arm, law, 1.0 / x.rate, x.delay, **changes)
    if x.wall is not None:
        kind: Any = "difference" if x.difference else "exact"
        rows += wall_flips(arm, x.wall, HAND, 1.0 / x.rate, x.delay, kind, **changes)
    print(f"{'limit':24} {'theory':>12} {'growth [1/s] within':>20} {'beyond':>10}")
    for name, value, inside, outside in rows:
        print(f"{name:24} {value:12.5g} {inside:20.3g} {outside:10.3g}")
    wrong = sum(not inside < 0.0 < outside for *_, inside, outside in rows)
    print(f"{len(rows) - wrong} of {len(rows)} runs flip within {100 * SHARE:g} % of the limit")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or [*LEADER.split()]))
