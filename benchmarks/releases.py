"""Compare two releases of hapticclay bit by bit.

    python releases.py --out old                 with the interpreter of the old release
    python releases.py --out new --load old      with that of the new one
    python releases.py --compare old new

The first two ask whatever `hapticclay` this interpreter imports a fixed set of questions: scenes
of every kind, analyses, identification, the paper's ledger, sweeps, the command line. Each answer
is taken apart into named parts (numbers, texts, arrays); `digests.json` holds them with one SHA-256
digest per question, and `arrays/` the arrays, thinned, so that the size of a difference is
known. `records/` holds records as this release saves them; with --load, the records of another
release are read instead. Wall times and versions are left out.

The third prints one line for each question whose answers differ: for an array or a number the
largest absolute difference, and in brackets the largest value there; for a text both texts. Its
exit status is 1 if any differ.

Only public names (`import hapticclay as hc`) and the command line are used, because modules may
move between releases. Where a public keyword changes its name or meaning, "One question, two
releases" below is the only place to adapt. The command line is run with the very package that
`import hapticclay` finds here. Bits can only agree on one machine, with the same numpy, SciPy
and MuJoCo. All questions take about three minutes on one core; --only chooses some by a
regular expression, --list names them.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import hashlib
import inspect
import json
import math
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Sums in linear algebra must not depend on the number of cores; children inherit this.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

import numpy as np  # noqa: E402

import hapticclay as hc  # noqa: E402

TS = 0.36e-3  # [s] the paper's sampling period, the default step
ARRAYS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta")  # of a record
UNTIMED = ("versions", "wall_time_s", "real_time_factor")  # keys of a summary that are left out
BOTH, PYTHON = ("python", "native"), ("python",)  # engines that can run a scene
KEEP = 2000  # samples of an array that are kept beside its digest, at most
SHOWN = 16  # parts of an answer that a line of the comparison names, at most
WIDTH = 60  # characters of a text that it shows

Answer = Any  # numbers, texts, arrays, and dataclasses, dictionaries and sequences of them
Make = Callable[[], hc.Scenario]


# ---- One question, two releases -----------------------------------------------------------------
#
# A hand is None (nothing at the handle, Th = 0), "nominal" (Eq. 19) or (mass, damper, spring). It
# is always said explicitly, so that no default decides. Release 0.1.0 takes impedance=True or False
# beside operator=, and there operator=None means the nominal hand; a later one may take operator=
# alone, where None means no hand.

OTHER = (0.5, 4.0, 20.0)  # a hand that is not the nominal one
HANDS = {"none": None, "nominal": "nominal", "other": OTHER}


def operator_of(hand: Any) -> hc.Operator | None:
    """The hc.Operator of a hand; None for no hand."""
    if hand is None:
        return None
    return hc.Operator() if hand == "nominal" else hc.Operator(*hand)


def scenario(experiment: str, hand: Any = None, **words: Any) -> hc.Scenario:
    """A scenario of an experiment; what its factory does not take is replaced afterwards.

    Args:
        experiment: a key of hc.SCENARIOS.
        hand: see above.
        **words: parameters of the factory, or fields of hc.Scenario.
    """
    factory = hc.SCENARIOS[experiment]
    known = inspect.signature(factory).parameters
    given = {name: value for name, value in words.items() if name in known}
    replaced = {name: value for name, value in words.items() if name not in known}
    if "impedance" in known and hand in (None, "nominal"):
        given["impedance"] = hand is not None
    elif "operator" in known:
        given["operator"] = operator_of(hand)
    else:
        replaced["operator"] = operator_of(hand)
    return dataclasses.replace(factory(**given), **replaced)


def bare(hand: Any = None, **fields: Any) -> hc.Scenario:
    """A scenario of no experiment, field by field."""
    return hc.Scenario(operator=operator_of(hand), **fields)


def hand_words(hand: Any) -> dict[str, Any]:
    """The keywords that tell an analysis (gain_limit, margins, ...) which hand it is about."""
    operator = operator_of(hand)
    if operator is None and "impedance" in inspect.signature(hc.gain_limit).parameters:
        return {"impedance": False}
    return {"operator": operator}


def hand_option(place: Place, words: tuple[str, ...], nominal: bool) -> list[str]:
    """The option of a command that puts the nominal hand, or none, at the handle.

    Args:
        place: where to ask.
        words: of the command.
        nominal: whether there is a hand.

    Raises:
        LookupError: its help knows no such option.
    """
    text = command(place, (*words, "--help"))["stdout"]
    for name in ("impedance", "operator", "hand"):
        if f"--no-{name}" in text:
            return [f"--{name}" if nominal else f"--no-{name}"]
        if f"--{name} " in text:
            return [f"--{name}", "nominal" if nominal else "none"]
    raise LookupError(f"{' '.join(words)}: no option for the hand in its help; see hand_option")


# ---- Questions ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """Where questions are asked.

    Attributes:
        out: folder of what is kept.
        load: folder whose records/ are read.
        work: folder that is empty at first and goes at the end.
    """

    out: Path
    load: Path
    work: Path


Question = Callable[[Place], Answer]
Entry = dict[str, Any]  # of digests.json


def plain(ask: Callable[..., Answer], *args: Any, **words: Any) -> Question:
    """A question that needs no place."""
    return lambda place: ask(*args, **words)


def attempt(ask: Callable[[], Answer]) -> Answer:
    """The answer, or the exception instead of it: one of many must not take the others along."""
    try:
        return ask()
    except Exception as error:
        return {"raises": f"{type(error).__name__}: {error}"}


# ---- Scenes -------------------------------------------------------------------------------------


def everywhere(b: float) -> hc.Clay:
    """The same clay b [N.s/m] everywhere."""
    return hc.Clay(hc.Profile((), (b,)), hc.Profile((), (b,)))


def slab(b: float) -> hc.Clay:
    """The paper's slab, of clay b [N.s/m]."""
    return hc.Clay(*[hc.Profile((0.05, 0.15), (0.0, b, 0.0))] * 2)


def nowhere() -> hc.Profile:
    """No clay on an axis."""
    return hc.Profile((), (0.0,))


def experiments() -> dict[str, Make]:
    """The four experiments and their options."""
    cut, two = functools.partial(scenario, "constant"), functools.partial(scenario, "variable")
    test, free = functools.partial(scenario, "stability"), functools.partial(scenario, "free")
    quickly = {"force": (4.0, 3.0), "t_max": 3.0}  # both clays within the time
    return {
        "constant": lambda: cut(),
        "constant-hand": lambda: cut("nominal", force=(2.0, 0.0), t_max=6.0),
        "constant-other-hand": lambda: cut(OTHER, force=(3.0, 0.5), t_max=4.0),
        "constant-shaping": lambda: cut(shaping=True, force=(1.0, 0.3), t_max=4.0),
        "constant-hand-shaping": lambda: cut("nominal", shaping=True, force=(2.0, 0.0), t_max=4.0),
        "constant-soft-gain": lambda: cut(b=10.0, gain=(3.0, 0.3), clay=(0.02, 0.1), length=0.12),
        "constant-origin": lambda: cut(origin=(0.2, 0.3), start=(0.01, 0.02), t_max=3.0),
        "constant-inside": lambda: cut(start=(0.1, 0.0), t_max=3.0),
        "constant-backwards": lambda: cut(start=(0.06, 0.0), force=(-1.0, 0.0), t_max=1.0),
        "constant-fine": lambda: cut(dt=1e-4, force=(2.0, 0.0), t_max=2.0),
        "constant-coarse": lambda: cut(dt=0.02, t_max=12.0),
        "constant-off-grid": lambda: cut(t_max=0.1001),
        "constant-one-short-step": lambda: cut(t_max=1e-5),
        "constant-stalled": lambda: cut(force=(0.0, 0.0), t_max=2.0),
        "variable": lambda: two(),
        "variable-growth-per-second": lambda: two(growth="0.15/s", **quickly),
        "variable-growth-per-sample": lambda: two(growth="0.15/sample", **quickly),
        "variable-growth-none": lambda: two(growth="none", **quickly),
        "variable-growth-number": lambda: two(
            growth=300.0, b=(20.0, 200.0), border=0.02, **quickly
        ),
        "variable-hand-shaping": lambda: two("nominal", shaping=True, **quickly),
        "variable-as-printed": lambda: two(as_printed=True),
        "stability": lambda: test("nominal", t_max=6.0),
        "stability-25": lambda: test("nominal", gain=25.0, t_max=4.0),
        "stability-y": lambda: test(
            "nominal", axis="y", gain=0.4, b=50.0, rms=2.0, seed=3, t_max=4.0
        ),
        "stability-no-hand": lambda: test(gain=3.0, shaping=True, rms=0.5, seed=7, t_max=4.0),
        "free": lambda: free(),
        "free-aslant": lambda: free(force=(1.0, -0.4), gain=(0.8, 0.7), t_max=1.5),
        "free-hand-shaping": lambda: free("nominal", shaping=True, force=(1.5, 0.2), t_max=3.0),
    }


