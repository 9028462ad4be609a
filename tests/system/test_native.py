"""The compiled kernel as it is built, installed and refused.

Where it lacks or is not to be trusted, runs are made by Python, one line on stderr says why and
what helps, and the results are the same. Each test has a copy of the package, in a process of its
own, which begins with NumPy and MuJoCo loaded.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
import zlib
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import native, probe
from hapticclay.simulation import engines
from tests.waiting import PATIENCE

ROOT = Path(__file__).parents[2]
PACKAGE = Path(native.__file__).parents[1]
SHORT = "hc.constant_cut(length=0.002, force=(5.0, 0.0), t_max=60.0)"  # over before it is long
RUN = f"""
import os, sys, zlib
import mujoco, numpy
for line in sys.stdin:  # a process for each copy of the package, but on Windows: there for one
    place, engine, *files = line.rstrip("\\n").split("\\t")
    if not hasattr(os, "fork") or not (child := os.fork()):
        break
    os.waitpid(child, 0)
    print(flush=True)
else:
    sys.exit()
for i, file in enumerate(files, 1):
    os.dup2(os.open(file, os.O_WRONLY), i)
sys.path.insert(0, place)
import hapticclay as hc
for _ in range(2):
    r = hc.simulate({SHORT}, engine=engine)
from hapticclay.kernel import native
print(native.is_there(), zlib.crc32(r.p.tobytes() + r.fe.tobytes()))
"""
built = pytest.mark.skipif(not native.is_there(), reason=f"no compiled kernel: {native.why_not()}")
builds = pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("Cython", "setuptools"))) or os.name == "nt",
    reason="needs Cython and setuptools",
)


@pytest.fixture(scope="module")
def right():
    """What a run of Python's prints."""
    r = hc.simulate(eval(SHORT), engine="python")
    return str(zlib.crc32(r.p.tobytes() + r.fe.tobytes()))


