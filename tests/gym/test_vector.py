"""Many copies: each is the single environment of its seed, and that is a run of `simulate`."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import hapticclay as hc
import hapticclay.gym
from hapticclay.gym import cut_line, registry, task

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


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_a_restart_that_was_refused_is_made_at_the_next_step(mode):
    """The second of the scenes that follow the first episodes is refused, once."""
    made = []

    class Refusing(cut_line.CutLineTask):
        def scenario(self, truth):
            made.append(truth)
            if len(made) == N + 2:
                raise hc.ParameterError("b", truth["b"], "must be another")
            return super().scenario(truth)

    class RefusingVector(hapticclay.gym.TaskVectorEnv):
        task_type = Refusing

    env = RefusingVector(N, max_episode_steps=1, autoreset_mode=mode, engine="python")
    env.reset(seed=0)
    rest = np.zeros((N, 2), np.float32)
    with pytest.raises(hc.ParameterError, match="must be another"):
        env.step(rest), env.step(rest)
    _, rewards, ended, cut_off, _ = env.step(rest)
    assert not rewards.any() and not (ended | cut_off).any()  # the step that restarts them
    assert len(made) > N + 2
    assert env.step(rest)[3].all()


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


@pytest.mark.parametrize("seed", [[1, 2], [1, "a", 2], [1.5, 2, 3], {1, 2, 3}, "abc", 2**128 - 2])
def test_what_is_no_seed_of_three_copies_is_refused(seed):
    env = vector().unwrapped
    with pytest.raises(hc.ParameterError) as told:
        env.reset(seed=seed)
    assert told.value.field.startswith("seed")


def test_seeds_may_be_an_array_or_a_range():
    env = vector().unwrapped
    expected = env.reset(seed=4)[0].tobytes()
    for seed in (np.array([4, 5, 6]), range(4, 7), (4, 5, 6), np.int32(4), np.array(4)):
        assert env.reset(seed=seed)[0].tobytes() == expected


def test_each_copy_takes_options_of_its_own():
    """As single environments do."""
    options = [{"mass": 0.3}, None, {"mass": 0.4, "b": 50.0}]
    x, _ = vector().reset(seed=7, options=options)
    for i, given in enumerate(options):
        env = gymnasium.make(CUT, engine="python")
        assert env.reset(seed=7 + i, options=given)[0].tobytes() == x[i].tobytes()


NO_OPTIONS = [
    3, "b", [{}], [{}, {}, 3], [{}, {}, {"reset_mask": [True]}], {"b": [1.0] * 3},
    {"reset_mask": "abc"}, {"reset_mask": [1, 0, 1]}, {"reset_mask": [[True], [True, False]]},
]  # fmt: skip


@pytest.mark.parametrize("options", NO_OPTIONS, ids=str)
def test_refused_options_draw_nothing(options):
    env, other = vector().unwrapped, vector().unwrapped
    env.reset(seed=0), other.reset(seed=0)
    with pytest.raises(hc.ParameterError) as told:
        env.reset(seed=9, options=options)
    assert told.value.field.startswith(("options", "reset_mask"))
    assert env.reset()[0].tobytes() == other.reset()[0].tobytes()


def test_before_a_reset_and_after_a_close_there_is_no_episode():
    env = vector(render_mode="rgb_array").unwrapped
    uses = (lambda: env.step(np.zeros((N, 2))), env.render, lambda: env.info_of(0))
    for _ in range(2):
        for use in uses:
            with pytest.raises(RuntimeError, match="reset"):
                use()
        with pytest.raises(hc.ParameterError, match="reset_mask"):
            env.reset(options={"reset_mask": np.array([True, False, True])})
        first = env.reset(seed=1)[0]
        env.step(np.zeros((N, 2)))
        env.close(), env.close()
    assert env.reset(seed=1)[0].tobytes() == first.tobytes()
    env.close()


def test_a_vector_says_that_it_cannot_be_copied():
    env = vector().unwrapped
    env.reset(seed=0)
    for use in (pickle.dumps, copy.deepcopy):
        with pytest.raises(TypeError, match="make another"):
            use(env)


def test_wrappers_of_gymnasium_take_it():
    import gymnasium.wrappers.vector as wrappers

    env = wrappers.RecordEpisodeStatistics(vector(max_episode_steps=3))
    env = wrappers.RescaleAction(wrappers.NormalizeObservation(env), np.float32(-2), np.float32(2))
    env.reset(seed=0)
    for _ in range(4):
        x, *_, infos = env.step(env.action_space.sample())
        if "episode" in infos:
            assert (infos["episode"]["l"] == 3).all()
    assert np.isfinite(x).all()
    env.close(), env.close()
