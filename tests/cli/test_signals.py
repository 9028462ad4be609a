"""SIGTERM and SIGHUP end a command as Ctrl-C does."""

import signal
import subprocess
import sys
import time

import pytest

import hapticclay as hc
from hapticclay.cli import app, console
from tests.waiting import PATIENCE

RUN = ["run", "constant", "--dt", "1e-6", "--every", "100", "--no-plots", "--out"]
SIGNALS = [signal.SIGTERM, signal.SIGHUP]
WAIT = """
import signal, sys, threading
from hapticclay.cli import app
from hapticclay.simulation import simulate
real, how = simulate.simulate, int(sys.argv.pop(1))
def struck(scenario, progress, **kw):
    def show(t, x):
        if t > 1e-3 and not done:
            done.append(1)
            signal.raise_signal(how)
        return progress(t, x)
    done = []
    return real(scenario, progress=show, engine="python", **kw)
simulate.simulate = struck
sys.exit(app.main())
"""


@pytest.mark.untraced
@pytest.mark.parametrize(  # ignored: Ctrl-C, as a shell's background jobs do
    "how, ignored", [(signal.SIGTERM, True), (signal.SIGHUP, False)]
)
def test_a_run_keeps_its_samples(tmp_path, how, ignored):
    ignore = (lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) if ignored else None
    words = [sys.executable, "-c", WAIT, str(int(how)), *RUN, str(tmp_path)]
    done = subprocess.run(
        words, capture_output=True, text=True, preexec_fn=ignore, timeout=PATIENCE
    )
    assert done.returncode == 128 + how and "Traceback" not in done.stderr
    assert "status: interrupted at" in done.stdout
    assert hc.Record.load(tmp_path).outcome.code == "interrupted"


@pytest.mark.parametrize("how", SIGNALS)
def test_an_export_leaves_no_temporary_file(tmp_path, monkeypatch, capsys, how):
    from hapticclay.simulation import export

    hc.simulate(hc.constant_cut(t_max=0.01)).save(tmp_path)
    before = set(tmp_path.iterdir())

    def slow(record, file):
        assert set(tmp_path.iterdir()) > before  # the temporary file is there
        signal.raise_signal(how)
        time.sleep(10.0)
        raise AssertionError("the signal did not interrupt the export")

    monkeypatch.setitem(export.EXPORTS, "csv", slow)
    assert app.main(["export", str(tmp_path), "--format", "csv"]) == 128 + how
    assert capsys.readouterr().err == f"hapticclay: ended by {how.name}\n"
    assert set(tmp_path.iterdir()) == before
    assert signal.getsignal(how) is signal.SIG_DFL


def test_a_signal_goes_to_who_listens_for_ctrl_c():
    with console.ends() as received:
        with console.ctrl_c() as stop:  # of a session in a window or a page
            signal.raise_signal(signal.SIGTERM)
            assert stop.is_set()
            with pytest.raises(KeyboardInterrupt):  # the second does not wait
                signal.raise_signal(signal.SIGHUP)
    assert received == [signal.SIGTERM, signal.SIGHUP]


def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with console.ends() as received:
            signal.raise_signal(signal.SIGHUP)
        assert received == [] and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
