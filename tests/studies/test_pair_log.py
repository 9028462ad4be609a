"""Logs of a leader and its follower: exact steps of an axis, gains found again, files read."""

import functools
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.io import savemat

import hapticclay as hc
from benchmarks import recordings
from hapticclay.cli.app import main
from hapticclay.studies.coulomb_axis import Axis, stepper

TRUE = {"P": 12.0, "D": 0.11, "J": 1.6e-3, "b": 4e-3, "friction": 0.03, "offset": -0.008}
RIG = Path(os.environ.get("HAPTICCLAY_TUE", "nowhere"))  # a folder of the rig's public logs


def slid(axis, q, v, torque, h):
    """The same axis under SciPy, from stop to stop."""
    t = 0.0
    while t < h:
        push = torque - axis.offset
        if v == 0.0 and abs(push) <= axis.friction:
            return q, 0.0
        way = math.copysign(1.0, v or push)

        def slope(_, y, way=way, push=push):
            return [y[1], (push - way * axis.friction - axis.b * y[1]) / axis.J]

        def stop(t, y, begin=t, way=way):
            return 1.0 if t == begin else way * y[1]

        stop.terminal, stop.direction = True, -1.0
        s = solve_ivp(slope, (t, h), [q, v], "DOP853", rtol=1e-12, atol=1e-16, events=stop)
        t, (q, v) = s.t[-1], s.y[:, -1]
        v = 0.0 if s.status == 1 else v
    return q, v


@pytest.mark.parametrize("b", [0.0, 3e-3, 0.4])
def test_a_step_with_stops_and_turns_is_that_of_scipy(b):
    rng, axis = np.random.default_rng(1), Axis(1.5e-3, b, 0.03, 0.005)
    for _ in range(40):
        v, torque, h = rng.normal(0.0, 0.3), rng.normal(0.0, 0.08), rng.uniform(1e-4, 0.02)
        found = axis.step(0.1, v, torque, h)
        # integrator and event are good to 1e-11 of the ranges, 0.05 rad and 1 rad/s
        np.testing.assert_allclose(found, slid(axis, 0.1, v, torque, h), rtol=0.0, atol=5e-11)
        assert stepper(axis, h)(0.1, v, torque) == found


def test_an_axis_that_friction_holds_stays():
    assert Axis(1.0, 0.1, 0.5, 0.1).step(0.3, 0.0, 0.55, 1.0) == (0.3, 0.0)


@functools.cache
def synthetic(*, force_scale=None, late=0, link=0, T=5e-4, n=8000, k=0.0, noise=3e-4, seed=0):
    """A log of a known pair: fine steps of Euler, filter and delays by hand."""
    rng, t = np.random.default_rng(seed), T * np.arange(n)
    waves = [(0.09, 0.7, 0.0), (0.05, 1.9, 1.0), (0.02, 4.3, 2.0), (0.006, 9.0, 0.5)]
    leader = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in waves)
    p, led = 0.6 if not late else 0.0, leader.tolist()
    q, v, x, torques = led[0], 0.0, 0.0, [0.0] * (late + 1)
    follower, u_f, force = np.zeros(n), np.zeros(n), np.zeros(n)
    b, J, h, dry = TRUE["b"], TRUE["J"], T / 20, TRUE["friction"] * T / 20 / TRUE["J"]
    for i in range(n):
        follower[i], force[i] = q, k * q
        before, x = x, p * x + (1.0 - p) * (led[max(i - link, 0)] - q)
        torques.append(TRUE["P"] * x + TRUE["D"] * (x - before) / T)
        u_f[i] = pushed = torques[-1 - late]
        for _ in range(20):
            free = v + h * (pushed - TRUE["offset"] - k * q - b * v) / J
            v = math.copysign(max(abs(free) - dry, 0.0), free)
            q += h * v
    u_l = -u_f if force_scale is None else -force_scale * force
    u_l, u_f = (u + rng.normal(0.0, noise, n) for u in (u_l, u_f))
    return hc.studies.PairLog(t, leader, follower, u_f, u_l, force, "made")


