"""The cost of a method: the edits that CONTRIBUTING.md lists, in a copy."""

from tests.kernel.edited import missing_in, run_edited

PACE = """    if m.method == FINE:
        return after / max(1.0, 1.0 * round(4.0 * after / m.dt))
    return after


def bound("""
EDITS = {  # the fast method with four steps a sample: by file, what stands, and what then
    "scene/scenario.py": [('Literal["fast", "accurate"]', 'Literal["fast", "accurate", "fine"]')],
    "model/support.py": [
        (
            '    Trait("held", "method",',
            '    Trait("fine", "method", lambda s: s.integrator == "fine"),\n'
            '    Trait("held", "method",',
        )
    ],
    "kernel/scene.py": [
        (
            '    elif s.integrator != "fast":\n        put_accurate(',
            '    elif s.integrator == "fine":\n        m.method = methods.FINE\n'
            '    elif s.integrator != "fast":\n        put_accurate(',
        )
    ],
    "kernel/methods.py": [
        (
            "CONTINUOUS, SAMPLED, ACCURATE = range(3)",
            "CONTINUOUS, SAMPLED, ACCURATE, FINE = range(4)",
        ),
        ("    return after\n\n\ndef bound(", PACE),
    ],
}
RUN = """
import dataclasses
import numpy as np
import hapticclay as hc
from hapticclay.kernel import native

assert not native.is_there(), "a kernel built from other sources is refused"
hand = dict(operator=hc.Operator(), force=(2.0, 0.3))
s = hc.constant_cut(**hand, clay=(0.005, 0.02), t_max=0.4, dt=1e-3)
coarse, fine, short = (
    hc.simulate(dataclasses.replace(s, integrator=x, dt=dt))
    for x, dt in (("fast", 1e-3), ("fine", 1e-3), ("fast", 2.5e-4))
)
assert len(fine.t) == len(coarse.t) and 3.9 * coarse.steps < fine.steps
(border,), (same,), (other,) = fine.crossings, short.crossings, coarse.crossings
assert abs(border.time - same.time) < 1e-9 < abs(border.time - other.time)
for name in ("p", "v", "fe", "tau"):
    a, b, c = (getattr(r, name)[: len(fine.t) - 1] for r in (fine, coarse, short))
    # as with steps of a quarter, but for the roundings of times
    away = np.abs(a - getattr(short, name)[::4][: len(a)]).max()
    assert away < 1e-9 * np.abs(a).max(), (name, away)
    assert np.abs(a - b).max() > 100.0 * away
assert abs(fine.energy["residual"] - short.energy["residual"]) < 1e-12
assert "fine" in hc.Scenario(integrator="fine").__repr__()
with hc.Simulation(dataclasses.replace(s, integrator="fine")) as one:
    while one.outcome is None:
        one.step()
np.testing.assert_array_equal(one.record().p, fine.p)
"""


def test_a_method_is_four_files_of_the_package(tmp_path):
    """Four steps a sample: path, rows, ledger and single steps take it as it is."""
    run_edited(tmp_path, EDITS, RUN)
    assert not missing_in("Add a method", EDITS)
