"""Minari data sets: episodes of a baseline with noise on its actions, kept as they are recorded."""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import gymnasium
import numpy as np

from .. import __version__
from ..arguments import checked
from ..errors import Bound, ParameterError, choice, integer, needing
from ..studies import store
from ..studies.store_runs import run_plan
from ..studies.sweep_rows import Notes
from .baselines import BASELINES, at_random, mean_of, returns
from .environment import Engine
from .registry import NAMESPACE

BASELINE = {  # the best policy of `BASELINES` that uses only what an agent observes
    "CutLine-v0": "PD along the line",
    "PareEdge-v0": "PD along the line",
    "AdaptiveGain-v0": "identify, then set",
    "ProbeClay-v0": "least squares",
}
SCORED = 20  # episodes behind the scores stored with a data set
SEEDS = 2**63 - 1  # the largest seed that Minari's files hold
NAME = re.compile(r"(?:(?=..+/)(?:[-\w]+/)+)?[-\w]*\w-v\d+")  # of those Minari takes, with version
FOLDER = "MINARI_DATASETS_PATH"  # Minari's variable for the folder of data sets
SCHEMA = "hapticclay-recording-1"
COLUMNS: dict[str, tuple[Any, str]] = {  # of an episode: type and description
    "observations": (np.float32, "observations, one after another"),
    "actions": (np.float32, "actions, one after another"),
    "rewards": (float, "reward of each control period"),
    "terminations": (bool, "whether the episode ended, after each control period"),
    "truncations": (bool, "whether it was cut off, likewise"),
}
WRITTEN = 50  # episodes that Minari's writer is given at once


@dataclass(frozen=True)
class Recording(store.Plan):
    """Episodes of an environment's baseline with noise on its actions, one per file."""

    id: str  # name of the environment
    noise: float  # standard deviation
    seed: int  # seed of the first episode; counted up for the others
    episodes: int  # a recording may be continued with another number
    engine: str  # the bits are the same for all
    chunk: int | None = 1

    notes: ClassVar[Notes] = {
        "run": ("", "number of the episode"),
        **{name: ("", description) for name, (_, description) in COLUMNS.items()},
    }
    noun: ClassVar[str] = "recording"
    remedy: ClassVar[str] = "take another name, or remove that folder"

    def __len__(self) -> int:
        return self.episodes

    def described(self) -> dict[str, Any]:
        """What determines each episode."""
        return {"schema": SCHEMA, "id": self.id, "noise": self.noise, "seed": self.seed}

    def blank_row(self) -> dict[str, Any]:
        """An episode, for the types of its columns."""
        return {"run": 0, **{name: np.zeros(1, kind) for name, (kind, _) in COLUMNS.items()}}

    def rows(self, runs: range, late: Callable[[], bool]) -> list[dict[str, Any]]:
        """Records episodes, with their observations and actions one after another."""
        return [{"run": i, **self._episode(self.seed + i)} for i in runs]

    @functools.cached_property
    def env(self) -> Any:
        return gymnasium.make(f"{NAMESPACE}/{self.id}", engine=self.engine)

    def _episode(self, seed: int) -> dict[str, np.ndarray]:
        """An episode by columns. Its noise has a stream of its own, so it depends on no other."""
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
        observation, info = self.env.reset(seed=seed)
        policy = BASELINES[self.id][BASELINE[self.id]](self.env.unwrapped.task, [info], 0)
        observations, steps, over = [observation], [], False
        while not over:
            action = policy(observation[None])[0]
            action = np.clip(action + self.noise * rng.standard_normal(action.shape), -1.0, 1.0)
            action = action.astype(np.float32)
            observation, reward, ended, cut_off, _ = self.env.step(action)
            observations.append(observation)
            steps.append((action, reward, ended, cut_off))
            over = ended or cut_off
        columns = (observations, *zip(*steps, strict=True))
        return {name: np.array(x).ravel() for name, x in zip(COLUMNS, columns, strict=True)}


@checked
def record(
    id: str,
    name: str,
    episodes: Annotated[int, Bound(1, 100_000)],
    noise: Annotated[float, Bound(0.0, 1.0)] = 0.1,
    seed: int = 0,
    engine: Engine = "auto",
    *,
    progress: Callable[[int], None] | None = None,
) -> Any:
    """Records episodes of the environment's baseline as a Minari data set.

    Each episode is kept as soon as it ends, in a hidden folder beside the data sets. After an
    interruption the same call continues there, and the data set has the same bits as one that was
    never interrupted. The data set appears when it is complete.
    """
    choice("id", id, tuple(BASELINE))
    seed = integer("seed", seed, 0, SEEDS - episodes)
    target = _target(name)
    with needing("a data set", "minari", "minari"):
        import minari  # noqa: F401  # pyright: ignore[reportMissingImports]
    with needing("a data set", "h5py", "minari"):  # which Minari imports when it writes
        if importlib.util.find_spec("h5py") is None:
            raise ImportError
    kept = target.with_name(f".{target.name}.part")
    plan = Recording(id, noise, seed, max(episodes, store.last_part(kept) + 1), engine)
    count = 0

    def show(more: int) -> None:
        nonlocal count
        count += more
        if progress:
            progress(min(count, episodes))

    with contextlib.closing(plan.env):
        run_plan(plan, kept, 1, progress=show, before=lambda _, todo: show(len(plan) - len(todo)))
    return _written(plan, kept, name, episodes)


