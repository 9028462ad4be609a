"""Where the hand holds an arm: a site or body of the file, and the joints before it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from ..display import names_words
from ..errors import ParameterError, nearest
from . import islands, limbs


class Handle(NamedTuple):
    """The handle of an arm, and the chain of joints that ends there.

    Attributes:
        site: kind, "site" or "body", and number in the model; None where the file names none.
        chain: joints before it, from the base on.
        names: sites and bodies that may be named as the handle.
        notes: what was chosen.
    """

    site: tuple[str, int] | None
    chain: list[int]
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()


def handle(model: Any, wanted: Any, joints: Sequence[int] | None) -> Handle:
    """The handle that is wanted, or the one that a file, or a choice of joints, leaves no doubt of.

    Raises:
        ParameterError: there is none of this name, or the file has several arms.
    """
    if wanted is not None:
        site = _named(model, wanted)
        body = _body(model, site)
        return Handle(site, limbs.joints_to_root(model, body), (), tuple(_shared(model, body)))
    sites = [i for i in range(model.nsite) if _ends_an_arm(model, int(model.site_bodyid[i]))]
    if joints is not None:
        island = islands.island(model, joints)
        sites = [i for i in sites if island.intersection(_chain(model, i))]
        if len(sites) != 1:
            return Handle(None, [], tuple(model.site(i).name for i in sites if model.site(i).name))
    if len(sites) == 1:
        site = "site", sites[0]
        return Handle(site, _chain(model, sites[0]), ())
    return _unnamed(model, sites)


def _names_at(model: Any, tip: int, sites: list[int]) -> list[str]:
    """Sites at the end of a limb, or the body there."""
    chain = limbs.joints_to_root(model, tip)
    names = [model.site(i).name for i in sites if _chain(model, i) == chain]
    return [x for x in names if x] or [model.body(tip).name or f"body {tip}"]


def _shared(model: Any, body: int) -> Iterator[str]:
    """A sentence on joints before a handle that carry other limbs, as a torso's."""
    chain, shared, inner = limbs.joints_to_root(model, body), list[int](), body
    for place in limbs.bodies_to_root(model, body):
        before = limbs.joints_to_root(model, place)
        branches = limbs.branches(model, place, inner)
        if before and 2 * max(branches, default=0) > len(chain) - len(before) > 0:
            shared = before
            break
        inner = place
    if shared:
        names = ", ".join(model.joint(j).name for j in shared)
        yield f"joints before the handle that carry other limbs, too: {names}; joints may omit them"


def name(model: Any, site: tuple[str, int]) -> str:
    """The name of a site or body."""
    kind, number = site
    return (model.site if kind == "site" else model.body)(number).name


def _body(model: Any, site: tuple[str, int]) -> int:
    kind, number = site
    return int(model.site_bodyid[number]) if kind == "site" else number


def _named(model: Any, wanted: Any) -> tuple[str, int]:
    sites = {model.site(i).name: i for i in range(model.nsite) if model.site(i).name}
    bodies = {model.body(i).name: i for i in range(1, model.nbody) if model.body(i).name}
    if not isinstance(wanted, str):
        raise ParameterError("site", wanted, "must be the name of a site or body, or None")
    if wanted in sites:
        return "site", sites[wanted]
    if wanted in bodies:
        return "body", bodies[wanted]
    raise unknown("site", wanted, [*sites, *bodies], "a site or body")


def unknown(field: str, word: Any, names: Sequence[str], kind: str) -> ParameterError:
    """The refusal of a name that the file does not have, with the nearest."""
    near = nearest(word, names) if isinstance(word, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else f": {names_words(names)}"
    return ParameterError(field, word, f"must be {kind} of the file{hint}")


def _chain(model: Any, site: int) -> list[int]:
    return limbs.joints_to_root(model, int(model.site_bodyid[site]))


def _ends_an_arm(model: Any, body: int) -> bool:
    """Whether joints move a body, and what it carries has no more of them one behind the other."""
    before = limbs.joints_to_root(model, body)
    return bool(before) and limbs.depth_behind(model, body) <= len(before)


def _unnamed(model: Any, sites: list[int]) -> Handle:
    """The handle of a file that has no site, or several, at the ends of arms."""
    names = tuple(model.site(i).name for i in sites if model.site(i).name)
    chains = {tuple(_chain(model, i)) for i in sites}
    if len(chains) == 1:
        return Handle(None, list(chains.pop()), names)
    try:
        limb = limbs.arm_limb(model)
    except limbs.Several as several:
        if loop := islands.loop_on_base(model):
            return Handle(None, loop, names)
        ends = names_words([x for tip in several.tips for x in _names_at(model, tip, sites)])
        bound = f"must be named (--site NAME), since the file has several limbs, such as {ends}"
        raise ParameterError("site", None, bound) from None
    if limb is None:
        return Handle(None, [], names)
    at_tip = [i for i in sites if _chain(model, i) == limb.joints]
    if len(at_tip) == 1:
        site = "site", at_tip[0]
        return Handle(site, limb.joints, (), (f"handle: {name(model, site)}",))
    tips = tuple(model.site(i).name for i in at_tip) or (model.body(limb.tip).name,)
    return Handle(None, limb.joints, tuple(x for x in tips if x))
