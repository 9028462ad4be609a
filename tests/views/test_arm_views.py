"""What a user sees of a run of an arm from a file: figures, table, energy, information."""

import dataclasses

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli.app import main
from hapticclay.scene.text import scenario_rows
from hapticclay.studies.joint_runs import buzz
from hapticclay.views import film, record_plots, run_figures, sticks
from hapticclay.views.buzz_film import buzz_of
from hapticclay.views.film import FilmOptions
from tests.views.test_film import needs_gl

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


def test_sticks_join_joints_and_handle(record):
    arm = record.scenario.arm
    shown = arm.mechanism.sticks(arm.q)
    np.testing.assert_allclose(shown.handle, arm.handle(), atol=1e-12)
    ends = shown.segments.reshape(-1, 3)
    assert np.abs(ends - shown.handle).max(axis=1).min() < 1e-12  # a link ends at the handle
    gap = np.abs(shown.segments[:, 1] - shown.segments[:, 0]).max(axis=1)
    assert gap.max() > 0.05 and len(shown.joints) >= len(arm.names)


def test_links_of_a_stick_figure_keep_their_lengths():
    """Between joints without slides; the five-bar's closing ends meet to 1e-9 m."""
    for name in NAMES:
        arm = hc.MjcfArm(name)
        rng = np.random.default_rng(1)
        first = None
        for _ in range(3):
            shown = arm.mechanism.sticks(arm.q + rng.normal(0.0, 0.05, len(arm.names)))
            size = np.linalg.norm(np.diff(shown.segments, axis=1)[:, 0], axis=1)
            first = size if first is None else first
            np.testing.assert_allclose(size, first, atol=1e-9)


@needs_gl
def test_films_of_arms(record):
    shots = [x.copy() for x in film.frames(record, FilmOptions(size=(480, 320), speed=1.0))]
    assert shots[0].shape == (320, 480, 3) and len(shots) >= 3
    assert (shots[0] != shots[-1]).any(axis=-1).sum() > 100
    assert (shots[0].astype(int) @ [1, 0, -1] > 90).sum() > 20  # the handle is orange


@needs_gl
def test_a_buzz_is_slowed_and_magnified():
    law = hc.JointPD((20.0, 10.0), (0.3, 0.1), velocity="difference")
    run, mode = buzz(hc.MjcfArm("planar_2r"), law, 1e-3, 1e-3)
    shown, options = buzz_of(run, mode.frequency)
    assert options.speed == pytest.approx(1.0 / mode.frequency)
    assert shown.t[-1] == pytest.approx(8.0 / mode.frequency, rel=1e-2)
    moved = options.magnify * np.abs(shown.q - np.median(shown.q, axis=0)).max()
    assert moved == pytest.approx(0.25)
    near, far = (
        next(film.frames(shown, FilmOptions(plots=False, magnify=x, size=(200, 160)))).copy()
        for x in (1.0, options.magnify)
    )
    assert (near != far).any()


def test_a_film_magnifies_arms_from_files_alone(tmp_path):
    with pytest.raises(hc.ParameterError, match="magnify = 2.0: must be 1 for the arm in closed"):
        film.stage_of(hc.simulate(hc.constant_cut(t_max=0.01)), FilmOptions(magnify=2.0))
    s = scenario("five_bar")
    apart = dataclasses.replace(s.controller, reference=tuple(s.arm.q + (0.01, -0.01)))
    wide = hc.simulate(dataclasses.replace(s, controller=apart))
    with pytest.raises(hc.ParameterError, match="magnify .*chains cannot be closed"):
        film.stage_of(wide, FilmOptions(magnify=100.0))


@pytest.mark.parametrize("render", ["held", "physical"])
def test_clay_in_the_plane_of_an_arm_that_moves_along_three_axes(render):
    """Figures of clay are those of the plane; what was removed is the path there times the tool."""
    clay = hc.slab(hc.Flow(Fy=0.5, b=10.0), 0.0005, 0.1)
    arm = {"plane": "zx", "friction": (0.0,) * 3}
    record = hc.simulate(scenario("haptic_3", arm=arm, clay=clay, render=render, operator=None))
    assert {"velocity", "force", "path", "force_velocity"} <= set(record.plot.all())
    flat = hc.studies.removed(record)[0]
    assert flat.shape == record.t.shape and flat[-1] > 0.0
    assert ("x and y", "z and x of the world") in scenario_rows(record.scenario)
    for axis in "xy":
        assert record.plot.velocity(axis).axes and record.plot.force(axis).axes


def test_what_needs_the_closed_form_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    s = scenario("planar_2r")
    s.save("a.toml")
    dataclasses.replace(s, name="b").save("b.toml")
    hc.simulate(s).save("record")
    for words, told in (
        (["compare", "a.toml", "b.toml"], "hapticclay arm judges arms from files"),
        (["impedance", "a.toml"], "hapticclay arm judges arms from files"),
        (["view", "./record"], "hapticclay video films arms from files"),
        (["view", "a.toml", "--web"], "control"),
    ):
        assert main(words) == 2
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1


def test_an_arm_that_is_one_point_has_a_room():
    """A slide that carries its handle has no links; cameras see it from some distance."""
    point = np.zeros((3, 3))
    model = sticks.room(point, point)
    for name in sticks.VIEWS:
        sticks.fit(model, name, point)
        assert np.linalg.norm(model.cam_pos[model.camera(name).id]) > 1e-3
