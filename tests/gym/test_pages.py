"""Pages of the environments: tables are those of the spaces, snippets run; benchmarks; command."""

import json
import re
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

from benchmarks import gym_baselines, gym_extremes, gym_speed
from hapticclay.gym import baselines, registry

ROOT = Path(__file__).parents[2]
NAMES = list(registry.ENTRIES)


def section(text, name):
    found = re.search(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", text, re.S)
    assert found, name
    return found[1]


@pytest.mark.parametrize("id", NAMES)
def test_tables_of_a_page_are_those_of_the_spaces(id):
    text = gym_baselines.page_of(id).read_text()
    for name, table in gym_baselines.spaces(id).items():
        assert section(text, name) == table
    env = gymnasium.make(f"hapticclay/{id}", engine="python")
    assert f"Box(-1, 1, {env.action_space.shape}, float32)" in text
    assert f"Box({env.observation_space.shape}, float32)" in text


@pytest.mark.parametrize("id", NAMES)
def test_a_page_has_the_parts_of_gymnasiums_own(id):
    text = gym_baselines.page_of(id).read_text()
    parts = re.findall(r"^## (.*)$", text, re.M)
    assert parts[:7] == [
        "Action space", "Observation space", "Rewards", "Starting state", "Episode end",
        "Arguments", "Information",
    ]  # fmt: skip
    assert parts[-1] == "Version history"
    assert (ROOT / "docs" / re.search(r"\]\((gym_\w+\.png)\)", text)[1]).is_file()
    told = section(text, "baselines")
    for name in baselines.BASELINES[id]:
        assert f"| {name} |" in told


def test_snippets_of_the_page_of_the_suite_say_what_they_print():
    text = (ROOT / "docs" / "gym.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines() == re.findall(r"print\(.*\)  # (.*)", code) != []


def test_extreme_episodes_are_finite(tmp_path):
    """The quick version of the benchmark's 10,000 episodes."""
    line = ["--episodes", "6", "--longest", "8", "--engine", "auto", "--out", str(tmp_path)]
    found = gym_extremes.main(line)
    assert [row["id"] for row in found["environments"]] == list(registry.IDS)
    for row in found["environments"]:
        assert row["episodes"] >= 6 and row["bad"] == 0
    assert (tmp_path / "gym_extremes.json").is_file()


def test_the_published_table_is_that_of_the_published_speeds():
    data = json.loads(gym_speed.PUBLISHED.read_text())
    text = (ROOT / "docs" / "gym.md").read_text()
    assert section(text, "speed") == gym_speed.table(data)
    assert [row["id"] for row in data["environments"]] == list(registry.IDS)


def test_speed_is_measured_beside_the_floor(tmp_path):
    line = ["--rounds", "1", "--seconds", "0.05", "--copies", "2", "--engine", "python"]
    line += ["--ids", "hapticclay/CutLine-v0", "--out", str(tmp_path)]
    (row,) = gym_speed.main(line)["environments"]
    assert row["single"]["share_of_floor"] > 0.0 and row["vector"]["copies"] == 2
    assert (tmp_path / "gym_speed.json").is_file()