def clays() -> dict[str, Make]:
    """Layers, growth, borders that are grazed, corners, and signals that drive the handle."""
    cut = functools.partial(scenario, "constant")
    P, C = hc.Profile, hc.Clay
    wave = functools.partial(hc.Multisine, rms=(1.0, 0.5), low=0.2, high=3.0, period=5.0, seed=5)

    def growing() -> hc.Clay:
        x = P((0.01,), (50.0, 100.0), growth=(0.0, 300.0))
        return C(x, P((0.01,), (50.0, 100.0), growth=(9.0, 0.0)))

    def layers() -> hc.Clay:
        x = P((0.01, 0.02, 0.03), (0.0, 50.0, 500.0, 5.0))
        return C(x, P((0.001,), (10.0, 90.0), along="y"))

    def stripes() -> hc.Clay:
        edges = tuple(0.02 + 1e-3 * i for i in range(100))
        return C(*[P(edges, (50.0, 100.0) * 50 + (50.0,))] * 2)

    def wall(b: float) -> hc.Clay:
        return C(*[P((0.0,), (0.0, b), along="y")] * 2)

    def corner() -> hc.Clay:
        return C(P((0.05,), (0.0, 200.0)), P((0.02,), (0.0, 200.0), along="y"))

    def swing() -> hc.Multisine:
        return hc.Multisine(rms=(2.0, 0.0), low=1.0, high=3.0, period=4.0, seed=3)

    return {
        "growth-both-axes": lambda: bare(clay=growing(), t_max=2.0),
        "growth-muscle": lambda: bare(
            "nominal", clay=growing(), muscle=wave(), length=None, t_max=2.0
        ),
        "growth-fast": lambda: bare(
            clay=C(P((0.01,), (0.0, 10.0), growth=(0.0, 1e5)), nowhere()), force=(2.0, 0.0),
            t_max=2.0,
        ),
        "layers": lambda: bare(clay=layers(), force=(1.0, 0.3), t_max=2.0),
        "stripes": lambda: bare(clay=stripes(), force=(3.0, 0.0), t_max=6.0),
        "corner": lambda: bare(clay=corner(), force=(1.0, 0.8), t_max=3.0),
        "corner-itself": lambda: bare(
            clay=corner(), velocity=(0.5, 0.2), force=(0.0, 0.0), t_max=1.0
        ),
        "along-a-border": lambda: cut(start=(0.1501, 0.0), force=(0.0, 1.0), t_max=0.3),
        "on-a-border": lambda: cut(start=(0.05, 0.0), force=(0.0, 1.0), t_max=1.0),
        "onto-a-border": lambda: bare(
            clay=wall(90.0), start=(0.0, -1e-4), force=(1.0, 0.05), t_max=2.0
        ),
        "grazing": lambda: bare(
            clay=wall(90.0), start=(0.0, -5e-4), force=(1.0, -0.02), t_max=2.0
        ),
        "grazing-stiff": lambda: bare(
            clay=wall(1e4), start=(0.0, -1e-4), force=(1.0, 0.5), t_max=2.0
        ),
        "muscle": lambda: bare(muscle=wave(), length=None, t_max=3.0),
        "muscle-lines": lambda: bare(
            "nominal", muscle=wave(lines=4, seed=9), clay=everywhere(90.0), length=None, t_max=3.0
        ),
        "muscle-through-a-border": lambda: bare(
            clay=C(P((0.0,), (0.0, 500.0)), nowhere()), force=(0.0, 0.0), muscle=swing(),
            length=None, t_max=3.0,
        ),
        "command": lambda: bare(command=wave(rms=(1e-3, 2e-3)), t_max=1.0),
        "command-hand": lambda: bare(
            "nominal", command=wave(rms=(1e-2, 0.0)), gain=(0.0, 0.0), force=(0.0, 0.0),
            length=None, t_max=3.0,
        ),
        "muscle-command": lambda: cut(
            muscle=wave(rms=(0.5, 0.2)), command=wave(rms=(1e-3, 1e-3), seed=6), t_max=3.0
        ),
    }  # fmt: skip


def extremes() -> dict[str, Make]:
    """Stiff clay and hits, weak motors, extreme hands, unstable loops, the ends of the reach."""
    cut, free = functools.partial(scenario, "constant"), functools.partial(scenario, "free")
    hit = functools.partial(cut, velocity=(2.0, 0.0), t_max=0.6)
    slow = {"gain": (1e-3, 1e-3), "b": 90.0}
    out: dict[str, Make] = {}
    for exponent in range(3, 10):
        b = 10.0**exponent
        out[f"stiff-1e{exponent}"] = lambda b=b: cut(b=b, start=(0.04, 0.0), t_max=1.0)
        out[f"hit-1e{exponent}"] = lambda b=b: hit(b=b)
        out[f"hit-hand-1e{exponent}"] = lambda b=b: cut(
            (0.25, 2.0, 60.0), b=b, velocity=(0.5, 0.0), start=(0.02, 0.0), force=(0.0, 0.0),
            shaping=True, torque_limit=(1e6, 1e6), t_max=0.4,
        )  # fmt: skip
    return out | {
        "hit-aslant": lambda: cut(b=1e9, velocity=(1.6, 1.2), t_max=0.6),
        "hit-weak-motors": lambda: hit(b=1e9, torque_limit=(0.1, 0.1)),
        "hit-heavy-hand": lambda: hit((100.0, 0.0, 0.0), b=1e9),
        "hit-shaping": lambda: hit(b=1e6, shaping=True),
        "hit-coarse": lambda: hit(b=1e9, dt=1e-2),
        "hit-rebound": lambda: cut(
            b=1e5, velocity=(0.3, 0.0), start=(0.03, 0.0), force=(-0.5, 0.0), t_max=0.6
        ),
        "hand-massless": lambda: cut((0.0, 2.0, 6.0), force=(2.0, 0.0), t_max=2.0),
        "hand-heavy": lambda: cut((100.0, 0.0, 0.0), gain=(0.02, 0.02), t_max=4.0),
        "hand-stiff": lambda: cut((0.0, 0.0, 1e7), **slow, t_max=0.3),
        "hand-stiff-heavy": lambda: cut((100.0, 1e3, 1e7), **slow, velocity=(0.2, 0.0), t_max=0.5),
        "weak-motors": lambda: cut(torque_limit=(0.1, 0.1), force=(3.0, 1.0), t_max=3.0),
        "saturated": lambda: cut(b=1e3, torque_limit=(0.1, 0.1), force=(0.0, 5.0), t_max=1.5),
        "unstable": lambda: cut(gain=(1.0, 1.0)),
        "unstable-goes-on": lambda: cut(gain=(25.0, 0.5), stop=False, t_max=2.0),
        "unstable-y-goes-on": lambda: bare(
            clay=slab(90.0), gain=(1.0, 1.0), force=(0.1, 0.02), start=(0.06, 0.0), length=None,
            stop=False, t_max=6.0,
        ),
        "unstable-hand": lambda: bare(
            "nominal", clay=everywhere(100.0), gain=(25.0, 0.3), start=(0.1, 0.0), length=None,
            stop=False, t_max=3.0,
        ),
        "unstable-late": lambda: cut(
            "nominal", gain=(4.2, 0.2), shaping=True, start=(0.05, 0.0), force=(0.5, 0.0), t_max=8.0
        ),
        "thrown-out": lambda: cut(gain=(1e4, 1e4), torque_limit=(1e6, 1e6)),
        "gain-tiny": lambda: cut(gain=(1e-6, 1e-6), t_max=1.0),
        "gain-off": lambda: bare(gain=(0.0, 0.0), t_max=1.0),
        "stretched": lambda: cut(force=(1.0, 50.0)),
        "folded": lambda: free(force=(-1.0, -1.0), gain=(0.5, 0.5), t_max=20.0),
    }  # fmt: skip


