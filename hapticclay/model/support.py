"""Supported combinations: one table of parts and methods, from the traits of each part."""

from __future__ import annotations

from typing import Any

from . import (
    arm,
    controller,
    hardware,
    operator,
    sampled_controller,
    signals,
)
from .clay import LAWS
from .traits import Refusal, Trait, check_traits, present

METHODS = (
    Trait("fast", "method", lambda s: s.control == "continuous" and s.integrator == "fast"),
    Trait(
        "accurate", "method", lambda s: s.integrator == "accurate",
        refuses={
            "held": Refusal("integrator", "must be 'fast' where control is 'sampled'"),
            "physical": Refusal("integrator", "must be 'fast' where control is 'sampled'"),
        },
    ),
    Trait("held", "method", lambda s: s.control == "sampled" and s.render == "held"),
    Trait("physical", "method", lambda s: s.control == "sampled" and s.render == "physical"),
)  # fmt: skip
PARTS = (
    *arm.TRAITS, *operator.TRAITS, *controller.TRAITS, *signals.TRAITS, *sampled_controller.TRAITS,
    *hardware.TRAITS,
)  # fmt: skip
TRAITS = {x.name: x for x in (*METHODS, *LAWS, *PARTS)}


def refusal(a: str, b: str) -> Refusal | None:
    """Why two parts cannot be combined; None if they can."""
    return TRAITS[a].refuses.get(b) or TRAITS[b].refuses.get(a)


def check_scene(s: Any) -> None:
    """Refuses parts and methods that cannot be combined."""
    own = [] if s.clay is None else present(s.clay, LAWS)
    check_traits([*present(s, METHODS), *own, *present(s, PARTS)], s)


# ---- the page ------------------------------------------------------------------------------------

HEAD = """# What can be combined

The table lists which parts work with which method; the list below it, all pairs that are refused.
All other pairs can be combined. Each cell is tested: a scene with "yes" runs, a scene with "no" is
refused with the message below. The page is made by
`python -m hapticclay.model.support docs/support.md`.

Methods: **fast** and **accurate** integration of continuous control; sampled control with clay
**held** by the motors, or **physical**. Linear theory (gain limits, margins, poles, impedance)
includes a part (yes), leaves it out (its limit is that of the scene without the part), or refuses
the scene (no). Bounds that depend on numbers, such as that of stiff clay, are on the page of the
part. What leaders and followers may touch, and their hardware, is on [their page](pair.md).
"""


def page() -> str:
    """The documentation page, in Markdown."""
    names = [x.name for x in METHODS]
    rows = [[x.name, *(_cell(x.name, m) for m in names), x.theory] for x in (*LAWS, *PARTS)]
    table = [["", *names, "linear theory"], ["---"] * (len(names) + 2), *rows]
    whys = [
        f"- {a} and {b}: `{why.field}` {why.bound}"
        for a in TRAITS
        for b, why in TRAITS[a].refuses.items()
    ]
    lines = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([HEAD, *lines, "", "## Refused", "", *whys, ""])


def _cell(part: str, method: str) -> str:
    return "no" if refusal(part, method) else "yes"


if __name__ == "__main__":
    import sys
    from pathlib import Path

    Path(sys.argv[1]).write_text(page())
