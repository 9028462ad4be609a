"""A wall is named alike in every command that has one, and is the wall that is meant."""

from dataclasses import replace
from typing import Any

import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.cli.walls import box_of
from hapticclay.errors import ParameterError

WORDS = (
    "--mass 200g --damper 0.5 --friction 0.01 --quantum 5um --Ts 2ms --delay 0.5ms "
    "--velocity-window 2 --filter 80 --hand 0.25 2 6 --unilateral"
)
MEANT = hc.VirtualWall(
    device=hc.Device(0.2, 0.5, 0.01, 5e-6), operator=hc.Operator(0.25, 2.0, 6.0), Ts=2e-3,
    delay=5e-4, velocity_window=2, velocity_filter=80.0, unilateral=True,
)  # fmt: skip


def device(words):
    """The options of a device on a command line."""
    command: Any = app.parse_words(["zwidth", *words.split()])
    return command.device


def wall(words):
    """The options of a wall on a command line."""
    command: Any = app.parse_words(["mbk", *words.split()])
    return command.wall


def test_every_option_reaches_its_field():
    found = device(WORDS)
    assert found.wall() == MEANT
    assert len(found.given) == 11 - 1  # all but the velocity, which excludes a filter
    whole = wall(WORDS + " --K 300 --B 2 --M -0.05")
    assert whole.wall() == replace(MEANT, K=300.0, B=2.0, M=-0.05)
    assert device("--velocity exact").wall().velocity == "exact"


def test_options_change_a_file_and_defaults_do_not(tmp_path):
    file = MEANT.save(tmp_path / "w.toml")
    assert wall("").wall(file, K=7.0) == MEANT
    told = wall("--filter none --K 3").wall(file)
    assert told == replace(MEANT, velocity_filter=None, K=3.0)
    assert wall("").wall(None, K=7.0) == hc.VirtualWall(7.0)


def test_what_is_given_in_vain_is_refused():
    for command in ("zwidth", "mbk"):
        with pytest.raises(ParameterError, match="mass = '200g': is for a bare device"):
            app.parse_words([command, "--arm", "x", "--mass", "200g"])
        app.parse_words([command, "--arm", "x", "--hand", "0.2", "1", "0", "--Ts", "none"])
    assert box_of(None) is None and box_of((0.0, 1.0, 2.0, 3.0, 4.0, 5.0)).damper == (2.0, 3.0)


def test_a_rate_is_another_name_for_the_sample():
    assert device("--rate 0.5kHz").wall().Ts == device("--Ts 2ms").wall().Ts == 2e-3
    with pytest.raises(ParameterError, match="rate = '500': is 1/Ts: give one of the two"):
        device("--rate 500 --Ts 2ms")
    with pytest.raises(ParameterError, match="--rate = 0.0: must be a finite number > 0 Hz"):
        device("--rate 0")


@pytest.mark.parametrize("command", ["zwidth", "mbk", "impedance", "passivity"])
def test_each_command_takes_them(command, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert app.main([command, "--damper", "-1 kg", "--out", str(tmp_path)]) == 2
    assert "--damper = '-1 kg': must be a number in N.s/m, not in kg" in capsys.readouterr().err
    assert app.main([command, "gone.toml", "--out", str(tmp_path)]) == 2
    assert "gone.toml" in capsys.readouterr().err
