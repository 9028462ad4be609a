"""The boundary found by runs against the exact one.

The growth that it is read from against known modes.
"""

import functools
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.model.constants import SecondOrder
from hapticclay.model.operator import Operator
from hapticclay.studies import boundary, growth, stability_map
from hapticclay.theory import gain_crossings, wall_limits
from hapticclay.views import stability_map_plots
from tests.oracles import Linear

TH = Operator()
Loop = functools.partial(boundary.PushedLoop, operator=TH)


@pytest.fixture(autouse=True, scope="module")
def few_points():
    """Lines of theory with few points: what is tested of them is at the columns of runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability_map, "LINE_POINTS", 4)
        yield


@settings(max_examples=10)
@given(
    st.floats(-2.0, 2.0), st.floats(20.0, 2000.0), st.floats(-30.0, -8.0), st.floats(0.0, math.tau)
)
def test_growth_is_that_of_the_least_damped_mode(sigma, omega, fast, phase):
    t = np.arange(1250) * 1e-3
    omega = min(omega, 0.9 * math.pi / 1e-3)
    v = (
        np.exp(sigma * t) * np.cos(omega * t + phase)
        + 3.0 * np.exp(fast * t)
        + 0.2 * np.exp(-0.06 * t)
    )
    rec = SimpleNamespace(
        t=t, v=np.column_stack((v, v)), scenario=SimpleNamespace(dt=1e-3), outcome=None
    )
    assert growth.growth_rate(rec, "x") == pytest.approx(
        sigma, abs=1e-3
    )  # the mode above it starts 30 times as large


def test_growth_sees_half_the_sampling_frequency():
    t = np.arange(1250) * 1e-3
    v = 1.0005 ** np.arange(1250) * (-1.0) ** np.arange(1250)
    rec = SimpleNamespace(
        t=t, v=np.column_stack((v, v)), scenario=SimpleNamespace(dt=1e-3), outcome=None
    )
    assert growth.growth_rate(rec, "y") == pytest.approx(math.log(1.0005) / 1e-3, rel=1e-6)


@pytest.mark.parametrize("late", range(1, 22, 2))
def test_a_sample_that_is_off_near_the_end_is_no_growth(late):
    """Its mode grows by up to 1e300 within the samples, and hides no other for that."""
    t = np.arange(1250) * 1e-3
    v = 1.5 + 0.39 * np.exp(-0.844 * t) * np.cos(51.7 * t)
    v[-late - 1] += 1e-5  # a tenth of what is taken for a mode
    rec = SimpleNamespace(
        t=t, v=np.column_stack((v, v)), scenario=SimpleNamespace(dt=1e-3), outcome=None
    )
    assert growth.growth_rate(rec, "x") == pytest.approx(-0.844, abs=1e-5)


@pytest.mark.parametrize("K", [2.0, 4.5])
def test_growth_of_a_run_is_the_rightmost_oscillating_pole(K):
    r = hc.simulate(Loop(K=K).scenario())
    poles = Linear(0, 90.0, K, 0.0, (0.25, 2.0, 6.0)).poles()
    pole = poles[np.abs(poles.imag) > 1.0].real.max()
    assert growth.growth_rate(r, "x") == pytest.approx(
        pole, abs=2e-3
    )  # second order: (omega dt)^2/12 of omega


@pytest.mark.parametrize("axis", ["x", "y"])
def test_boundary_of_the_shaped_arm_is_within_2_percent_of_the_exact_one(axis):
    found = boundary.simulated_gain(
        Loop(axis=axis), guess=3.0 if axis == "x" else 1.0
    )  # not told where
    assert found == pytest.approx(
        hc.theory.gain_limit(axis, 90.0, TH), rel=3e-3
    )  # CLOSE, and the step


def test_boundary_of_the_sampled_arm():
    exact = hc.theory.gain_limit("x", 90.0, TH, Ts=2e-3)
    assert boundary.simulated_gain(Loop(Ts=2e-3)) == pytest.approx(exact, rel=5e-3)
    assert (
        abs(exact / hc.theory.gain_limit("x", 90.0, TH) - 1.0) > 0.1
    )  # it would tell the two apart


def test_boundary_with_a_delay_and_no_hand():
    loop = Loop(axis="y", operator=None, Ts=2e-3, delay=3e-3)
    exact = hc.theory.gain_limit("y", 90.0, Ts=2e-3, delay=3e-3)
    assert boundary.simulated_gain(loop) == pytest.approx(exact, rel=5e-3)


def test_without_shaping_the_gap_is_that_of_the_pose():
    loop = Loop(inertia_shaping=False, pose=(0.10, 0.0))
    exact = boundary.pose_limit(loop)
    found = boundary.simulated_gain(loop, exact)
    nominal = hc.theory.gain_limit("x", 90.0, TH)
    assert found == pytest.approx(exact, rel=5e-3) and found < 0.7 * nominal
    assert boundary.pose_limit(replace(loop, inertia_shaping=True)) == pytest.approx(
        nominal, rel=1e-6
    )
    assert boundary.pose_limit(replace(loop, pose=(0.0, 0.0))) == pytest.approx(nominal, rel=1e-6)


@pytest.mark.parametrize("delay", [0.0, 7e-4, 2e-3, 5e-3])
def test_sampled_loop_at_a_pose(delay):
    loop = Loop(Ts=2e-3, delay=delay, pose=(0.10, 0.0))
    for operator in (TH, None):
        exact = hc.theory.gain_limit("x", 90.0, operator, Ts=2e-3, delay=delay)
        for shaping in (True, False):
            nominal = replace(loop, operator=operator, pose=(0.0, 0.0), inertia_shaping=shaping)
            assert boundary.pose_limit(nominal) == pytest.approx(
                exact, rel=1e-9
            )  # both are found to 1e-10
    assert boundary.pose_limit(loop) == pytest.approx(boundary.simulated_gain(loop), rel=5e-3)
    loop = replace(loop, inertia_shaping=False)
    exact = boundary.pose_limit(loop)
    assert exact < 0.8 * hc.theory.gain_limit("x", 90.0, TH, Ts=2e-3, delay=delay)
    assert boundary.simulated_gain(loop, exact) == pytest.approx(exact, rel=5e-3)


def test_pose_matrix_has_the_poles_of_both_axes_where_they_are_decoupled():
    A = boundary.pose_matrix(Loop(K=2.0, inertia_shaping=False))
    parts = [Linear(i, 90.0, K, 0.0, (0.25, 2.0, 6.0)).poles() for i, K in ((0, 2.0), (1, 0.0))]
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(A)), np.sort_complex(np.concatenate(parts)), atol=1e-6
    )


def test_crossing_by_bisection_alone_and_where_there_is_none():
    assert boundary.find_crossing(
        lambda x: -1.0 if x < 7.3 else math.inf, 1.0, 100.0
    ) == pytest.approx(7.3, rel=2e-3)
    assert boundary.find_crossing(lambda x: x - 0.2, 5.0, 100.0) == pytest.approx(0.2, rel=2e-3)
    assert boundary.find_crossing(lambda x: -1.0, 1.0, 100.0) == math.inf
    assert boundary.find_crossing(lambda x: 1.0, 1.0, 100.0) == 0.0


@pytest.mark.parametrize("K,said", [(2.0, "stable"), (12.0, "limit cycle")])
def test_divergence_and_limit_cycles_are_told_apart(K, said):
    assert boundary.classify_run(Loop(K=K, push=boundary.LARGE_PUSH)) == said


def test_a_slow_growth_is_still_a_divergence():
    assert boundary.classify_run(Loop(K=4.2, push=1e-5)) == "diverges"


def saturating(K, share):
    """Rightmost pole of the y axis, b = 90 with the hand, whose motors give but a share of what
    they are asked for.
    """
    s = np.poly1d([1.0, 0.0])
    D, C, T = s**2 + 32.4 * s + 492.46, s * (s + 10.0), 0.25 * s**2 + 92.0 * s + 6.0
    Dg = s**2 + 30.3 * s + 765.5
    asked = C * Dg * (32.4 * s + 492.46) + D * 765.5 * K * T
    return (C * Dg * (s**2 + 0.131 * T) + share * asked).roots.real.max()


SHARES = np.linspace(0.02, 1.0, 99)


def test_motors_in_their_limits_make_a_limit_cycle_of_a_loop_that_is_stable():
    """K = 0.84 is stable in the linear loop, but not with motors that give 0.5 to 0.9 of it.

    A large push stays.
    """
    loop = Loop("y", K=0.84, push=0.05, torque_limit=(0.5, 0.5))
    assert saturating(0.84, 1.0) < 0.0 < max(saturating(0.84, n) for n in SHARES)
    assert boundary.continuous_stable(loop) and boundary.classify_run(loop) == "limit cycle"
    assert boundary.explain_disagreement(loop, False) == "saturation"
    assert boundary.classify_run(replace(loop, torque_limit=(40.0, 40.0))) == "stable"
    assert boundary.classify_run(replace(loop, push=1e-4)) == "stable"


def test_motors_that_leave_their_limits_late_are_no_divergence():
    """K = 0.8 is stable whatever share of it the motors give."""
    assert max(saturating(0.8, n) for n in SHARES) < 0.0
    assert boundary.classify_run(Loop("y", K=0.8, push=0.05, torque_limit=(1.2, 1.2))) == "stable"


def test_causes():
    push = dict(push=boundary.LARGE_PUSH)
    assert (
        boundary.explain_disagreement(
            Loop(K=2.8, inertia_shaping=False, pose=(0.1, 0.0), **push), False
        )
        == "pose-dependent Lambda"
    )
    Ts = 4e-3
    K = 0.5 * (hc.theory.gain_limit("x", 90.0, TH) + hc.theory.gain_limit("x", 90.0, TH, Ts=Ts))
    assert boundary.explain_disagreement(Loop(K=K, Ts=Ts, **push), False) == "sampling"
    both = Loop(K=K, Ts=Ts, inertia_shaping=False, pose=(0.1, 0.0), **push)
    assert boundary.explain_disagreement(both, False) == "sampling and pose-dependent Lambda"
    K = 0.5 * sum(hc.theory.gain_limit("x", 90.0, TH, Ts=1e-3, delay=d) for d in (0.0, 4e-3))
    assert boundary.explain_disagreement(Loop(K=K, Ts=1e-3, delay=4e-3, **push), False) == "delay"


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(axis="z"), "axis"),
        (dict(K=0.0), "K"),
        (dict(delay=1e-3), "delay"),
        (dict(b=-1.0), "b"),
        (dict(pose=(0.0,)), "pose"),
    ],
)
def test_bad_loops_are_refused(kw, field):
    with pytest.raises(ParameterError) as e:
        Loop(**kw)
    assert e.value.field == field


# ---- maps ----------------------------------------------------------------------------------------
# ----------------


@pytest.mark.parametrize("make", [stability_map._gain_damping, stability_map._delay_damping])
def test_maps_of_damping_hold_the_limit_of_their_loop(make):
    """By runs within 0.2 % of the exact line of the same loop (boundary.BRACKET), and the engine's
    steps; every cell is as the line says."""
    found = make(Loop(), 2, 2, iter)
    assert found.gap() < 3e-3
    (xs, limits), *_ = found.found.values()
    for cell in found.cells:
        limit = limits[xs.index(cell.x)]
        assert (cell.simulated == "stable") == (cell.y < limit), cell


@pytest.fixture(scope="module")
def poses():
    return stability_map._gain_pose(Loop(inertia_shaping=False), 2, 3, iter)


def test_map_of_poses_agrees_with_the_linear_loop_at_each_and_names_the_cause(poses):
    assert poses.gap() < 0.02
    wrong = [c for c in poses.cells if c.cause]
    assert wrong and {c.cause for c in wrong} == {"pose-dependent Lambda"}
    for c in poses.cells:
        assert (c.cause == "") == (c.theory == (c.simulated == "stable"))
        exact = np.interp(c.x, *poses.lines["linear loop at this pose, continuous time"])
        assert (c.simulated == "stable") == (c.y < exact)


def test_picture_shows_the_map_with_units(poses, tmp_path):
    figure = stability_map_plots.stability_map_plot(poses)
    ax = figure.axes[0]
    assert "[cm]" in ax.get_xlabel() and "[1/kg]" in ax.get_ylabel()
    shown = {line.get_label(): line for line in ax.lines}
    np.testing.assert_allclose(shown["boundary found by runs"].get_ydata(), poses.found["runs"][1])
    np.testing.assert_allclose(shown["boundary found by runs"].get_xdata(), [-10.0, 10.0])
    ringed = shown["differs from the nominal continuous loop"]
    assert len(ringed.get_xdata()) == sum(bool(c.cause) for c in poses.cells)
    figure.savefig(tmp_path / "a.png")


def hatched(figure):
    return [c for c in figure.axes[0].collections if c.get_hatch()]


@pytest.mark.parametrize("x,factor", [(-0.1, 0.9), (-0.1, 1.1), (0.1, 0.9), (0.1, 1.1)])
def test_picture_hatches_gains_above_the_limit_of_the_loop_of_the_runs(poses, x, factor):
    """The limit at both ends of the path is worked out anew, for the loop that the runs are of."""
    (area,) = hatched(stability_map_plots.stability_map_plot(poses))
    K = factor * boundary.pose_limit(replace(Loop(inertia_shaping=False), pose=(x, 0.0)))
    inside = 0.999 * 100.0 * x  # [cm], just within the edge
    assert area.get_paths()[0].contains_point((inside, K)) == (factor > 1.0)
    assert area.get_label() == "gain margin < 1"


def test_picture_hatches_nothing_where_nothing_is_unstable(poses):
    endless = {name: (x, [math.inf] * len(x)) for name, (x, _) in poses.lines.items()}
    (area,) = hatched(stability_map_plots.stability_map_plot(replace(poses, lines=endless)))
    assert np.ptp(area.get_paths()[0].vertices[:, 1]) == 0.0
    assert not hatched(stability_map_plots.stability_map_plot(replace(poses, limit="")))


def test_smallest_unstable_damping_is_where_the_gain_limit_is_the_gain():
    Ts, delay = 1e-3, 2e-3
    b = stability_map._unstable_damping(Loop(), Ts, delay)
    loop = hc.theory.Loop("x", operator=TH, K=1.0, Ts=Ts, delay=delay)
    assert gain_crossings.is_stable(replace(loop, b=0.999 * b))
    assert not gain_crossings.is_stable(replace(loop, b=1.001 * b))
    assert (
        stability_map._unstable_damping(Loop(), 2e-3, 0.032) == 0.0
    )  # the servo itself does not bear it


def needed_damper(b, Ts, samples, n=4001):
    """Damper that held, late clay needs: Colgate's and Schenkel's condition with the worst middle.

    Between two samples the force changes once, after the delay's fraction. The hand may choose the
    path between them, so the energy of a period is minimised over the place of the device there:
    a quadratic in one complex number, for each frequency.
    """
    whole, part = divmod(samples, 1.0)
    theta = np.linspace(0.0, math.pi, n)[1:]
    z = np.exp(1j * theta)
    H = b * (1.0 - 1.0 / z) / Ts * z**-whole
    # path 0 at the sample, m after part Ts, z at the next: forces H/z until then, H after
    share = np.array([part, 1.0 - part]) * Ts
    low, high = np.zeros(len(theta)), np.full(len(theta), 10.0 * b + 1.0)
    for _ in range(60):  # least damper d with Re energy >= 0 at the best m, by bisection
        d = 0.5 * (low + high)
        # energy = d |m - 1|^2/s0 + d |z - m|^2/s1 + Re{conj(H/z)(m - 1) + conj(H)(z - m)}
        curve = d / share[0] + d / share[1]
        linear = d / share[0] + d * z / share[1] + 0.5 * (H - H / z)
        rest = d / share[0] + d / share[1] + (-(H / z).conj() + H.conj() * z).real
        energy = rest - np.abs(linear) ** 2 / curve
        low, high = np.where(energy < 0.0, d, low), np.where(energy < 0.0, high, d)
    return high.max()


@pytest.mark.parametrize("samples", [0.3, 0.5, 0.9, 1.5, 2.7, 3.0])
def test_late_held_clay_is_passive_up_to_the_line_of_the_map(samples):
    Ts, damper = 1e-3, 2.0
    wall = hc.VirtualWall(device=hc.Device(damper=damper), Ts=Ts, delay=samples * Ts)
    b = wall_limits.passive_damping_limit(wall)
    if samples % 1.0:
        # the grid of 4000 frequencies misses the peak by a share of (pi/4000)^2
        assert needed_damper(b, Ts, samples) == pytest.approx(damper, rel=1e-5)
    else:
        theta = np.linspace(0.0, math.pi, 4001)[1:]
        z = np.exp(1j * theta)
        need = 0.5 * Ts / (1 - np.cos(theta)) * ((1 - 1 / z) ** 2 * b / Ts * z**-samples).real
        assert need.max() == pytest.approx(damper, rel=1e-5)
    for factor in (0.999, 1.001):
        v = hc.theory.clay_passivity(factor * b, Ts, damper, delay=samples * Ts)
        assert bool(v) == (factor < 1.0)


def test_command_prints_verdicts_and_writes_them(tmp_path, capsys, monkeypatch):
    def small(kind, loop, quick, progress):
        return stability_map._gain_pose(replace(loop, Ts=None, delay=0.0), 2, 3, progress)

    monkeypatch.setattr(stability_map, "stability_map", small)
    monkeypatch.setattr(
        boundary, "simulated_gain", lambda loop, guess=None: boundary.pose_limit(loop)
    )
    monkeypatch.setattr(
        boundary,
        "classify_run",
        lambda loop: "stable" if loop.K < boundary.pose_limit(loop) else "diverges",
    )
    args = "stability --gain 0.5 --delay 1e-3 --map gain-pose --out".split() + [str(tmp_path / "o")]
    assert app.main(args) == 0
    out = capsys.readouterr().out
    assert (
        "sampled every 0.36 ms" in out
        and f" {hc.theory.gain_limit('x', 90.0, TH):.4g}  largest stable K" in out
    )
    assert "1 ms late" in out and "pose-dependent Lambda" in out and "Eq. 13" in out
    assert max(len(line) for line in out.partition("boundary found")[0].splitlines()) <= 80
    data = json.loads((tmp_path / "o" / "stability.json").read_text())
    assert data["map"]["kind"] == "gain-pose" and len(data["verdicts"]) > 10
    assert data["asked"] == {
        "axis": "x",
        "b": 90.0,
        "K": 0.5,
        "operator": {"mass": 0.25, "damper": 2.0, "spring": 6.0},
        "compensator": {"num": [1.0], "den": [1.0, 10.0, 0.0]},
        "servo": {
            "G": {"gain": 910.19, "damping": 41.8, "stiffness": 910.19},
            "S": {"gain": 0.7919, "damping": 41.1, "stiffness": 432.0},
        },
        "Ts": 0.36e-3,
        "delay": 1e-3,
        "inertia_shaping": False,
        "map": "gain-pose",
        "quick": False,
    }
    limits = [r["value"] for r in data["verdicts"] if r["what"] == "largest stable K"]
    kinds = ({}, {"Ts": 0.36e-3}, {"delay": 1e-3}, {"Ts": 0.36e-3, "delay": 1e-3})
    assert limits == pytest.approx(
        [hc.theory.gain_limit("x", 90.0, TH, **kw) for kw in kinds], rel=1e-12
    )  # whatever K
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == ["gain-pose.png", "stability.json"]


def test_command_takes_a_compensator_and_a_servo_as_numbers(capsys, tmp_path):
    words = "stability --b 50 --gain 0.5 --num 1 20 --den 1 40 0 --inertia-shaping --Ts 1e-3"
    words += " --G 800 40 900 --S 0.5 40 400 --out"
    assert app.main([*words.split(), str(tmp_path)]) == 0
    capsys.readouterr()
    rows = json.loads((tmp_path / "stability.json").read_text())["verdicts"]
    servo = hc.Servo(SecondOrder(800.0, 40.0, 900.0), SecondOrder(0.5, 40.0, 400.0))
    c = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    loop = hc.theory.Loop("x", 50.0, TH, servo, c, 0.5)
    bare = hc.Arm().nominal_mobility[0]
    limits = [r["value"] for r in rows if r["what"] == "largest stable K"]
    sampled = hc.theory.gain_limit(replace(loop, Ts=1e-3, mobility=bare))
    assert limits[1] == pytest.approx(sampled, rel=1e-12)
    found = {r["question"]: r["value"] for r in rows}
    assert found["phase margin"] == pytest.approx(
        math.degrees(hc.theory.margins(loop).phase), rel=1e-12
    )
    assert app.main(["stability", "--num", "1", "2", "3", "4", "--out", str(tmp_path)]) == 2
    assert "compensator.num" in capsys.readouterr().err


SERVO = hc.Servo(SecondOrder(900.0, 45.0, 900.0), SecondOrder(0.6, 38.0, 500.0))
ARM = hc.Arm(0.3, 0.32, 0.09, 0.7)


@pytest.mark.parametrize(
    "kw",
    [
        dict(compensator=hc.Compensator((3.0, 60.0), (1.0, 60.0, 500.0, 0.0)), b=50.0),
        dict(
            compensator=hc.Compensator((0.2, 1.0), (1.0, 8.0)), servo=SERVO, operator=None, b=20.0
        ),
        dict(servo=SERVO, arm=ARM, inertia_shaping=False, pose=(0.05, 0.0)),
        dict(servo=SERVO, arm=ARM, Ts=2e-3, delay=1e-3),
        dict(compensator=hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0)), Ts=2e-3),
    ],
)
def test_boundary_of_runs_of_other_parts_is_the_exact_one(kw):
    loop = Loop(**kw)
    exact = boundary.pose_limit(loop, 1e4)
    if "pose" not in kw:
        assert exact == pytest.approx(boundary.nominal_limit(loop), rel=1e-6)
    assert boundary.simulated_gain(loop, exact, 1e4) == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(
    "gain,stable", [("0.8604", True), ("0.8606", False)]
)  # its limit is 0.8605
def test_command_gives_margins_and_transparency_of_stable_loops_only(
    gain, stable, tmp_path, capsys
):
    args = ["stability", "--axis", "y", "--gain", gain, "--out", str(tmp_path)]
    assert app.main(args) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = json.loads((tmp_path / "stability.json").read_text())["verdicts"]
    assert rows[0]["answer"] is stable
    mine = [r for r in rows if "margin" in r["question"] or "transparency" in r["question"]]
    assert len(mine) == 5
    for r in mine:
        assert (r["value"] is None and r["omega"] is None) != stable, r
        shown = (
            next(x for x in lines if x.startswith(r["question"]))
            .removeprefix(r["question"])
            .split()
        )
        assert (shown[0] == shown[-1] == "-") != stable, shown


@pytest.mark.parametrize(
    "args,word",
    [
        (["--map", "gain"], "--map"),
        (["--b", "-1"], "b = -1"),
        (["--gain", "0"], "K = 0"),
        (["--axis", "z"], "--axis"),
    ],
)
def test_command_refuses_bad_input_in_one_line(args, word, tmp_path, capsys):
    assert app.main(["stability", *args, "--out", str(tmp_path / "o")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and word in err and not (tmp_path / "o").exists()
