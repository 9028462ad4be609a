"""Machine code on disk: what is damaged is compiled again, what cannot be written is not kept."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

numba = pytest.importorskip("numba")

from hapticclay.stepping import cache, machine_code  # noqa: E402


def seventh(x):
    return x / 7


def fresh(folder):
    """A dispatcher as a new process has it."""
    made = numba.njit(seventh)
    made._cache = cache.FileCache(seventh, folder)
    return made


def hits(made):
    return sum(made.stats.cache_hits.values())


def flipped(data):
    return data[:-100] + bytes([data[-100] ^ 4]) + data[-99:]


DAMAGE = {
    "empty": lambda data: b"",
    "short": lambda data: data[:7],
    "cut": lambda data: data[: len(data) // 2],
    "longer": lambda data: data + b"x",
    "flipped": flipped,
    "garbage": lambda data: os.urandom(len(data)),
    "foreign": lambda data: sealed(b"no pickle"),
    "another": lambda data: sealed(cache.dumps((("other", "key"), ()))),
}


def sealed(body):
    return cache.hashlib.sha256(body).digest() + body


def test_machine_code_is_kept_by_types(tmp_path):
    first = fresh(tmp_path)
    assert first(14) == 2.0 and first(3.5) == 0.5 and hits(first) == 0
    assert len(list(tmp_path.iterdir())) == 2
    second = fresh(tmp_path)
    assert second(14) == 2.0 and second(3.5) == 0.5 and hits(second) == 2


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_machine_code_is_compiled_again(damage, tmp_path):
    assert fresh(tmp_path)(14) == 2.0
    (file,) = tmp_path.iterdir()
    file.write_bytes(DAMAGE[damage](file.read_bytes()))
    (tmp_path / f"1234{machine_code.MARK}").touch()
    again, told = fresh(tmp_path), []
    before = cache.on_miss.set(lambda: told.append(1))
    assert again(14) == 2.0 and hits(again) == 0 and told == [1]
    cache.on_miss.reset(before)
    assert list(tmp_path.iterdir()) == [file]  # the mark promised what was not there
    third = fresh(tmp_path)
    assert third(14) == 2.0 and hits(third) == 1


def test_where_nothing_can_be_written_functions_are_compiled_all_the_same(tmp_path, capfd):
    (tmp_path / "file").touch()
    for made in (fresh(tmp_path / "file"), fresh(tmp_path / "file")):
        assert made(14) == 2.0 and made(3.5) == 0.5
    told = capfd.readouterr().err
    assert told.count("machine code is not kept") == 1 and told.count("\n") == 1


@pytest.mark.untraced
def test_a_full_disk_ends_no_run_and_leaves_nothing(tmp_path):
    """A limit on the size of files fails in the middle of a write, as a full disk does."""
    code = (
        "import sys, resource; from pathlib import Path; sys.path.insert(0, sys.argv[2]); "
        "from test_cache import fresh; resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500)); "
        "print(fresh(Path(sys.argv[1]))(14))"
    )
    folder = tmp_path / "full"
    words = [sys.executable, "-c", code, str(folder), str(Path(__file__).parent)]
    out = subprocess.run(words, capture_output=True, text=True, check=True)
    assert out.stdout == "2.0\n" and out.stderr.count("\n") == 1
    assert "not kept" in out.stderr and not list(folder.iterdir())


def test_another_environment_has_a_folder_of_its_own(monkeypatch):
    names = {machine_code.cache_folder.__wrapped__()}
    for package in ("numba", "llvmlite", "mujoco", "numpy"):
        with monkeypatch.context() as patch:
            patch.setattr(machine_code, "version", lambda x, p=package: "0" if x == p else "1")
            names.add(machine_code.cache_folder.__wrapped__())
    monkeypatch.setattr(machine_code, "_processor", lambda: "another")
    names.add(machine_code.cache_folder.__wrapped__())
    assert len(names) == 6


def test_what_no_file_holds_is_told_before_it_is_compiled(tmp_path):
    told = []
    before = cache.on_miss.set(lambda: told.append(len(list(tmp_path.iterdir()))))
    try:
        for made in (fresh(tmp_path), fresh(tmp_path)):
            made(14)
    finally:
        cache.on_miss.reset(before)
    fresh(tmp_path)(3.5)  # nobody listens
    assert told == [0]
