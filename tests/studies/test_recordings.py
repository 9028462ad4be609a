"""The ledger of recordings: files by address and checksum, and a page of what is found."""

import hashlib

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks import recordings


def test_a_file_is_got_once_and_checked(tmp_path):
    """From an address, here a folder; a second time from its place."""
    there, here = tmp_path / "there", tmp_path / "here"
    (there / "m2").mkdir(parents=True)
    (there / "m2" / "log.mat").write_bytes(b"numbers")
    digest = hashlib.sha256(b"numbers").hexdigest()
    address = f"{there.as_uri()}/"
    assert recordings.had(here, "m2/log.mat", digest) is None
    file = recordings.had(here, "m2/log.mat", digest, address)
    assert file == here / "m2" / "log.mat" and file.read_bytes() == b"numbers"
    assert recordings.had(here, "m2/log.mat", digest) == file
    with pytest.raises(SystemExit, match="another file"):
        recordings.had(here, "m2/log.mat", "0" * 64)


def test_another_file_at_the_address_is_not_kept(tmp_path):
    (tmp_path / "x.mat").write_bytes(b"changed")
    with pytest.raises(SystemExit, match="another file"):
        recordings.had(tmp_path / "here", "x.mat", "0" * 64, f"{tmp_path.as_uri()}/")
    assert not (tmp_path / "here").exists()


def test_every_log_of_the_list_has_settings():
    for path, digest in recordings.sums().items():
        parts = recordings.NAME.match(path)
        assert parts and parts[2] in recordings.LETTERS, path
        assert len(digest) == 64


def test_the_page_has_what_is_found(tmp_path, monkeypatch, capsys):
    """A made log under the name of one of the rig's; the others are missing."""
    t = 5e-4 * np.arange(4000)
    leader = 0.09 * np.sin(4.4 * t) + 0.05 * np.sin(12.0 * t)
    error = 3e-3 * np.sin(12.0 * t + 1.0) + 1e-3 * np.sin(60.0 * t)
    torque = 8.0 * error + 0.1 * np.gradient(error, t)
    signals = [
        {"label": "p (rad) master, slave", "values": np.column_stack((leader, leader - error))},
        {"label": "u (Nm) -tau_rm, tau_rs", "values": np.column_stack((torque, torque))},
    ]
    file = tmp_path / "m2_question1a_free_motion.mat"
    savemat(file, {"scope": {"time": t, "signals": signals}})
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    sums = {"m2_question1/m2_question1a_free_motion.mat": digest, "m2_question1/other.mat": "0"}
    monkeypatch.setattr(recordings, "sums", lambda: sums)
    (row,) = recordings.main(tmp_path, out=tmp_path / "out")
    assert row["architecture"] == "position-position" and row["letter"] == "a"
    text = (tmp_path / "out" / "recordings.md").read_text()
    assert "1 logs of 5 s" in text and "1 logs were not at hand" in text
    assert {x.name for x in (tmp_path / "out").iterdir()} == {"recordings.md", "recordings.json"}


def test_without_recordings_it_says_where_they_are(tmp_path):
    with pytest.raises(SystemExit, match="--fetch"):
        recordings.main(tmp_path)
