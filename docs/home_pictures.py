"""Makes the five pictures of the first page and of README.md, docs/home_*.png, all of one size;
and those of the gallery that show clay, docs/thumbnails/*.png.

python docs/home_pictures.py [arm pair cut wall film thumbnails]
"""

import os
import runpy
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from PIL import Image

import hapticclay as hc
from hapticclay.views import film
from hapticclay.views.stage import Stage

DOCS = Path(__file__).parent
CLAY = "dent groove layers marble rotated smooth sticking".split()  # of examples/clay
THUMBNAIL = 800, 560  # [pixels]
KP, KD = (240, 240, 240, 240, 24, 31, 25), (3, 3, 3, 3, 0.2, 0.2, 0.2)  # of leader_7
SIZE, DPI = (4.4, 3.3), 160  # [inch], [1/inch]: letters stay legible at half of a page's width


def arm(ax: Axes) -> None:
    """The last joint of a leader that is let go 1 mrad off, below and above the gains it carries.

    Args:
        ax: where it is drawn.
    """
    leader = hc.MjcfArm("leader_7", friction=[0.0] * 7)
    at, push = leader.q.tolist(), [0.0] * 6 + [1e-3]
    for factor, color in ((1.5, "#d55e00"), (1.0, "#0072b2")):
        law = hc.JointPD([factor * k for k in KP], KD, velocity="filter", cutoff=90.0)
        law = replace(law, reference=[q - x for q, x in zip(at, push, strict=True)])
        record = hc.simulate(
            hc.Scenario(
                arm=leader,
                controller=law,
                Ts=2e-3,
                dt=5e-4,
                t_max=0.8,
                hardware=hc.Hardware(delay=2e-3),
                stop_when_unstable=False,
            )
        )
        q = 1e3 * (record.q[:, 6] - law.reference[6])
        ax.plot(1e3 * record.t, q, color=color, label=f"all Kp times {factor:g}")
    ax.set(xlabel="time [ms]", ylabel="angle of joint 7 [mrad]", xlim=(0.0, 800.0))
    ax.legend(loc="upper left")


def pair(ax: Axes) -> None:
    """The delay that two such arms carry between them, over their gains.

    Args:
        ax: where it is drawn.
    """
    leader = hc.MjcfArm("leader_7")
    both = hc.Pair(leader, leader, hc.JointPD(KP, KD, runs="drive"), hc.Link(), Ts=2e-3)
    found = hc.theory.pair_map(both, gains=40, delays=2)
    ax.fill_between(found.gains, 1e3 * found.limits, color="#56b4e9", alpha=0.22, lw=0)
    ax.plot(found.gains, 1e3 * found.limits, label="largest delay, by theory")
    ax.text(0.75, 5.0, "stable", ha="center")
    ax.set(xscale="log", xlabel="factor of all Kp", ylabel="one-way delay [ms]")
    ax.set(xlim=(0.25, 8.0), ylim=(0.0, 40.0))
    ax.set_xticks([0.25, 0.5, 1, 2, 4, 8], ["1/4", "1/2", "1", "2", "4", "8"])
    ax.minorticks_off()
    ax.legend(loc="upper right")


def cut(ax: Axes) -> None:
    """Velocity over position in the constant cut.

    Args:
        ax: where it is drawn.
    """
    record = hc.simulate(hc.constant_cut())
    ax.axvspan(5.0, 15.0, ymax=0.8, color="#e5c7b8", lw=0)
    ax.plot(100.0 * record.p[:, 0], 100.0 * record.v[:, 0], label="run")
    for first, last, b in ((0.0, 5.0, 0.0), (5.0, 15.0, 90.0), (15.0, 20.0, 0.0)):
        label = "steady speed, K f/(10 + K b)" if b else None
        ax.plot((first, last), 2 * (100.0 / (10.0 + b),), "--", color="#d55e00", label=label)
    ax.text(10.0, 5.0, "clay", ha="center")
    ax.set(xlabel="position [cm]", ylabel="velocity [cm/s]", xlim=(0.0, 20.0), ylim=(-0.6, 13.6))
    ax.set_xticks((0, 5, 10, 15, 20))
    ax.legend(loc="upper left")


def wall(ax: Axes) -> None:
    """A hand that presses on a wall which vibrates, and on the same wall with damping.

    Args:
        ax: where it is drawn.
    """
    hand = hc.Operator(mass=0.0, damper=2.0, spring=0.0)
    device = hc.Device(mass=0.1, damper=0.5)
    stiff = hc.VirtualWall(K=6000.0, device=device, operator=hand, Ts=1e-3, unilateral=True)
    ax.axhspan(0.0, 4.0, color="0.92", lw=0)
    for each, color in ((stiff, "#d55e00"), (replace(stiff, B=5.0), "#0072b2")):
        press = each.scenario(0.4, push=0.05, start=-0.005, muscle=hc.Constant((2.0, 0.0)))
        record = hc.simulate(press, engine="python")
        label = f"6000 N/m, B = {each.B:g} N·s/m"
        ax.plot(1e3 * record.t, 1e3 * record.p[:, 0], color=color, label=label)
    ax.text(395.0, 3.3, "in the wall", ha="right")
    ax.set(xlabel="time [ms]", ylabel="position [mm]", xlim=(0.0, 400.0), ylim=(-5.4, 4.0))
    ax.set_xticks((0, 100, 200, 300, 400))
    ax.legend(loc="lower right")


def frame() -> np.ndarray:
    """The last frame of a film of the variable cut, without plots."""
    record = hc.simulate(hc.variable_cut())
    width, height = (round(DPI * x) for x in SIZE)
    options = film.FilmOptions(size=(width, height), plots=False, smooth=True, speed=1000.0)
    for image in film.frames(record, options):
        last = image
    return last


def scene(record: hc.Record) -> np.ndarray:
    """The arm and the clay after a run.

    Args:
        record: the run.
    """
    stage = Stage(record.scenario)
    lens = film.Lens(stage, *THUMBNAIL, "close", smooth=True)
    stage.carve(record.p)
    stage.pose(record.q[-1])
    image = lens.photograph().copy()
    lens.close()
    return image


DRAWN: dict[str, Callable[[Axes], None]] = {
    "arm": arm,
    "pair": pair,
    "cut": cut,
    "wall": wall,
}


def main(names: list[str]) -> None:
    """Makes pictures.

    Args:
        names: of the pictures; none for all.
    """
    plt.style.use("hapticclay.views.figure")
    for name, draw in DRAWN.items():
        if not names or name in names:
            figure, ax = plt.subplots(figsize=SIZE)
            draw(ax)
            figure.savefig(DOCS / f"home_{name}.png", dpi=DPI)
            plt.close(figure)
    if not names or "film" in names:
        Image.fromarray(frame()).save(DOCS / "home_film.png", optimize=True)
    for name in CLAY if not names or "thumbnails" in names else ():
        record = runpy.run_path(str(DOCS.parent / f"examples/clay/{name}.py"))["record"]
        Image.fromarray(scene(record)).save(DOCS / f"thumbnails/{name}.png", optimize=True)
        plt.close("all")


if __name__ == "__main__":
    main(sys.argv[1:])