def accurate() -> dict[str, Make]:
    """The fourth-order integrator, where nothing in the scene changes with time."""
    cut = functools.partial(scenario, "constant", integrator="accurate", dt=2e-3)
    free = functools.partial(scenario, "free", integrator="accurate", dt=2e-3)
    return {
        "accurate-constant": lambda: cut(t_max=8.0),
        "accurate-hand-shaping": lambda: cut("nominal", shaping=True, force=(2.0, 0.0), t_max=3.0),
        "accurate-aslant": lambda: cut(force=(1.0, 0.3), t_max=3.0),
        "accurate-stiff": lambda: cut(b=2e4, t_max=0.8),
        "accurate-too-stiff": lambda: cut(b=1e9, t_max=0.8),
        "accurate-hit": lambda: cut(b=1e3, velocity=(1.0, 0.0), t_max=0.5),
        "accurate-unstable": lambda: cut(gain=(1.0, 1.0)),
        "accurate-free": lambda: free(t_max=0.9007),
        "accurate-paper-step": lambda: cut(dt=TS, force=(2.0, 0.0), t_max=1.0),
        "accurate-variable": lambda: scenario(
            "variable", growth="none", force=(4.0, 3.0), integrator="accurate", dt=2e-3, t_max=2.0
        ),
    }


def driven_accurately() -> dict[str, Make]:
    """The fourth-order integrator, where something does: no engine but Python's."""
    wave = functools.partial(hc.Multisine, low=0.2, high=3.0, period=5.0, seed=5)
    how = {"integrator": "accurate", "dt": 2e-3, "t_max": 2.0}
    return {
        "accurate-growth": lambda: scenario("variable", force=(4.0, 3.0), **how),
        "accurate-muscle": lambda: scenario("stability", "nominal", **how),
        "accurate-command": lambda: scenario("free", command=wave(rms=(1e-3, 2e-3)), **how),
    }


def sampled() -> dict[str, Make]:
    """Sampled control without hardware: both ways to render, one and four steps a sample."""
    out: dict[str, Make] = {}
    for render in ("held", "implicit"):
        for name, Ts in (("", None), ("-ts4", 4 * TS)):
            end = f"{render}{name}"
            how = {"control": "sampled", "render": render, "Ts": Ts}
            cut = functools.partial(scenario, "constant", **how)
            out |= {
                f"sampled-constant-{end}": lambda cut=cut: cut(force=(2.0, 0.3), t_max=3.0),
                f"sampled-hand-{end}": lambda cut=cut: cut(
                    "nominal", force=(2.0, 0.0), start=(0.04, 0.0), shaping=True, t_max=1.0
                ),
                f"sampled-hit-{end}": lambda cut=cut: cut(b=300.0, velocity=(1.0, 0.0), t_max=0.4),
                f"sampled-variable-{end}": lambda how=how: scenario(
                    "variable", force=(4.0, 3.0), t_max=1.5, **how
                ),
                f"sampled-stability-{end}": lambda how=how: scenario(
                    "stability", "nominal", gain=2.0, t_max=1.5, **how
                ),
            }
    how = {"control": "sampled", "dt": 1e-4, "Ts": 1e-3}
    return out | {
        "sampled-stiff-implicit": lambda: scenario(
            "constant", b=1e6, control="sampled", render="implicit", start=(0.04, 0.0), t_max=1.0
        ),
        "sampled-stiff-held": lambda: scenario(
            "constant", b=1e4, control="sampled", start=(0.04, 0.0), t_max=1.0
        ),
        "sampled-unstable-goes-on": lambda: scenario(
            "stability", "nominal", gain=25.0, t_max=1.5, **how
        ),
        "sampled-free": lambda: scenario("free", force=(1.0, 0.2), t_max=1.5, **how),
        "sampled-command": lambda: scenario(
            "free", command=hc.Multisine((1e-3, 2e-3), 0.2, 3.0, 5.0), t_max=1.0, **how
        ),
    }


def hardware() -> dict[str, Make]:
    """Each part of hc.Interface alone, and together."""
    coupling = functools.partial(hc.Coupling, 2e3, 10.0)
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "ideal": dict,
        "jitter": lambda: dict(jitter=5e-5),
        "lost": lambda: dict(lost=0.1, seed=2),
        "encoder": lambda: dict(encoder=4096),
        "encoder-difference": lambda: dict(encoder=65_536, velocity="difference"),
        "difference": lambda: dict(velocity="difference"),
        "window": lambda: dict(encoder=65_536, velocity="difference", window=5),
        "velocity-filter": lambda: dict(velocity="difference", velocity_filter=100.0),
        "adc": lambda: dict(adc_bits=10, adc_range=20.0),
        "force-noise": lambda: dict(force_noise=0.05, seed=4),
        "force-filter-1": lambda: dict(force_filter=100.0, filter_order=1),
        "force-filter-2": lambda: dict(force_filter=100.0),
        "dac": lambda: dict(dac_bits=10),
        "dac-range": lambda: dict(dac_bits=12, dac_range=(10.0, 5.0)),
        "delay-fraction": lambda: dict(delay=1e-4),
        "delay-samples": lambda: dict(delay=3 * TS),
        "delay-both": lambda: dict(delay=2.5 * TS),
        "friction": lambda: dict(friction=(0.02, 0.01)),
        "passivity": lambda: dict(passivity=True),
        "coupling": lambda: dict(coupling=coupling()),
    }

    def together() -> dict[str, Any]:
        return dict(
            jitter=2e-5, lost=0.02, encoder=65_536, velocity="difference", window=3,
            velocity_filter=200.0, adc_bits=14, adc_range=20.0, force_noise=0.01,
            force_filter=200.0, dac_bits=14, dac_range=(20.0, 20.0), delay=1.5e-4,
            friction=(0.01, 0.005), seed=11,
        )  # fmt: skip

    def cut(part: dict[str, Any], hand: Any = None, **words: Any) -> hc.Scenario:
        usual = dict(control="sampled", clay=(0.02, 0.15), force=(2.0, 0.3), t_max=0.6)
        return scenario("constant", hand, interface=hc.Interface(**part), **(usual | words))

    out: dict[str, Make] = {
        f"hardware-{name}": lambda part=part: cut(part()) for name, part in parts.items()
    }
    every = lambda: together() | dict(passivity=True, coupling=coupling())  # noqa: E731
    return out | {
        "hardware-together": lambda: cut(together()),
        "hardware-together-implicit": lambda: cut(together(), render="implicit"),
        "hardware-together-hand": lambda: cut(together(), "nominal", shaping=True),
        "hardware-together-ts4": lambda: cut(together(), Ts=4 * TS),
        "hardware-all": lambda: cut(every()),
        "hardware-all-hand-ts4": lambda: cut(every(), "nominal", Ts=4 * TS, b=300.0),
        "hardware-delay-implicit": lambda: cut(dict(delay=1e-3), render="implicit", b=1e5),
        "hardware-delay-unstable": lambda: cut(dict(delay=6e-3), stop=False),
        "hardware-passivity-hit": lambda: cut(
            dict(passivity=True), b=2e3, velocity=(0.5, 0.0), force=(0.0, 0.0)
        ),
        "hardware-muscle": lambda: scenario(
            "stability", "nominal", control="sampled", interface=hc.Interface(**together()),
            t_max=0.8,
        ),
        "hardware-variable": lambda: scenario(
            "variable", control="sampled", interface=hc.Interface(**together()), border=0.01,
            force=(4.0, 3.0), t_max=0.8,
        ),
    }  # fmt: skip


@functools.cache
def scenes() -> dict[str, tuple[Make, tuple[str, ...]]]:
    """Every scene by name: what makes it, and the engines that can run it."""
    anywhere = experiments() | clays() | extremes() | accurate()
    here = driven_accurately() | sampled() | hardware()
    return {n: (m, BOTH) for n, m in anywhere.items()} | {n: (m, PYTHON) for n, m in here.items()}


