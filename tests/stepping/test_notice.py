"""What a compilation says: how long it takes, that it lives, how long it took; no thread stays."""

import dataclasses
import io
import re
import sys
import threading
import time

import pytest

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.stepping import machine_code, notice, scene


class Stream(io.StringIO):
    """A stream that opens its gate after some signs of life."""

    terminal = False
    signs = 4  # the beginning, and three of life

    def __init__(self):
        super().__init__()
        self.writes, self.gate = 0, threading.Event()

    def isatty(self):
        return self.terminal

    def write(self, text):
        self.writes += 1
        if self.writes >= self.signs:
            self.gate.set()
        return super().write(text)


class Terminal(Stream):
    terminal = True


class Notebook(Terminal):
    """ipykernel's stream may say that it is a terminal; it shows no overwritten line."""


Notebook.__module__ = "ipykernel.iostream"


@pytest.fixture
def quick(monkeypatch):
    """Signs of life every millisecond, and a made-up clock that goes 7 s from look to look."""
    monkeypatch.setattr(notice, "TICK", 1e-3)
    monkeypatch.setattr(notice, "EVERY", 1e-3)
    seconds = iter(range(0, 10**9, 7))
    monkeypatch.setattr(notice.time, "monotonic", lambda: next(seconds))


def told(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    with notice.Notice("fast runs", 40.0) as n:
        n.begin()
        n.begin()  # the second function that the cache lacks
        assert stream.gate.wait(60.0)
    assert not n.life.is_alive()
    written = stream.writes
    time.sleep(0.01)
    assert stream.writes == written
    return stream.getvalue()


@pytest.mark.parametrize("kind", [Stream, Notebook])
def test_each_sign_is_a_line_where_none_can_be_overwritten(quick, monkeypatch, kind):
    first, *life, last = told(kind(), monkeypatch).splitlines()
    assert first == "hapticclay: compiling fast runs, this once: about 40 s"
    assert life[:3] == [f"hapticclay: compiling, {7 * k} s gone" for k in (1, 2, 3)]
    assert re.fullmatch(r"hapticclay: compiled in \d+ s", last)


@pytest.mark.parametrize("columns,width", [(None, 79), (0, 79), (50, 49), (200, 199)])
def test_a_terminal_counts_the_seconds_in_one_line(quick, monkeypatch, columns, width):
    stream = Terminal()
    if columns is not None:
        monkeypatch.setattr(stream, "fileno", lambda: 2)
        size = notice.os.terminal_size((columns, 24))
        monkeypatch.setattr(notice.os, "get_terminal_size", lambda fd: size)
    empty, *shown, erased, last = told(stream, monkeypatch).split("\r")
    line = "hapticclay: compiling fast runs, this once: about 40 s"
    assert empty == "" and shown[:2] == [line[:width], f"{line}, 7 s gone"[:width]]
    assert erased == " " * width and re.fullmatch(r"hapticclay: compiled in \d+ s\n", last)


def test_a_time_that_is_not_known_is_not_told(quick, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Stream())
    with notice.Notice("fast runs", None) as n:
        n.begin()
        assert stream.gate.wait(60.0)
    first, second, *_ = stream.getvalue().splitlines()
    assert first == "hapticclay: compiling fast runs, this once"
    assert second == "hapticclay: compiling, 7 s gone"


def kind(**more):
    x = Profile((0.01,), (1.0, 2.0), Fy=(0.0, 0.5))
    scenario = dataclasses.replace(hc.free(), clay=Clay(x, x), control="sampled", **more)
    return machine_code.kind_of(scene.parts_of(scenario))


@pytest.mark.parametrize("what", [None, machine_code.COMPLETE, machine_code.CARRY])
def test_friction_in_physical_clay_that_yields_has_no_known_time(what):
    """Seconds were told for minutes; held clay, or no friction, adds up as it should."""
    slips = dict(hardware=hc.Hardware(friction=(0.02, 0.0)))
    for more, known in (
        (slips | dict(render="physical"), False),
        (slips, True),
        (dict(render="physical"), True),
    ):
        k = kind(**more) if what is None else (what, kind(**more))
        assert (machine_code.known_time(k) is not None) == known
        assert machine_code.known_time(k) in (None, machine_code.compile_time(k))


def test_without_a_compilation_nothing_is_said_or_started(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Stream())
    before = threading.active_count()
    with notice.Notice("fast runs", 40.0):
        assert threading.active_count() == before
    assert stream.getvalue() == ""


def test_what_fails_was_not_compiled(monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Stream())
    with pytest.raises(KeyError), notice.Notice("fast runs", 40.0) as n:
        n.begin()
        raise KeyError
    assert stream.getvalue().count("\n") == 1 and not n.life.is_alive()


@pytest.mark.parametrize("closed", [True, False])
def test_a_stream_that_is_gone_ends_nothing(quick, monkeypatch, closed):
    stream = Stream() if closed else None
    monkeypatch.setattr(sys, "stderr", stream)
    with notice.Notice("fast runs", 40.0) as n:
        n.begin()
        if stream:
            stream.close()
    assert not n.life.is_alive()