def inside(number, true, widths=2.5):
    """Whether a number is its true value: 2.5 half widths are five deviations."""
    return abs(number.value - true) <= widths * 0.5 * (number.high - number.low)


def test_a_free_pair_is_found_again():
    found = hc.studies.identify_pair(synthetic())
    assert found.architecture == "position-position"
    assert inside(found["P"], TRUE["P"]) and inside(found["D"], TRUE["D"])
    assert inside(found["leader P"], TRUE["P"])
    assert found["filter lag"].value == pytest.approx(0.6 / 0.4 * 5e-4, rel=0.03)
    assert inside(found["link delay"], 0.0)
    # Euler's fine steps are of first order: 25 us of 5 ms, a part in two hundred
    assert found["inertia"].value == pytest.approx(TRUE["J"], rel=0.02)
    assert found["Coulomb friction"].value == pytest.approx(TRUE["friction"], rel=0.01)
    assert found["torque offset"].value == pytest.approx(TRUE["offset"], rel=0.02)
    assert found.simulated_rms == pytest.approx(found.rms, rel=2e-3)


def test_delays_are_found_again():
    found = hc.studies.identify_pair(synthetic(late=3, link=40))
    assert found["delay"].value == pytest.approx(1.5e-3, rel=0.02)
    assert found["link delay"].value == pytest.approx(0.02, rel=1e-3)
    assert inside(found["P"], TRUE["P"], 4.0)


def test_reflected_force_and_the_spring_that_is_felt():
    """The follower pushes a spring; the leader feels k P/(k + P), friction aside."""
    k = 3.0
    found = hc.studies.identify_pair(synthetic(force_scale=1.3, k=k))
    assert found.architecture == "position-force"
    assert inside(found["force scale"], 1.3)
    assert found["contact stiffness"].value == pytest.approx(k, rel=1e-6)
    K = found["contact stiffness, motor"].value  # friction and inertia are in it
    assert K == pytest.approx(k, rel=0.1)
    felt = 1.3 * k * TRUE["P"] / (K + TRUE["P"])
    assert found["felt, k P/(K + P)"].value == pytest.approx(felt, rel=1e-3)
    assert found["felt, measured"].value == pytest.approx(felt, rel=0.03)  # they lag
    assert math.isnan(found.simulated_rms) and any("touches" in x for x in found.warnings)


def test_a_follower_that_a_hand_pushes_is_said_to_be():
    """The columns of a pair the other way round: its follower leads."""
    log = synthetic(n=4000)
    found = hc.studies.identify_pair(
        hc.studies.PairLog(log.t, log.follower, log.leader, -log.follower_torque)
    )
    assert math.isnan(found.simulated_rms) and any("hand" in x for x in found.warnings)
    assert inside(found["P"], TRUE["P"], 4.0)


def test_a_leader_without_torque_is_unknown():
    log = synthetic()
    found = hc.studies.identify_pair(
        hc.studies.PairLog(log.t, log.leader, log.follower, log.follower_torque)
    )
    assert found.architecture == "unknown" and any("force" in x for x in found.warnings)


# ---- files


def scope_file(log, file):
    """A scope of Simulink as the rig's software writes it, a smaller scope beside it."""
    one = {"label": "Lever positions (rad) master, slave, wall"}
    one["values"] = np.column_stack((log.leader, log.follower))
    two = {"label": "Interaction forces (Nm at lever)     -F_h, F_e"}
    two["values"] = np.column_stack((log.force, log.force))
    three = {"label": "Input torque (Nm at lever)      -tau_rm, tau_rs"}
    three["values"] = np.column_stack((-log.leader_torque, log.follower_torque))
    reference = {"time": log.t, "signals": {"values": log.leader, "label": ""}}
    savemat(file, {"ref": reference, "scope": {"time": log.t, "signals": [one, two, three]}})
    return file


