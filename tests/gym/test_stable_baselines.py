"""The adapter of Stable-Baselines3; needs that package, which needs torch."""

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import hapticclay as hc
import hapticclay.gym
from hapticclay.gym import registry


@pytest.mark.filterwarnings("ignore:.*shows nothing here")  # tests have no display
@pytest.mark.parametrize("id", registry.IDS)
def test_its_checker_finds_nothing(id):
    from stable_baselines3.common.env_checker import check_env

    check_env(gymnasium.make(id, engine="python").unwrapped)


def test_the_adapter_steps_as_its_own_vector_does():
    """Episodes of 3 periods, against DummyVecEnv, over 7 steps."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    from hapticclay.gym.stable_baselines import StableBaselinesVecEnv

    mine = StableBaselinesVecEnv("CutLine-v0", 2, engine="python", max_episode_steps=3)
    id = "hapticclay/CutLine-v0"
    theirs = DummyVecEnv([lambda: gymnasium.make(id, engine="python", max_episode_steps=3)] * 2)
    mine.seed(5), theirs.seed(5)
    assert np.array_equal(mine.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    for _ in range(7):
        actions = rng.uniform(-0.3, 0.3, (2, 2)).astype(np.float32)
        a, b = mine.step(actions), theirs.step(actions)
        for x, y in zip(a[:3], b[:3], strict=True):
            assert np.array_equal(x, y)
        for x, y in zip(a[3], b[3], strict=True):
            assert x.keys() == y.keys()
            assert all(np.array_equal(x[name], y[name]) for name in x)
    mine.close()


def test_another_mode_of_autoreset_is_refused():
    from hapticclay.gym.cut_line import CutLineVector
    from hapticclay.gym.stable_baselines import StableBaselinesVecEnv

    with pytest.raises(hc.ParameterError, match="SAME_STEP"):
        StableBaselinesVecEnv(CutLineVector(2, engine="python"))


def test_options_are_those_of_each_copy():
    """Against DummyVecEnv: the infos of the reset, and those of the next, which has no options."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    from hapticclay.gym.stable_baselines import StableBaselinesVecEnv

    mine = StableBaselinesVecEnv("CutLine-v0", 3, engine="python", max_episode_steps=2)
    id = "hapticclay/CutLine-v0"
    theirs = DummyVecEnv([lambda: gymnasium.make(id, engine="python", max_episode_steps=2)] * 3)
    for options in ([{"mass": 0.3}, {}, {"b": 50.0}], {"mass": 0.4}, None):
        for env in (mine, theirs):
            env.seed(5)
            env.set_options(options)
        for _ in range(2):
            assert np.array_equal(mine.reset(), theirs.reset())
            assert mine.reset_infos == theirs.reset_infos
    for _ in range(2):  # to the end of an episode, after which the next infos are kept
        mine.step(np.zeros((3, 2))), theirs.step(np.zeros((3, 2)))
    assert mine.reset_infos == theirs.reset_infos
    mine.set_options([{"mass": 0.3}])
    with pytest.raises(hc.ParameterError, match="options"):
        mine.reset()
    mine.close()


def test_what_is_no_vector_environment_of_ours_is_refused_by_name():
    from hapticclay.gym.cut_line import CutLineVector
    from hapticclay.gym.stable_baselines import StableBaselinesVecEnv

    def own():
        return CutLineVector(2, engine="python", autoreset_mode="SAME_STEP")

    wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(own())
    single = gymnasium.make("hapticclay/CutLine-v0", engine="python")
    for env, told in (
        (wrapped, "unwrapped"), (single, "TaskVectorEnv"), (3, "TaskVectorEnv"),
        ("CutLin-v0", "did you mean 'CutLine-v0'"),
    ):  # fmt: skip
        with pytest.raises(hc.ParameterError, match=told) as error:
            StableBaselinesVecEnv(env)
        assert error.value.field == "env"
    for kw in ({"num_envs": 2}, {"engine": "python"}):
        with pytest.raises(hc.ParameterError, match="must not be given"):
            StableBaselinesVecEnv(own(), **kw)
    with pytest.raises(hc.ParameterError, match="SAME_STEP"):
        StableBaselinesVecEnv("CutLine-v0", 2, autoreset_mode="NEXT_STEP")
