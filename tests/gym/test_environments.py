"""Single environments: the checkers of Gymnasium, seeds, options, bounds, ends, pictures."""

import copy
import functools
import json
import math
import os
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import hapticclay as hc
import hapticclay.gym
from hapticclay.gym import draws, registry, task
from hapticclay.gym.quantities import Quantity, box_of

IDS = registry.IDS
CUT = "hapticclay/CutLine-v0"


def made(id=CUT, **kw):
    return gymnasium.make(id, engine="python", **kw)


def some_actions(env, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.5, 0.5, (n, *env.action_space.shape)).astype(np.float32)


@pytest.mark.filterwarnings("ignore:.*shows nothing here")  # tests have no display
@pytest.mark.parametrize("id", IDS)
def test_gymnasiums_checker_finds_nothing(id):
    """Warnings are errors in these tests."""
    env = made(id, disable_env_checker=True)
    check_env(env.unwrapped)
    env.close()
    env.close()


@pytest.mark.parametrize("id", IDS)
def test_a_spec_survives_json_and_makes_the_same_environment(id):
    env = made(id, ranges={"mass": [0.3, 0.4]})
    spec = gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gymnasium.make(spec)
    a, b = env.reset(seed=5), again.reset(seed=5)
    assert a[0].tobytes() == b[0].tobytes() and a[1] == b[1]
    assert 0.3 <= a[1]["mass"] <= 0.4


def test_the_module_may_be_named_in_the_id():
    env = gymnasium.make(f"hapticclay.gym:{CUT}", engine="python")
    assert env.spec.max_episode_steps == 500


@pytest.mark.parametrize("id", IDS)
def test_the_same_seed_and_actions_give_the_same_bytes_of_an_environment_used_before(id):
    env, other = made(id), made(id)
    other.reset(seed=9)
    other.step(other.action_space.sample())
    found = []
    for e in (env, other):
        rows = [e.reset(seed=4)[0]]
        for action in some_actions(e, 5):
            x, reward, *_, info = e.step(action)
            rows += [x, [reward], list(info.values())]
        found.append(np.concatenate(rows).tobytes())
    assert found[0] == found[1]


def test_observations_belong_to_the_caller():
    env = made()
    first, info = env.reset(seed=1)
    kept, told = first.copy(), dict(info)
    env.step(np.ones(2, np.float32))
    assert np.array_equal(first, kept) and info == told


@pytest.mark.parametrize("id", IDS)
def test_options_replace_what_is_drawn_and_change_nothing_else(id):
    env = made(id)
    drawn = env.reset(seed=2)[1]
    given = env.reset(seed=2, options={"mass": 0.5, "spring": 20.0})[1]
    assert given == drawn | {"mass": 0.5, "spring": 20.0}


@pytest.mark.parametrize("id", IDS)
def test_what_is_drawn_lies_in_its_range(id):
    """10 seeds; the ends of a range are told with the draws."""
    env = made(id)
    for seed in range(10):
        _, info = env.reset(seed=seed)
        for name, r in env.unwrapped.task.ranges.items():
            assert r.low <= info[name] <= r.high


def test_a_log_uniform_draw_has_a_uniform_logarithm():
    """Quartiles of 4000 draws: their standard error is 0.007 in the share, four of it allowed."""
    rng, r = np.random.default_rng(0), draws.HAND["spring"]
    x = [draws.draw({"k": r}, rng, {})["k"] for _ in range(4000)]
    share = np.log(np.array(x) / r.low) / math.log(r.high / r.low)
    for q in (0.25, 0.5, 0.75):
        assert np.mean(share < q) == pytest.approx(q, abs=0.028)


