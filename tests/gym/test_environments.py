"""Single environments: the checkers of Gymnasium, seeds, options, bounds, ends, pictures."""

import json
import math

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import hapticclay as hc
import hapticclay.gym  # noqa: F401, registers
from hapticclay.gym import draws, registry, task
from hapticclay.gym.quantities import Quantity, box_of

IDS = registry.IDS
CUT = "hapticclay/CutLine-v0"


def made(id=CUT, **kw):
    return gymnasium.make(id, engine="python", **kw)


def some_actions(env, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.5, 0.5, (n, *env.action_space.shape)).astype(np.float32)


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
    x = [draws.draw({"k": r}, rng, None)["k"] for _ in range(4000)]
    share = np.log(np.array(x) / r.low) / math.log(r.high / r.low)
    for q in (0.25, 0.5, 0.75):
        assert np.mean(share < q) == pytest.approx(q, abs=0.028)


@pytest.mark.parametrize(
    "kw, field",
    [
        ({"ranges": {"mas": [0, 1]}}, "ranges"),
        ({"ranges": {"mass": [1, 0.5]}}, "ranges.mass"),
        ({"ranges": {"mass": [-1, 0.5]}}, "ranges.mass"),
        ({"shape": "circle"}, "shape"),
        ({"engine": "fast"}, "engine"),
        ({"render_mode": "rgb"}, "render_mode"),
    ],
)
def test_bad_arguments_are_refused_by_name(kw, field):
    with pytest.raises(hc.ParameterError) as told:
        registry_class(CUT)(**kw)
    assert told.value.field.startswith(field)


def registry_class(id):
    from hapticclay.gym import CutLine

    assert id == CUT
    return CutLine


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
        registry_class(CUT)(engine="python").step(np.zeros(2))


@pytest.mark.parametrize("action", [np.full(2, np.nan), np.full(2, np.inf), np.full(2, -1e30)])
def test_actions_that_are_no_numbers_or_too_large_stay_within_bounds(action):
    env = made().unwrapped
    env.reset(seed=0)
    x, reward, *_ = env.step(action)
    assert np.isfinite(x).all() and math.isfinite(reward)
    assert env.observation_space.contains(x)


def test_a_loop_beyond_its_gain_limit_ends_the_episode_within_a_period():
    """A gain of 30 where `gain_limit` is 4.3; the run itself is watched step by step.

    The motors reach their limits in the growing oscillation. The episode ends no later than 20 ms
    after the first sample at which they do.
    """
    options = {"b": 60.0, "mass": 0.25, "damper": 2.0, "spring": 6.0}
    env = made("hapticclay/AdaptiveGain-v0")
    env.reset(seed=0, options=options)
    inner = env.unwrapped
    run, m = hc.Simulation(inner.task.scenario(inner._episode.truth), engine="python"), None
    reached, t = None, 0
    while True:
        _, reward, terminated, _, info = env.step(np.ones(1, np.float32))
        m = inner._episode.memory
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
    scene = inner.task.scenario(inner._episode.truth)
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
