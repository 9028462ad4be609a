"""What each part of a scene costs, in the engine's step and in the whole loop.

A part that is off is not there.

    python -m benchmarks.parts [--out DIR] [--rounds N] [--steps N]

Every part is measured beside the plain scene, in turns; medians of ratios. Writes parts.json.
"""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import hapticclay as hc
from hapticclay.kernel import engine, native
from hapticclay.model.arm import PAPER
from hapticclay.model.hardware import Coupling, Hardware
from hapticclay.model.signals import Multisine
from hapticclay.views import stage

from . import common


def arm(*files: str, change: Callable[[Any], None] | None = None) -> mujoco.MjModel:
    """The arm with these parts of mjcf/, and what change adds."""
    spec = engine.compose_spec(["arm.xml", *files], PAPER)
    if change:
        change(spec)
    return spec.compile()


def _skin(spec: Any) -> None:
    for body, *skin in stage.arm_skin(PAPER):
        stage._skin(spec.body(body) if body else spec.worldbody, *skin[:-1], "")


def _sensors(spec: Any) -> None:
    for kind in (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL):
        for joint in ("shoulder", "elbow"):
            spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname=joint)
    for kind in (mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtSensor.mjSENS_FRAMELINVEL):
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_XBODY, objname="link2")


def _contact(spec: Any) -> None:
    spec.option.disableflags = 0
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=(1.0, 1.0, 0.1), pos=(0.0, 0.0, -0.06)
    )
    ball = {"size": (0.0601, 0.0, 0.0), "pos": (0.35, 0.0, 0.0)}
    spec.body("link2").add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, mass=0.0, **ball)


def _heights(spec: Any) -> None:
    stage._block(spec, stage.Block((0.0, 0.0), (0.2, 0.2), 200, 200, 0.03, np.zeros((16, 16, 3))))


ENGINE: dict[str, Callable[[], mujoco.MjModel]] = {
    "arm alone": lambda: arm(),
    "clay": lambda: arm("clay.xml"),
    "skin": lambda: arm("room.xml", change=lambda spec: _skin(spec)),
    "skin, room, heightfield": lambda: arm(
        "room.xml", change=lambda spec: (_skin(spec), _heights(spec))
    ),
    "sensors": lambda: arm(change=_sensors),
    "contact of tool and table": lambda: arm(change=_contact),
}
CUT = dataclasses.replace(hc.constant_cut(start=(0.06, 0.0)), length=None)
WAVE = Multisine(rms=(0.1, 0.1), low=0.2, high=3.0, period=5.0, seed=1)


def _sampled(**hardware: Any) -> hc.Scenario:
    given = Hardware(**hardware) if hardware else None
    return dataclasses.replace(CUT, control="sampled", hardware=given)


LOOP: dict[str, tuple[hc.Scenario, dict[str, Any]]] = {
    "cut": (CUT, {}),
    "one sample in 100 recorded": (CUT, {"every": 100}),
    "no clay": (dataclasses.replace(CUT, clay=None, gain=(0.01, 0.01)), {}),
    "inertia_shaping": (dataclasses.replace(CUT, inertia_shaping=True), {}),
    "Th": (dataclasses.replace(CUT, operator=hc.Operator(), force=(2.0, 0.0)), {}),
    "clay that grows": (hc.variable_cut(start=(0.06, 0.06)), {}),
    "muscle force": (dataclasses.replace(CUT, muscle=WAVE), {}),
    "sampled control": (_sampled(), {}),
    "sampled, encoder": (_sampled(encoder=65536), {}),
    "sampled, A/D, noise, filter": (
        _sampled(adc_bits=16, force_noise=0.01, force_filter=500.0),
        {},
    ),
    "sampled, D/A": (_sampled(dac_bits=16), {}),
    "sampled, delay": (_sampled(delay=1e-4), {}),
    "sampled, jitter, lost samples": (_sampled(jitter=1e-5, dropout_probability=0.01), {}),
    "sampled, friction": (_sampled(friction=(0.01, 0.01)), {}),
    "sampled, passivity observer": (_sampled(passivity=True), {}),
    "sampled, virtual coupling": (_sampled(coupling=Coupling(2000.0, 20.0)), {}),
}


