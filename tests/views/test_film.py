"""Films: what is in them, how long a frame takes, and what is said where something is missing."""

import functools
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from matplotlib.text import Text

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.views import film
from hapticclay.views.film import FilmOptions
from hapticclay.views.running_plots import RunningPlots, plots_fit, running_figure
from hapticclay.views.stage import Stage
from tests.hunt import HUNTS
from tests.waiting import PATIENCE


def lens_works():
    try:
        film.Lens(Stage(hc.free()), 64, 64, "room").close()
    except hc.ParameterError as error:
        return str(error)
    return ""


reason = lens_works()
needs_gl = pytest.mark.skipif(bool(reason), reason=reason)


@pytest.fixture(scope="module")
def record():
    return hc.simulate(hc.constant_cut(), every=10)


@needs_gl
def test_frames_show_the_clay_being_cut_and_the_plots_growing(record):
    images = film.frames(record, FilmOptions(speed=40.0, size=(640, 480)))
    shots = [x.copy() for x in images]
    assert len(shots) == len(film.samples_shown(record, 40.0, 30)) and shots[0].shape == (
        480,
        640,
        3,
    )
    scene, plots = np.s_[:, :400], np.s_[:, 400:]
    for part in (scene, plots):
        changed = [
            int((a[part] != b[part]).any(axis=-1).sum())
            for a, b in zip(shots, shots[1:], strict=False)
        ]
        assert min(changed[:-1]) > 0
    clay = [
        ((x[scene].astype(int) @ [1, -1, 0]) > 40).sum() for x in (shots[0], shots[-1])
    ]  # reddish
    assert clay[0] > 3000
    sky = shots[0][5, 300].astype(int)
    assert sky.min() > 150  # light behind, not black


@needs_gl
@pytest.mark.perf
def test_frame_is_quick_in_software(record):
    """A frame of 640x480 takes less than 60 ms of processor time; wall time depends on load."""
    images = film.frames(record, FilmOptions(size=(640, 480)))
    next(images)
    spent = []
    for _ in range(12):
        begin = time.process_time()
        next(images)
        spent.append(time.process_time() - begin)
    images.close()
    assert min(spent) < 0.06


@needs_gl
@pytest.mark.parametrize("kind", ["mp4", "webp", "gif"])
def test_film_can_be_read_back(record, tmp_path, kind):
    import imageio.v3 as iio

    if kind == "mp4":
        pytest.importorskip("imageio_ffmpeg", reason="pip install 'hapticclay[video]'")
    out = film.film(record, tmp_path / f"film.{kind}", FilmOptions(speed=60.0, size=(320, 240)))
    if kind == "mp4":
        import imageio_ffmpeg

        ffmpeg = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(out)]
        raw = subprocess.run(
            [*ffmpeg, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
        )
        back = np.frombuffer(raw.stdout, np.uint8).reshape(-1, 240, 320, 3)
    else:
        back = iio.imread(out, index=...)
    assert back.shape[1:3] == (240, 320)
    assert len(back) == len(film.samples_shown(record, 60.0, film.FRAME_RATES[f".{kind}"]))
    assert [p.name for p in tmp_path.iterdir()] == [f"film.{kind}"]


def filmed(folder, blocked, *outs):
    """Messages of `hapticclay video` where modules are missing; a simulation would raise.

    Args:
        folder: that it runs in.
        blocked: names of the modules.
        outs: of each film, its file and a value of MUJOCO_GL, None for no value.
    """
    code = (
        f"import os, sys; sys.modules.update(dict.fromkeys({blocked!r}))\n"
        "from hapticclay.cli import app, video; video.simulate_with_progress = None\n"
        f"for out, wanted in {outs!r}:\n"
        "    os.environ.pop('MUJOCO_GL', None)\n"
        "    os.environ.update({'MUJOCO_GL': wanted} if wanted else {})\n"
        "    status = app.main(['video', 'constant', '--out', out])\n"
        "    assert status == 2, (out, wanted)\n"
        "sys.exit(status)"
    )
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "MUJOCO_GL")}
    p = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert p.returncode == 2 and p.stderr.count("\n") == len(outs), p.stderr
    assert p.stdout == "" and list(folder.iterdir()) == []
    return p.stderr.splitlines()


def test_missing_codec_is_said_before_anything_is_simulated(tmp_path):
    words = {
        "x.mp4": "pip install 'hapticclay[video]'",
        "x.webp": "pip install --upgrade pillow",
        "x.gif": "pip install --upgrade pillow",
    }
    blocked = "imageio_ffmpeg", "PIL.features"
    said = filmed(tmp_path, blocked, *((out, None) for out in words))
    for word, line in zip(words.values(), said, strict=True):
        assert word in line


def test_missing_gl_is_said_before_anything_is_simulated(tmp_path):
    words = {
        None: "apt-get install libegl1",
        "egl": "apt-get install libegl1",
        "elg": "must be egl or osmesa",
        "off": "unset it",
        "glfw": "needs a display",
    }
    said = filmed(tmp_path, ("mujoco.egl",), *(("x.webp", wanted) for wanted in words))
    for word, line in zip(words.values(), said, strict=True):
        assert word in line


@pytest.mark.parametrize(
    "wanted,blocked", [("elg", "nothing"), ("egl", "OpenGL"), ("osmesa", "OpenGL.GL")]
)
def test_runs_need_no_gl_whatever_is_asked_for(tmp_path, wanted, blocked):
    """MuJoCo itself refuses to be imported with such a setting."""
    code = (
        f"import os, sys; sys.modules[{blocked!r}] = None\n"
        "import hapticclay as hc; status = hc.simulate(hc.constant_cut(t_max=0.1)).status\n"
        "print(status, os.environ['MUJOCO_GL'])"
    )
    env = {**os.environ, "MUJOCO_GL": wanted}
    p = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert p.stdout == f"time limit at 0.1000 s {wanted}\n", p.stderr