def record_answer(record: hc.Record) -> Answer:
    """A record but for its scenario, wall time and versions."""
    crossed = record.crossings
    return {
        **{name: getattr(record, name) for name in ARRAYS},
        "extra": record.extra,
        "outcome": record.outcome,
        "crossings": {
            "axis": np.array([c.axis for c in crossed], dtype=str),
            **{
                name: np.array([getattr(c, name) for c in crossed], dtype=float)
                for name in ("border", "time", "speed")
            },
        },
        "energy": record.energy,
        "steps": record.steps,
    }


def simulated(name: str, engine: str = "python", every: int = 1) -> hc.Record:
    """The record of a scene."""
    return hc.simulate(scenes()[name][0](), engine=engine, every=every)


def ask_scene(name: str, engine: str, every: int = 1) -> Answer:
    """The record of a scene."""
    return record_answer(simulated(name, engine, every))


THINNED = (  # scenes of which every seventh sample is kept, too
    ("constant", "python"), ("constant", "native"), ("unstable", "native"), ("stability", "native"),
    ("accurate-constant", "native"), ("sampled-constant-held", "python"),
    ("hardware-all", "python"),
)  # fmt: skip
MEASURED = (  # scenes whose records are evaluated
    "constant", "constant-hand", "variable", "stability", "unstable-goes-on", "corner", "stripes",
    "sampled-hand-held", "hardware-all", "constant-one-short-step",
)  # fmt: skip


def ask_record(name: str) -> Answer:
    """What the methods of a record, and the functions of one, make of it."""
    r = simulated(name)
    summary = {k: v for k, v in r.summary().items() if k not in UNTIMED}
    volume = {
        "usual": lambda: hc.removed(r),
        "narrow": lambda: hc.removed(r, width=0.006, depth=0.004),
        "coarse": lambda: hc.removed(r, cell=2e-3),
    }
    return {
        "status": r.status,
        "summary": summary,
        "ratio": {f: r.ratio(getattr(r, f)) for f in ("fe", "fh")},
        "steady": r.steady(),
        "regions": {str(axis): r.regions(axis) for axis in (None, "x", "y")},
        "stretches": {str(axis): [len(s) for s in r.stretches(axis)] for axis in (None, "x", "y")},
        "removed": {k: attempt(ask) for k, ask in volume.items()},
        "irregularity": {axis: attempt(lambda a=axis: hc.irregularity(r, a)) for axis in "xy"},
        "port_energy": attempt(lambda: hc.port_energy(r)),
        "observed_passivity": attempt(lambda: hc.observed_passivity(r)),
    }


def ask_defaults(experiment: str) -> Answer:
    """The scenario that an experiment is when nothing is said."""
    return dataclasses.asdict(hc.SCENARIOS[experiment]())


def ask_model() -> Answer:
    """What the engine's model is made of, with clay and without."""
    bodies = ("body_mass", "body_inertia", "body_ipos", "body_pos", "jnt_axis", "jnt_range")
    joints = ("dof_armature", "dof_damping", "dof_frictionloss", "qpos0")
    motors = ("actuator_gear", "actuator_gainprm", "actuator_biasprm", "actuator_ctrlrange")
    options = ("timestep", "integrator", "gravity", "disableflags", "enableflags")
    out = {}
    for name in ("constant", "free", "accurate-constant", "hardware-all"):
        model = hc.build(scenes()[name][0]())
        out[name] = {field: getattr(model, field) for field in (*bodies, *joints, *motors)}
        out[name]["opt"] = {field: getattr(model.opt, field) for field in options}
    return out


# ---- Analyses -----------------------------------------------------------------------------------

CLAYS = (0.0, 1.0, 10.0, 50.0, 62.0, 90.0, 100.0, 1e3, 3900.0, 1e4, 1e6, 1e9)  # [N.s/m]
LOOPS: dict[str, dict[str, Any]] = {
    "continuous": {},
    "late": {"delay": 1e-3},
    "late-implicit": {"delay": 1e-3, "render": "implicit"},
    "sampled": {"Ts": TS},
    "sampled-implicit": {"Ts": TS, "render": "implicit"},
    "sampled-half-late": {"Ts": TS, "delay": 0.5 * TS},
    "sampled-late": {"Ts": TS, "delay": 1e-3},
    "sampled-late-implicit": {"Ts": TS, "delay": 1e-3, "render": "implicit"},
    "sampled-slowly": {"Ts": 4 * TS},
    "sampled-very-slowly": {"Ts": 0.01, "delay": 0.025},
}
GAINS = (0.1, 0.5, 1.0, 2.0, 25.0)
FEW = (0.0, 50.0, 90.0, 1e3, 1e6)  # [N.s/m]
COMPENSATORS = {
    "printed": (10.0, None),
    "fast": (40.0, None),
    "lead": (40.0, 8.0),
    "lag": (5.0, 20.0),
}


def grid(ask: Callable[[Any, float], Answer], bs: tuple[float, ...] = CLAYS) -> Answer:
    """Answers for each hand and clay; ask is called with the hand and b."""
    return {
        hand: {f"b={b:g}": attempt(lambda h=given, b=b: ask(h, b)) for b in bs}
        for hand, given in HANDS.items()
    }


def ask_gain_limit(axis: str, loop: str) -> Answer:
    """The largest stable gain of one of LOOPS."""
    return grid(lambda hand, b: hc.gain_limit(axis, b, **LOOPS[loop], **hand_words(hand)))


def ask_coupled(axis: str, loop: str) -> Answer:
    """Verdicts on one of LOOPS."""

    def ask(K: float, hand: Any, b: float) -> Answer:
        return hc.coupled_stability(axis, K, b, **LOOPS[loop], **hand_words(hand))

    return {f"K={K:g}": grid(functools.partial(ask, K), FEW) for K in (0.5, 2.0)}


def compensator(name: str) -> hc.Compensator:
    """One of COMPENSATORS."""
    pole, zero = COMPENSATORS[name]
    if not hasattr(hc.Compensator, "zpk"):  # releases that know these two alone
        return hc.Compensator(pole, zero)
    return hc.Compensator((1.0,) if zero is None else (1.0, zero), (1.0, pole, 0.0))


def ask_margins(axis: str, at: str) -> Answer:
    """Margins of the loop, broken at one place, with every compensator."""

    def ask(K: float, shape: str, hand: Any, b: float) -> Answer:
        return hc.margins(
            axis, K, b, at=at, compensator=compensator(shape), **hand_words(hand)
        )  # fmt: skip

    many = {f"K={K:g}": grid(functools.partial(ask, K, "printed"), FEW) for K in GAINS}
    return many | {shape: grid(functools.partial(ask, 0.5, shape), FEW) for shape in COMPENSATORS}


def ask_nyquist(axis: str) -> Answer:
    """Nyquist curves and what they enclose."""

    def ask(K: float, at: str, hand: Any, b: float) -> Answer:
        found = hc.nyquist(axis, K, b, at=at, **hand_words(hand))
        return {"omega": found.omega, "L": found.L, "N": found.N, "P": found.P, "Z": found.Z}

    return {
        f"K={K:g}, {at}": grid(functools.partial(ask, K, at), (50.0, 90.0))
        for K in (0.5, 25.0)
        for at in ("force", "compensator")
    }


def ask_small_gain(axis: str) -> Answer:
    """The paper's conditions, Eqs. 9 to 13."""

    def ask(K: float, equation: int, hand: Any, b: float) -> Answer:
        return hc.small_gain(axis, K, b, equation=equation, **hand_words(hand))

    return {
        f"K={K:g}, ({equation})": grid(functools.partial(ask, K, equation), FEW)
        for K in (0.5, 2.0)
        for equation in (9, 10, 11, 12, 13)
    }


def ask_passivity(axis: str) -> Answer:
    """Passivity in continuous time, with every compensator."""
    return {
        f"{shape}, K={K:g}, b={b:g}": attempt(
            lambda s=shape, K=K, b=b: hc.passivity(axis, K, b, compensator=compensator(s))
        )
        for shape in COMPENSATORS
        for K in GAINS
        for b in CLAYS
    }


def ask_clay_passivity() -> Answer:
    """Passivity of held clay, and of a wall beside it."""
    return {
        f"b={b:g}, Ts={Ts:g}, {more}": attempt(
            lambda b=b, Ts=Ts, more=more: hc.clay_passivity(b, Ts, **more)
        )
        for b in (0.0, 1.0, 50.0, 1e3)
        for Ts in (TS, 1e-3)
        for more in ({}, {"damping": 60.0}, {"damping": 60.0, "stiffness": 2e4})
    }