def test_a_scope_of_simulink_is_read_with_its_signs(tmp_path):
    log = synthetic(n=400)
    read = hc.studies.PairLog.load(scope_file(log, tmp_path / "log.mat"))
    for name in ("t", "leader", "follower", "leader_torque", "follower_torque", "force"):
        np.testing.assert_array_equal(getattr(read, name), getattr(log, name))


def test_columns_of_a_pair_go_on_with_it(tmp_path):
    file = tmp_path / "rig.csv"
    rows = [f"{1e-3 * i},{i},{2 * i},{3 * i}" for i in range(120)]
    file.write_text("\n".join(["t [s],master [rad],slave [rad],tau_s [N.m]", *rows]))
    commands = hc.studies.log_report(hc.Log.read(file)).commands
    assert commands == (f"hapticclay pair --data {file}",)


def test_a_scope_in_degrees_is_turned_into_radians(tmp_path):
    t = 1e-3 * np.arange(200.0)
    one = {"label": "p (deg) leader, follower", "values": np.outer(t, [90.0, 180.0])}
    two = {"label": "u (mNm) tau_s", "values": t[:, None]}
    savemat(tmp_path / "log.mat", {"s": {"time": t, "signals": [one, two]}})
    read = hc.studies.PairLog.load(tmp_path / "log.mat")
    np.testing.assert_allclose(read.follower, math.pi * t, rtol=1e-15)
    np.testing.assert_allclose(read.follower_torque, 1e-3 * t, rtol=1e-15)


def test_a_scope_in_another_quantity_is_refused(tmp_path):
    t = 1e-3 * np.arange(200.0)
    signal = {"label": "p (mm) leader, follower, tau_s", "values": np.outer(t, [1.0, 2.0, 3.0])}
    savemat(tmp_path / "log.mat", {"s": {"time": t, "signals": signal}})
    with pytest.raises(hc.ParameterError, match=r"leader \[mm\]"):
        hc.studies.PairLog.load(tmp_path / "log.mat")


def test_a_csv_file_is_read_with_units_and_names(tmp_path):
    log = synthetic(n=200)
    head = "time [ms],master [deg],slave [deg],u1 [mN.m],tau_rs [N.m],F_e [N.m]"
    columns = (
        1e3 * log.t, np.degrees(log.leader), np.degrees(log.follower),
        -1e3 * log.leader_torque, log.follower_torque, log.force,
    )  # fmt: skip
    file = tmp_path / "log.csv"
    np.savetxt(file, np.column_stack(columns), "%.17g", ",", header=head, comments="")
    read = hc.studies.PairLog.load(file, {"leader_torque": "-u1"})
    for name in ("t", "leader", "follower", "leader_torque", "follower_torque", "force"):
        np.testing.assert_allclose(getattr(read, name), getattr(log, name), rtol=1e-13, atol=1e-18)


def test_uneven_stamps_and_counts_are_read(tmp_path):
    """Jittered stamps, an encoder that begins again, and units that the file does not state."""
    log, rng = synthetic(n=2000), np.random.default_rng(5)
    t = log.t + rng.uniform(-1e-4, 1e-4, len(log.t))
    leader = np.interp(t, log.t, log.leader)
    counts = np.round((leader - 0.05) * 65536 / math.tau) % 65536  # begins again
    columns = (t, counts, np.degrees(np.interp(t, log.t, log.follower)), t)
    file = tmp_path / "log.csv"
    head = "t,leader,follower,tau_s"
    np.savetxt(file, np.column_stack(columns), "%.17g", ",", header=head, comments="")
    read = hc.studies.PairLog.load(file, units={"follower": "deg"}, counts={"leader": 65536})
    assert len(read.notes) == 2 and abs(read.Ts - 5e-4) < 2e-4 / 2000  # jitter of the ends
    found = np.interp(read.t, t, leader)
    turns = np.round((read.leader - found).mean() / math.tau) * math.tau
    # rounding, and splines between jittered rows
    assert np.abs(read.leader - found - turns + 0.05).max() < 3.0 * math.tau / 65536


