"""Good values of the arguments that public functions and classes must be given."""

import importlib
import inspect
from pathlib import Path

import numpy as np

import hapticclay as hc

ARM = Path(__file__).parents[1] / "mjcf" / "arms" / "planar_2r.xml"


def good_values(folder):
    """Good values of the arguments that must be given, by name, and by function and name."""
    cut, wall = hc.constant_cut(t_max=0.01), hc.VirtualWall(K=100.0)
    profile, t = hc.Profile((), (40.0,)), np.linspace(0.0, 4.0, 400)
    loop = hc.theory.Loop(K=1.0, b=90.0)
    zigzag = hc.walls.zigzag(1e-4)
    swept = hc.studies.Sweep("constant", {"b": hc.studies.Range(1.0, 9.0, 2)})
    logged = hc.studies.PairLog(t, np.sin(t), np.sin(t - 0.05), np.cos(t))
    files = [cut.save(folder / "a.toml"), hc.constant_cut(b=50.0).save(folder / "b.toml")]
    by_name = {
        "axis": "x", "K": 1.0, "b": 90.0, "wall": wall, "scenario": cut, "subject": wall,
        "record": hc.simulate(cut, engine="python"), "loop": loop, "box": hc.theory.Box(),
        "omega": [1.0],
        "flow": hc.Flow(Fy=1.0, b=5.0), "compensators": [hc.Compensator()], "V": 0.1,
        "data": hc.studies.Measurement(t, np.sin(t), np.cos(t)),
        "hands": next(iter(hc.studies.POPULATIONS)),
        "mass": 1.0, "damper": 1.0, "spring": 1.0, "Ts": 1e-3, "decay": 1.0, "name": "stiff clay",
        "trials": hc.studies.Trials(wall, {"K": hc.studies.Distribution("uniform", 1.0, 9.0)}),
        "out": "nowhere", "path": "nowhere",
        "exchanges": hc.ports.Exchanges.of_table(np.arange(24.0).reshape(2, 12)),
        "part": cut, "changes": {"gain.x": 1.0}, "scenarios": [cut], "resists": 90.0,
    }  # fmt: skip
    pushed = importlib.import_module("hapticclay.studies.boundary").PushedLoop()
    ramp = {"amplitude": (1.0, 0.0), "low": 1.0, "high": 2.0, "duration": 3.0, "rate": (1.0, 0.0)}
    grid = {"x_edges": (), "y_edges": (), "values": ((40.0,),)}
    image = {"image": [[0.5]], "x": (0.0, 0.1), "y": (0.0, 0.1), "b": (0.0, 9.0)}
    smooth = {"x": (0.0, 0.1), "y": (0.0, 0.1), "values": ((1.0, 1.0), (1.0, 1.0))}
    arm = hc.MjcfArm(ARM)
    of_joints = {"arm": arm, "law": hc.JointPD((100.0, 50.0), (1.0, 0.5))}
    rubbed = hc.JointPD((100.0, 50.0), (1.0, 0.5), friction=((1.0, 9.0, 0.1), (0.2, 9.0, 0.0)))
    device = hc.Device()
    pair = {"pair": hc.Pair(device, device, hc.JointPD((100.0,), (5.0,)))}
    by_function = {
        "pair_limits": pair, "pair_map": {**pair, "gains": 3, "delays": 3}, "compare_links": pair,
        "pair_transparency": pair, "pair_hands": {**pair, "hands": hc.theory.Box(), "samples": 2},
        "Pair": {"leader": device, "follower": device, "law": hc.JointPD((1.0,), (1.0,))},
        "friction_cycle": {"arm": arm, "law": rubbed},
        "joint_limits": of_joints, "joint_runs": of_joints,
        "over_poses": {**of_joints, "poses": 2}, "identify": {"periods": 1, "realisations": 2},
        "wall_limit": {"arm": arm, "B": 1.0, "operator": hc.Operator()},
        "MjcfArm": {"file": ARM}, "JointPD": {"Kp": (1.0,), "Kd": (1.0,)},
        "stable_band": {"part": "K"}, "arm_mbk": {"loop": pushed}, "arm_index": {"loop": pushed},
        "gain_band": {"b": [10.0]},
        "wall_band": {"B": [1.0]}, "Chirp": ramp, "Clay": {"x": profile, "y": profile},
        "Constant": {"value": (1.0, 0.0)}, "Controller": {"law": "a:b"}, "Function": {"f": abs},
        "Coupling": {"spring": 1.0, "damper": 1.0}, "Grid": grid, "Smooth": smooth,
        "Distribution": {"law": "uniform", "first": 1.0, "second": 2.0},
        "Groove": {"x": (0.0, 0.1), "y": (0.0, 0.1), "pressure": 1e4},
        "Grid.of_function": {"b": max, "x_edges": (0.0, 0.1), "y_edges": (0.0, 0.1)},
        "Grid.of_image": image, "Smooth.of_image": image,
        "Smooth.of_function": {"b": max, "x": (0.0, 0.1), "y": (0.0, 0.1), "nodes": (2, 2)},
        "Compensator.zpk": {"zeros": [], "poles": [-1.0], "gain": 1.0},
        "Hands.around": {"operator": hc.Operator()},
        "Path": {"places": (0.0, 1e-4)}, 
        "Trajectory": {"t": (0.0,), "points": ((0.0, 0.0),)}, "Ramp": {**ramp, "start": 0.0},
        "Profile": {"edges": (), "values": (1.0,)}, "Material": {"source": "own"},
        "Pulse": {"value": (1.0, 0.0), "start": 0.0, "width": 1.0},
        "Samples": {"t": (0.0, 1.0), "values": ((0.0, 0.0), (1.0, 1.0))},
        "SecondOrder": {"gain": 1.0, "damping": 1.0, "stiffness": 1.0},
        "Servo": {"G": hc.SecondOrder(1.0, 1.0, 1.0), "S": hc.SecondOrder(1.0, 1.0, 1.0)},
        "Spring": {"start": 0.0, "end": 0.1, "stiffness": 10.0},
        "Step": {"value": (1.0, 0.0), "time": 0.0}, "Sum": {"parts": (hc.Constant((1.0, 0.0)),)},
        "wall_borders": {"plane": "damper-stiffness", "x": 1.0}, "polygon": {"turn": (1, 2)},
        "zigzag": {"amplitude": 1e-4}, "taken_energy": {"path": zigzag},
        "parse_grid": {"text": "b=1:9:2"},
        "Sweep": {"experiment": "constant", "vary": swept.vary},
        "run_sweep": {"sweep": swept}, "compare_files": {"paths": files},
        "Trials": {"base": wall, "vary": {"K": hc.studies.Distribution("uniform", 1.0, 9.0)}},
        "run_staircase": {"staircase": hc.studies.Staircase(), "observer": hc.studies.Observer()},
        "staircase_mean": {"staircase": hc.studies.Staircase(), "observer": hc.studies.Observer()},
        "Log": {"path": ARM, "table": hc.Log.read(_log(folder)).table},
        "log_report": {"log": hc.Log.read(_log(folder))},
        "lab": {"name": "jnd"},
        "simulate_columns": {"base": cut, "columns": {"gain.x": np.ones(3)}},
        "run_columns": {"base": cut, "columns": {"gain.x": np.ones(3)}},
        "serve_pair": {"pair": hc.Pair(hc.Device(), hc.Device(), hc.JointPD((9.0,), (1.0,)))},
        "PairLog": {"t": t, "leader": np.sin(t), "follower": np.cos(t), "follower_torque": t},
        "identify_pair": {"log": logged},
        "Recording": {"t": (0.0, 0.01), "p": np.zeros((2, 2))},
        "replay": {"recording": hc.studies.Recording((0.0, 0.01), f=np.ones((2, 2)))},
        "Measurement": {"t": t, "input": np.sin(t), "output": np.cos(t)},
        "Measurement.resampled": {"t": t, "input": np.sin(t), "output": np.cos(t)},
    }  # fmt: skip
    return by_name, by_function


def _log(folder):
    path = folder / "log.csv"
    path.write_text("t,x\n0,1\n1,2\n")
    return path


def required(name, made, good):
    """Arguments of a call with defaults wherever there are some."""
    by_name, by_function = good
    own = by_function.get(name, {})
    return {
        word: own.get(word, by_name.get(word))
        for word, p in inspect.signature(made).parameters.items()
        if (p.default is p.empty or word in own) and p.kind is not p.VAR_KEYWORD
    }