def ask_worst_case(axis: str) -> Answer:
    """The worst hand of a box, exactly and by trials."""
    boxes = {
        "nominal": lambda: hc.Box(),
        "wide": lambda: hc.Box((0.05, 1.0), (0.5, 8.0), (0.0, 30.0)),
        "rigid": lambda: hc.Box((0.1, 1.0), (1.0, 4.0), (3.0, 12.0), rigid=True),
    }
    ways: dict[str, dict[str, Any]] = {
        "exact": {},
        "sampled": {"Ts": TS, "samples": 6},
        "sampled-late": {"Ts": TS, "delay": 1e-3, "render": "implicit", "samples": 6},
        "late": {"delay": 1e-3, "samples": 4},
    }
    out: dict[str, Answer] = {
        f"{box}, {way}, b={b:g}": attempt(
            lambda box=box, way=way, b=b: hc.worst_case(axis, 1.0, b, boxes[box](), **ways[way])
        )
        for box in boxes
        for way in ways
        for b in (0.0, 90.0, 1e4)
    }
    for shape in COMPENSATORS:
        out[f"rigid, {shape}"] = attempt(
            lambda s=shape: hc.worst_case(
                axis, 1.0, 90.0, boxes["rigid"](), compensator=compensator(s)
            )
        )
    return out


def ask_design(axis: str) -> Answer:
    """The largest gain for each kind of margin, and with every compensator."""
    asked: dict[str, dict[str, Any]] = {
        "stable": {},
        "gain": {"gain_margin": 2.0},
        "phase": {"phase_margin": math.radians(40.0)},
        "disk": {"disk_margin": 0.6},
        "delay": {"delay_margin": 5e-3},
        "all": {"gain_margin": 1.5, "phase_margin": 0.4, "disk_margin": 0.4, "delay_margin": 2e-3},
        "at-force": {"gain_margin": 2.0, "at": "force"},
        "sampled": {"gain_margin": 2.0, "Ts": TS},
        "late": {"gain_margin": 1.5, "delay": 1e-3, "render": "implicit"},
    }
    out = {
        name: grid(
            lambda hand, b, how=how: hc.design_gain(axis, b, **how, **hand_words(hand)),
            (50.0, 90.0, 1e3),
        )
        for name, how in asked.items()
    }
    shapes = {
        shape: grid(
            lambda hand, b, s=shape: hc.design_gain(
                axis, b, gain_margin=2.0, phase_margin=0.5, compensator=compensator(s),
                **hand_words(hand),
            ),
            (90.0,),
        )
        for shape in COMPENSATORS
    }  # fmt: skip
    return out | shapes


def ask_compare(axis: str) -> Answer:
    """Compensators at equal margin."""

    def ask(hand: Any, b: float, **how: Any) -> Answer:
        shapes = [compensator(s) for s in ("printed", "fast", "lead")]
        return {
            str(i): found
            for i, found in enumerate(hc.compare(axis, b, shapes, **how, **hand_words(hand)))
        }

    margin = {"gain_margin": 2.0, "phase_margin": 0.5, "delay_margin": 1e-3}
    return {
        "usual": grid(lambda hand, b: ask(hand, b, **margin), (50.0, 90.0)),
        "band": grid(lambda hand, b: ask(hand, b, **margin, band=(1.0, 10.0)), (90.0,)),
        "force": grid(lambda hand, b: ask(hand, b, disk_margin=0.3, delay_margin=1e-3, at="force"),
                      (90.0,)),
    }  # fmt: skip


def ask_transparency(axis: str) -> Answer:
    """fe/fh over frequency, and how far it is from 1 over a band."""
    omega = np.concatenate(([0.0], np.geomspace(1e-2, 1e3, 60)))

    def ask(shape: str, K: float, b: float) -> Answer:
        c = compensator(shape)
        error = functools.partial(hc.transparency_error, axis, K, b, compensator=c)
        return {
            "ratio": attempt(lambda: hc.transparency(axis, K, b, omega, compensator=c)),
            "error": attempt(error),
            "narrow": attempt(lambda: error(band=(1.0, 5.0))),
        }

    return {
        f"{shape}, K={K:g}, b={b:g}": ask(shape, K, b)
        for shape in COMPENSATORS
        for K in GAINS
        for b in FEW
    }


def ask_poles(axis: str) -> Answer:
    """Poles of the closed loop."""
    return {
        f"K={K:g}": grid(
            lambda hand, b, K=K: hc.closed_loop_poles(axis, K, b, operator_of(hand))
        )
        for K in (0.0, *GAINS)
    }  # fmt: skip


def ask_refusals() -> Answer:
    """What is said of values out of their bounds."""
    Scenario, Interface = hc.Scenario, hc.Interface
    wrong: dict[str, Callable[[], Any]] = {
        "b": lambda: hc.constant_cut(b=-1.0),
        "b nan": lambda: hc.constant_cut(b=math.nan),
        "b word": lambda: hc.constant_cut(b="ninety"),  # type: ignore[arg-type]
        "gain": lambda: hc.constant_cut(gain=(0.0, 1.0)),
        "gain single": lambda: hc.constant_cut(gain=1.0),  # type: ignore[arg-type]
        "clay": lambda: hc.constant_cut(clay=(0.15, 0.05)),
        "dt": lambda: hc.free(dt=0.1),
        "length": lambda: hc.free(length=-0.1),
        "reach": lambda: hc.free(origin=(0.5, 0.4)),
        "shaping": lambda: hc.free(shaping=1),  # type: ignore[arg-type]
        "growth": lambda: hc.variable_cut(growth="slow"),  # type: ignore[arg-type]
        "as printed": lambda: hc.variable_cut(as_printed=True, gain=(2.0, 2.0)),
        "axis": lambda: hc.stability_test(axis="z"),  # type: ignore[arg-type]
        "integrator": lambda: Scenario(integrator="exact"),
        "sampled": lambda: Scenario(integrator="accurate", control="sampled"),
        "Ts": lambda: Scenario(Ts=TS),
        "Ts multiple": lambda: Scenario(control="sampled", Ts=1.5 * TS),
        "interface": lambda: Scenario(interface=Interface()),
        "render": lambda: Scenario(
            control="sampled", render="implicit", interface=Interface(passivity=True)
        ),
        "jitter": lambda: Scenario(control="sampled", interface=Interface(jitter=TS)),
        "encoder": lambda: Interface(encoder=2),
        "window": lambda: Interface(window=3),
        "coupling": lambda: hc.Coupling(0.0, 1.0),
        "operator": lambda: hc.Operator(mass=-1.0),
        "edges": lambda: hc.Profile((0.1, 0.0), (1.0, 2.0, 3.0)),
        "values": lambda: hc.Profile((0.1,), (1.0,)),
        "multisine": lambda: hc.Multisine(low=1.1, high=1.2, period=1.0),
        "every": lambda: hc.simulate(hc.free(), every=0),
        "engine": lambda: hc.simulate(hc.free(), engine="fortran"),
        "scenario": lambda: hc.simulate("free"),  # type: ignore[arg-type]
        "keep": lambda: hc.simulate_batch([hc.free()], keep="all"),
        "gain limit": lambda: hc.gain_limit("x", -1.0),
        "K": lambda: hc.margins("x", -1.0, 90.0),
        "box": lambda: hc.Box(mass=(2.0, 1.0)),
        "samples": lambda: hc.worst_case("x", 1.0, 90.0, hc.Box(), Ts=TS, samples=-1),
        "band": lambda: hc.identify("x", "G", band=(5.0, 1.0)),
        "what": lambda: hc.identify("x", "H"),
        "amplitude": lambda: hc.identify("x", "G", amplitude=0.5, period=0.5, realisations=1),
        "width": lambda: hc.removed(hc.simulate(hc.constant_cut(t_max=1e-3)), width=1.0),
        "record": lambda: hc.Record.load("no/such/record"),
    }

    def tried(make: Callable[[], Any]) -> Any:
        make()
        return "accepted"

    return {name: attempt(lambda make=make: tried(make)) for name, make in wrong.items()}


# ---- Identification -----------------------------------------------------------------------------


