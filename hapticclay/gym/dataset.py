"""Minari data sets: episodes of a baseline with noise on its actions, kept as they are recorded."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import re
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from .. import __version__
from ..errors import ParameterError, choice, integer, needing, number
from ..files import atomic
from ..simulation.engines import ENGINES
from .baselines import BASELINES, at_random, mean_of, returns
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
COLUMNS = ("observations", "actions", "rewards", "terminations", "truncations")
WRITTEN = 50  # episodes that Minari's writer is given at once


def record(
    id: str,
    name: str,
    episodes: int,
    noise: float = 0.1,
    seed: int = 0,
    engine: str = "auto",
    *,
    progress: Callable[[int], None] | None = None,
) -> Any:
    """Records episodes of the environment's baseline as a Minari data set.

    Each episode is kept as soon as it ends, in a hidden folder beside the data sets. After an
    interruption the same call continues there, and the data set has the same bits as one that was
    never interrupted. The data set appears when it is complete.
    """
    choice("id", id, tuple(BASELINE))
    choice("engine", engine, ENGINES)
    episodes = integer("episodes", episodes, 1, 100_000)
    noise = number("noise", noise, 0.0, 1.0)
    seed = integer("seed", seed, 0, SEEDS - episodes)
    target = _target(name)
    with needing("a data set", "minari", "minari"):
        import minari  # noqa: F401  # pyright: ignore[reportMissingImports]
    with needing("a data set", "h5py", "minari"):  # which Minari imports when it writes
        if importlib.util.find_spec("h5py") is None:
            raise ImportError
    settings = {"id": id, "noise": noise, "seed": seed, "hapticclay": __version__}
    kept = _begun(target.with_name(f".{target.name}.part"), settings)
    _record_missing(kept, episodes, settings, engine, progress or (lambda n: None))
    return _written(kept, target, name, episodes, settings, engine)


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
    if target.exists():
        remedy = f"take another name or version, or say minari delete {name}"
        raise ParameterError("name", name, f"must be new: {target} is there; {remedy}")
    return target


def _begun(kept: Path, settings: dict[str, Any]) -> Path:
    """The folder of a recording, begun or continued; refused where others settings began it."""
    file = kept / "recording.json"
    with contextlib.suppress(FileNotFoundError):
        before = _settings_in(file)
        for name, value in settings.items():
            if before.get(name) != value:
                bound = f"must be {before.get(name)!r}, as in the interrupted recording in {kept}"
                remedy = "or take another name, or remove that folder"
                raise ParameterError(name, value, f"{bound}; {remedy}")
        return kept
    with atomic(file) as f:
        f.write(json.dumps(settings).encode())
    return kept


def _settings_in(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_bytes())
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise ParameterError(
            "name", str(file.parent), "must not hold a damaged recording: remove it"
        )
    return found


def _record_missing(
    kept: Path, n: int, settings: dict[str, Any], engine: str, progress: Callable[[int], None]
) -> None:
    """Records the episodes that are not kept yet."""
    missing = [i for i in range(n) if _episode_in(_file_of(kept, i)) is None]
    progress(n - len(missing))
    if not missing:
        return
    env = gymnasium.make(f"{NAMESPACE}/{settings['id']}", engine=engine)
    try:
        for count, i in enumerate(missing, 1):
            rows = _episode(env, settings, settings["seed"] + i)
            with atomic(_file_of(kept, i)) as f:
                np.savez(f, **rows)  # pyright: ignore[reportArgumentType]
            progress(n - len(missing) + count)
    finally:
        env.close()


def _file_of(kept: Path, i: int) -> Path:
    return kept / f"episode_{i}.npz"


def _episode_in(file: Path) -> dict[str, np.ndarray] | None:
    """A kept episode by columns; None where it is not there, or damaged."""
    try:
        with file.open("rb") as f, np.load(f) as found:
            return {name: found[name] for name in COLUMNS}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _episode(env: Any, settings: dict[str, Any], seed: int) -> dict[str, np.ndarray]:
    """An episode by columns. Its noise has a stream of its own, so it depends on no other."""
    id, noise = settings["id"], settings["noise"]
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    observation, info = env.reset(seed=seed)
    policy = BASELINES[id][BASELINE[id]](env.unwrapped.task, [info], 0)
    seen, steps, over = [observation], [], False
    while not over:
        action = policy(observation[None])[0]
        action = np.clip(action + noise * rng.standard_normal(action.shape), -1.0, 1.0)
        action = action.astype(np.float32)
        observation, reward, ended, cut_off, _ = env.step(action)
        seen.append(observation)
        steps.append((action, reward, ended, cut_off))
        over = ended or cut_off
    columns = (seen, *zip(*steps, strict=True))
    return {name: np.array(x) for name, x in zip(COLUMNS, columns, strict=True)}


def _buffers(kept: Path, which: range) -> list[Any]:
    """Kept episodes as Minari's writer takes them."""
    from minari.data_collector import (  # pyright: ignore[reportMissingImports]
        EpisodeBuffer,
    )

    settings = _settings_in(kept / "recording.json")
    found = []
    for i in which:
        rows = _episode_in(_file_of(kept, i))
        if rows is None:
            raise OSError(f"{_file_of(kept, i)} has gone while the data set was written")
        lists: dict[str, Any] = {name: list(x) for name, x in rows.items()}
        found.append(EpisodeBuffer(id=i, seed=settings["seed"] + i, infos={}, **lists))
    return found


def _written(
    kept: Path, target: Path, name: str, n: int, settings: dict[str, Any], engine: str
) -> Any:
    """Writes the data set beside the kept episodes, moves it to its place, removes them."""
    import minari  # pyright: ignore[reportMissingImports]

    id = settings["id"]
    maker = BASELINES[id][BASELINE[id]]
    scores = [
        mean_of(returns(id, made, range(SCORED), engine=engine).total)[0]
        for made in (at_random, maker)
    ]
    folder = _folder()
    with tempfile.TemporaryDirectory(dir=kept) as beside, _datasets_in(beside):
        made = minari.create_dataset_from_buffers(
            dataset_id=name,
            buffer=_buffers(kept, range(min(n, WRITTEN))),
            env=gymnasium.make(f"{NAMESPACE}/{id}", engine=engine),
            algorithm_name=f"{BASELINE[id]}, noise {settings['noise']:g}",
            author="The hapticclay authors",
            author_email="none given",
            eval_env=f"{NAMESPACE}/{id}",
            code_permalink=f"hapticclay {__version__}: hapticclay/gym/dataset.py",
            description=f"{BASELINE[id]} in {NAMESPACE}/{id} of hapticclay {__version__}",
            ref_min_score=min(scores),
            ref_max_score=max(scores),
            num_episodes_average_score=SCORED,
        )
        for i in range(WRITTEN, n, WRITTEN):
            made.update_dataset_from_buffer(_buffers(kept, range(i, min(i + WRITTEN, n))))
        sums = made.storage.apply(minari.EpisodeMetadataCallback())
        made.storage.update_episode_metadata(sums)
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
        if not place.exists():
            os.replace(description, place)
    try:
        os.rename(beside / name, folder / name)
    except OSError:  # another process was faster
        bound = f"must be new: {folder / name} was written meanwhile"
        raise ParameterError("name", name, bound) from None
