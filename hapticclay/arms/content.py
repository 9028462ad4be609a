"""What of an MJCF or URDF file acts on an arm, in theory and in runs alike: declared once.

The table is that of docs/own_arm.md, which `python -m hapticclay.arms.content docs/own_arm.md`
writes; what it says is noted or refused is noted or refused here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError

USED, NOTED, REFUSED, IGNORED = "used", "noted", "refused", "no effect"


class Content(NamedTuple):
    """Attributes of an element of MJCF, and what becomes of them."""

    element: str
    attributes: str
    fate: str
    words: str


CONTENT = (
    Content("option", "gravity", USED, "weight; the law may hold it (`gravity`)"),
    Content(
        "option", "density viscosity wind", USED,
        "fluid forces of bodies and of ellipsoids; theory has their slope at rest; noted",
    ),
    Content(
        "option", "timestep integrator", IGNORED,
        "a run chooses its step and method: `dt`, and second order",
    ),
    Content(
        "option",
        "impratio magnetic o_margin o_solref o_solimp o_friction cone jacobian solver iterations "
        "tolerance ls_iterations ls_tolerance noslip_iterations noslip_tolerance ccd_iterations "
        "ccd_tolerance sleep_tolerance sdf_iterations sdf_initpoints",
        IGNORED, "of contacts, sensors and the solver of soft constraints: none is used",
    ),
    Content("option", "flag", USED, "as follows"),
    Content("option", "actuatorgroupdisable", USED, "these actuators limit no torque"),
    Content(
        "flag", "spring damper gravity frictionloss limit equality constraint", USED,
        "what is off does not act; noted. Springs and dampers both off: nor do fluid and gravcomp",
    ),
    Content("flag", "clampctrl", USED, "off: ctrlrange limits no torque"),
    Content(
        "flag",
        "contact warmstart filterparent actuation refsafe sensor midphase nativeccd island "
        "eulerdamp autoreset override energy fwdinv invdiscrete multiccd sleep diagexact ipc "
        "speculative",
        IGNORED, "of contacts, sensors, the engine's own solver and step",
    ),
    Content(
        "body", "pos quat axisangle xyaxes zaxis euler childclass inertial joint freejoint geom "
        "site attach frame", USED, "as MuJoCo compiles them",
    ),
    Content("body", "gravcomp", USED, "share of a body's weight that is compensated"),
    Content("body", "plugin flexcomp", NOTED, "elastic parts take no part"),
    Content("body", "name", USED, "the handle may be a body: `site`"),
    Content("body", "mocap sleep simple fuse user camera light", IGNORED, "nothing of mechanics"),
    Content(
        "joint", "type", USED,
        "hinge or slide. A free joint is held where it is, a ball that is not of the arm is locked",
    ),
    Content("joint", "name", USED, "without one: joint 1, joint 2, ... in the order of the file"),
    Content("joint", "pos axis ref class", USED, "as MuJoCo compiles them"),
    Content(
        "joint", "stiffness springref springdamper", USED,
        "springs, polynomials too; theory has their slope at the pose",
    ),
    Content(
        "joint", "damping", USED, "dampers, polynomials too; theory has their slope at rest; noted"
    ),
    Content("joint", "springyield", NOTED, "the spring stays elastic"),
    Content("joint", "armature", USED, "inertia of the rotor: `arm.armature`"),
    Content(
        "joint", "frictionloss", USED,
        "Coulomb friction: `arm.friction`. That of a follower is carried, times the ratio at the "
        "pose, to the joint that moves it; of one that several joints move, it is noted",
    ),
    Content("joint", "range limited", USED, "a run ends there"),
    Content(
        "joint", "actuatorfrcrange actuatorfrclimited", USED,
        "limit of the motor's torque, the smaller side; noted where they differ",
    ),
    Content(
        "joint", "solreflimit solimplimit margin solreffriction solimpfriction", IGNORED,
        "softness of MuJoCo's limits and friction, which are exact here",
    ),
    Content("joint", "actuatorgravcomp group user", IGNORED, "the sum of torques is the same"),
    Content("tendon", "springlength stiffness damping armature", USED, "as those of joints"),
    Content("tendon", "springyield", NOTED, "the spring stays elastic"),
    Content("tendon", "frictionloss", REFUSED, "of the arm's joints: give their friction"),
    Content("tendon", "limited range", NOTED, "a tendon's limits take no part"),
    Content("tendon", "site geom pulley joint class name", USED, "as MuJoCo compiles them"),
    Content(
        "tendon",
        "actuatorfrclimited actuatorfrcrange solreflimit solimplimit solreffriction "
        "solimpfriction margin group width material rgba user",
        IGNORED, "of limits, friction and pictures",
    ),
    Content(
        "equality", "connect weld joint tendon", USED, "rigid: joints that it ties follow; noted"
    ),
    Content("equality", "active", USED, "false: the constraint does not act"),
    Content(
        "equality", "body1 body2 anchor site1 site2 relpose joint1 joint2 tendon1 tendon2 polycoef",
        USED, "as MuJoCo compiles them",
    ),
    Content("equality", "flex flexstrain cell", NOTED, "elastic parts take no part"),
    Content(
        "equality", "solref solimp torquescale name class", IGNORED, "constraints are rigid"
    ),
    Content(
        "actuator", "armature damping", USED, "times gear^2, added to the joint or tendon it drives"
    ),
    Content(
        "actuator", "forcerange forcelimited gear", USED, "limit of its joint's torque, times gear"
    ),
    Content(
        "actuator", "ctrlrange ctrllimited gaintype gainprm", USED,
        "the same of a motor, whose force is its control times the gain",
    ),
    Content(
        "actuator", "biastype biasprm", USED,
        "gains of its joint: the law of `hapticclay arm FILE` and `hc.JointPD.of(arm)`",
    ),
    Content("actuator", "joint jointinparent tendon group", USED, "what it drives"),
    Content(
        "actuator",
        "name class nsample interp delay actlimited actrange lengthrange cranklength site refsite "
        "body cranksite slidersite user actdim dyntype dynprm velrange ffrange "
        "inheritrange input actearly",
        NOTED, "actuators give no torque: the law that is judged does",
    ),
)  # fmt: skip


# ---- sentences -----------------------------------------------------------------------------------


LARGEST = {  # arrays of a model, and the largest size of their numbers, far beyond any arm
    "opt.gravity": 1e6,  # [m/s^2]
    "opt.wind": 1e6,  # [m/s]
    "opt.density": 1e6,  # [kg/m^3]
    "opt.viscosity": 1e6,  # [Pa.s]
    "body_mass": 1e9,  # [kg]
    "body_inertia": 1e12,  # [kg.m^2]
    "body_pos": 1e6,  # [m]
    "body_ipos": 1e6,
    "body_gravcomp": 1e3,
    "jnt_pos": 1e6,
    "jnt_axis": 2.0,
    "jnt_stiffness": 1e12,  # [N.m/rad, N/m]
    "jnt_stiffnesspoly": 1e12,
    "qpos0": 1e6,  # [rad, m]
    "qpos_spring": 1e6,
    "key_qpos": 1e6,
    "site_pos": 1e6,
    "dof_armature": 1e9,  # [kg.m^2, kg]
    "dof_damping": 1e12,  # [N.m.s/rad, N.s/m]
    "dof_dampingpoly": 1e12,
    "dof_frictionloss": 1e12,  # [N.m, N]
    "tendon_stiffness": 1e12,
    "tendon_stiffnesspoly": 1e12,
    "tendon_damping": 1e12,
    "tendon_dampingpoly": 1e12,
    "tendon_armature": 1e9,
    "actuator_gear": 1e9,
    "actuator_armature": 1e9,
    "actuator_damping": 1e12,
    "actuator_dampingpoly": 1e12,
    "eq_data": 1e9,
}


def check_numbers(model: Any, error: Callable[[str], ParameterError]) -> None:
    """Refuses numbers that are not finite, or so large that sums of them are not.

    Raises:
        ParameterError: as `error` makes it of the reason.
    """
    for name, most in LARGEST.items():
        values = np.abs(np.ravel(attrgetter(name)(model)))
        if not (values <= most).all():
            worst = float(values[np.argmax(~(values <= most))])
            why = "is not finite" if not np.isfinite(worst) else f"must be at most {most:g}"
            raise error(f"{name.removeprefix('opt.')} {why}: {worst:g}")


def refuse(model: Any) -> None:
    """Refuses what no arm has.

    Raises:
        ParameterError: a tendon has friction, or a damper gives energy.
    """
    for i in np.flatnonzero(model.tendon_frictionloss).tolist():
        bound = "must be 0 of a tendon: give the friction of its joints"
        raise ParameterError("frictionloss", model.tendon(i).name or f"tendon {i + 1}", bound)
    for name, of in (("dof", "joint"), ("tendon", "tendon")):
        linear, higher = getattr(model, f"{name}_damping"), getattr(model, f"{name}_dampingpoly")
        b, c = higher.T
        gives = (linear < 0.0) | (c < 0.0) | ((b < 0.0) & (b * b > 4.0 * linear * c))
        bent = np.any(higher, axis=1) | (name == "tendon")
        for i in np.flatnonzero(gives & bent).tolist():
            bound = f"must take energy at all rates: a, c >= 0, b >= -2 sqrt(a c) ({of} {i + 1})"
            raise ParameterError("damping", [float(linear[i]), *higher[i].tolist()], bound)


def off(model: Any) -> Iterator[str]:
    """Sentences about flags that switch parts of a file off."""
    from ..physics import mujoco

    bits = mujoco.mjtDisableBit
    for name, what in (
        ("SPRING", "springs"), ("DAMPER", "dampers"), ("GRAVITY", "gravity"),
        ("FRICTIONLOSS", "friction of joints"), ("LIMIT", "ranges of joints"),
        ("EQUALITY", "constraints"), ("CONSTRAINT", "constraints, ranges and friction of joints"),
    ):  # fmt: skip
        if model.opt.disableflags & int(getattr(bits, f"mjDSBL_{name}")):
            yield f"switched off in the file (flag {name.lower()}): {what}"


def noted(model: Any, names: dict[int, str], own: list[int], following: list[int]) -> Iterator[str]:
    """Sentences about what acts in a way of its own, and what takes no part.

    Args:
        model: compiled, settled.
        names: of the joints, by index.
        own: degrees of freedom of the arm's joints.
        following: of those that constraints move with them.
    """
    moving = [*own, *following]
    bent = [i for i in moving if np.any(model.jnt_stiffnesspoly[i])]
    yield from _of(bent, names, "springs that are not linear, in theory by their slope at the pose")
    bent = [i for i in moving if np.any(model.dof_dampingpoly[i])]
    yield from _of(bent, names, "dampers that are not linear, in theory by their slope at rest")
    rubbing = [i for i in following if model.dof_frictionloss[i]]
    yield from _of(rubbing, names, "friction of joints that several move takes no part")
    yielding = [i for i in moving if model.jnt_springyield[i] and model.jnt_stiffness[i]]
    yield from _of(yielding, names, "springs that yield in the file (springyield), here elastic")
    if np.any(model.tendon_springyield * model.tendon_stiffness):
        yield "springs of tendons yield in the file (springyield), here they stay elastic"
    if model.opt.density or model.opt.viscosity:
        wind = ", wind" * bool(np.any(model.opt.wind))
        yield (
            f"a fluid acts on the bodies ({model.opt.density:g} kg/m^3, "
            f"{model.opt.viscosity:g} Pa.s{wind}), in theory by its slope at rest"
        )
    if np.any(model.tendon_limited):
        yield "limits of tendons take no part"
    if model.nplugin:
        yield "plugins of the file take no part"
    if model.nflex:
        yield "flexes of the file take no part"


def _of(joints: list[int], names: dict[int, str], what: str) -> Iterator[str]:
    if joints:
        yield f"{what}: {', '.join(names[i] for i in joints)}"


# ---- the table -----------------------------------------------------------------------------------

START, END = "<!-- content: start -->", "<!-- content: end -->"


def table() -> str:
    """The table, in Markdown."""
    rows = [("element", "attributes", "", "what becomes of it"), ("---",) * 4, *CONTENT]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def page(text: str) -> str:
    """The text of a page with the table as it is now between its marks."""
    before, _, rest = text.partition(START)
    return f"{before}{START}\n\n{table()}\n\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    import sys
    from pathlib import Path

    of = Path(sys.argv[1])
    of.write_text(page(of.read_text()))
