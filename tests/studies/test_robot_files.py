"""The ledger of robot files: got by address and checksum, judged, compared with MuJoCo."""

import hashlib
import json

import numpy as np
import pytest
from scipy.linalg import expm

import hapticclay as hc
from benchmarks import robot_files
from benchmarks.peers import held_arm

ARM = """<mujoco model="two"><worldbody><body name="upper">
  <joint name="a" axis="0 1 0" damping=".1"/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
  <body name="lower" pos=".3 0 0"><joint name="b" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02"/><site name="tool" pos=".2 0 0"/></body>
</body></worldbody></mujoco>"""
URDF = """<robot name="one"><link name="base"/><link name="arm">
  <inertial><origin xyz=".2 0 0"/><mass value="2"/>
    <inertia ixx=".01" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
  </joint></robot>"""
COMMIT = "0" * 40


def listing(folder, texts, handles):
    """Files of a repository in a folder, and the list of them."""
    lines = []
    for (path, text), handle in zip(texts.items(), handles, strict=True):
        file = folder / "one+robots" / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        digest = hashlib.sha256(text.encode()).hexdigest()
        lines.append("\t".join(("one/robots", COMMIT, path, digest, handle)))
    out = folder / "list.tsv"
    out.write_text("\n".join(lines) + "\n")
    return out


def test_the_list_has_addresses_checksums_and_every_file_once():
    robots = robot_files.listed()
    for x in robots:
        assert x.repository.count("/") == 1 and len(x.commit) == 40 and len(x.digest) == 64, x
        assert int(x.commit, 16) and int(x.digest, 16) and x.handle, x
    assert len({x.place for x in robots}) == len(robots)
    assert len({x.repository for x in robots if not x.is_part}) >= 30


def test_files_are_judged_and_the_page_has_them(tmp_path):
    """An arm, one whose handle must be named, one that is no model, and one that is not there."""
    other = ARM[ARM.index("<body") : ARM.rindex("</worldbody>")].replace('name="', 'name="right_')
    two = ARM.replace("</worldbody>", f"{other}</worldbody>")
    texts = {"arm.xml": ARM, "two.xml": two, "broken.xml": "<mujoco><x/></mujoco>", "far.xml": ""}
    file = listing(tmp_path, texts, ("-", "tool", "-", "-"))
    (tmp_path / "one+robots" / "far.xml").unlink()
    rows = robot_files.main(tmp_path, out=tmp_path / "out", listing=file)
    assert [x["path"] for x in rows] == ["arm.xml", "two.xml", "broken.xml"]
    arm, named, broken = rows
    assert arm["result"] == "answered" and arm["joints"] == ["a", "b"]
    assert named["result"] == "answered, handle named" and named["joints"] == ["a", "b"]
    assert broken["result"] == "refused" and "element" in broken["why"]
    for row in (arm, named):
        assert row["inertia"] < robot_files.ROUNDING
        assert row["radii"][0] < 1.0 < row["radii"][1]
    text = (tmp_path / "out" / "robot_files.md").read_text()
    assert "3 files of 1 repositories: 2 are answered" in text and "1 files were not" in text
    assert len(json.loads((tmp_path / "out" / "robot_files.json").read_text())["rows"]) == 3


def test_a_file_that_takes_too_long_is_a_row(tmp_path):
    listing(tmp_path, {"arm.xml": ARM}, ("-",))
    file = tmp_path / "one+robots" / "arm.xml"
    assert robot_files.alone(file, "-", patience=0.0) == {"result": "too slow"}


def test_without_files_it_says_where_they_are(tmp_path):
    with pytest.raises(SystemExit, match="--fetch"):
        robot_files.main(tmp_path)


@pytest.mark.parametrize(("damping", "error"), [(0.0, 1e-8), (0.5, 1e-8), (5e3, 1e-3)])
def test_the_map_measured_is_that_of_a_mass_under_held_torques(tmp_path, damping, error):
    """One joint without weight about its axis, in closed form: q, qd, and the torque that is held.

    Differences of 1e-6 of numbers near 1 leave 1e-10; RK4 at a step of half the time constant of
    a stiff damper is within 4e-4 a step of what decays.
    """
    file = tmp_path / "one.urdf"
    file.write_text(URDF.replace("</joint>", f'<dynamics damping="{damping}"/></joint>'))
    arm = hc.MjcfArm(file)
    plain = held_arm.HeldArm(file, arm)
    J, T, Kp, Kd = 0.02 + 2.0 * 0.2**2, 1e-3, 900.0, 3.0
    np.testing.assert_allclose(plain.inertia(arm.q), [[J]], rtol=1e-14)
    law = hc.JointPD(Kp=(Kp,), Kd=(Kd,))
    motion = expm(T * np.array([[0.0, 1.0, 0.0], [0.0, -damping / J, 1.0 / J], [0.0, 0.0, 0.0]]))
    for scale in (0.1, 1.0, 20.0):
        by_hand = np.vstack((motion[:2], [-scale * Kp, -Kd, 0.0]))
        expected = np.abs(np.linalg.eigvals(by_hand)).max()
        assert abs(plain.radius(law, scale, T) - expected) < error


def test_pinocchio_has_the_inertia_of_a_urdf(tmp_path):
    pytest.importorskip("pinocchio")
    file = tmp_path / "one.urdf"
    file.write_text(URDF)
    arm = hc.MjcfArm(file, pose=[0.7], armature=[0.5])
    found = held_arm.urdf_inertia(file, arm)
    assert found is not None and abs(found.item() - 0.6) < 1e-14
