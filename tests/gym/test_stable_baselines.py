"""The adapter of Stable-Baselines3; needs that package, which needs torch."""

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import hapticclay as hc
import hapticclay.gym
from hapticclay.gym import registry


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