@pytest.fixture
def place(tmp_path):
    """A copy of the package: links, but for what a test changes."""
    copy = tmp_path / "site" / "hapticclay"
    copy.mkdir(parents=True)
    for entry in PACKAGE.iterdir():
        if entry.name in ("kernel", "formulas", "native"):
            shutil.copytree(entry, copy / entry.name)  # and what Python compiled of it
        else:
            (copy / entry.name).symlink_to(entry)
    if not (copy / "mjcf").exists():
        (copy / "mjcf").symlink_to(ROOT / "mjcf")
    return copy


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs in a copy of the package, in a process of its own; words of stdout, lines of stderr."""
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    env["PYTHONDONTWRITEBYTECODE"] = "1"
    words, started = [sys.executable, "-P", "-c", RUN], []
    files = [tmp_path_factory.mktemp("said") / name for name in ("out", "err")]

    def in_a_process(place, engine="auto"):
        if not started or started[-1].poll() is not None:
            pipes = dict(stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            started.append(subprocess.Popen(words, env=env, text=True, **pipes))
        for file in files:
            file.write_text("")
        print(place.parent, engine, *files, sep="\t", file=started[-1].stdin, flush=True)
        if not started[-1].stdout.readline():
            started[-1].wait(timeout=PATIENCE)
        out, err = (file.read_text() for file in files)
        return out.split(), err.splitlines()

    yield in_a_process
    for process in started:
        process.communicate(timeout=PATIENCE)


def changed(place, what):
    """Spoils a copy; what the line then says."""
    folder = place / "native"
    module = next((folder / "kernel").glob("loop.*.so"), None) or folder / "kernel/loop.pyd"
    if what == "never built":
        shutil.rmtree(folder)
        return "not built"
    if what == "no compiler at install":
        (folder / "built.py").write_text("LACKED = 'no C compiler (cc)'\n")
        return "not built: no C compiler (cc)"
    if what == "other sources":
        with (place / "kernel/path.py").open("a") as f:
            f.write("# more\n")
        return "built from other sources: kernel/path.py has changed"
    if what == "other types":
        (place / "formulas/more.pxd").write_text("cdef double x\n")
        return "built from other sources: formulas/more.pxd has changed"
    if what == "truncated":
        os.truncate(module, module.stat().st_size // 2)
        return f"damaged: native/kernel/{module.name} is not as it was built"
    if what == "incomplete":
        module.unlink()
        return f"incomplete: native/kernel/{module.name} is lacking"
    if what == "two builds":
        shutil.copy(module, module.with_name(f"loop{EXTENSION_SUFFIXES[0]}"))
        return f"mixed: native/kernel/loop{EXTENSION_SUFFIXES[0]} is of another build"
    if what == "another Python":
        other = module.with_name("loop.cpython-39-x86_64-linux-gnu.so")
        module.rename(other)
        text = (folder / "built.py").read_text().replace(module.name, other.name)
        (folder / "built.py").write_text(text)
        return f"built for another Python: native/kernel/{other.name}"
    machine = next((folder / "kernel").glob("machine.*"))
    text = (folder / "built.py").read_text()
    machine.unlink()
    (folder / "built.py").write_text(text + "MODULES = {}\n")
    size = "SIZES = {}\n" if what == "miscompiled" else "SIZES = {'State': 8}\n"
    (folder / "kernel/machine.py").write_text(size + "def compute_probe(links, out):\n    pass\n")
    if what == "miscompiled":
        return "miscompiled: formulas give other numbers than in Python"
    return "miscompiled: the record State has another size"


@built
@pytest.mark.parametrize(
    "what",
    [
        "never built",
        "no compiler at install",
        "other sources",
        "other types",
        "truncated",
        "incomplete",
        "two builds",
        "another Python",
        "miscompiled",
        "other records",
    ],
)
def test_what_is_not_to_be_trusted_is_one_line_and_the_same_numbers(run, place, right, what):
    if what == "two builds" and (place / f"native/kernel/loop{EXTENSION_SUFFIXES[0]}").exists():
        pytest.skip("this build has the first name that Python looks for")
    why = changed(place, what)
    out, err = run(place)
    assert out == ["False", right]
    (line,) = err
    assert f"no compiled kernel ({why})" in line and "pip install" in line
    assert ("apt install gcc python3-dev" in line) == ("C compiler" in why)


@built
def test_a_native_run_without_the_kernel_is_refused_in_the_same_words(run, place):
    why = changed(place, "other sources")
    out, err = run(place, "native")
    assert not out and "ParameterError" in err[-1]
    assert f"needs the compiled kernel ({why}): pip install" in err[-1]


@built
def test_a_whole_build_is_used_and_an_installation_is_not_written_to(run, place, right):
    def files():
        return {x: x.lstat().st_mtime_ns for x in place.rglob("*")}

    before = files()
    assert run(place) == (["True", right], [])
    assert files() == before


@built
def test_the_self_test_sees_a_bit(monkeypatch):
    made, fill = native.machine(), probe.fill

    def other(links, out):
        fill(links, out)
        out[6] = np.nextafter(out[6], 9.0)

    native.check_numbers(made)
    monkeypatch.setattr(probe, "fill", other)
    with pytest.raises(ImportError, match="miscompiled"):
        native.check_numbers(made)


def test_a_short_run_in_python_says_nothing_and_a_long_one_says_it_once(monkeypatch, capsys):
    monkeypatch.setattr(native, "why_not", lambda: "not built: no C compiler (cc)")
    monkeypatch.setattr(engines, "_notice_given", False)
    assert engines.engine_for("auto", 10.0) == "python" and not capsys.readouterr().err
    for _ in range(2):
        assert engines.engine_for("auto", 1e9) == "python"
    assert capsys.readouterr().err.count("not built") == 1
    with pytest.raises(ParameterError, match="needs the compiled kernel"):
        engines.engine_for("native")


# ---- building ------------------------------------------------------------------------------------


@pytest.fixture
def checkout(tmp_path):
    """A copy of what setup.py reads."""
    copy = tmp_path / "checkout"
    ignored = shutil.ignore_patterns("__pycache__", "native")
    shutil.copytree(ROOT / "hapticclay", copy / "hapticclay", ignore=ignored)
    shutil.copytree(ROOT / "mjcf", copy / "mjcf")
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE", "MANIFEST.in"):
        shutil.copy(ROOT / name, copy / name)
    return copy


def run_setup(checkout, *args, **env):
    """Runs setup.py; what it said."""
    env = {k: v for k, v in os.environ.items() if k not in ("CC", "PYTHONPATH")} | env
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "setup.py", "-q", *args],
        cwd=checkout, env=env, text=True, capture_output=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


@builds
@pytest.mark.parametrize("case", ["no compiler", "a compiler that fails", "no headers"])
def test_without_a_compiler_or_headers_the_package_is_built_without_the_kernel(checkout, case):
    env = {"CC": "no-such-cc" if case == "no compiler" else "false"}
    why = {
        "no compiler": "no C compiler (no-such-cc)",
        "a compiler that fails": "the C compiler (false) does not work",
        "no headers": "no Python.h in",
    }[case]
    if case == "no headers":  # sysconfig of the child says that they are elsewhere
        (checkout / "sitecustomize.py").write_text(
            "import sysconfig\nfind = sysconfig.get_path\n"
            "sysconfig.get_path = lambda x, *a: '/none' if x == 'include' else find(x, *a)\n"
        )
        env = {"PYTHONPATH": str(checkout)}
    said = run_setup(checkout, "bdist_wheel", **env)
    assert f"no compiled kernel ({why}" in said
    (wheel,) = (checkout / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        assert why in archive.read("hapticclay/native/built.py").decode()
    check_contents(names)
    assert not [x for x in names if x.endswith((".so", ".pyd"))]


def check_contents(names):
    """All of the package, and nothing that lies beside it."""
    skipped = ("__pycache__", "/native/")
    files = (x for x in (ROOT / "hapticclay").rglob("*") if x.is_file())
    wanted = {x.relative_to(ROOT).as_posix() for x in files}
    wanted = {x for x in wanted if not any(y in x for y in skipped)}
    wanted |= {f"hapticclay/{x.relative_to(ROOT).as_posix()}" for x in (ROOT / "mjcf").rglob("*.*")}
    assert wanted <= names
    assert {x.split("/")[0] for x in names} == {
        "hapticclay", next(x.split("/")[0] for x in names if ".dist-info" in x)
    }  # fmt: skip


@builds
@pytest.mark.skipif(
    not Path(sysconfig.get_path("include"), "Python.h").is_file() or not shutil.which("cc"),
    reason="needs a C compiler and Python's headers",
)
def test_a_wheel_holds_the_kernel_for_this_python_and_later_ones(run, checkout, tmp_path, right):
    less = {"HAPTICCLAY_CFLAGS": "-O0"}  # a third of the time; -O3 built what other tests run
    if (ROOT / "build").is_dir():  # what `make` compiled
        shutil.copytree(ROOT / "build", checkout / "build")
        less = {}
    run_setup(checkout, "bdist_wheel", **less)
    (wheel,) = (checkout / "dist").glob("*.whl")
    assert "-cp311-abi3-" in wheel.name or not native.is_there()
    with zipfile.ZipFile(wheel) as archive:
        check_contents(set(archive.namelist()))
        archive.extractall(tmp_path / "site")
    assert run(tmp_path / "site/hapticclay") == (["True", right], [])