def test_units_on_the_command_line(tmp_path):
    log = synthetic(n=2000)
    file = tmp_path / "log.csv"
    table = np.column_stack((log.t, np.degrees(log.leader), log.follower, log.follower_torque))
    np.savetxt(file, table, "%.17g", ",", header="t,q1,follower,tau_s", comments="")
    words = ["--columns", "leader=q1", "--units", "q1=deg", "--out", str(tmp_path / "out")]
    assert main(["pair", "--data", str(file), *words]) == 0
    told = json.loads((tmp_path / "out" / "pair_log.json").read_text())
    P = next(x for x in told["numbers"] if x["name"] == "P")
    assert P["value"] == pytest.approx(12.0, rel=0.01)  # a wrong unit is off by 57


def test_the_command_writes_and_prints(tmp_path, capsys):
    file = scope_file(synthetic(), tmp_path / "made.mat")
    assert main(["pair", "--data", str(file), "--out", str(tmp_path / "out")]) == 0
    assert "position-position" in capsys.readouterr().out
    assert {x.name for x in (tmp_path / "out").iterdir()} == {"pair_log.json", "pair_log.png"}


@pytest.mark.parametrize(
    "content, told",
    [
        (b"nothing", "must"),
        (None, "must be a readable file"),
    ],
)
def test_other_files_are_refused_in_a_line(tmp_path, capsys, content, told):
    file = tmp_path / "x.mat"
    if content is not None:
        file.write_bytes(content)
    assert main(["pair", "--data", str(file)]) == 2
    out = capsys.readouterr()
    assert told in out.err and out.err.count("\n") == 1 and not out.out


def test_a_column_that_is_missing_is_named(tmp_path):
    log = synthetic(n=200)
    file = tmp_path / "log.csv"
    table = np.column_stack((log.t, log.leader))
    np.savetxt(file, table, delimiter=",", header="t,leader", comments="")
    with pytest.raises(hc.ParameterError, match="position of the follower"):
        hc.studies.PairLog.load(file)


# ---- the rig's logs, where they are


@pytest.mark.skipif(not RIG.is_dir(), reason="no logs of the rig")
@pytest.mark.parametrize(
    "name, letter, rms, as_set",
    [
        ("question1e_free_motion", "e", 2.147e-3, 2.066e-3),
        ("m2_question1a_free_motion", "a", 3.708e-3, 3.789e-3),
        ("m2_question1e_free_motion", "e", 3.160e-3, 3.033e-3),
    ],
)
def test_the_rig(name, letter, rms, as_set):
    """Gains within 0.7 %, errors as measured, simulated within 4 %, as set to the last digit."""
    log = hc.studies.PairLog.load(RIG / f"{name}.mat")
    assert recordings.set_rms(log, recordings.LETTERS[letter]) == pytest.approx(as_set, abs=1e-6)
    found = hc.studies.identify_pair(log)
    assert found["P"].value == pytest.approx(recordings.LETTERS[letter].P, rel=7e-3)
    assert found.rms == pytest.approx(rms, abs=5e-7)  # half of the last printed digit
    assert found.simulated_rms == pytest.approx(rms, rel=0.04)
    if found.architecture == "position-force":
        assert 1.0 <= found["force scale"].value <= 1.008


@pytest.mark.parametrize("columns", [None, {"leader": "d"}])
def test_a_missing_column_is_told_with_all_that_there_are(columns, tmp_path):
    (tmp_path / "log.csv").write_text("t,a,b,c\n" + "".join(f"{i},1,2,3\n" for i in range(50)))
    with pytest.raises(hc.ParameterError, match="t, a, b, c"):
        hc.studies.PairLog.load(tmp_path / "log.csv", columns)


