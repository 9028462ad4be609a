"""Every number the paper prints stands once in params.py, and is what the paper printed."""

import ast
from pathlib import Path

import pytest

from hapticclay import params

SOURCE = Path(params.__file__)

PRINTED = {  # as printed, Eqs. 14-28 and Secs. 4, 4.1
    "Gx": (params.G[0], (910.19, 41.8, 910.19)),
    "Gy": (params.G[1], (765.5, 30.3, 765.5)),
    "Sx": (params.S[0], (0.7919, 41.1, 432.0)),  # 79.19 cm/N
    "Sy": (params.S[1], (0.131, 32.4, 492.46)),  # 13.1 cm/N
}


@pytest.mark.parametrize("name", PRINTED)
def test_transfer_functions(name):
    block, (gain, damping, stiffness) = PRINTED[name]
    assert (block.gain, block.damping, block.stiffness) == pytest.approx((gain, damping, stiffness), rel=1e-15)


def test_operator_clay_arm_and_sampling():
    th = params.Operator()
    assert (th.mass, th.damper, th.spring) == (0.25, 2.0, 6.0)
    assert (params.L1, params.L2, params.TS) == (0.24, 0.35, 0.36e-3)
    assert (params.C_POLE, params.B_CONSTANT, params.CLAY_X, params.PATH_LENGTH) == (10.0, 90.0, (0.05, 0.15), 0.20)


def test_path_is_centred_on_the_nominal_pose():
    assert params.ORIGIN == pytest.approx((params.L2 - params.PATH_LENGTH / 2, params.L1), abs=1e-16)


@pytest.mark.parametrize("number", ["41.8", "30.3", "79.19", "13.1", "41.1", "432.0", "32.4", "492.46", "0.36e-3"])
def test_a_printed_number_is_typed_once(number):
    typed = 0
    for file in SOURCE.parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, float):
                typed += node.value == float(number)
    assert typed == 1
