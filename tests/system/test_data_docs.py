"""docs/data.md and docs/sweep.md: their snippets run, their commands exist, their words are so."""

import json
import re
import shlex
import socket
import textwrap
from pathlib import Path

import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.live.session import Session
from hapticclay.live.stream import UdpStream
from hapticclay.simulation import export
from tests.snippets import printed_by

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "data.md").read_text()


def test_snippet_prints_what_it_says(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.S)
    said = [x.partition("  # ")[2] for x in code.splitlines() if x.startswith("print(")]
    assert printed_by(code, tmp_path).splitlines() == said and all(said)
    assert (tmp_path / "velocity.png").read_bytes().startswith(b"\x89PNG")


def test_sweep_snippet_runs_on_a_sweep(tmp_path, monkeypatch, capsys):
    text = (DOCS / "sweep.md").read_text()
    code, columns = re.findall(r"```python\n(.*?)```", text, re.S)
    monkeypatch.chdir(tmp_path)
    assert printed_by(columns, tmp_path).endswith("['time limit']\n")  # no run is unstable
    grid = ["--grid", "b=20:50:2log gain.x=0.5,1", "--fixed", "t_max=1 dt=0.002"]
    assert app.main(["sweep", *grid, "--out", "out/map", "--workers", "1"]) == 0
    out = printed_by(code, tmp_path).splitlines()
    assert out[0] == "m/s - steady speed in that clay"
    runs = hc.studies.read_sweep("out/map").to_pandas()
    assert list(runs.columns[:3]) == ["run", "b", "gain.x"] and len(runs) == 4
    assert runs.attrs["units"]["gain.x"] == "1/kg" and runs.attrs["units"]["b"] == "N.s/m"
    assert runs.attrs["descriptions"]["b"] == "parameter of the run"
    assert set(runs.attrs["descriptions"]) == set(runs.columns)


def test_units_of_a_sweep_are_in_its_files(tmp_path):
    import pandas as pd
    import pyarrow.parquet as pq

    grid = ["--grid", "b=20,50", "--fixed", "t_max=0.1 dt=0.002"]
    assert app.main(["sweep", *grid, "--out", str(tmp_path), "--workers", "1"]) == 0
    (part,) = (tmp_path / "data").glob("*.parquet")
    schema = pq.read_schema(part)
    assert schema.field("end_time").metadata[b"unit"] == b"s"
    assert schema.field("fe_over_v_y").metadata[b"unit"] == b"N.s/m"
    table = hc.studies.read_sweep(tmp_path)
    pd.testing.assert_frame_equal(table.to_pandas(), pd.read_parquet(tmp_path / "data"))


def test_every_format_has_a_row():
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.M) == list(
        dict.fromkeys(("nc", "parquet", "csv", "mat", "mcap", "rrd"))
    )
    assert set(export.EXPORTS) == set(re.findall(r"^\| `(\w+)` \|", PAGE, re.M))


@pytest.mark.parametrize("line", re.findall(r"^    hapticclay (.+)$", PAGE, re.M))
def test_commands_run(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line)
    if words[0] == "view":  # needs a display; test_stream.py sends what it sends
        assert app.main(["view", *words[1:], "--help"]) == 0
        return
    if words[0] in ("info", "export"):
        for folder in ("out/run/constant", "push"):
            hc.simulate(hc.constant_cut(t_max=0.1)).save(folder)
    if words[0] == "run":
        (file,) = re.findall(r"scenario `push.toml`:\n\n((?:    .*\n)+)", PAGE)
        Path("push.toml").write_text(textwrap.dedent(file))
    if words[0] == "fit":
        hc.simulate(hc.constant_cut(), every=20).export("cut.csv")
    if words[0] == "identify":
        push = hc.Multisine((0.3, 0.0), low=0.2, high=8.0, period=5.0)
        more = {"gain": (0.0, 0.0), "force": (0.0, 0.0), "muscle": push, "length": None}
        hc.simulate(hc.Scenario(t_max=15.0, dt=1e-3, **more), every=5).export("push.csv")
    assert app.main(words) == 0


def test_stream_has_the_fields_of_the_page():
    (shown,) = re.findall(r"```json\n(.*?)```", PAGE, re.S)
    session = Session(hc.constant_cut())
    session.pull((0.06, 0.0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        s.settimeout(10.0)
        stream = UdpStream(f"127.0.0.1:{s.getsockname()[1]}")
        stream.send(session)
        stream.close()
        sent = json.loads(s.recv(65536))

    def form(x):
        return {k: form(v) for k, v in x.items()} if isinstance(x, dict) else type(x).__name__

    assert form(sent) == form(json.loads(shown))
