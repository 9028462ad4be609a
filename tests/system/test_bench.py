"""The benchmark: its figures follow from the runs, its tables from the figures."""

import csv
import dataclasses
import functools
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks import (
    arm_integrators,
    arms,
    bench,
    common,
    diagrams,
    extremes,
    first_results,
    hits,
    pages,
    pairs,
    parts,
    problems,
    provenance,
    ranking,
    sampled_loop,
    sampled_reference,
    scaling,
    stiffness,
    study,
    throughput,
    turns,
    yielding_clay,
)
from benchmarks import work_precision as wp
from benchmarks.peers import common as peers
from benchmarks.peers import handle, mujoco_plain, ours, scipy_ivp
from benchmarks.peers import sampled_loop as sampled_peers
from benchmarks.peers import yielding_clay as yielding_peers
from tests.hunt import HUNTS


@pytest.fixture(scope="module")
def rows():
    """All methods; with more than one setting, those whose errors are compared."""
    names = "ours", "mujoco_plain", "scipy_ivp", "no_such_peer"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ours, "warm", lambda: None)  # nobody reads these times
        for peer in (ours, mujoco_plain, scipy_ivp):
            some = {
                name: x if name.startswith(("fast", "DOP853")) else x[:1]
                for name, x in peer.methods().items()
                if HUNTS or name != "accurate, native"
            }
            patch.setattr(peer, "methods", lambda some=some: some)
        found, omissions = wp.measure(True, ["default cut"], names, rounds=1)
    assert len(omissions) == 1 and "no_such_peer" in omissions[0]
    return found


@pytest.fixture(scope="module")
def scaled():
    """What a sweep on workers took: threads of this process, processes in a hunt."""
    cluster = pytest.importorskip("distributed", reason="pip install 'hapticclay[cluster]'")
    workers = functools.partial(cluster.LocalCluster, processes=HUNTS)
    short = dataclasses.replace(scaling.job(True), fixed={"t_max": 0.02})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cluster, "LocalCluster", workers)
        patch.setattr(scaling, "job", lambda quick: short)
        patch.setattr(scaling, "TASKS", 100)
        return scaling.measure(True, 1)


SHORT = 0.8  # [s] of a run into stiff clay, which the handle meets after 0.6 s


sampled_solution = functools.cache(sampled_reference.solve)


