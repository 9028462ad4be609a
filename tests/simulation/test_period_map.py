"""The map of a period beside the eigenvalues of the exact loop, and where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.simulation import period_map
from hapticclay.studies import growth
from hapticclay.studies.boundary import PushedLoop, pose_matrix
from tests.hunt import examples, some
from tests.oracles.sampled_wall import sample_map
from tests.simulation.test_stepwise import fast

HAND = hc.Operator(0.4, 5.0, 80.0)
LEAD = hc.Compensator((1.0, 20.0), (1.0, 60.0, 0.0))
LOOPS = {
    "continuous": PushedLoop(K=2.0, b=60.0),
    "at another pose": PushedLoop(K=2.0, b=60.0, inertia_shaping=False, pose=(0.03, -0.02)),
    "with a hand": PushedLoop(K=2.0, b=60.0, operator=HAND),
    "springs back": PushedLoop(K=2.0, b=60.0, k=400.0, operator=HAND),
    "stiff": PushedLoop(K=0.5, b=1e5),
    "another compensator": PushedLoop(K=9.0, b=60.0, compensator=LEAD, operator=HAND),
    "sampled": PushedLoop(K=2.0, b=60.0, Ts=5e-4),
    "late": PushedLoop(K=2.0, b=60.0, Ts=1e-3, delay=3.3e-3, operator=HAND),
    "physical": PushedLoop(K=2.0, b=60.0, Ts=1e-3, render="physical", operator=HAND),
    "sampled, another": PushedLoop(K=9.0, b=60.0, Ts=1e-3, compensator=LEAD),
}
WALLS = {
    "light, late": hc.VirtualWall(
        K=2000.0, B=35.7, device=hc.Device(0.03, 0.05), Ts=3e-4, delay=0.4 * 3e-4
    ),
    "with a hand": hc.VirtualWall(K=900.0, B=5.0, device=hc.Device(0.5, 2.0), operator=HAND),
    "two samples late": hc.VirtualWall(
        K=50.0, B=20.0, device=hc.Device(2.0, 5.0), operator=HAND, Ts=1e-2, delay=2e-2
    ),
    "window": hc.VirtualWall(K=3e3, B=2.0, device=hc.Device(0.1, 1.0), Ts=1e-4, velocity_window=4),
    "filter": hc.VirtualWall(K=3e3, B=2.0, device=hc.Device(0.1, 1.0), velocity_filter=100.0),
    "exact velocity": hc.VirtualWall(K=3e3, B=2.0, device=hc.Device(0.1, 1.0), velocity="exact"),
}


def scene_of(base):
    """The scene of a run of a loop or a wall."""
    if isinstance(base, PushedLoop):
        return base.scenario(1.0, stop_when_unstable=False)
    return base.scenario(1.0, push=1e-3, steps=16)


def map_of(scenario, engine="python", i=0):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(period_map, "engine_for", lambda asked: engine)
        return period_map.PeriodMaps().of(scenario, i)


def rates(loop):
    """Exact growth rates of the oscillations of a loop, of both axes [1/s]."""
    z = np.linalg.eigvals(pose_matrix(loop)).astype(complex)
    if loop.Ts:
        z = np.log(z[np.abs(z) > 1e-6]) / loop.Ts
    return z.real[(np.abs(z.imag) > 1.0) | (z.real > 1.0)]


@pytest.mark.parametrize("name", LOOPS)
def test_the_rate_of_a_loop_is_that_of_its_eigenvalues(name):
    loop = LOOPS[name]
    found, exact = growth.growth_of_map(map_of(scene_of(loop))), rates(loop)
    if name == "another compensator":  # the loop of y, which is not seen, decays more slowly
        exact = exact[exact < -20.0]
    # 1e-3: what a step of second order changes in the rate; a kick changes 1e-6 of it
    assert found == pytest.approx(exact.max(), rel=1e-3)


@pytest.mark.parametrize("name", WALLS)
def test_the_eigenvalues_of_a_wall_are_those_of_its_definition(name):
    wall = WALLS[name]
    found = map_of(scene_of(wall))
    exact = np.linalg.eigvals(sample_map(wall))
    # 2e-4: 16 engine steps a sample, and the turning of the link by the kick
    assert np.abs(np.linalg.eigvals(found.matrix)).max() == pytest.approx(
        np.abs(exact).max(), rel=2e-4
    )
    assert found.period == pytest.approx(wall.Ts)


@examples(12)
@given(
    K=st.floats(0.1, 20.0),
    b=st.floats(5.0, 500.0),
    hand=st.tuples(st.floats(0.05, 2.0), st.floats(0.5, 20.0), st.floats(0.0, 300.0)),
    pose=st.tuples(st.floats(0.01, 0.05), st.floats(-0.05, -0.01)),
    delay=st.floats(0.0, 3e-3),
)
def test_the_map_of_any_sampled_loop_has_its_eigenvalues(K, b, hand, pose, delay):
    loop = PushedLoop(
        K=K, b=b, operator=hc.Operator(*hand), pose=pose, delay=delay, Ts=1e-3,
        inertia_shaping=False,
    )  # fmt: skip
    found, exact = (
        np.linalg.eigvals(x) for x in (map_of(scene_of(loop)).matrix, pose_matrix(loop))
    )
    for z in exact[np.abs(exact) > 0.1]:
        # 1e-4: what a step of second order and a kick of 1e-6 change in a period
        assert np.abs(found - z).min() < 1e-4


@fast
@pytest.mark.parametrize("base", some([LOOPS["stiff"], LOOPS["late"], WALLS["window"]], 2))
def test_compiled_steps_give_the_same_bits(base):
    s = scene_of(base)
    plain, compiled = map_of(s), map_of(s, "native")
    for name, x in plain._asdict().items():
        assert np.array_equal(x, getattr(compiled, name)), name


def test_coordinates_that_do_not_act_on_the_axis_are_left_out():
    shaped = map_of(scene_of(LOOPS["continuous"]))
    turned = map_of(scene_of(LOOPS["at another pose"]))
    # joint 1 and the loop of x; all of both axes
    assert len(shaped.matrix) == 6 and len(turned.matrix) == 12
    # joint 1, torque on link 1, two numbers of the law, measured rate, four past angles
    assert len(map_of(scene_of(WALLS["window"])).matrix) == 10
    assert turned.seen @ turned.pushed == pytest.approx(1.0)  # a push of 1 m/s is seen as that


def test_one_scene_does_not_decide_what_acts_in_the_next():
    maps = period_map.PeriodMaps()
    straight = scene_of(replace(LOOPS["at another pose"], pose=(0.0, 0.0)))
    maps.of(straight, 0)
    found = maps.of(scene_of(LOOPS["at another pose"]), 0)
    assert growth.growth_of_map(found) == pytest.approx(
        growth.growth_of_map(map_of(scene_of(LOOPS["at another pose"]))), rel=1e-6
    )


def test_scenes_of_one_kind_may_differ_in_their_steps_and_delays():
    wall, maps = WALLS["two samples late"], period_map.PeriodMaps()
    for steps, late in ((16, 2.0), (4, 0.5), (50, 3.2)):
        s = replace(wall, delay=late * wall.Ts).scenario(1.0, steps=steps)
        found, alone = maps.of(s, 0), map_of(s)
        assert np.array_equal(found.matrix, alone.matrix) and found.period == alone.period
        assert found.period == pytest.approx(wall.Ts)


SAMPLED = scene_of(LOOPS["sampled"])
SLIDES = hc.Profile((), (20.0,), Fy=(0.5,))
YIELDS = hc.Clay(SLIDES, SLIDES)


@pytest.mark.parametrize(
    "scenario",
    [
        replace(SAMPLED, hardware=hc.Hardware(encoder=4096)),
        replace(SAMPLED, hardware=hc.Hardware(friction=(0.01, 0.0))),
        replace(SAMPLED, hardware=hc.Hardware(jitter=1e-5)),
        replace(SAMPLED, hardware=hc.Hardware(passivity=True)),
        replace(scene_of(LOOPS["continuous"]), clay=YIELDS),
        replace(scene_of(LOOPS["continuous"]), integrator="accurate"),
        replace(scene_of(LOOPS["with a hand"]), start=(0.02, 0.0)),  # its spring pulls
        replace(scene_of(LOOPS["continuous"]), torque_limit=(1e-5, 1e-5)),  # a kick saturates it
        scene_of(hc.VirtualWall(K=10.0, velocity_window=200)),
    ],
    ids=[
        "encoder",
        "friction",
        "jitter",
        "passivity",
        "yields",
        "accurate",
        "moves",
        "weak",
        "long",
    ],
)
def test_where_small_motions_are_not_linear_there_is_no_map(scenario):
    assert map_of(scenario) is None