def step(model: mujoco.MjModel, steps: int) -> float:
    """Return seconds a step of the engine alone, looping in C.

    It is restarted often enough to stay clear of denormals.
    """
    data = mujoco.MjData(model)
    spent = 0.0
    for _ in range(max(1, steps // 500)):
        mujoco.mj_resetData(model, data)
        data.qpos[:2], data.qvel[:2] = (1.9, -1.9), (0.1, -0.2)
        begin = time.process_time()
        mujoco.mj_step(model, data, 500)
        spent += time.process_time() - begin
    return spent / (max(1, steps // 500) * 500)


def run(name: str, steps: int, engine: str = "python") -> float:
    """Seconds a step of the whole loop."""
    scenario, how = LOOP[name]
    scenario = dataclasses.replace(
        scenario, t_max=(steps + 0.5) * scenario.dt, stop_when_unstable=False
    )
    r = hc.simulate(scenario, engine=engine, **how)
    return r.wall_time / r.steps


def compare(names: list[str], cost: Callable[[str], float], rounds: int) -> list[dict[str, Any]]:
    """One row a name: its cost over that of the first, which is measured anew beside each."""
    plain = names[0]
    cost(plain)
    rows, base = [], []
    for name in names[1:]:
        ratios = []
        for _ in range(rounds):
            first, other, again = cost(plain), cost(name), cost(plain)
            ratios.append(other / (0.5 * (first + again)))
            base += [first, again]
        rows.append({"part": name, "ratio": statistics.median(ratios)})
    least = 1e6 * statistics.median(base)
    return [
        {"part": plain, "ratio": 1.0, "us": least},
        *({**r, "us": least * r["ratio"]} for r in rows),
    ]


TITLES = {
    "engine": "One step of the engine, in C, beside the arm alone.",
    "loop": "One step of the whole loop in Python, every sample recorded, beside the constant cut.",
    "native": "The same, compiled.",
}


def sections(data: dict[str, Any]) -> list[str]:
    """The paragraphs of the page."""
    out = ["A part that a scene lacks costs nothing."]
    for name, title in TITLES.items():
        if name not in data:
            continue
        cells = [
            {"part": r["part"], "over plain": f"{r['ratio']:.2f}", "us": f"{r['us']:.2f}"}
            for r in data[name]
        ]
        out += [title, common.table(cells)]
    return out


def conclusions(data: dict[str, Any]) -> list[str]:
    """The part that costs most in a compiled step."""
    found = data.get("native", data["loop"])
    most = max(found, key=lambda r: r["ratio"])
    return [
        "Parts. A part that a scene lacks costs nothing; the most expensive one "
        f"({most['part']}) makes a step {most['ratio']:.2f} times as long."
    ]


def main(
    out: Path = Path("out/bench"),
    quick: bool = False,
    rounds: int | None = None,
    steps: int | None = None,
) -> dict[str, Any]:
    """Measures, writes the data; returns it."""
    rounds, steps = rounds or (1 if quick else 5), steps or (2000 if quick else 10_000)
    models = {name: make() for name, make in ENGINE.items()}
    found = {
        "engine": compare(list(models), lambda name: step(models[name], steps), rounds),
        "loop": compare(list(LOOP), lambda name: run(name, steps // 2), rounds),
    }
    if native.is_there():
        common.warm()
        found["native"] = compare(list(LOOP), lambda name: run(name, 10 * steps, "native"), rounds)
    return common.write(out, "parts", {"rounds": rounds, "steps": steps, **found})


if __name__ == "__main__":
    parser = common.parser(__doc__)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--steps", type=int)
    args = parser.parse_args()
    print("\n\n".join(sections(main(args.out, rounds=args.rounds, steps=args.steps))))