def ask_identify(axis: str, what: str, noise: bool = False, **words: Any) -> Answer:
    """One block, identified from short runs; words: other options of hc.identify."""
    period, band = (4.0, (0.25, 3.0)) if what == "Th" else (2.0, (0.5, 20.0))
    usual = {"period": period, "band": band, "periods": 1, "lines": 20, "realisations": 2}
    given = hc.Noise(20_000, 0.05) if noise else None
    found = hc.identify(axis, what, noise=given, **(usual | words))
    arrays = ("frequency", "response", "deviation", "coherence", "values")
    return {
        **{name: getattr(found, name) for name in arrays},
        "coefficients": {c.name: c for c in found.coefficients},
        "periods": found.periods,
        "realisations": found.realisations,
    }


def identifications() -> dict[str, Question]:
    """Every block, with and without noise, and the other options."""
    quick = {"period": 0.5, "band": (4.0, 20.0), "lines": 6}
    out: dict[str, Question] = {}
    for axis in "xy":
        for what in ("G", "S", "Th"):
            name = f"identify/{what}-{axis}"
            out[name] = plain(ask_identify, axis, what)
            out[f"{name}-noise"] = plain(ask_identify, axis, what, True, seed=3)
    return out | {
        "identify/S-x-shaping": plain(ask_identify, "x", "S", True, shaping=True),
        "identify/S-y-origin": plain(ask_identify, "y", "S", origin=(0.2, 0.35), amplitude=1e-3),
        "identify/G-x-sampled": plain(ask_identify, "x", "G", control="sampled", **quick),
        "identify/S-x-sampled": plain(ask_identify, "x", "S", True, control="sampled", **quick),
        "identify/drift": plain(lambda: hc.drift_map(0.3, seed=1).summary()),
    }


# ---- Batches ------------------------------------------------------------------------------------

SWEPT = (np.geomspace(1.0, 1000.0, 25), np.linspace(0.2, 8.0, 20))  # b, and K on x: 500 runs
MIXED = (
    "constant", "variable", "stability-25", "growth-muscle", "layers", "hit-1e6", "unstable",
    "hand-stiff", "accurate-hand-shaping", "accurate-growth", "sampled-hit-held", "hardware-all",
)  # fmt: skip


def ask_summaries() -> Answer:
    """500 runs of which no samples are kept."""
    b, K = SWEPT
    runs = [scenario("constant", b=x, gain=(k, 0.5), t_max=2.0) for x in b for k in K]
    return hc.simulate_batch(runs, threads=1, keep="summaries")


def ask_mixed(keep: str, every: int) -> Answer:
    """Scenes of every kind in one batch."""
    runs = [scenes()[name][0]() for name in MIXED]
    found = hc.simulate_batch(runs, threads=1, every=every, keep=keep)
    if keep == "summaries":
        return found
    return {name: record_answer(r) for name, r in zip(MIXED, found, strict=True)}


# ---- The command line ---------------------------------------------------------------------------


