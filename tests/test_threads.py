"""Threads of BLAS: one inside a question, as before behind it."""

import math
import os
import subprocess
import sys
import threading

import pytest
from threadpoolctl import ThreadpoolController

import hapticclay as hc
from hapticclay.model.sampled_controller import LawFailed
from hapticclay.studies import store, store_runs
from hapticclay.threads import OneThread, one_thread

PLACE = (0.5 * math.pi, -0.5 * math.pi)


def counts():
    """Threads of each library of BLAS in this process."""
    return [x.num_threads for x in ThreadpoolController().select(user_api="blas").lib_controllers]


@pytest.fixture(autouse=True)
def two():
    """All libraries on two threads, as they start on a machine of two cores."""
    import scipy.linalg  # noqa: F401

    with ThreadpoolController().limit(limits=2, user_api="blas"):
        if set(counts()) != {2}:
            pytest.skip("a BLAS whose threads cannot be set")
        yield


def scene(controller):
    """The two-link arm under a sampled controller, which theory calls."""
    return hc.Scenario(
        control="sampled",
        render="physical",
        controller=controller,
        origin=(hc.Arm().l2, hc.Arm().l1),
        force=(0.0, 0.0),
        length=None,
        t_max=0.01,
        operator=hc.Operator(0.4, 5.0, 80.0),
        clay=None,
    )


def watched(inside, fails=False):
    """A controller that notes the threads where it is called."""

    def law(t, q, qd, fh, state, params):
        inside.update(counts())
        if fails:
            raise ZeroDivisionError
        return tuple(20.0 * (p - a - 0.03 * w) for p, a, w in zip(PLACE, q, qd, strict=True)), ()

    return scene(hc.Controller(law))


def test_a_question_runs_on_one_thread_and_leaves_two():
    inside = set()
    hc.theory.controller_stability(watched(inside))
    assert inside == {1} and set(counts()) == {2}


def test_a_question_that_fails_leaves_two():
    inside = set()
    with pytest.raises(LawFailed):
        hc.theory.controller_stability(watched(inside, fails=True))
    assert inside == {1} and set(counts()) == {2}


def test_the_runs_of_a_sweep_do_likewise(tmp_path):
    """The function that processes of this machine and of a cluster call."""
    inside = set()

    def ended():
        inside.update(counts())
        return False

    sweep = hc.studies.Sweep("constant", hc.studies.parse_grid("b=60,90"), {"t_max": 0.01})
    with store.claimed(sweep, tmp_path) as (plan, todo):
        store_runs.run_part(plan, todo[0], str(tmp_path), ended=ended)
    assert inside == {1} and set(counts()) == {2}


def test_questions_inside_one_another_and_beside():
    """The last thread of Python to leave restores; what ends before does not."""
    limit, entered, leave = OneThread(), threading.Event(), threading.Event()

    def other():
        with limit:
            entered.set()
            leave.wait(60.0)

    thread = threading.Thread(target=other)
    with limit, limit:
        assert set(counts()) == {1}
        thread.start()
        assert entered.wait(60.0)
    assert set(counts()) == {1}
    leave.set()
    thread.join()
    assert set(counts()) == {2}


def test_what_a_user_has_set_is_back_behind_a_question():
    with ThreadpoolController().limit(limits=3, user_api="blas"):
        before = counts()
        with one_thread:
            assert set(counts()) == {1}
        assert counts() == before


LATE = """
import sys
import numpy
from hapticclay.threads import one_thread
with one_thread:
    assert "scipy" not in sys.modules
    import scipy.linalg
    from threadpoolctl import ThreadpoolController
    def counts():
        blas = ThreadpoolController().select(user_api="blas")
        return {x.num_threads for x in blas.lib_controllers}
    with one_thread:
        assert counts() == {1}
    assert counts() == {1}
assert counts() == {2}
"""
LAZY = """
import sys
import hapticclay as hc
hc.simulate(hc.constant_cut(b=90.0))
assert "threadpoolctl" not in sys.modules
"""


@pytest.mark.parametrize("program", [LATE, LAZY])
def test_what_is_loaded_later(program):
    """SciPy brings a BLAS of its own; a run without matrices needs no threadpoolctl."""
    words = [sys.executable, "-c", program]
    subprocess.run(words, check=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "2"})