@pytest.mark.parametrize(
    "kw, field",
    [
        ({"ranges": 3}, "ranges"),
        ({"ranges": "mass"}, "ranges"),
        ({"ranges": [("mass", [1, 2])]}, "ranges"),
        ({"ranges": False}, "ranges"),
        ({"ranges": {"mass": 0.3}}, "ranges.mass"),
        ({"ranges": {"mass": [0.3, None]}}, "ranges.mass"),
        ({"ranges": {"mass": ["3 N", "4 N"]}}, "ranges.mass"),
        ({"ranges": {"mas": [0, 1]}}, "ranges"),
        ({"ranges": {"mass": [1, 0.5]}}, "ranges.mass"),
        ({"ranges": {"mass": [-1, 0.5]}}, "ranges.mass"),
        *(({"engine": x}, "engine") for x in (None, 3, "fast", ["auto"])),
        ({"render_mode": "fast"}, "render_mode"),
        ({"given": {}}, "given"),
        ({"rangs": {}}, "rangs"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_mode")  # Gymnasium's own words about it
@pytest.mark.parametrize("made_by", ["single", "make", "make_vec"])
@pytest.mark.parametrize("id", IDS)
def test_bad_arguments_are_refused_by_name(id, made_by, kw, field):
    """By each environment, and in the ways that Gymnasium makes it."""
    entry = registry.ENTRIES[id.partition("/")[2]]
    makers = {
        "single": getattr(hapticclay.gym, entry.name),
        "make": functools.partial(gymnasium.make, id),
        "make_vec": functools.partial(gymnasium.make_vec, id),
    }
    with pytest.raises(hc.ParameterError) as told:
        makers[made_by](**kw)
    assert told.value.field.startswith(field)


@pytest.mark.parametrize("mode", [3, "", ["human"], "fast"])
def test_render_modes_are_refused_by_name(mode):
    from hapticclay.gym.cut_line import CutLineVector

    for kind in (hapticclay.gym.CutLine, CutLineVector):
        with pytest.raises(hc.ParameterError, match="rgb_array"):
            kind(render_mode=mode)


@pytest.mark.parametrize("shape", ["circle", 3, None, ["arc"]])
def test_shapes_are_refused_by_name(shape):
    with pytest.raises(hc.ParameterError, match="straight, arc, corner"):
        hapticclay.gym.CutLine(shape=shape)
    with pytest.raises(hc.ParameterError, match="unexpected argument of PareEdge"):
        gymnasium.make("hapticclay/PareEdge-v0", shape=shape)


def test_bad_options_and_actions_are_refused():
    env = made().unwrapped
    with pytest.raises(hc.ParameterError, match="mass"):
        env.reset(options={"mas": 1.0})
    with pytest.raises(hc.ParameterError, match="options.b"):
        env.reset(options={"b": -1.0})
    env.reset(seed=0)
    with pytest.raises(hc.ParameterError, match="shape"):
        env.step(np.zeros(3))


def test_a_step_before_a_reset_is_refused():
    with pytest.raises(RuntimeError, match="reset"):
        hapticclay.gym.CutLine(engine="python").step(np.zeros(2))


@pytest.mark.parametrize("action", [np.full(2, -1e30), np.full(2, np.float32(3e38)), [5, -7]])
def test_actions_beyond_their_space_are_those_at_its_bounds(action):
    env, other = made().unwrapped, made().unwrapped
    env.reset(seed=0), other.reset(seed=0)
    x, reward, *_ = env.step(action)
    y, same, *_ = other.step(np.clip(action, -1.0, 1.0).astype(np.float32))
    assert x.tobytes() == y.tobytes() and reward == same
    assert env.observation_space.contains(x)


NO_ACTIONS = [  # of two numbers
    [math.nan, 0.0], [0.0, math.inf], [-math.inf, 0.0], np.full(2, np.nan, np.float32), None, "ab",
    ["0.5", "1"], [None, None], [True, False], [1j, 0], 0.5, [[0.0, 0.0]], [[1, 2], [3]],
    np.zeros(2, object), [10**400, 0], {"a": 1}, np.array([1, 2], "M8[s]"),
]  # fmt: skip


@pytest.mark.parametrize("action", NO_ACTIONS, ids=str)
def test_what_is_no_action_is_refused_and_the_episode_goes_on_as_if_not_given(action):
    """Single, and as the rows of a vector."""
    env, other = made().unwrapped, made().unwrapped
    many = gymnasium.make_vec(CUT, num_envs=2, engine="python").unwrapped
    for e in (env, other, many):
        e.reset(seed=0)
    with pytest.raises(hc.ParameterError) as told:
        env.step(action)
    assert told.value.field.startswith("action")
    with pytest.raises(hc.ParameterError) as told:
        many.step([action, action])
    assert told.value.field.startswith("actions")
    good = np.full(2, 0.3, np.float32)
    x = env.step(good)[0]
    assert x.tobytes() == other.step(good)[0].tobytes() == many.step([good, good])[0][0].tobytes()


@pytest.mark.parametrize("seed", [1.5, "a", -1, True, [1], np.array(2.5), 2**128, math.nan])
def test_what_is_no_seed_is_refused(seed):
    env, many = made().unwrapped, gymnasium.make_vec(CUT, num_envs=2, engine="python").unwrapped
    for e in (env, many):
        with pytest.raises(hc.ParameterError) as told:
            e.reset(seed=seed)
        assert told.value.field.startswith("seed")


def test_seeds_of_numpy_and_those_that_gymnasium_draws_are_seeds():
    env = made().unwrapped
    first = env.reset(seed=3)[1]
    assert env.reset(seed=np.int64(3))[1] == first
    drawn = made().unwrapped
    _, info = drawn.reset()
    assert env.reset(seed=drawn.np_random_seed)[1] == info


NO_OPTIONS = [3, "b", [("b", 1.0)], (), False, {3: 1.0}, {"b": None}, {"b": [1.0]}, {"b": "60 kg"}]


@pytest.mark.parametrize("options", NO_OPTIONS, ids=str)
def test_refused_options_draw_nothing(options):
    """The next episode is that of the seed's stream, as if there had been no refusal."""
    env, other = made().unwrapped, made().unwrapped
    env.reset(seed=0), other.reset(seed=0)
    with pytest.raises(hc.ParameterError) as told:
        env.reset(seed=5, options=options)
    assert told.value.field.startswith("options")
    assert env.reset()[1] == other.reset()[1]


def test_values_with_units_are_options_and_ends_of_ranges():
    env = made(ranges={"mass": ["300 g", "0.3 kg"]}).unwrapped
    info = env.reset(seed=0, options={"b": "60 N.s/m", "offset": "1 mm"})[1]
    assert (info["mass"], info["b"], info["offset"]) == (0.3, 60.0, 1e-3)


@pytest.mark.parametrize("id", IDS)
def test_copies_and_pickles_go_on_as_the_original(id):
    env = made(id, render_mode="rgb_array").unwrapped
    env.reset(seed=1)
    actions = some_actions(env, 4)
    env.step(actions[0])
    found = []
    copies = pickle.loads(pickle.dumps(env)), copy.deepcopy(env)
    drawn = copies if id == CUT else copies[:1]
    for e in (*copies, env):
        rows = [e.step(action)[0] for action in actions[1:]] + [e.reset()[0]]
        found.append(np.array(rows).tobytes())
        if e in drawn:
            assert e.render().std() > 0.0
        e.close()
    assert found[0] == found[1] == found[2]


def test_closed_twice_and_reset_again():
    env = made(render_mode="rgb_array").unwrapped
    first = env.reset(seed=2)[0]
    env.close(), env.close()
    for use in (lambda: env.step(np.zeros(2)), env.render):
        with pytest.raises(RuntimeError, match="reset"):
            use()
    assert env.reset(seed=2)[0].tobytes() == first.tobytes()
    env.close()


def test_without_a_display_human_mode_says_once_that_it_shows_nothing():
    env = made(render_mode="human")
    with pytest.warns(UserWarning, match="'human' shows nothing here") as told:
        for seed in range(2):
            env.reset(seed=seed)
            env.step(np.zeros(2, np.float32))
            assert env.render() is None
            env.unwrapped.close()
    assert len(told) == 1


def test_a_backend_with_windows_shows_nothing_without_a_display():
    """In a process of its own: matplotlib chooses its backend once."""
    code = f"""
import gymnasium, numpy as np, hapticclay.gym
env = gymnasium.make("{CUT}", engine="python", render_mode="human")
for seed in range(2):
    env.reset(seed=seed)
    env.step(np.zeros(2, np.float32))
    assert env.render() is None
    env.unwrapped.close()
"""
    hidden = {"DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND"}
    around = {k: v for k, v in os.environ.items() if k not in hidden} | {"MPLBACKEND": "tkagg"}
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=around
    )
    lines = [x for x in found.stderr.splitlines() if "WARN" in x]
    assert len(lines) == 1 and "'human' shows nothing here" in lines[0]


def test_a_loop_beyond_its_gain_limit_ends_the_episode_within_a_period():
    """A gain of 30 where `gain_limit` is 4.3; the run itself is watched step by step.

    The motors reach their limits in the growing oscillation. The episode ends no later than 20 ms
    after the first sample at which they do.
    """
    options = {"b": 60.0, "mass": 0.25, "damper": 2.0, "spring": 6.0}
    env = made("hapticclay/AdaptiveGain-v0")
    env.reset(seed=0, options=options)
    inner = env.unwrapped
    run, m = hc.Simulation(inner.task.scenario(inner._episodes.truth), engine="python"), None
    reached, t = None, 0
    while True:
        _, reward, terminated, _, info = env.step(np.ones(1, np.float32))
        m = inner._episodes.memory
        push = m["muscle"][t] * min((t + 1) / 20, 1.0)
        run.set(gain=(info["K"], 0.2))
        for _ in range(inner.task.steps):
            run.advance(1, force=(push, 0.0))
            if reached is None and (np.abs(run.state.tau) >= 40.0).any():
                reached = run.t
        t += 1
        if terminated:
            break
        assert t < 500
    assert info["lost"] and info["K"] == 30.0
    assert reached is None or run.t <= reached + 0.02
    assert reward == -1.0 - (500 - t)  # what the largest error would have cost


STIFF_HAND = {"mass": 0.3, "damper": 0.0, "spring": 1e5}
DIVERGING = {  # K of y is above its limit with this hand, 0.41 to 0.45 1/kg
    "CutLine-v0": {**STIFF_HAND, "b": 60.0, "gain": 2.0, "angle": 0.0, "offset": 0.0},
    "PareEdge-v0": {
        **STIFF_HAND, "gain": 2.0, "offset": 0.0, "depth": 3e-3, "depth_at_end": 3e-3,
        "pressure": 1e5, "damping": 1e6,
    },
    "ProbeClay-v0": {**STIFF_HAND, "b": 315.0, "Fy": 0.24},
}  # fmt: skip


@pytest.mark.parametrize("name", DIVERGING)
def test_a_diverging_run_ends_its_episode_within_20_ms(name):
    """A constant action is a constant force along a straight line, so `simulate` makes the run.

    Its record tells the first sample with a motor at its limit or faster than 20 m/s.
    """
    env = made(f"hapticclay/{name}")
    env.reset(seed=0, options=DIVERGING[name])
    inner, action, ended, n = env.unwrapped, np.zeros(env.action_space.shape, np.float32), False, 0
    action[:2] = 0.5, 1.0
    while not ended:
        _, _, ended, cut_off, info = env.step(action)
        n += 1
        assert not cut_off
    scene = inner.task.scenario(inner._episodes.truth)
    force = tuple(getattr(inner.task, "most", task.FORCE) * x for x in (0.5, 1.0))
    end = n * inner.task.steps * scene.dt
    fields = {"force": force, "t_max": end + 0.1, "stop_when_unstable": False}
    record = hc.simulate(hc.with_fields(scene, fields), engine="python")
    bad = (np.abs(record.tau) >= 40.0).any(axis=1) | (np.hypot(*record.v.T) > 20.0)
    assert info["lost"] and bad.any()
    assert 0.0 <= end - record.t[bad.argmax()] <= 0.02


def test_a_picture_is_drawn_of_what_moves():
    env = made(render_mode="rgb_array")
    env.reset(seed=0)
    before = env.render()
    for _ in range(5):
        env.step(np.array([1.0, 0.0], np.float32))
    after = env.render()
    assert before.shape == after.shape and before.dtype == np.uint8
    assert before.std() > 0.0 and (before != after).any()
    env.close()


@pytest.mark.parametrize("shape", ["arc", "corner"])
def test_lines_of_other_shapes(shape):
    env = made(shape=shape)
    x, _ = env.reset(seed=0, options={"offset": 0.0})
    assert env.observation_space.contains(x)
    assert x[0] == pytest.approx(0.0, abs=1e-4)  # [mm], float32
    assert x[7] == pytest.approx(10.0, rel=1e-6)  # [cm] remaining


def test_wrappers_of_gymnasium_take_it():
    env = gymnasium.wrappers.RecordEpisodeStatistics(
        gymnasium.wrappers.FrameStackObservation(
            gymnasium.wrappers.TimeAwareObservation(
                gymnasium.wrappers.DelayObservation(
                    gymnasium.wrappers.RescaleAction(made(), np.float32(-2), np.float32(2)), 1
                )
            ),
            2,
        )
    )
    env.reset(seed=0)
    x, *_ = env.step(env.action_space.sample())
    assert env.observation_space.contains(x)


def test_spaces_are_symmetric_finite_and_float32():
    for id in IDS:
        env = made(id)
        box = env.action_space
        assert box.dtype == np.float32 and np.array_equal(box.low, -box.high)
        assert np.isfinite(env.observation_space.low).all()
        assert np.isfinite(env.observation_space.high).all()
    assert box_of((Quantity("x", -1.0, 2.0, "m"),)).shape == (1,)


def test_arguments_are_plain_data():
    json.dumps(made(shape="arc", ranges={"b": [50.0, 60.0]}).spec.kwargs)
