"""A leader in a person's hand, its follower, and the verdict that stands beside them."""

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.live.pair_session import PairSession, Theory
from tests.waiting import until

LAW = hc.JointPD((400.0,), (20.0,))
DEVICE = hc.Device(0.5, 1.0)


def pair(law=LAW, **kw):
    given = {"Ts": 2e-3, "link": hc.Link(delay=4e-3), "follower_clay": hc.Contact(200.0, 5.0)}
    return hc.Pair(DEVICE, DEVICE, law, **(given | kw))


def known(session):
    return until(lambda: session.theory.found)


def test_a_held_handle_rests_where_three_springs_balance():
    """Hand, law and contact in series, after 4 s: their slowest motion has decayed to 1e-6."""
    k, K = 300.0, 200.0
    session = PairSession(pair(leader_operator=hc.Operator(0.25, 10.0, k)))
    session.pull([0.05, 0.0])
    for _ in range(80):
        session.advance(0.05)
    force = 0.05 / (1.0 / k + 1.0 / 400.0 + 1.0 / K)
    t, leader, follower, *_, hand, contact, _, _ = session.run.newest
    assert leader[0] == pytest.approx(0.05 - force / k, rel=1e-4)
    assert follower[0] == pytest.approx(force / K, rel=1e-4)
    assert hand[0] == pytest.approx(force, rel=1e-4) == contact[0]
    frame = session.frames[-1]
    assert frame.off == pytest.approx(force / 400.0, rel=1e-3)
    assert frame.hand == pytest.approx(force, rel=1e-4)
    assert session.record().t[1] == pytest.approx(10 * 2e-3)  # every tenth sample


def test_without_a_spring_the_session_lends_a_hand_and_theory_counts_it():
    session = PairSession(pair())
    assert session.pair.leader_operator.spring == 300.0
    assert known(session).delay == hc.theory.pair_limits(session.pair).delay
    assert session.verdict().text.startswith("stable at position-position")


def test_a_change_restarts_and_beyond_the_limit_the_pair_swings_and_ends():
    session = PairSession(pair(law=hc.JointPD((400.0,), (2.0,)), follower_clay=None))
    session.pull([0.01, 0.0])
    session.advance(0.1)
    limit = known(session).delay
    session.change(delay=round(1.5 * limit / 1e-3) * 1e-3, gain=2.0)
    assert session.t == 0.0 and not session.frames and session.point is None
    assert session.pair.law.Kp == (800.0,) and session.given.law.Kp == (400.0,)
    found = known(session)
    assert not found.stable and session.verdict().unstable
    session.pull([0.01, 0.0])
    for _ in range(40):
        session.advance(0.05)
    q = session.record().leader[:, 0]
    assert np.abs(q[len(q) // 2 :]).max() > 2.0 * np.abs(q[: len(q) // 2]).max()


def test_a_delay_that_cannot_run_changes_nothing():
    session = PairSession(pair())
    with pytest.raises(hc.ParameterError, match="whole parts"):
        session.change(delay=np.pi * 1e-3)
    assert session.delay == 4e-3 and session.pair.link.delay == 4e-3


def test_a_leader_at_a_wall_beyond_its_plane_is_refused():
    """The muscle acts in the plane of the first two axes, so that the wall cannot turn it."""
    arm = hc.MjcfArm("haptic_3", friction=[0.0] * 3)
    wall = hc.Contact(500.0, 5.0, unilateral=True, start=0.5, axis="z")
    law = hc.JointPD((1.0,) * 3, (0.5,) * 3)
    with pytest.raises(hc.ParameterError, match="contact.axis"):
        PairSession(hc.Pair(arm, arm, law, leader_clay=wall, Ts=2e-3))


def test_a_pause_stands_still():
    session = PairSession(pair())
    session.paused = True
    session.advance(0.05)
    assert session.t == 0.0 and not session.recorded


def test_theory_answers_the_newest_question():
    theory = Theory()
    for late in (2e-3, 4e-3, 6e-3):
        theory.ask(pair(link=hc.Link(delay=late)))
    assert until(lambda: theory.found).present == 6e-3
