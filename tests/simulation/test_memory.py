"""A record that does not fit into memory is refused before anything is simulated."""

import dataclasses
import subprocess
import sys
import tracemalloc

import pytest

import hapticclay as hc
from hapticclay.kernel import native
from hapticclay.simulation import memory, one_run
from tests.waiting import PATIENCE

GB = 10**9
WIRED = dataclasses.replace(
    hc.constant_cut(control="sampled", dt=1e-4, t_max=0.08), hardware=hc.Hardware()
)


def machine(root, files):
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize(
    "files,left",
    [
        ({"proc/meminfo": "MemTotal: 9 kB\nMemFree: 1 kB\nMemAvailable:  4000 kB\n"}, 4_096_000),
        (
            {
                "proc/meminfo": "MemAvailable: 4000 kB\n",
                "sys/fs/cgroup/memory.max": "1000000\n",
                "sys/fs/cgroup/memory.current": "900000\n",
                "sys/fs/cgroup/memory.stat": "anon 7\ninactive_file 200000\n",
            },
            300_000,
        ),
        (
            {
                "proc/meminfo": "MemAvailable: 4000 kB\n",
                "sys/fs/cgroup/memory.max": "max\n",
                "sys/fs/cgroup/memory.current": "900000\n",
                "sys/fs/cgroup/memory.stat": "",
            },
            4_096_000,
        ),
        (
            {
                "proc/meminfo": "MemAvailable: 4000 kB\n",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": "1000000\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": "1200000\n",
                "sys/fs/cgroup/memory/memory.stat": "",
            },
            -200_000,
        ),
    ],
)
def test_the_least_of_machine_and_container_counts(files, left, tmp_path):
    assert memory.memory_left(machine(tmp_path, files)) == left


def test_there_is_less_left_than_installed():
    assert 0 < memory.memory_left() < 1e14


@pytest.mark.parametrize(
    "scenario,engine,every",
    [
        (hc.constant_cut(dt=2e-4, t_max=0.2), "python", 1),
        (hc.constant_cut(dt=2e-4, t_max=5.0), "native", 1),
        (hc.stability_test(dt=1e-3, t_max=8.0), "python", 1),
        (hc.variable_cut(dt=1e-3, t_max=1.0), "python", 1),
        (hc.constant_cut(control="sampled", dt=1e-4, t_max=0.08), "python", 1),
        (hc.constant_cut(integrator="accurate", dt=5e-4, t_max=10.0), "native", 1),
        (WIRED, "python", 1),
    ],
    ids=["constant", "native", "driven", "growing", "sampled", "accurate", "hardware"],
)
def test_need_is_what_a_run_takes(scenario, engine, every, monkeypatch):
    """Beside tracemalloc's peak, which sees every array: what a run takes, within -10 and +50 %."""
    if engine == "native" and not native.is_there():
        pytest.skip("needs the compiled kernel")
    hc.simulate(dataclasses.replace(scenario, t_max=0.05), engine=engine)  # imports
    tracemalloc.start()
    record = hc.simulate(scenario, engine=engine, every=every)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert record.outcome.code == "time limit"  # so it took what the longest run would
    monkeypatch.setattr(one_run, "SMALL_MEMORY", 0.0)
    for left, fits in ((0.9 * peak, False), (1.5 * peak, True)):
        monkeypatch.setattr(one_run, "memory_left", lambda left=left: left)
        if fits:
            one_run.check_memory(scenario, every)
        else:
            with pytest.raises(hc.ParameterError):
                one_run.check_memory(scenario, every)


def test_what_does_not_fit_is_refused_and_the_advice_helps(monkeypatch):
    monkeypatch.setattr(one_run, "memory_left", lambda: 4.0 * GB)
    monkeypatch.setattr(one_run, "engine_for", lambda *a: pytest.fail("ran"))
    scenario = hc.constant_cut(dt=1e-6)
    with pytest.raises(hc.ParameterError) as error:
        hc.simulate(scenario)
    assert str(error.value) == (
        "every = 1: up to 60000002 samples take 25.8 GB of memory, and 4 GB are left: "
        "keep fewer (--every 8), or lower t_max"
    )
    one_run.check_memory(scenario, 8)
    with pytest.raises(hc.ParameterError, match="every = 6"):
        one_run.check_memory(scenario, 6)


def test_what_is_not_kept_takes_no_memory(monkeypatch):
    """Hardware remembers no more of a run than what it keeps."""
    monkeypatch.setattr(one_run, "memory_left", lambda: 0.1 * GB)
    long = dataclasses.replace(WIRED, t_max=1e4)
    one_run.check_memory(long, 1000)
    with pytest.raises(hc.ParameterError, match="t_max = 10000.0: up to 100000000 steps take"):
        monkeypatch.setattr(one_run, "memory_left", lambda: 0.0)
        one_run.check_memory(long, 100)


def test_a_process_may_have_less_than_the_machine():
    pytest.importorskip("resource")
    code = (
        "import resource, hapticclay as hc\n"
        "from hapticclay.cli import app\n"
        "from hapticclay.simulation import one_run\n"
        "taken = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (taken + 10**9,) * 2)\n"
        "assert 0.5e9 < one_run.memory_left() <= 1e9\n"
        "raise SystemExit(app.main(['run', 'free', '--force', '0', '0', '--dt', '1e-5', '--t-max', "
        "'100']))"
    )
    p = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE
    )
    assert p.returncode == 2 and p.stdout == "" and p.stderr.count("\n") == 1, p.stderr
    assert p.stderr.startswith("hapticclay: every = 1: up to 10000002 samples take 4.3 GB")
