"""Many copies: each is the single environment of its seed, and that is a run of `simulate`."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import hapticclay as hc
from hapticclay.gym import registry, task

IDS = registry.IDS
CUT = "hapticclay/CutLine-v0"
N = 3


def vector(id=CUT, n=N, **kw):
    return gymnasium.make_vec(id, num_envs=n, engine="python", **kw)


def actions_for(env, n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.4, 0.4, (n, *env.action_space.shape)).astype(np.float32)


@pytest.mark.parametrize("id", IDS)
def test_copy_i_is_the_single_environment_of_its_seed_to_the_bit(id):
    many = vector(id)
    x, _ = many.reset(seed=7)
    singles = [gymnasium.make(id, engine="python") for _ in range(N)]
    for i, env in enumerate(singles):
        assert env.reset(seed=7 + i)[0].tobytes() == x[i].tobytes()
    for actions in actions_for(many, 6):
        x, rewards, ended, _, infos = many.step(actions)
        for i, env in enumerate(singles):
            y, reward, over, _, info = env.step(actions[i])
            assert y.tobytes() == x[i].tobytes() and reward == rewards[i] and over == ended[i]
            assert all(infos[name][i] == value for name, value in info.items())


def test_a_copy_is_a_run_of_simulate_to_the_bit():
    """Under a constant action along a straight line in the direction of x."""
    options = {"angle": 0.0, "offset": 0.0}
    many = vector()
    many.reset(seed=3, options=options)
    n, action = 5, np.array([[0.25, 0.0]] * N, np.float32)
    for _ in range(n):
        x, *_ = many.step(action)
    inner = many.unwrapped
    for i in range(N):
        truth = inner.info_of(i)
        scenario = inner.task.scenario(truth)
        force = (0.25 * task.FORCE, 0.0)
        end = (n * inner.task.steps + 1) * task.DT
        record = hc.simulate(
            hc.with_fields(scenario, {"force": force, "t_max": end}), engine="python"
        )
        k = n * inner.task.steps
        _, _, handle = inner._episodes.copy(i)
        assert record.p[k].tolist() == list(handle.p)
        assert record.v[k].tolist() == list(handle.v)
        assert record.fh[k].tolist() == list(handle.fh)
        assert np.float32(100.0 * record.v[k][0]) == x[i][1]


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_resets_are_those_of_gymnasiums_own_vector(mode):
    """Episodes of 3 periods: observations, rewards, ends and masked infos agree over 8 steps."""
    mine = vector(max_episode_steps=3, autoreset_mode=mode)
    theirs = SyncVectorEnv(
        [lambda: gymnasium.make(CUT, engine="python", max_episode_steps=3)] * N,
        autoreset_mode=AutoresetMode[mode],
    )
    a, b = mine.reset(seed=1)[0], theirs.reset(seed=1)[0]
    assert a.tobytes() == b.tobytes()
    for actions in actions_for(mine, 8, seed=2):
        x, y = mine.step(actions), theirs.step(actions)
        for p, q in zip(x[:4], y[:4], strict=True):
            assert np.array_equal(p, q)
        assert_same_infos(x[4], y[4])


def assert_same_infos(mine, theirs):
    for name, value in theirs.items():
        if name == "final_info":
            assert_same_infos(mine[name], value)
        elif name.startswith("_"):
            assert np.array_equal(mine[name], value), name
        else:
            mask = theirs[f"_{name}"]
            for a, b in zip(mine[name][mask], value[mask], strict=True):
                assert np.array_equal(a, b), name


def test_without_autoreset_a_mask_says_which_copies_begin_anew():
    env = vector(max_episode_steps=2, autoreset_mode="DISABLED")
    env.reset(seed=0)
    rest = np.zeros((N, 2), np.float32)
    env.step(rest)
    _, _, _, cut_off, _ = env.step(rest)
    assert cut_off.all()
    with pytest.raises(RuntimeError, match="reset"):
        env.step(rest)
    before = env.unwrapped.info_of(1)
    mask = np.array([True, False, False])
    env.reset(options={"reset_mask": mask, "mass": 0.3})
    assert env.unwrapped.info_of(0)["mass"] == 0.3 and env.unwrapped.info_of(1) == before
    with pytest.raises(hc.ParameterError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(N, bool)})


def test_arrays_belong_to_the_caller():
    env = vector()
    x, info = env.reset(seed=0)
    kept, mass = x.copy(), info["mass"].copy()
    env.step(np.ones((N, 2), np.float32))
    env.reset(seed=5)
    assert np.array_equal(x, kept) and np.array_equal(info["mass"], mass)


def test_a_vector_draws_its_copies():
    env = vector(n=2, render_mode="rgb_array")
    env.reset(seed=0)
    frames = env.render()
    assert len(frames) == 2 and frames[0].shape == frames[1].shape
    env.close()


@pytest.mark.parametrize(
    "kw, field",
    [
        ({"autoreset_mode": "LATER"}, "autoreset_mode"),
        ({"n": 0}, "num_envs"),
        ({"max_episode_steps": 0}, "max_episode_steps"),
    ],
)
def test_bad_arguments_are_refused_by_name(kw, field):
    from hapticclay.gym.cut_line import CutLineVector

    kw = {"num_envs": kw.pop("n", N), **kw}
    with pytest.raises(hc.ParameterError) as told:
        CutLineVector(engine="python", **kw)
    assert told.value.field == field


def test_actions_of_another_shape_are_refused():
    env = vector().unwrapped
    env.reset(seed=0)
    with pytest.raises(hc.ParameterError, match="shape"):
        env.step(np.zeros((N, 3)))