def command(place: Place, words: Iterable[str]) -> dict[str, Any]:
    """Runs `hapticclay` with these words in the work folder.

    Returns:
        Exit status, and the lines of both outputs but those that tell times.
    """
    package = str(Path(hc.__file__).resolve().parents[1])
    path = [package, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(path), "NO_COLOR": "1", "COLUMNS": "80"}
    done = subprocess.run(
        [sys.executable, "-m", "hapticclay", *words],
        cwd=place.work, env=env, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    timed = re.compile(r"steps in .* times real time|\d+ of \d+ runs, .* gone")

    def kept(text: str) -> str:
        return "\n".join(line for line in text.splitlines() if not timed.search(line))

    return {"status": done.returncode, "stdout": kept(done.stdout), "stderr": kept(done.stderr)}


def read(file: Path) -> Any:
    """A JSON file that a command has written; None if it has not."""
    return json.loads(file.read_text()) if file.is_file() else None


def ask_run(place: Place, name: str) -> Answer:
    """`hapticclay run`: the table, summary.json and record.npz."""
    experiment, _, options = RUNS[name].partition(" ")
    start = ("run", experiment)
    out = f"run-{name}"
    words = (*start, *with_hand(place, start, options), "--no-plots", "--out", out)
    said = command(place, words)
    summary = read(place.work / out / "summary.json")
    record = place.work / out / "record.npz"
    return {
        "said": said,
        "summary": summary and {k: v for k, v in summary.items() if k not in UNTIMED},
        "record": record_answer(hc.Record.load(record)) if record.is_file() else None,
    }


def ask_verdicts(place: Place, name: str) -> Answer:
    """`hapticclay stability`: the table and stability.json."""
    start, out = ("stability",), f"verdicts-{name}"
    said = command(place, (*start, *with_hand(place, start, VERDICTS[name]), "--out", out))
    found = read(place.work / out / "stability.json")
    chart = found and found["map"]
    parts = ("lines", "found", "exact", "cells", "notes")
    return {
        "said": said,
        "verdicts": found and {row.pop("question"): row for row in found["verdicts"]},
        "map": chart and {part: chart[part] for part in parts},
    }


def ask_ledger(place: Place) -> Answer:
    """`hapticclay reproduce`: the paper's figures beside ours."""
    said = command(place, ("reproduce", "--quick", "--out", "paper"))
    found = read(place.work / "paper" / "ledger.json")
    rows = found and {f"{i:02d} {row['what']}": row for i, row in enumerate(found["rows"])}
    return {"said": said, "rows": rows}


def ask_identify_command(place: Place) -> Answer:
    """`hapticclay identify`: the table and identify.json."""
    from hapticclay.cli.identify import IdentifyCommand

    words = "--quick --axis x --noise --seed 2 --out identified"
    named = ["--simulated"] * hasattr(IdentifyCommand, "simulated")  # from 0.4 on
    said = command(place, ["identify", *named, *words.split()])
    found = read(place.work / "identified" / "identify.json")
    names = ("coefficients", "frequency", "real", "imaginary", "deviation", "coherence", "noise")
    return {
        "said": said,
        "results": found and {r["what"]: {n: r[n] for n in names} for r in found["results"]},
    }


def ask_sweep(place: Place, name: str, words: tuple[str, ...]) -> Answer:
    """A sweep's data set, by columns, in the order of its runs; without wall times."""
    import pyarrow.parquet as pq

    out = f"sweep-{name}"
    said = command(place, ("sweep", *words, "--workers", "1", "--no-maps", "--out", out))
    if said["status"]:
        return {"said": said}
    table = pq.read_table(place.work / out / "data").sort_by("run")
    columns = {c: table[c].to_numpy() for c in table.column_names if c != "wall_time"}
    for column, values in columns.items():
        if values.dtype == object:
            columns[column] = values.astype(str)
    return {"said": said, "columns": columns}


SPEC = """experiment = "variable"
design = "sobol"
runs = 32
seed = 5
chunk = 10

[vary]
growth = "0:600"
"gain.x" = "0.2:2log"
"operator.mass" = "0.1:1"
"operator.spring" = [0.0, 6.0, 60.0]

[fixed]
impedance = true
t_max = 2.0
force = [1.0, 0.7]
shaping = true
"""


def ask_sweep_of_file(place: Place) -> Answer:
    """A sweep of a TOML file."""
    file = place.work / "spec.toml"
    file.write_text(SPEC)
    return ask_sweep(place, "file", (file.name,))


RUNS = {
    "constant": "constant --b 50 --gain 2 0.5 --force 2 0 HAND",
    "variable": "variable --growth 0.15/sample --t-max 5 --every 3",
    "stability": "stability --gain 25 --t-max 3 HAND",
    "free": "free --shaping --control sampled --Ts 0.00144 --t-max 2 --force 1 0.3",
    "accurate": "constant --integrator accurate --dt 0.002 --t-max 4",
    "unstable": "constant --gain 1 1",
}  # HAND stands for the option that puts the nominal hand at the handle, NOBODY for the other one
VERDICTS = {
    "x": "",
    "y": "--axis y --b 50",
    "late": "--Ts None --delay 0.001 --gain 2",
    "unstable": "--gain 25 --delay 0.001 --shaping",
    "no-hand": "--axis y --gain 1 NOBODY",
    "map-gain-damping": "--map gain-damping --quick",
    "map-delay-damping": "--map delay-damping --quick",
    "map-gain-pose": "--map gain-pose --quick",
}
REFUSED = {
    "value": "run constant --b=-1 --out wrong",
    "word": "run constant --b soft",
    "option": "run constant --bb 3",
    "experiment": "run constat",
    "range": "sweep --grid b=1:1000",
}
SWEEPS = {  # arguments with spaces
    "grid-500": ("--grid", "b=1:1000:25log gain.x=0.2:8:20", "--fixed", "t_max=2"),
    "lhs": (
        "--grid", "b=1:1e5log force.x=0.5:3 start.x=-0.1:0.3", "--design", "lhs", "--runs", "40",
        "--fixed", "t_max=1.5", "--seed", "7", "--chunk", "16",
    ),
    "sampled": ("--grid", "b=20,90,400 Ts=0.00036,0.00144", "--fixed", "t_max=0.6 control=sampled"),
}  # fmt: skip


def with_hand(place: Place, words: tuple[str, ...], options: str) -> list[str]:
    """Options of a command, the one for the hand as this release spells it."""
    out: list[str] = []
    for option in options.split():
        hand = option in ("HAND", "NOBODY")
        out += hand_option(place, words, option == "HAND") if hand else [option]
    return out


def commands() -> dict[str, Question]:
    """The command line: what it prints, and what it writes."""
    out: dict[str, Question] = {}
    for name in RUNS:
        out[f"run/{name}"] = functools.partial(ask_run, name=name)
    for name in VERDICTS:
        out[f"verdicts/{name}"] = functools.partial(ask_verdicts, name=name)
    for name, words in REFUSED.items():
        out[f"refused/{name}"] = functools.partial(command, words=words.split())
    out["paper/ledger"] = ask_ledger
    out["identify-command/x"] = ask_identify_command
    for name, words in SWEEPS.items():
        out[f"sweep/{name}"] = functools.partial(ask_sweep, name=name, words=words)
    out["sweep/file"] = ask_sweep_of_file
    return out


# ---- Records on disk ----------------------------------------------------------------------------

SAVED = {  # scenes whose records are saved, and which samples are kept of them
    "constant-hand": 5, "variable": 20, "stability-25": 3, "unstable": 1, "layers": 4,
    "accurate-hand-shaping": 1, "sampled-constant-held-ts4": 2, "hardware-all": 1,
    "muscle-command": 3,
}  # fmt: skip


def ask_load(place: Place, name: str) -> Answer:
    """Saves a record, reads the one that was saved (by --load's release), and runs it again."""
    every = SAVED[name]
    record = simulated(name, every=every)
    volume, rate = hc.removed(record)
    notes = {"made by": "releases.py", "real_time": 0.5}
    extra = {"removed": volume, "removal_rate": rate}
    whole = dataclasses.replace(record, extra=extra, notes=notes)
    whole.save(place.out / "records" / name)
    loaded = hc.Record.load(place.load / "records" / name)
    again = hc.simulate(loaded.scenario, engine="python", every=every)
    summary = {k: v for k, v in loaded.summary().items() if k not in UNTIMED}
    return {
        **record_answer(loaded),
        "summary": summary,
        "again": record_answer(again),
        "same_scenario": again.scenario == record.scenario,
    }


# ---- All of them --------------------------------------------------------------------------------


def questions() -> dict[str, Question]:
    """Every question by name, in the order in which they are asked."""
    out: dict[str, Question] = {}
    for name, (_, engines) in scenes().items():
        for engine in engines:
            out[f"scene/{name}/{engine}"] = plain(ask_scene, name, engine)
    for name, engine in THINNED:
        out[f"scene/{name}/{engine}-every-7"] = plain(ask_scene, name, engine, 7)
    for name in MEASURED:
        out[f"record/{name}"] = plain(ask_record, name)
    for name in SAVED:
        out[f"load/{name}"] = functools.partial(ask_load, name=name)
    for experiment in hc.SCENARIOS:
        out[f"defaults/{experiment}"] = plain(ask_defaults, experiment)
    out["model"] = plain(ask_model)
    out["refusals"] = plain(ask_refusals)
    out["batch/summaries-500"] = plain(ask_summaries)
    out["batch/mixed-summaries"] = plain(ask_mixed, "summaries", 1)
    out["batch/mixed-records"] = plain(ask_mixed, "records", 3)
    for axis in "xy":
        for loop in LOOPS:
            out[f"gain-limit/{axis}/{loop}"] = plain(ask_gain_limit, axis, loop)
            out[f"coupled-stability/{axis}/{loop}"] = plain(ask_coupled, axis, loop)
        for at in ("compensator", "force"):
            out[f"margins/{axis}/{at}"] = plain(ask_margins, axis, at)
        out |= {
            f"nyquist/{axis}": plain(ask_nyquist, axis),
            f"small-gain/{axis}": plain(ask_small_gain, axis),
            f"passivity/{axis}": plain(ask_passivity, axis),
            f"worst-case/{axis}": plain(ask_worst_case, axis),
            f"design-gain/{axis}": plain(ask_design, axis),
            f"compare/{axis}": plain(ask_compare, axis),
            f"transparency/{axis}": plain(ask_transparency, axis),
            f"poles/{axis}": plain(ask_poles, axis),
        }
    out["clay-passivity"] = plain(ask_clay_passivity)
    return out | identifications() | commands()


# ---- Parts and digests --------------------------------------------------------------------------


def parts_of(answer: Answer, path: str = "") -> Iterator[tuple[str, Any]]:
    """Takes an answer apart.

    Yields:
        (name, part): a number, text, bool or None, or an array. Sequences of numbers are arrays.
    """
    below = f"{path}." if path else ""
    if isinstance(answer, np.generic):
        answer = answer.item()
    if dataclasses.is_dataclass(answer) and not isinstance(answer, type):
        answer = {f.name: getattr(answer, f.name) for f in dataclasses.fields(answer)}
    if isinstance(answer, np.ndarray) and answer.dtype.names:
        answer = {name: answer[name] for name in answer.dtype.names}
    if isinstance(answer, list | tuple):
        figures = all(isinstance(x, int | float) and not isinstance(x, bool) for x in answer)
        parts = {str(i): x for i, x in enumerate(answer)}
        answer = np.array(answer, dtype=float) if figures else parts
    if isinstance(answer, dict):
        for key, value in answer.items():
            yield from parts_of(value, f"{below}{key}")
    elif isinstance(answer, complex):
        yield path, np.array(answer)
    elif answer is None or isinstance(answer, bool | int | float | str | np.ndarray):
        yield path, answer
    else:
        raise TypeError(f"{path}: a {type(answer).__name__} is no part of an answer")


def fingerprint(x: np.ndarray) -> dict[str, Any]:
    """What stands for an array in digests.json."""
    text = x.dtype.kind == "U"
    data = "\0".join(x.ravel().tolist()).encode() if text else np.ascontiguousarray(x).tobytes()
    kind = "text" if text else x.dtype.str
    return {"array": kind, "shape": list(x.shape), "sha256": hashlib.sha256(data).hexdigest()}


def digest(parts: dict[str, Any]) -> str:
    """The digest of an answer from its parts, as they are in digests.json."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def thinned(x: np.ndarray, keep: int) -> np.ndarray:
    """About `keep` samples of an array at most, the same ones for each length; 0 for all."""
    if not x.ndim or not keep or len(x) <= keep:
        return x
    return x[np.unique(np.append(np.arange(0, len(x), -(-len(x) // keep)), len(x) - 1))]


def entry(question: Question, place: Place) -> tuple[Entry, dict[str, np.ndarray]]:
    """Asks; an exception is an answer.

    Returns:
        What digests.json holds, and the arrays.
    """
    begin = time.perf_counter()
    try:
        found = dict(parts_of(question(place)))
    except Exception as error:
        found = {"raises": f"{type(error).__name__}: {error}"}
    parts: dict[str, Any] = {}
    for name, value in found.items():
        if isinstance(value, str):  # folders differ from run to run
            for folder, word in ((place.work, "WORK"), (place.load, "LOAD"), (place.out, "OUT")):
                value = value.replace(str(folder), word)
        parts[name] = fingerprint(value) if isinstance(value, np.ndarray) else value
    arrays = {name: value for name, value in found.items() if isinstance(value, np.ndarray)}
    seconds = round(time.perf_counter() - begin, 3)
    return {"digest": digest(parts), "seconds": seconds, "parts": parts}, arrays


def ask_all(out: Path, load: Path | None, only: str, keep: int) -> None:
    """Asks the questions and writes digests.json, arrays/ and records/ into out.

    Args:
        out: folder; what an earlier call left there goes.
        load: folder of an earlier call, whose records are read; None for out itself.
        only: regular expression that the names of questions must hold.
        keep: samples kept of each array, 0 for all.
    """
    chosen = {n: q for n, q in questions().items() if re.search(only, n)}
    out.mkdir(parents=True, exist_ok=True)
    for left in ("arrays", "records"):
        shutil.rmtree(out / left, ignore_errors=True)
    entries: dict[str, Any] = {}
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="releases-") as work:
        place = Place(out.resolve(), (load or out).resolve(), Path(work).resolve())
        try:
            for i, (name, question) in enumerate(chosen.items(), 1):
                entries[name], arrays = entry(question, place)
                file = out / "arrays" / f"{name}.npz"
                file.parent.mkdir(parents=True, exist_ok=True)
                if arrays:
                    kept: Any = {n: thinned(x, keep) for n, x in arrays.items()}
                    np.savez_compressed(file, **kept)
                raised = entries[name]["parts"].get("raises", "")
                line = f"[{i:3d}/{len(chosen)}] {entries[name]['seconds']:7.2f} s  {name}"
                print(f"{line}  {raised[:WIDTH]}".rstrip(), flush=True)
        finally:  # Ctrl-C keeps what was answered
            about = {
                "release": hc.__version__,
                "package": str(Path(hc.__file__).parent),
                "python": platform.python_version(),
                "numpy": np.__version__,
                "machine": platform.platform(),
                "only": only,
                "seconds": round(time.perf_counter() - begin, 1),
            }
            written = json.dumps({"about": about, "entries": entries}, indent=1)
            (out / "digests.json").write_text(written + "\n")
    print(f"{len(entries)} questions in {about['seconds']:g} s: {out / 'digests.json'}")


# ---- Comparison ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Difference:
    """One part of two answers that differ.

    Attributes:
        name: of the part.
        said: the difference, for reading.
        size: largest absolute difference; NaN where there is no such number.
        words: whether both are texts.
    """

    name: str
    said: str
    size: float = math.nan
    words: bool = False


def is_number(x: Any) -> bool:
    """Whether a part is a number, which True and False are not."""
    return isinstance(x, int | float) and not isinstance(x, bool)


def distance(name: str, a: Any, b: Any) -> Difference:
    """How far two numbers, or arrays of one shape, are from each other."""
    a, b = np.atleast_1d(a), np.atleast_1d(b)
    if a.dtype.kind not in "biufc" or b.dtype.kind not in "biufc":
        return Difference(name, f"{int(np.sum(a != b))} of {a.size} values", words=True)
    a, b = (x if x.dtype.kind == "c" else x.astype(float) for x in (a, b))
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    if same.all():
        return Difference(name, "equal at the samples kept, or but for the sign of 0 or the type")
    with np.errstate(all="ignore"):
        apart = np.abs(a - b)[~same]
    finite = np.isfinite(apart)
    size = float(np.max(apart[finite], initial=0.0))
    scale = float(np.max(np.abs(a)[np.isfinite(a)], initial=0.0))
    lost = "" if finite.all() else f", {int(np.sum(~finite))} against NaN or infinity"
    return Difference(name, f"{size:.2g} ({scale:.2g}){lost}", size)


def differences(name: str, old: Entry, new: Entry, folders: list[Path]) -> list[Difference]:
    """What differs between two answers to a question.

    Args:
        name: of the question.
        old: its entry in digests.json.
        new: the other one.
        folders: that both are in.
    """
    raised = [x["parts"].get("raises") for x in (old, new)]
    if (raised[0] is None) != (raised[1] is None):
        which = "new" if raised[0] is None else "old"
        return [Difference("raises", f"only in {which}: {raised[0] or raised[1]}")]
    files = [folder / "arrays" / f"{name}.npz" for folder in folders]
    arrays = [dict(np.load(f)) if f.is_file() else {} for f in files]
    out = []
    for part in dict.fromkeys([*old["parts"], *new["parts"]]):
        here = [part in x["parts"] for x in (old, new)]
        if not all(here):
            out.append(Difference(part, f"only in {'old' if here[0] else 'new'}"))
            continue
        a, b = old["parts"][part], new["parts"][part]
        if json.dumps(a) == json.dumps(b):
            continue
        if isinstance(a, dict) and isinstance(b, dict):
            if a["shape"] != b["shape"]:
                out.append(Difference(part, f"shape {a['shape']} -> {b['shape']}"))
            elif all(part in x for x in arrays) and arrays[0][part].shape == arrays[1][part].shape:
                out.append(distance(part, arrays[0][part], arrays[1][part]))
            else:
                out.append(Difference(part, "its samples were not kept alike"))
        elif is_number(a) and is_number(b):
            out.append(distance(part, a, b))
        else:
            texts = isinstance(a, str) and isinstance(b, str)
            a, b = excerpts(a, b) if texts else (repr(a)[:WIDTH], repr(b)[:WIDTH])
            out.append(Difference(part, f"{a} -> {b}", words=texts))
    return out


def excerpts(a: str, b: str) -> tuple[str, str]:
    """The pieces of two texts around where they begin to differ."""
    begin = max(0, len(os.path.commonprefix([a, b])) - WIDTH // 3)
    first, second = (("..." if begin else "") + repr(x[begin : begin + WIDTH]) for x in (a, b))
    return first, second


def compare(old: Path, new: Path, only: str) -> int:
    """Prints what differs between two folders that `ask_all` has written.

    Args:
        old: one folder.
        new: the other one.
        only: regular expression that the names of questions must hold.

    Returns:
        The exit status: 1 if anything differs.
    """
    folders = [old, new]
    found = [json.loads((f / "digests.json").read_text()) for f in folders]
    for word, x in zip(("old", "new"), found, strict=True):
        about = x["about"]
        print(f"{word}: {about['release']}, {about['package']}, numpy {about['numpy']}")
    entries = [{n: e for n, e in x["entries"].items() if re.search(only, n)} for x in found]
    names = list(dict.fromkeys([*entries[0], *entries[1]]))
    equal = words_only = missing = 0
    largest = (0.0, "")
    for name in names:
        a, b = (e.get(name) for e in entries)
        if a is None or b is None:
            missing += 1
            print(f"{name}: asked only of {'new' if a is None else 'old'}")
            continue
        if a["digest"] == b["digest"]:
            equal += 1
            continue
        apart = differences(name, a, b, folders)
        words_only += all(d.words for d in apart)
        sizes = [(d.size, f"{name}, {d.name}") for d in apart if not math.isnan(d.size)]
        largest = max([largest, *sizes])
        more = f"; and {len(apart) - SHOWN} more" if len(apart) > SHOWN else ""
        print(f"{name}: {'; '.join(f'{d.name} {d.said}' for d in apart[:SHOWN])}{more}")
    print(f"{equal} of {len(names)} equal")
    if words_only:
        print(f"{words_only} differ in texts alone")
    if missing:
        print(f"{missing} were asked of one release only")
    if largest[1]:
        print(f"largest difference of a number: {largest[0]:.2g}, {largest[1]}")
    return 0 if equal == len(names) else 1


def main() -> int:
    """The command line of this script; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="ask, and write the answers into this folder")
    parser.add_argument(
        "--load", type=Path, metavar="DIR", help="read the records that another call saved there"
    )
    parser.add_argument(
        "--compare", nargs=2, type=Path, metavar=("OLD", "NEW"), help="compare two such folders"
    )
    parser.add_argument(
        "--only", default="", metavar="PATTERN", help="questions with this regular expression"
    )
    parser.add_argument(
        "--keep", type=int, default=KEEP, help=f"samples kept of an array, 0 for all ({KEEP})"
    )
    parser.add_argument("--list", action="store_true", help="name the questions")
    given = parser.parse_args()
    if given.list:
        print("\n".join(n for n in questions() if re.search(given.only, n)))
        return 0
    if given.compare:
        return compare(*given.compare, given.only)
    if given.out is None:
        parser.error("give --out DIR, --compare OLD NEW or --list")
    if given.load and not (given.load / "records").is_dir():
        parser.error(f"--load {given.load}: there is no folder records in it")
    ask_all(given.out, given.load, given.only, given.keep)
    return 0


if __name__ == "__main__":
    sys.exit(main())
