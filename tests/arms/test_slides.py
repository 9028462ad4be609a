"""Joints that slide: counts a metre, and units."""

import mujoco
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app

LIFT = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="lift" type="slide"
axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{}<site name="h" pos="0.1 0 0"/>
</body></worldbody></mujoco>"""
TURN = """<body><joint name="turn" axis="0 0 1"/><inertial pos="0.1 0 0" mass="0.5"
diaginertia="0.01 0.01 0.01"/></body>"""


def lift(inner=""):
    return hc.MjcfArm(mujoco.MjSpec.from_string(LIFT.format("")))


def lift_and_turn():
    text = LIFT.format(TURN)
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), joints=["lift", "turn"])


def seen_by_a_law(arm, **hardware):
    """Joint positions that a law of one's own is handed, and those at the same samples."""
    seen = []

    def law(t, q, qd, fh, state, params):
        seen.append(q)
        return tuple(0.3 + 0.0 * x for x in q), state

    run = hc.simulate(
        hc.Scenario(
            arm=arm,
            controller=hc.Controller(law),
            Ts=1e-2,
            dt=1e-2,
            t_max=0.5,
            hardware=hc.Hardware(**hardware),
            stop_when_unstable=False,
        ),  # fmt: skip
        engine="python",
    )
    n = min(len(seen), len(run.q))
    return np.array(seen[:n]), run.q[:n]


def test_a_linear_encoder_reads_whole_counts_of_a_length():
    seen, q = seen_by_a_law(lift(), linear_encoder="2 1/mm")
    np.testing.assert_allclose(seen * 2000, np.round(q * 2000), atol=1e-9)
    assert np.ptp(q) > 0.01  # far beyond a count


def test_each_kind_of_joint_has_counts_of_its_own():
    seen, q = seen_by_a_law(lift_and_turn(), linear_encoder=500.0, encoder=360)
    step = np.array([1 / 500, 2 * np.pi / 360])
    np.testing.assert_allclose(seen / step, np.round(q / step), atol=1e-9)
    exact, q = seen_by_a_law(lift_and_turn(), linear_encoder=0.0, encoder=360)
    np.testing.assert_array_equal(exact[:, 0], q[:, 0])


def scene(arm, **hardware):
    n = len(arm.names)
    law = hc.JointPD((1.0,) * n, (1.0,) * n)
    return hc.Scenario(arm=arm, controller=law, Ts=1e-3, hardware=hc.Hardware(**hardware))


@pytest.mark.parametrize(
    ("arm", "hardware", "words"),
    [
        (lift, dict(encoder=4096), "and lift slides: give counts a metre as hardware.linear_enc"),
        (lift_and_turn, dict(encoder=4096), "and lift slides: give counts a metre"),
        (lift, dict(encoder=4096, linear_encoder=1e5), "encoder = 4096: must be None: no joint tu"),
        (lambda: hc.MjcfArm("planar_2r"), dict(linear_encoder=1e5), "None: no joint slides"),
        (lift_and_turn, dict(linear_encoder=(1e5, 1e5)), "each of 1 joints that slide"),
        (lift_and_turn, dict(encoder=(99, 99), linear_encoder=0.0), "each of 1 joints that turn"),
        (lift, dict(linear_encoder="5 m"), "linear_encoder = '5 m': must be a number in 1/m"),
    ],
)  # fmt: skip
def test_counts_that_do_not_fit_the_joints_are_refused(arm, hardware, words):
    with pytest.raises(hc.ParameterError, match=words):
        scene(arm(), **hardware)


def test_the_arms_of_a_pair_have_them_too():
    law, arm = hc.JointPD((50.0,), (2.0,), velocity="difference"), lift()
    fine = hc.Hardware(linear_encoder="100 1/mm")
    pair = hc.Pair(arm, arm, law, leader_hardware=fine, Ts=1e-3, t_max=0.05)
    assert len(hc.simulate(pair).t) == 50
    with pytest.raises(hc.ParameterError, match="pair.leader_hardware.encoder = 4096.*lift slides"):
        hc.Pair(arm, arm, law, leader_hardware=hc.Hardware(encoder=4096))


def test_counts_are_written_and_read_with_their_unit(tmp_path):
    (tmp_path / "arm.xml").write_text(LIFT.format(TURN))
    arm = hc.MjcfArm(str(tmp_path / "arm.xml"), joints=["lift", "turn"])
    s = scene(arm, encoder=4096, linear_encoder="20 1/um")
    s.save(tmp_path / "scene.toml")
    assert hc.Scenario.load(tmp_path / "scene.toml").hardware == s.hardware
    assert "linear encoder 2e+07 counts per metre" in str(s)


def heads(table):
    return {head.partition(" [")[2].removesuffix("]") for head in table} - {""}


TURNS = {"N.m/rad", "N.m.s/rad", "Hz"}
UNITS = {
    "turn": (lambda: hc.MjcfArm("planar_2r"), TURNS),
    "slide": (lift, {"N/m", "N.s/m", "Hz"}),
    "both": (lift_and_turn, {"N.m/rad or N/m", "N.m.s/rad or N.s/m", "Hz"}),
}


@pytest.mark.parametrize("kind", UNITS)
def test_tables_have_the_units_of_their_joints(kind):
    make, units = UNITS[kind]
    arm = make()
    n = len(arm.names)
    found = hc.theory.joint_limits(arm, hc.JointPD((50.0,) * n, (2.0,) * n), 1e-3)
    table = found.tables()["joints"]
    assert heads(table) == units
    assert list(table["joint"])[0] == ("lift (slides)" if kind == "both" else arm.names[0])
    printed = found.text().splitlines()[:2]
    assert all(any(unit in line for line in printed) for unit in units)
    pair = hc.Pair(arm, arm, hc.JointPD((50.0,) * n, (2.0,) * n))
    assert heads(hc.theory.pair_limits(pair).tables()["joints"]) == {x for x in units if "s/" in x}


def test_a_run_is_shown_in_the_units_of_its_joints(capsys, tmp_path):
    (tmp_path / "arm.xml").write_text(LIFT.format('<geom size="0.01"/>'))
    arm = hc.MjcfArm(str(tmp_path / "arm.xml"))
    law = hc.JointPD((50.0,), (2.0,), reference=(0.01,))
    scenario = hc.Scenario(arm=arm, controller=law, Ts=1e-3, t_max=0.1)
    assert app.main(["run", str(scenario.save(tmp_path / "s.toml")), "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "[m/s]" in shown and "[N]" in shown and "rad" not in shown


def test_counts_a_turn_of_friction_fed_to_a_slide_are_refused():
    law = hc.JointPD((50.0,), (2.0,), velocity="difference", friction=((1.0, 50.0, 0.0),))
    with pytest.raises(hc.ParameterError, match="counts = 4096: .* they are a turn, and lift slid"):
        hc.theory.friction_cycle(lift(), law, 1e-3, counts=4096)
    found = hc.theory.friction_cycle(lift(), law, 1e-3)
    assert "rests within [m]" in found.tables()["joints"]
