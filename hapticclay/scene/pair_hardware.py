"""Hardware of the arms of a pair: what acts in it, and what does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..arms.mjcf_arm import MjcfArm
from ..errors import ParameterError
from ..model.arm import Arm
from ..model.hardware import Hardware
from .link import ENDS

FELT = ("position-force", "four-channel")  # kinds of link that send a measured force
OF_FORCE = ("adc_bits", "force_noise", "force_filter")
SENSORS = {  # in words, what theory leaves out
    "encoder": "encoder",
    "linear_encoder": "linear encoder",
    "adc_bits": "A/D converter",
    "force_noise": "noise of the force",
    "force_filter": "filter of the force",
    "dac_bits": "D/A converter",
    "dac_range": "torque limits",
    "friction": "joint friction",
}


def check_hardware(pair: Any, i: int, names: Sequence[str]) -> None:
    """Refuses hardware that cannot act at an end of a pair."""
    given: Hardware | None = pair.hardware[i]
    if given is None:
        return
    for name, (is_wrong, bound) in _refusals(pair, i, given).items():
        if is_wrong:
            raise ParameterError(f"pair.{ENDS[i]}_hardware.{name}", getattr(given, name), bound)
    given.check_encoders(turning(pair.arms[i], pair.n), names, f"pair.{ENDS[i]}_hardware.")


def _refusals(pair: Any, i: int, given: Hardware) -> dict[str, tuple[bool, str]]:
    arm, drives = pair.arms[i], pair.laws[i].runs == "drive"
    from_file, closed = isinstance(arm, MjcfArm), isinstance(arm, Arm)
    converts = given.dac_bits is not None or given.dac_range is not None
    silent = pair.link.kind not in FELT
    felt = f"must be left out with {pair.link.kind}, which measures no force"
    found = {
        "jitter": (given.jitter > 0.0, "must be 0 in a pair, whose hosts sample together"),
        "dropout_probability": (given.dropout_probability > 0.0, "must be 0 in a pair: Link(loss)"),
        "velocity": (given.velocity != "exact", "must be 'exact' in a pair: JointPD(velocity)"),
        "delay": (given.delay > 0.0, "must be 0 in a pair: Pair(delay)"),
        "passivity": (given.passivity, "must be False in a pair: Link(passivity)"),
        "coupling": (given.coupling is not None, "must be None in a pair"),
        "encoder": _encoder(arm, given.encoder),
        "linear_encoder": _encoder(arm, given.linear_encoder),
        "friction": (
            any(given.friction) and not closed,
            f"must be 0 here: {'MjcfArm(friction)' if from_file else 'Device(friction)'}",
        ),
        "dac_range": (
            given.dac_range is not None and from_file,
            "must be None with an arm from a file: MjcfArm(torque_limit)",
        ),
        "dac_bits": (
            given.dac_bits is not None and given.dac_range is None and not from_file,
            "must be None without dac_range, the range of the converter",
        ),
    }
    if drives and converts:
        name = "dac_bits" if given.dac_bits is not None else "dac_range"
        found[name] = (True, "must be None where drives run the law, beyond the converter")
    for name in OF_FORCE:
        found[name] = (bool(getattr(given, name)) and silent, felt)
    return found


def _encoder(arm: Any, counts: Any) -> tuple[bool, str]:
    one_axis = not isinstance(arm, MjcfArm | Arm)
    return counts is not None and one_axis, "must be None for a device of one axis: Device(quantum)"


def turning(arm: Any, n: int) -> list[bool]:
    """Whether each of n joints of an arm turns; others slide."""
    return arm.mechanism.turning if isinstance(arm, MjcfArm) else [True] * n


def slides_of(arm: Any) -> tuple[bool, ...]:
    """Whether each joint of an arm of a pair slides, as a device of one axis does."""
    if isinstance(arm, MjcfArm):
        return tuple(not turns for turns in arm.mechanism.turning)
    return (False, False) if isinstance(arm, Arm) else (True,)


def left_out(pair: Any, i: int) -> str:
    """What theory leaves out of it, in words; "" for nothing."""
    given, words = pair.hardware[i], []
    if given is not None:
        for name, word in SENSORS.items():
            value = getattr(given, name)
            words += [word] if (any(value) if name == "friction" else value) else []
    if getattr(pair.arms[i], "quantum", 0.0):
        words.append("encoder")
    return f"{', '.join(words)}: left out; runs have them" if words else ""
