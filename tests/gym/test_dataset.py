"""Data sets: whole or not at all, refused before any episode, the same bits after interruptions."""

import json
import math
import signal
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.gym import dataset
from hapticclay.studies import store
from tests.waiting import PATIENCE

CUT, NAME = "CutLine-v0", "hapticclay/test/a-v0"
OF_WORDS = ["gym", "dataset", CUT, "--name", NAME]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of Minari's data sets; scores cost two episodes, not forty."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    monkeypatch.setattr(dataset, "SCORED", 2)
    return tmp_path


def rows_of(folder, name):
    """Everything that readers see of a data set, as Minari reads it."""
    minari = pytest.importorskip("minari")
    found = minari.load_dataset(name)
    rows = [
        (e.id, *(np.asarray(x).tobytes() for x in (e.observations, e.actions, e.rewards)),
         e.terminations.tolist(), e.truncations.tolist())
        for e in found.iterate_episodes()
    ]  # fmt: skip
    told = json.loads((folder / name / "data" / "metadata.json").read_text())
    seeds = [x["seed"] for x in found.storage.get_episode_metadata(range(len(rows)))]
    return rows, seeds, {k: v for k, v in told.items() if k != "dataset_id"}


def stopped_after(n):
    """A progress function that interrupts a recording when n episodes are kept."""

    def progress(count):
        if count >= n:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize(
    "name",
    [None, 3, "", "a b", "a", "a/b", "../a-v0", "/a-v0", "a//b-v0", "a-v", "x/b-v0", ".a-v0"],
)
def test_names_that_minari_cannot_read_are_refused(folder, name):
    with pytest.raises(hc.ParameterError) as told:
        dataset.record(CUT, name, 1, engine="python")
    assert told.value.field == "name"
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    "kw", [{"id": "Cut"}, {"episodes": 0}, {"episodes": 2.5}, {"noise": math.nan}, {"seed": -1},
           {"seed": 2**63}, {"engine": "fast"}],
)  # fmt: skip
def test_bad_arguments_are_refused_before_any_episode(folder, kw):
    given = {"id": CUT, "name": NAME, "episodes": 1, "engine": "python", **kw}
    with pytest.raises(hc.ParameterError) as told:
        dataset.record(**given)
    assert told.value.field == next(iter(kw))
    assert not list(folder.iterdir())


def test_a_data_set_that_is_there_is_refused_before_any_episode(folder, capsys, monkeypatch):
    (folder / NAME / "data").mkdir(parents=True)

    def never(*args, **kw):
        raise AssertionError("an environment was made")

    monkeypatch.setattr(gymnasium, "make", never)
    assert app.main(OF_WORDS) == 2
    told = capsys.readouterr()
    assert len(told.err.splitlines()) == 1 and f"minari delete {NAME}" in told.err


@pytest.mark.parametrize(
    "words", ["dataset --seeds 5", "baselines --episodes 5", "baselines --noise 0.2",
              "baselines --name a-v0"],
)  # fmt: skip
def test_options_of_the_other_action_are_refused(words, capsys):
    assert app.main(["gym", *words.split()]) == 2
    assert f"say gym {'baselines' if 'dataset' in words else 'dataset'}" in capsys.readouterr().err


def test_an_interrupted_recording_goes_on_to_the_same_bits(folder, capsys):
    """Interrupted twice, a kept file damaged between: the data set is that of one call."""
    pytest.importorskip("minari")
    dataset.record(CUT, "whole-v0", 3)
    for n in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            dataset.record(CUT, NAME, 3, progress=stopped_after(n))
        assert not (folder / NAME).exists()
    kept = sorted(folder.rglob("part-*.parquet"))
    assert len(kept) == 2
    kept[1].write_bytes(kept[1].read_bytes()[:100])
    counts = []
    dataset.record(CUT, NAME, 3, progress=counts.append)
    assert counts == [1, 2, 3]  # one was kept, two recorded
    rows, seeds, told = rows_of(folder, NAME)
    assert (rows, seeds, told) == rows_of(folder, "whole-v0")
    assert seeds == [0, 1, 2] and told["total_episodes"] == 3
    files = [folder / x / "data" / "main_data.hdf5" for x in (NAME, "whole-v0")]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert not list(folder.rglob("*.parquet"))
    for row in rows:  # noise is of each episode, not shared
        assert row[2] != rows[row[0] - 1][2]


KILLED = """
import os, signal, sys
from hapticclay.gym import dataset

def end(count):
    if count == 2:
        os.kill(os.getpid(), signal.SIGKILL)

dataset.record("CutLine-v0", sys.argv[1], 4, progress=end)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="POSIX")
@pytest.mark.parametrize("episodes", [1, 3])
def test_a_killed_recording_goes_on_with_any_number_of_episodes(folder, episodes):
    """Two of four are kept; the data set is that of a call of its own with that many."""
    pytest.importorskip("minari")
    killed = subprocess.run([sys.executable, "-c", KILLED, NAME], timeout=PATIENCE)
    assert killed.returncode == -signal.SIGKILL
    counts = []
    dataset.record(CUT, NAME, episodes, progress=counts.append)
    assert counts == ([1] if episodes == 1 else [2, 3])
    dataset.record(CUT, "whole-v0", episodes)
    assert rows_of(folder, NAME) == rows_of(folder, "whole-v0")


def test_of_two_recordings_at_once_one_is_refused(folder):
    pytest.importorskip("minari")
    with store.claimed(
        dataset.Recording(CUT, 0.1, 0, 2, "auto"), folder / "hapticclay/test/.a-v0.part"
    ):
        with pytest.raises(hc.ParameterError, match="another recording is at work"):
            dataset.record(CUT, NAME, 2, engine="python")


def test_the_command_goes_on_and_other_arguments_are_refused(folder, capsys, monkeypatch):
    pytest.importorskip("minari")
    record = dataset.record
    monkeypatch.setattr(
        dataset, "record", lambda *a, progress, **kw: record(*a, progress=both(progress), **kw)
    )

    def both(progress):
        stop = stopped_after(1)
        return lambda n: (progress(n), stop(n))

    assert app.main([*OF_WORDS, "--episodes", "2"]) == 130
    assert "1 of 2 episodes are kept; the same command continues" in capsys.readouterr().out
    monkeypatch.setattr(dataset, "record", record)
    assert app.main([*OF_WORDS, "--episodes", "2", "--noise", "0.2"]) == 2
    assert "holds another recording (noise = 0.1)" in capsys.readouterr().err
    assert app.main([*OF_WORDS, "--episodes", "2"]) == 0
    assert f"{NAME}: 2 episodes, " in capsys.readouterr().out
    assert app.main([*OF_WORDS, "--episodes", "2"]) == 2
    rows, _, told = rows_of(folder, NAME)
    assert [row[0] for row in rows] == [0, 1]
    assert told["num_episodes_average_score"] == 2
