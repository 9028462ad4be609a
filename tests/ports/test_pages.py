"""The pages about ports run, and say what they print."""

import re
import subprocess
import sys
from pathlib import Path

from tests.snippets import printed_by

DOCS = Path(__file__).parents[2] / "docs"


def code_of(page, i=0):
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), re.S)[i]


def test_the_test_of_the_device_page_passes(tmp_path):
    (tmp_path / "test_wall.py").write_text(code_of("device.md"))
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_wall.py"]
    out = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert out.returncode == 0 and "1 passed" in out.stdout, out.stdout


def test_the_floor_under_an_arm_from_a_file_is_reported_as_the_page_says(tmp_path):
    code = code_of("device.md", 1)
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"^# (.*)", code, re.M) != []


def test_the_snippet_of_the_buzz_page_prints_what_it_says(tmp_path):
    code = code_of("buzz.md")
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"^# (.*)", code, re.M) != []


def test_the_snippet_of_the_page_about_devices_prints_what_it_says(tmp_path):
    code = code_of("connect.md")
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"^# (.*)", code, re.M) != []
    assert len((tmp_path / "device.csv").read_text().splitlines()) > 300
