"""Every public function, handed each kind of arm: an answer, or a refusal in one line."""

import functools
import inspect
import warnings

import mujoco
import pytest

import hapticclay as hc
from tests.good_values import good_values, required
from tests.hunt import HUNTS
from tests.public import NAMES

LIFT = """<mujoco><worldbody><body name="l"><joint name="lift" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{}</body></worldbody></mujoco>"""
TURN = """<body><joint name="turn" axis="0 0 1" range="-2 2"/><inertial pos="0.1 0 0" mass="0.5"
diaginertia="0.01 0.01 0.01"/><site name="h" pos="0.1 0 0"/></body>"""


def text_arm(inner, **kw):
    return hc.MjcfArm(mujoco.MjSpec.from_string(LIFT.format(inner)), **kw)


ARMS = {
    "two joints": lambda: hc.MjcfArm("planar_2r"),
    "five-bar": lambda: hc.MjcfArm("five_bar"),
    "slide": lambda: text_arm('<site name="h"/>'),
    "slide and hinge": lambda: text_arm(TURN),
    "three axes": lambda: hc.MjcfArm("haptic_3"),
    "no handle": lambda: text_arm(""),
}
CUT = {"t_max": 0.01, "Ts": 1e-3, "dt": 1e-3, "control": "sampled"}


def law_of(arm):
    n = len(arm.names)
    return hc.JointPD((20.0,) * n, (0.5,) * n, friction=((0.01, 9.0, 0.0),) * n)


def still(t, q, qd, fh, state, params):
    return tuple(-0.1 * x for x in qd), state


@functools.cache
def things():
    """Arms, scenarios, pairs and records of each kind, by name."""
    out = {"closed form": hc.Arm(), "device": hc.Device()}
    arms = {name: make() for name, make in ARMS.items()}
    scenes = {"paper": hc.constant_cut(t_max=0.01), "closed form": hc.Scenario(
        controller=hc.JointPD((9.0,) * 2, (0.5,) * 2), **CUT
    )}  # fmt: skip
    pairs = {
        "closed form": hc.Pair(hc.Arm(), hc.Arm(), hc.JointPD((9.0,) * 2, (0.5,) * 2), t_max=0.01),
        "devices": hc.Pair(hc.Device(), hc.Device(), hc.JointPD((9.0,), (0.5,)), t_max=0.01),
    }
    for name, arm in arms.items():
        if arm.site is not None:
            scenes[f"law, {name}"] = hc.Scenario(arm=arm, controller=law_of(arm), **CUT)
            scenes[f"own, {name}"] = hc.Scenario(arm=arm, controller=hc.Controller(still), **CUT)
            pairs[name] = hc.Pair(arm, arm, law_of(arm), t_max=0.01)
    records = {f"record, {k}": hc.simulate(x) for k, x in {**scenes, **pairs}.items()}
    pairs = {f"pair, {k}": x for k, x in pairs.items()}
    return {
        **out, **{f"arm, {k}": x for k, x in arms.items()},
        **{f"scene, {k}": x for k, x in scenes.items()}, **pairs, **records,
    }  # fmt: skip


PAIRED = ("compare_links", "pair_hands", "pair_limits", "pair_map", "pair_transparency")
ONE = {  # of functions whose answers take seconds: the kind in the suite; a hunt has all
    **{f"theory.{name}": "pair, slide" for name in PAIRED},
    "studies.joint_runs": "arm, five-bar",
    "studies.measure_impedance": "scene, law, slide",
    "walls.arm_index": "scene, law, slide",
    "walls.arm_mbk": "scene, law, slide",
}
PLACES = ("arm", "scenario", "subject", "record", "pair", "wall", "loop", "base", "part", "leader")
FUNCTIONS = [
    (name, place)
    for name, made in NAMES.items()
    if inspect.isfunction(made)
    for place in (*PLACES, "scenarios")
    if place in inspect.signature(made).parameters
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name,place", FUNCTIONS)
def test_each_kind_of_arm_is_answered_or_refused(name, place, tmp_path):
    made, good = NAMES[name], good_values(tmp_path)
    given = required(name.rpartition(".")[2], made, good)
    for kind, thing in things().items():
        one = ONE.get(name, kind)
        if kind != one and isinstance(thing, type(things()[one])) and not HUNTS:
            continue
        call = {**given, place: [thing] if place == "scenarios" else thing}
        if "out" in inspect.signature(made).parameters:
            call["out"] = tmp_path / kind
        if "law" in call and isinstance(thing, hc.MjcfArm):
            call["law"] = law_of(thing)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                made(**call)
        except hc.ParameterError as error:
            assert "\n" not in str(error) and len(str(error)) < 600, (kind, error)
        except Exception as error:  # any other one is what this test is for
            raise AssertionError((kind, type(error).__name__, str(error)[:200])) from error
