"""What a user sees of a run of an arm from a file: figures, table, energy, information."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.views import record_plots, run_figures

NAMES = ("planar_2r", "haptic_3", "five_bar", "leader_7")


def scenario(name, **more):
    arm = hc.MjcfArm(name, **more.pop("arm", {}))
    n = len(arm.names)
    law = hc.JointPD(Kp=(8.0,) * n, Kd=(0.2,) * n, reference=tuple(arm.q + 0.01))
    given = {"Ts": 1e-3, "t_max": 0.1, "operator": hc.Operator()} | more
    return hc.Scenario(name=name, arm=arm, controller=law, **given)


@pytest.fixture(scope="module", params=NAMES)
def record(request):
    return hc.simulate(scenario(request.param))


def test_joints_against_reference(record):
    figure, n = record.plot(), len(record.scenario.joints)
    assert len(figure.axes) == 3 * n
    for j in range(n):
        for ax, x in zip(figure.axes[3 * j :], (record.q, record.qd, record.tau), strict=False):
            np.testing.assert_array_equal(ax.lines[0].get_ydata(), x[:, j])
        pulled = figure.axes[3 * j].lines[1]
        assert pulled.get_ydata()[0] == record.scenario.controller.reference[j]
        assert figure.axes[3 * j].get_ylabel() == record.scenario.joints[j]


def test_torque_limits_are_drawn_where_torques_come_near():
    s = scenario("planar_2r", arm={"torque_limit": (0.1, 1e3)})
    figure = hc.simulate(s).plot.joints()
    assert [len(figure.axes[i].lines) for i in (2, 5)] == [3, 1]
    assert figure.axes[2].lines[1].get_ydata()[0] == -0.1


def test_handle_and_path_have_its_axes(record):
    axes = len(record.scenario.axes)
    assert len(record.plot.handle().axes) == 3 * axes
    path = record.plot.path()
    assert len(path.axes) == axes - 1
    for ax in path.axes:
        low, high = np.sort(ax.get_xlim())
        x = ax.lines[0].get_xdata()
        assert low < x.min() and x.max() < high


def test_figures_of_the_command_and_their_numbers(record):
    assert set(record.plot.all()) == {"joints", "handle", "path"}
    samples = run_figures.run_tables(record, "joints")["samples"]
    first = record.scenario.joints[0]
    np.testing.assert_array_equal(samples[f"tau_{first} [N.m]"], record.tau[:, 0])
    assert len(samples) == 1 + 3 * len(record.scenario.joints)


def test_energies_balance_as_the_run_adds_them_up(record):
    """Trapezoids over samples of a third of a millisecond, in torques that step at each Ts: 3 %."""
    found, total = record_plots.energies(record), record_plots._added_up(record)
    through = record.energy["throughput"]
    assert through > 0.0 and abs(record.energy["residual"]) < 1e-3 * through
    for name, value in total.items():
        assert found[name][-1] == pytest.approx(value, abs=0.03 * through), name
    gained = record.energy["kinetic"]
    assert found["stored"][-1] == pytest.approx(gained, abs=1e-3 * through)
    lost = record.energy["joint_dampers"] + record.energy.get("friction", 0.0)
    assert found["joints"][-1] == pytest.approx(lost, abs=0.03 * through)
    record.plot.energy()


def test_clay_in_the_plane_is_drawn_under_the_path():
    clay = hc.slab(20.0, 0.0005, 0.1)
    record = hc.simulate(scenario("planar_2r", clay=clay, operator=None))
    assert {"joints", "handle", "path", "velocity", "force"} <= set(record.plot.all())
    assert record.plot.path().axes[0].patches


def test_a_run_from_a_file_writes_figures_and_a_table(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    s = scenario("planar_2r")
    s.save("arm.toml")
    assert main(["run", "arm.toml", "--out", "a", "--data"]) == 0
    text = capsys.readouterr().out
    assert "shoulder" in text and "largest torque" in text and "path" not in text
    assert {x.name for x in (tmp_path / "a").glob("*.png")} == {
        "joints.png",
        "handle.png",
        "path.png",
    }
    assert main(["info", "a"]) == 0
    assert "planar_2r: shoulder, elbow" in capsys.readouterr().out
    again = hc.Record.load("a")
    np.testing.assert_array_equal(again.q, hc.simulate(s).q)


def test_other_laws_have_no_reference():
    def law(t, q, qd, fh, state, params):
        return (-q[0] - qd[0], -q[1] - qd[1]), state

    s = dataclasses.replace(scenario("planar_2r"), controller=hc.Controller(law))
    figure = hc.simulate(s).plot()
    assert len(figure.axes[0].lines) == 1