def _folder() -> Path:
    """The folder of Minari's data sets."""
    given = os.environ.get(FOLDER)
    return Path(given) if given is not None else Path.home() / ".minari" / "datasets"


def _target(name: Any) -> Path:
    """The folder of a new data set; refused where there is one."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        bound = "must be letters, digits, - and _, with a version: as hapticclay/cut-line/pd-v0"
        raise ParameterError("name", name, bound)
    target = _folder() / name
    if os.path.exists(target):
        remedy = f"take another name or version, or say minari delete {name}"
        raise ParameterError("name", name, f"must be new: {target} is there; {remedy}")
    return target


def _buffers(plan: Recording, kept: Path, which: range) -> list[Any]:
    """Kept episodes as Minari's writer takes them."""
    from minari.data_collector import (  # pyright: ignore[reportMissingImports]
        EpisodeBuffer,
    )

    found = []
    for i in which:
        table = store.read_part(store.part_file(kept, i))
        if table is None:
            raise OSError(f"episode {i} in {kept} was damaged while the data set was written")
        [row] = table.to_pylist()
        columns = {name: np.array(row[name], kind) for name, (kind, _) in COLUMNS.items()}
        n = len(columns["rewards"])
        columns["observations"] = columns["observations"].reshape(n + 1, -1)
        columns["actions"] = columns["actions"].reshape(n, -1)
        lists: dict[str, Any] = {name: list(x) for name, x in columns.items()}
        found.append(EpisodeBuffer(id=i, seed=plan.seed + i, infos={}, **lists))
    return found


def _written(plan: Recording, kept: Path, name: str, n: int) -> Any:
    """Writes the data set beside the kept episodes, moves it to its place, removes them."""
    import minari  # pyright: ignore[reportMissingImports]

    id, engine, policy = plan.id, plan.engine, BASELINE[plan.id]
    scores = [
        mean_of(returns(id, maker, range(SCORED), engine=engine).total)[0]
        for maker in (at_random, BASELINES[id][policy])
    ]
    folder = _folder()
    with tempfile.TemporaryDirectory(dir=kept) as beside, _datasets_in(beside):
        made = minari.create_dataset_from_buffers(
            dataset_id=name,
            buffer=_buffers(plan, kept, range(min(n, WRITTEN))),
            env=gymnasium.make(f"{NAMESPACE}/{id}", engine=engine),
            algorithm_name=f"{policy}, noise {plan.noise:g}",
            author="The hapticclay authors",
            author_email="none given",
            eval_env=f"{NAMESPACE}/{id}",
            code_permalink=f"hapticclay {__version__}: hapticclay/gym/dataset.py",
            description=f"{policy} in {NAMESPACE}/{id} of hapticclay {__version__}",
            ref_min_score=min(scores),
            ref_max_score=max(scores),
            num_episodes_average_score=SCORED,
        )
        for i in range(WRITTEN, n, WRITTEN):
            made.update_dataset_from_buffer(_buffers(plan, kept, range(i, min(i + WRITTEN, n))))
        metadata = made.storage.apply(minari.EpisodeMetadataCallback())
        made.storage.update_episode_metadata(metadata)
        _move(Path(beside), folder, name)
    shutil.rmtree(kept)
    return minari.load_dataset(name)


@contextlib.contextmanager
def _datasets_in(folder: str) -> Iterator[None]:
    """Lets Minari write to a folder."""
    before = os.environ.get(FOLDER)
    os.environ[FOLDER] = folder
    try:
        yield
    finally:
        if before is None:
            del os.environ[FOLDER]
        else:
            os.environ[FOLDER] = before


def _move(beside: Path, folder: Path, name: str) -> None:
    """Moves a data set and what describes its namespaces; the data set last, at once."""
    for description in sorted(beside.rglob("namespace_metadata.json")):
        place = folder / description.relative_to(beside)
        place.parent.mkdir(parents=True, exist_ok=True)
        if not os.path.exists(place):
            os.replace(description, place)
    try:
        os.rename(beside / name, folder / name)
    except OSError:  # another process was faster
        bound = f"must be new: {folder / name} was written meanwhile"
        raise ParameterError("name", name, bound) from None