@functools.cache
def stiff_row(b, dt, row=stiffness.row):
    """The row of the stiffness sweep, of a SHORT run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stiffness, "T", SHORT)
        return row(b, dt)


@pytest.fixture(scope="module")
def studied():
    """Rows and words of the studies of one problem, measured quickly, by problem."""
    quick = [sampled_loop.problem(render, True) for render in sampled_loop.RENDERED]
    quick += [yielding_clay.problem(True)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampled_reference, "solve", sampled_solution)
        return {problem.name: study.measure(problem, True, 1) for problem in quick}


def of(rows, package, **kw):
    return [r for r in rows if r["package"] == package and all(r[k] == v for k, v in kw.items())]


def test_errors_of_the_exact_solution_are_none():
    exact = problems.reference("default cut")
    t = np.arange(0.0, 11.0, 0.01)
    p, v = exact(t)
    b = np.where((t > exact.crossings[0]) & (t < exact.crossings[1]), 90.0, 0.0)
    found = wp.errors(
        "default cut", problems.Result(exact.crossings, t, p, b * v[:, 0], v[:, 0], 1.0)
    )
    assert found["crossing"] == 0.0 and found["position"] == 0.0 and found["force"] < 1e-12
    assert found["b"] == 0.0
    late = [x + 1e-3 for x in exact.crossings]
    assert wp.errors("default cut", problems.Result(late, t, p, b * v[:, 0], v[:, 0], 1.0))[
        "crossing"
    ] == pytest.approx(1e-3)


def test_a_failed_run_is_a_row_without_errors():
    r = problems.Result(
        [], np.array([0.0]), np.zeros((1, 2)), np.zeros(1), np.zeros(1), 1.0, "blow-up"
    )
    assert set(wp.errors("default cut", r).values()) == {None}


def test_the_default_path_is_a_thousand_times_closer_than_first_order_stepping(rows):
    for r in of(rows, "MuJoCo, plain"):
        for mine in of(rows, "hapticclay", method="fast", setting=r["setting"]):
            assert mine["crossing"] < 1e-3 * r["crossing"]
    assert {r["setting"] for r in of(rows, "MuJoCo, plain")} & {
        r["setting"] for r in of(rows, "hapticclay")
    }


def test_peers_converge_to_the_reference(rows):
    best = min(r["crossing"] for r in of(rows, "SciPy"))
    assert best < 1e-8


@pytest.mark.parametrize("problem", problems.PROBLEMS)
def test_compiled_right_hand_side_is_the_plain_one(problem):
    """The same law compiled:

    rounding of sums in another order; and so the same crossings, at an rtol of 1e-10, shown with a
    hand.
    """
    job = peers.Job.of(problem)
    plain, fast = peers.ode(job), scipy_ivp.compiled(problem)
    rng = np.random.default_rng(0)
    for b in job.b:
        z = peers.initial(job) + 0.1 * rng.normal(size=12)
        np.testing.assert_allclose(fast(0.0, z, b), plain(0.0, z, b), rtol=1e-12, atol=1e-12)
    if problem != "hand in the loop" and not HUNTS:
        return
    one, other = (
        scipy_ivp.solve(problem, m, 1e-10).crossings for m in ("DOP853", "DOP853, compiled")
    )
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_leaders_are_said_by_the_figures():
    times = {"a": {1e-5: 1.0, 1e-9: 4.0}, "b": {1e-7: 6.0, 1e-9: 3.0}}
    rows = [
        dict(problem="p", package=k, method="m", setting=e, crossing=e, wall=w)
        for k, x in times.items()
        for e, w in x.items()
    ]
    found = ranking.leaders(rows)
    assert [x["package"] for x in found] == ["a"] * 4 + ["b"] * 3  # from 1e-2 to 1e-5, from 1e-6 on
    assert (
        found[0]["factor"] == 3.0
        and found[-1]["next"] == "a, m"
        and found[-1]["factor"] == pytest.approx(4 / 3)
    )
    assert ranking.who_leads(found) == (
        "Fastest, by requested error: a at 1e-2 to 1e-5 s (the next package takes 3.0 times as "
        "long); b at 1e-6 to 1e-8 s (the next package takes 1.3 times as long)."
    )
    assert ranking.who_leads(ranking.leaders(rows[:2])).endswith("a at 1e-2 to 1e-8 s.")


def test_recommendation_is_the_fastest_row_that_keeps_the_error(rows):
    for x in ranking.recommend(rows):
        fit = [r for r in rows if r["crossing"] is not None and r["crossing"] <= x["asked"]]
        assert x["wall"] == min(r["wall"] for r in fit) and x["error"] <= x["asked"]


def test_page_says_what_was_measured_and_nothing_else(rows, tmp_path):
    data = {
        "machine": common.machine(),
        "omissions": ["a peer: not installed"],
        "rows": rows,
        "hybrid": [],
    }
    found = pages.pages({"work_precision": data})
    table = list(csv.DictReader(found["work_precision.csv"].splitlines()))
    assert len(table) == len(rows)
    for r, line in zip(rows, table, strict=True):
        assert (line["package"], line["method"]) == (r["package"], r["method"])
        assert float(line["crossing"]) == pytest.approx(r["crossing"], rel=1e-5)
        assert float(line["setting"]) == r["setting"]
    text = found["work_precision.md"]
    assert "- a peer: not installed" in text and "mujoco 4" in text
    best = ranking.leaders(rows)[0]
    assert best["first"] in text and f"{best['factor']:.1f}" in text
    json.dumps(rows, allow_nan=False)


def test_a_diagram_has_six_lines_at_most_and_units(rows):
    (figure,) = wp.figures({"rows": rows}).values()
    assert len(figure.axes) == 4
    packages = {r["package"] for r in rows}
    assert [x.get_label() for x in figure.axes[0].lines][:1] == ["hapticclay"]
    assert len(figure.axes[0].lines) == len(packages) <= diagrams.LINES
    assert all("[" in ax.get_ylabel() and "[ms]" in ax.get_xlabel() for ax in figure.axes)


def test_a_diagram_keeps_the_six_packages_that_are_fastest_at_an_error():
    def row(package, method, wall):
        return dict(package=package, method=method, setting=1.0, wall=wall, e=1e-4)

    rows = [row(name, "a", k) for k, name in enumerate("hgfedcba", 1)]
    assert [*diagrams.lines(rows, ["e"])] == [*"hgfedc"]
    few = [row("hapticclay", x, 1.0) for x in ("fast", "fast, native", "sampled, held")]
    shown = diagrams.lines([*few, row("b", "x", 1.0)], ["e"])
    assert [*shown] == ["hapticclay, fast, native", "b, x"]


def test_jobs_are_those_of_the_package():
    assert dataclasses.replace(problems.PROBLEMS["default cut"]) == problems.hc.constant_cut()


def test_sampled_control_is_as_late_as_its_hold_and_as_exact_as_the_hybrid_system():
    found = wp.against_hybrid(True)
    assert {r["render"] for r in found} == {"held", "physical"}
    for r in found:
        assert r["hybrid"] < 0.05 * r["continuous"]
    for coarse, fine in zip(found[0::2], found[1::2], strict=True):
        assert (
            coarse["continuous"] > 2.0 * fine["continuous"]
            and coarse["hybrid"] > 2.0 * fine["hybrid"]
        )


def test_sampled_rows_recommend_nothing(rows):
    cheap = [
        {**r, "crossing": 0.0, "wall": 0.0} for r in of(rows, "hapticclay", method="sampled, held")
    ]
    assert cheap and ranking.recommend(rows + cheap) == ranking.recommend(rows)


# ---- studies of one problem ----------------------------------------------------------------------


def test_the_sampled_reference_and_scipy_agree_to_rounding_and_ours_to_its_first_order(studied):
    for problem in ("sampled loop with held clay", "sampled loop with physical clay"):
        rows, _ = studied[problem]
        # two programs in other coordinates: rounding of 150 samples, a place of 1e-2 m
        assert max(r["position"] for r in of(rows, "SciPy", method="DOP853")) < 1e-14
        # all counts the same: within the way that the push moves the handle in a step, W f dt^2/2
        assert max(r["position"] for r in of(rows, "hapticclay")) < 0.8 * (3.6e-4) ** 2 * 5.0 / 2.0
        assert min(r["position"] for r in of(rows, "MuJoCo, plain")) > 1e-6


@pytest.mark.parametrize("render", sampled_loop.RENDERED)
def test_two_sampled_references_round_every_number_alike_and_pass_the_border(render):
    s = sampled_loop.scene(render, 150)
    one, other = (sampled_solution(s, *x) for x in ((), sampled_loop.SECOND))
    assert one.p[-1, 0] > sampled_loop.BORDER
    for kind, levels in one.levels.items():
        np.testing.assert_array_equal(levels, other.levels[kind])
        assert len(np.unique(levels)) > 3
    # what rounding is spared: farther from an edge than both solutions lie apart [m, rad, N]
    assert min(x.min() for x in one.spare.values()) > 1e9 * np.abs(one.p - other.p).max()


def test_yielding_clay_stops_and_a_regularised_law_creeps(studied):
    rows, told = studied["yielding clay"]
    assert "the same 6 stops and releases" in told
    assert {r["note"] for r in rows} == {""}
    assert max(r["position"] for r in of(rows, "hapticclay", method="accurate")) < 1e-6
    coarse, fine = (r["position"] for r in of(rows, "hapticclay", method="fast"))
    assert coarse > 2.0 * fine  # second order, or first where a stop falls within a step
    assert max(r["position"] for r in of(rows, "SciPy", method="DOP853, modes")) < 1e-5
    for r in rows:
        if "regularised" in r["method"]:  # creep of eps = 1e-2 m/s, 0.13 s before x yields
            assert 0.1 * 1e-2 * 0.13 < r["position"] < 1e-2


def test_compiled_laws_of_the_peers_are_the_plain_ones():
    """Rounding of sums in another order."""
    numba, rng = pytest.importorskip("numba"), np.random.default_rng(0)
    loop = sampled_peers.Loop.of(sampled_loop.scene("physical"))
    z = np.array((1.9, 0.2, 0.3, -0.4))
    plain, fast = (sampled_peers.right_hand_side(loop, x)[1] for x in (False, True))
    np.testing.assert_allclose(fast(z, 1.0, -2.0, 90.0), plain(z, 1.0, -2.0, 90.0), rtol=1e-12)
    loop = yielding_peers.Loop.of(yielding_clay.scene())
    laws = zip(
        *(yielding_peers.equations(loop, x) for x in (handle.plain, numba.njit)), strict=True
    )
    z = peers.initial(loop.job) + 0.1 * rng.normal(size=12)
    for (plain, fast), more in zip(laws, ((1.0, 0.0), (0.0, 0.0), (1e-2,)), strict=True):
        for x, y in zip(plain(0.3, z, *more), fast(0.3, z, *more), strict=True):
            np.testing.assert_allclose(y, x, rtol=1e-11, atol=1e-12)


def test_the_page_of_a_study_says_who_leads_and_how_single_runs_fare():
    def row(package, method, setting, position, wall):
        own = dict(package=package, method=method, setting=setting)
        return dict(problem="p q", position=position, wall=wall, note="", **own)

    rows = [
        row("hapticclay", "fast, native", 1e-3, 1e-6, 3.0),
        row("hapticclay", "fast" + study.THROUGHOUT, 1e-3, 1e-6, 1.0),
        row("SciPy", "LSODA", "0.1, 0.01", 1e-7, 2.0),
        row("SciPy", "LSODA", "0.1, 0.001", 1e-5, 2.5),
    ]
    text = "\n".join(study.sections({"texts": {"p q": ["about", "told"]}, "rows": rows}))
    both, single = text.split("The release measured here made the first steps")
    lead = "hapticclay at 1e-2 to 1e-6 m (the next package takes 2.0 times as long)"
    assert f"by requested error: {lead}; SciPy at 1e-7 m." in both
    assert "by requested error: SciPy at 1e-2 to 1e-7 m (the next" in single
    assert "Only SciPy went below 1.0e-6 m." in text and "(p_q.png)" in text
    settings = [r["setting"] for r in study.shown(rows)]
    assert "0.1, 0.01" in settings and "0.1, 0.001" not in settings  # beaten in both


def test_the_front_holds_what_no_other_point_beats():
    points = [dict(setting="a", wall=w, e=e) for w, e in ((3, 1), (1, 9), (2, 5), (2, 6), (4, 2))]
    assert [(r["wall"], r["e"]) for r in diagrams.line(points, "e")] == [(1, 9), (2, 5), (3, 1)]
    ladder = [{**r, "setting": 0.1} for r in points]
    assert diagrams.line(ladder, "e") == ladder


def test_an_incomplete_run_has_no_error():
    exact = np.zeros((3, 2))
    assert study.error(study.Run(exact + [3.0, 4.0], 1.0), exact) == 5.0
    for run in (
        study.Run(exact, 1.0, "failed"),
        study.Run(exact[:2], 1.0),
        study.Run(exact + np.nan, 1.0),
    ):
        assert study.error(run, exact) is None


def test_runs_take_turns_and_long_ones_run_once():
    order, walls = [], iter([1.0, turns.LONG, 3.0, 2.0])

    def job(name):
        order.append(name)
        return study.Run(np.zeros((1, 2)), next(walls))

    _, found = turns.take_turns([(x, lambda x=x: job(x)) for x in "ab"], 3)
    assert order == ["a", "b", "a", "a"] and found == [2.0, turns.LONG]


def draws_one_of_a_kind():
    """A `Figure.savefig` that draws only the first figure of each number of axes."""
    save, drawn = Figure.savefig, set()

    def savefig(self, file, **kw):
        n = len(self.axes)
        if HUNTS or n not in drawn:
            save(self, file, **kw)
        drawn.add(n)

    return savefig


def test_command_writes_one_page_figures_and_data_and_renews_the_readme(
    tmp_path, monkeypatch, capsys, rows, scaled, studied
):
    monkeypatch.setattr(wp, "measure", lambda *a, **kw: (of(rows, "hapticclay"), []))
    monkeypatch.setattr(study, "measure", lambda problem, *a: studied[problem.name])
    monkeypatch.setattr(scaling, "measure", lambda *a: scaled)
    monkeypatch.setattr(wp, "against_hybrid", lambda quick: [])
    monkeypatch.setattr(stiffness, "SWEEP", (1e2, 1e5))
    monkeypatch.setattr(stiffness, "row", stiff_row)
    monkeypatch.setattr(common, "warm", lambda: None)  # nobody reads these times
    monkeypatch.setattr(Figure, "get_layout_engine", lambda self: None)  # nor sees the figures
    monkeypatch.setattr(Figure, "savefig", draws_one_of_a_kind())
    monkeypatch.setattr(hits, "CLAYS", (1e1, 1e3))
    monkeypatch.setattr(arm_integrators, "CASES", ())
    monkeypatch.setattr(arm_integrators, "HALVINGS", 1)
    monkeypatch.setattr(arm_integrators, "SECONDS", 1.0)
    for name, less in (
        ("PEERS", ()),
        ("OURS", (1,)),
        ("POSES_QUICK", 2),
        ("REPEATS", 1),
        ("TIMED", 99),
    ):
        monkeypatch.setattr(arms, name, less)
    monkeypatch.setattr(pairs, "CASES", [])
    monkeypatch.setattr(pairs, "own_limit", lambda exact, *a: exact)  # tests of pairs run them
    monkeypatch.setattr(pairs, "own_time", lambda repeats: 1.0)
    delays = {"limit": 0.1, "theory": 24, "runs": 24}
    monkeypatch.setattr(pairs, "delay_row", lambda kind, quick: {"kind": kind, **delays})
    monkeypatch.setattr(pairs, "theory_times", lambda quick: [{"question": "all", "time": 0.1}])
    if not HUNTS:  # in Python
        monkeypatch.setattr(hits, "methods", lambda: {"fast": (2e-2, 1e-2, 4e-3, 2e-3)})
    monkeypatch.setattr(throughput, "SCENES", {"constant cut": throughput.SCENES["constant cut"]})
    monkeypatch.setattr(throughput, "SHORT_QUICK", 40)  # too few to be compiled for
    monkeypatch.setattr(throughput, "OFTEN", 1)
    measure, batches, run = throughput.measure, throughput.batches, parts.run
    monkeypatch.setattr(throughput, "measure", lambda rounds, steps: measure(1, 500))
    monkeypatch.setattr(throughput, "batches", lambda sizes, rounds: batches([(8, 100)], 1))
    monkeypatch.setattr(parts, "run", lambda name, steps, *how: run(name, 500, *how))
    monkeypatch.setattr(throughput, "warm", lambda todo: None)
    speed = dict(runs_a_second=1e3, over_floor_cpu=1.2, floor_us_a_run=300.0, us_a_run=360.0)
    columns = [dict(runs=n, control="continuous", peak_MiB=100.0, **speed) for n in (100, 1000)]
    monkeypatch.setattr(throughput, "column_runs", lambda sizes, control: columns)
    for table in ("ENGINE", "LOOP"):
        monkeypatch.setattr(parts, table, dict(list(getattr(parts, table).items())[:2]))
    some = [c for c in extremes.cases() if c.name in ("none", "held", "folded") and c.quick][:1]
    less = dataclasses.replace
    some = [less(c, scenario=less(c.scenario, t_max=1.0)) for c in some]
    monkeypatch.setattr(extremes, "cases", lambda: some)
    readme = tmp_path / "README.md"
    readme.write_text(f"before\n{pages.BEGIN}\nold\n{pages.END}\nafter\n")
    bench.main(tmp_path / "o", True, readme)
    files = sorted(p.name for p in (tmp_path / "o").iterdir())
    data = pages.load(tmp_path / "o")
    drawn = {"scaling.png", "throughput.png", *pages.figures(data)}
    assert {*files} == {f"{x}.json" for x in pages.PARTS} | {*pages.pages(data)} | drawn
    for name, text in pages.pages(data).items():
        assert (tmp_path / "o" / name).read_text() == text
    methods = {r["method"] for r in data["work_precision"]["rows"]}
    assert methods - {"fast, native", "accurate, native"} == {
        "fast",
        "accurate",
        "sampled, held",
        "sampled, physical",
    }
    text = readme.read_text()
    assert (
        text.startswith("before")
        and text.endswith("after\n")
        and "\nold\n" not in text
        and "requested error [s]" in text
    )
    page = (tmp_path / "o" / "extremes.md").read_text()
    assert all(c.name in page for c in some)


def test_a_page_is_stale_once_the_kernel_computes_something_else(tmp_path):
    package = tmp_path / "hapticclay" / "kernel"
    package.mkdir(parents=True)
    file = package / "kick.py"
    file.write_text("def kick(v):\n    return 2.0 * v\n")
    before = provenance.code_digest("hits", tmp_path)
    data = {"hits": {"made": {"code": before, "commit": "abc"}}, "parts": {}}
    assert provenance.stale(data, tmp_path) == {"parts": "unknown"}
    file.write_text('def kick(v):\n    """Twice."""\n    # as it was\n    return 2.0*v\n')
    assert provenance.code_digest("hits", tmp_path) == before
    file.write_text("def kick(v):\n    return 2.5 * v\n")
    assert provenance.stale(data, tmp_path) == {"hits": "abc", "parts": "unknown"}


def test_the_pages_of_arms_alone_are_stale_once_an_arm_is_read_otherwise(tmp_path):
    file = tmp_path / "hapticclay" / "arms" / "loading.py"
    file.parent.mkdir(parents=True)
    file.write_text("def mass():\n    return 1.0\n")
    made = {x: {"made": {"code": provenance.code_digest(x, tmp_path)}} for x in pages.PARTS}
    assert provenance.stale(made, tmp_path) == {}
    file.write_text("def mass():\n    return 2.0\n")
    assert set(provenance.stale(made, tmp_path)) == {"arms", "pairs"}


def test_the_check_names_what_is_missing_or_older_than_the_code(tmp_path, capsys):
    for name in pages.PARTS:
        common.note(tmp_path, name, {"made": provenance.Stopwatch(name).stamp()})
    assert bench.check(tmp_path) == 0
    common.note(tmp_path, "hits", {"made": {"code": "0", "commit": "abc"}})
    (tmp_path / "parts.json").unlink()
    capsys.readouterr()
    assert bench.check(tmp_path) == 1
    assert capsys.readouterr().out == (
        "parts: not measured\nhits: measured on other code than this (commit abc)\n"
    )


def test_an_interrupted_benchmark_goes_on_with_what_is_missing(tmp_path, monkeypatch, capsys):
    begun, stops = [], iter([False, True])

    class Part:
        def __init__(self, name):
            self.name = name

        def main(self, out, quick):
            begun.append(self.name)
            if next(stops, False):
                raise KeyboardInterrupt
            return common.write(out, self.name, {"rows": []})

    monkeypatch.setattr(pages, "PARTS", {name: Part(name) for name in "abc"})
    with pytest.raises(KeyboardInterrupt):
        bench.measure(tmp_path, False, False)
    bench.measure(tmp_path, False, False)
    assert begun == ["a", "b", "b", "c"]
    assert "a: measured before on this code" in capsys.readouterr().out
    assert bench.estimated(["a", "b"], pages.load(tmp_path)) >= 0.0
    for quick, anew, more in ((False, False, ""), (True, False, "abc"), (True, True, "abc")):
        begun.clear()
        bench.measure(tmp_path, quick, anew)
        assert begun == list(more)


def test_published_pages_were_made_from_the_published_data():
    """All but the diagrams, whose pixels differ between releases of matplotlib."""
    folder = Path(__file__).parents[2] / "docs" / "bench"
    data = pages.load(folder)
    assert set(data) == set(pages.PARTS)
    for name, text in pages.pages(data).items():
        assert (folder / name).read_text() == text
        for file in re.findall(r"\]\(([\w.-]+)\)", text):  # pictures, pages and data
            assert (folder / file).is_file(), file
    assert pages.recommended(data) in (folder.parents[1] / "README.md").read_text()


def test_stiffness_sweep_tells_where_each_breaks_down(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(stiffness, "SWEEP", (1e2, 1e5))
    monkeypatch.setattr(stiffness, "row", stiff_row)
    data = stiffness.main(tmp_path)
    soft, stiff = data["rows"]
    assert not any(soft[k]["broken"] for k in ("default", "plain, implicitfast", "plain, Euler"))
    assert stiff["plain, Euler"]["broken"]  # explicit: b dt/Lambda = 28 > 2
    for r in data["rows"]:
        assert r["default"]["error"] < 2e-5 and r["default"]["energy"] < 1.1
    assert "broken" in stiffness.sections(data)[-1]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["stiffness.json"]


def test_runs_of_an_arm_find_its_gain_limit_at_one_step_in_a_sample(tmp_path, monkeypatch):
    monkeypatch.setattr(arms, "OURS", (1,))
    monkeypatch.setattr(arm_integrators, "CASES", [("Euler", "mjINT_EULER", 1)])
    monkeypatch.setattr(arms, "PEERS", ("no_such_peer",))
    for name, less in (("POSES", 2), ("REPEATS", 1), ("TIMED", 100)):  # nobody reads the times
        monkeypatch.setattr(arms, name, less)
    monkeypatch.setattr(common, "warm", lambda: None)
    data = arms.main(tmp_path)
    ours, euler = data["rows"]
    # the bisection finds it to 0.07 %; the step is off by (omega Ts)^2/12, 0.2 % at 12 Hz
    assert abs(ours["error"]) < 0.003 and 0.3 < euler["error"] < 0.5
    assert "37" in "".join(arms.conclusions(data)) and arms.sections(data)
    assert "no_such_peer" in "".join(data["omissions"])
    assert pages.part_page("arms", data).count("No_such_peer") == 1


@pytest.mark.parametrize("share, grows", [(0.996, False), (1.004, True)])
def test_two_plain_arms_flip_at_the_largest_gain_of_theory(share, grows):
    """The same messages in MuJoCo, RK4: 0.4 % on each side."""
    exact = pairs.hc.theory.pair_limits(pairs.leaders()).gain
    assert pairs.plain_grows("RK4", 1, share * exact, 3.0) is grows


def test_the_longest_delay_in_runs_is_that_of_theory(monkeypatch):
    """In whole samples, of 20 ms here: 4.77 are unstable, 5 are not."""
    assert pairs.last_stable(lambda n: n > 29, 14, 58) == 29
    monkeypatch.setattr(pairs, "ONE_TS", 20e-3)
    row = pairs.delay_row("four-channel", True)
    assert row["runs"] == row["theory"] == 5
    assert 4.7 < row["limit"] / pairs.ONE_TS < 4.8


def test_first_results_are_of_two_interpreters(tmp_path, monkeypatch):
    """Both are the one that runs this."""
    long = "import time; time.sleep(99)"
    monkeypatch.setattr(first_results, "FIRST", {"nothing": "pass", "too long": long})
    monkeypatch.setattr(first_results, "SCENES", {"gone": "no_such_name", "new": "pass"})
    monkeypatch.setattr(first_results, "NEW", ("new",))
    monkeypatch.setattr(first_results, "PRELUDE", "")
    monkeypatch.setattr(
        first_results, "described", lambda _: dict(versions="x", MB=1.0, all_MB=2.0)
    )
    line = ["--before", sys.executable, "--now", sys.executable, "--limit", "1"]
    data = first_results.main([*line, "--out", str(tmp_path)])
    rows = {r["job"]: r for r in data["rows"]}
    assert 0.0 < rows["nothing"]["before"]["first"] < 1.0
    assert rows["too long"]["now"] == {"first": None, "again": None}
    assert "no_such_name" in rows["gone"]["now"]["note"] and rows["new"]["before"] is None
    text = (tmp_path / "first_results.md").read_text()
    assert "| gone " in text and "not there" in text and "> 1 " in text and "failed" in text


def test_published_stiff_clay_breaks_nothing_of_ours():
    rows = pages.load(Path(__file__).parents[2] / "docs" / "bench")["stiffness"]["rows"]
    assert all(r["default"]["error"] < 2e-5 and r["default"]["energy"] < 1.1 for r in rows)


def test_scaling_is_measured_and_its_projection_is_bounded(tmp_path, monkeypatch, scaled):
    monkeypatch.setattr(scaling, "measure", lambda *a: scaled)
    data = scaling.main(tmp_path, quick=True)
    assert [r["workers"] for r in data["rows"]] == list(range(1, common.CORES + 1))
    assert data["rows"][0]["speedup"] == 1.0 and all(r["runs_per_s"] > 0.0 for r in data["rows"])
    bound = data["asked_s"] / data["task_s"]
    assert all(r["speedup"] == min(r["workers"], bound) for r in data["projection"])
    page = "".join(scaling.sections(data))
    assert f"{data['runs']} runs" in page and (tmp_path / "scaling.png").stat().st_size > 5000


def test_parts_are_compared_with_the_plain_scene(tmp_path):
    cost = iter([1.0, 1.0, 3.0, 1.0, 2.0, 8.0, 2.0])  # warming up; two rounds: before, part, after
    plain, part = parts.compare(["plain", "part"], lambda _: next(cost), 2)
    assert part["ratio"] == 3.5 and plain["ratio"] == 1.0
    assert part["us"] == pytest.approx(3.5 * plain["us"])