@needs_gl
def test_smooth_pictures_have_soft_edges():
    """Colours halfway between two things, of which a plain picture has but those of the shading."""
    kinds = []
    for smooth in (False, True):
        stage = Stage(hc.free())
        stage.pose((0.6, -0.9))
        lens = film.Lens(stage, 320, 320, "room", smooth)
        kinds.append(len(np.unique(lens.photograph().reshape(-1, 3), axis=0)))
        lens.close()
    assert kinds[1] > 1.2 * kinds[0]


@pytest.mark.parametrize("args,word", [
    (["video", "constant", "--out", "x.avi"], ".mp4"),
    (["video", "constant", "--speed", "0"], "speed"),
    (["video", "constant", "--size", "10", "10"], "size[w]"),
    (["video", "constant", "--camera", "moon"], "moon"),
    (["video", "constnat"], "did you mean 'constant'"),
    (["video", "no/such"], "must be a saved record"),
    (["view", "constant", "--tool-width", "0"], "--tool-width"),
    (["view", "constant", "--every", "0"], "every = 0: must be a whole number"),
    (["view", "constant", "--web", "--port", "99999"], "port = 99999: must be a whole number"),
])  # fmt: skip
def test_bad_input_is_one_line(args, word, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DISPLAY", ":none")
    code = app.main([*args, *(["--t-max", "0.1"] if args[:2] == ["video", "constant"] else [])])
    err = capsys.readouterr().err
    assert code == 2 and err.count("\n") == 1 and word in err


@pytest.mark.layout
def test_running_plots_end_as_the_whole_curve(record):
    """Drawn in many images or in one: the same bytes, with curves inside the axes only."""
    pieces, whole = RunningPlots(record, 300, 480), RunningPlots(record, 300, 480)
    blank = whole.draw(0).copy()
    for n in np.linspace(1, len(record.t), 20).astype(int):
        pieces.draw(n)
    np.testing.assert_array_equal(pieces.draw(len(record.t)), whole.draw(len(record.t)))
    drawn = (whole.draw(len(record.t)) != blank).any(axis=-1)
    assert drawn.sum() > 1000 and not drawn[:, :30].any()
    np.testing.assert_array_equal(whole.draw(0), blank)


SIZES = [
    (120, 100),
    (120, 240),
    (130, 333),
    (180, 320),
    (180, 480),
    (240, 160),
    (240, 360),
    (360, 480),
    (480, 720),
]


SCENES = {
    "constant": hc.constant_cut(dt=1e-3),
    "variable": hc.variable_cut(dt=1e-3),
    "free": hc.free(t_max=0.1),
    "unstable": hc.stability_test(25.0, t_max=3.0, dt=1e-3),
    "stiff": hc.constant_cut(b=1e6, t_max=2.0),
}
PLOTTED = [  # the least picture of each scene, and each larger one of some
    (name, size)
    for i, size in enumerate(SIZES)
    for j, name in enumerate(SCENES)
    if HUNTS or i == 0 or (i + j) % 8 == 0
]


@functools.cache
def ran(name):
    return hc.simulate(SCENES[name], every=7)


@pytest.mark.parametrize("name, size", PLOTTED, ids=str)
@pytest.mark.layout
def test_labels_of_running_plots_neither_overlap_nor_leave_the_picture(name, size):
    assert plots_fit(*size)
    figure, _ = running_figure(ran(name), *size)
    boxes = []
    for ax in figure.axes:
        hidden = set()  # ticks out of view, and those of an earlier layout
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            drawn = axis.majorTicks[: len(axis.get_majorticklocs())]
            hidden |= {
                t.label1
                for t in axis.majorTicks
                if t not in drawn or not low <= t.get_loc() <= high
            }
        for text in ax.findobj(Text):
            if (
                text.get_visible() and text.get_text() not in ("", "b") and text not in hidden
            ):  # b names a line
                boxes.append((text.get_text(), text.get_window_extent()))
    assert len(boxes) > 3 * len(figure.axes)
    for i, (name, box) in enumerate(boxes):
        assert (
            box.x0 > -0.5 and box.y0 > -0.5 and box.x1 < size[0] + 0.5 and box.y1 < size[1] + 0.5
        ), (name, box)
        for other, more in boxes[:i]:
            apart = max(box.x0, more.x0) >= min(box.x1, more.x1) or max(box.y0, more.y0) >= min(
                box.y1, more.y1
            )
            assert apart, (name, other)


@needs_gl
@pytest.mark.parametrize(
    "size", [(160, 160), (316, 240), (320, 98), (320, 240), (390, 300)], ids=str
)
def test_small_films_have_what_fits_and_whole_titles(record, size):
    """The title's box is darker than the sky; a clipped one would reach the right edge."""
    images = film.frames(record, FilmOptions(speed=50.0, size=size))
    image = next(images).astype(int)
    images.close()
    picture = image[:, : size[0] - 120] if size[0] >= 320 and size[1] >= 100 else image
    plain = picture is image
    assert plain == bool((image[:, -1] != 255).any())  # plots are on white
    dark = (picture[:12].mean(axis=-1) < 140).any(axis=0)
    assert dark[5:60].all() and not dark[-1]
