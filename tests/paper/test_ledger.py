"""Every number the paper prints stands once in params.py, and is what the paper printed."""

from pathlib import Path

import pytest

from hapticclay.model import constants, operator
from hapticclay.paper import ledger, report
from hapticclay.scene import scenario

SOURCE = Path(scenario.__file__)

PRINTED = {  # as printed, Eqs. 14-28 and Secs. 4, 4.1
    "Gx": (constants.G[0], (910.19, 41.8, 910.19)),
    "Gy": (constants.G[1], (765.5, 30.3, 765.5)),
    "Sx": (constants.S[0], (0.7919, 41.1, 432.0)),  # 79.19 cm/N
    "Sy": (constants.S[1], (0.131, 32.4, 492.46)),  # 13.1 cm/N
}


@pytest.mark.parametrize("name", PRINTED)
def test_transfer_functions(name):
    block, (gain, damping, stiffness) = PRINTED[name]
    assert (block.gain, block.damping, block.stiffness) == pytest.approx(
        (gain, damping, stiffness), rel=1e-15
    )


def test_operator_clay_arm_and_sampling():
    th = operator.Operator()
    assert (th.mass, th.damper, th.spring) == (0.25, 2.0, 6.0)
    assert (constants.L1, constants.L2, constants.TS) == (0.24, 0.35, 0.36e-3)
    assert (constants.B_VARIABLE, constants.BORDER, constants.COUNTERWEIGHT) == (
        (50.0, 100.0),
        0.05,
        (1.0, 45.0),
    )
    assert (constants.GROWTH, constants.GROWTH_EQ25, constants.B_STABILITY) == (30.0, 0.15, 100.0)
    assert (constants.GAINS_FIG11, constants.GAIN_LIMIT_PRINTED) == ((2.0, 3.0, 25.0), 5.0)
    assert (constants.C_POLE, constants.B_CONSTANT, constants.CLAY_X, constants.PATH_LENGTH) == (
        10.0,
        90.0,
        (0.05, 0.15),
        0.20,
    )


def test_path_is_centred_on_the_nominal_pose():
    assert constants.ORIGIN == pytest.approx(
        (constants.L2 - constants.PATH_LENGTH / 2, constants.L1), abs=1e-16
    )


def test_docs_paper_is_what_the_ledger_gives(ledger_rows):
    page = Path(scenario.__file__).parents[2] / "docs" / "paper.md"
    assert page.read_text() == report.paper_page(ledger_rows), (
        "make docs/paper.md anew: hapticclay reproduce --page docs/paper.md"
    )


def test_every_row_that_should_agree_does(ledger_rows):
    wrong = [(r.what, r.error) for r in ledger_rows if r.agrees is False]
    assert not wrong
    assert sum(r.agrees is True for r in ledger_rows) > 40
    assert {r.status for r in ledger_rows} == set(ledger.STATUSES)


@pytest.mark.parametrize(
    "words",
    [  # each disagreement of the paper with itself has a row with evidence
        "90 N-s/cm",
        "10 N-s/cm",
        "approach zero",
        "100 + 30t",
        "100 + 0.15t",
        "18-20 cm",
        "should not exceed 5C",
        "a steady cut",
        "25",
        "force in x, position y",
    ],
)
def test_each_contradiction_has_its_row(words, ledger_rows):
    mine = [r for r in ledger_rows if words in r.printed]
    assert mine and all(len(r.reason) > 15 for r in mine)