def sines(*parts):
    """A log of the exact law 12 e + 0.1 de/dt, its error e of sines of (size, omega)."""
    T = 5e-4
    t = T * np.arange(8000)
    leader = 0.09 * np.sin(4.4 * t) + 0.05 * np.sin(12.0 * t + 1.0) + 0.02 * np.sin(27.0 * t)
    e = sum(a * np.sin(w * t) for a, w in parts)
    torque = 12.0 * e + 0.1 * sum(a * w * np.cos(w * t) for a, w in parts)
    return hc.studies.PairLog(t, leader, leader - e, torque, -torque)


def test_an_error_of_one_sine_has_no_gains():
    """Gain and phase are two numbers; P, D and lag are three."""
    found = hc.studies.identify_pair(sines((2e-3, 30.0)))
    for name in ("P", "D", "leader P", "leader D"):
        assert math.isnan(found[name].low) and math.isnan(found[name].high)
    assert sum("not told apart" in x for x in found.warnings) == 2


@pytest.mark.parametrize("second", [(1e-3, 33.0), (2e-5, 90.0)])
def test_an_error_of_two_sines_has_gains(second):
    """Close ones, and one of a hundredth; differences in place of a rate are 0.25 ms late."""
    found = hc.studies.identify_pair(sines((2e-3, 30.0), second))
    assert not any("not told apart" in x for x in found.warnings)
    assert found["P"].value == pytest.approx(12.0, rel=5e-3)
    for name in ("P", "D"):
        half = 0.5 * (found[name].high - found[name].low)
        assert 0.0 < half < 0.02 * found[name].value


@pytest.mark.parametrize("by_row", [True, False])
@pytest.mark.parametrize(
    "rate, delay, lag", [(30.0, 0.1, 0.08), (50.0, 0.04, 0.15), (100.0, 0, 0.05)]
)
def test_a_follower_whose_torque_is_unknown_is_late_and_lags(by_row, rate, delay, lag, tmp_path):
    """A filter once a row, or a lag in continuous time behind sines, in closed form."""
    rng = np.random.default_rng(3)
    t = np.arange(int(20.0 * rate)) / rate
    f, phase = rng.uniform(0.1, 1.5, 6), rng.uniform(0.0, 6.28, 6)
    waves = np.exp(2j * np.pi * np.outer(t, f) + 1j * phase)
    leader = 0.3 * waves.sum(axis=1).real
    if by_row:
        a, late = np.exp(-1.0 / (rate * lag)), round(delay * rate)
        u = np.concatenate((np.full(late, leader[0]), leader))[: len(t)]
        follower = np.full(len(t), leader[0])
        for i in range(1, len(t)):
            follower[i] = a * follower[i - 1] + (1.0 - a) * u[i]
    else:
        s = 2j * np.pi * f
        follower = 0.3 * (waves @ (np.exp(-s * delay) / (1.0 + s * lag))).real
    follower = 0.1 + follower + 1e-4 * rng.standard_normal(len(t))
    path = tmp_path / "a.csv"
    columns = np.column_stack((t, np.degrees(leader), np.degrees(follower)))
    head = "timestamp,leader [deg],follower [deg]"
    np.savetxt(path, columns, "%.9g", ",", header=head, comments="")
    assert hc.studies.log_report(hc.Log.read(path)).commands == (f"hapticclay pair --data {path}",)
    found = hc.studies.identify_pair(hc.studies.PairLog.load(path))
    # lines between rows, of sines up to 1.5 Hz at 30 rows a second; splines of a leader by row
    for name, true in (("delay", delay), ("lag", lag), ("scale", 1.0), ("offset", 0.1)):
        assert found[name].value == pytest.approx(true, abs=1e-3 + 0.01 * true), name
    assert found["explained"].value > 0.99
    assert "s late and lags by" in found.headline()
    assert any("no torque of the follower was logged" in x for x in found.warnings)
    assert found.plot().axes
