"""The cost of an imperfection of the hardware: the edits that CONTRIBUTING.md lists, in a copy."""

from tests.kernel.edited import missing_in, run_edited

FIELD = "    dead_band: Annotated[float, Bound(0.0, 10.0, 'N.m')] = 0.0\n"
TRAIT = """    ("dead band", lambda x: x.dead_band > 0.0, LEFT_OUT, {},
     lambda x: told_values("dead band {}", (x.dead_band,), "N.m")),
"""
RECORD = "    band: real  # torques below it are none [N.m]\n"
FUNCTION = '''def without_small(m, t):
    """A torque, none within a dead band [N.m]."""
    return 0.0 if abs(t) < m.band else t


'''
QUANTIZED = "    s.next.{0}.tau = law.quantize(t{1}, m.dac_bits, m.dac_range{1})\n"
DECLARED = "cdef double without_small(Model m, double t) noexcept nogil\n"
EDITS = {  # a dead band, below which motors hold no torque: by file, what stands, and what then
    "model/hardware.py": [
        ("    friction: Annotated[", FIELD + "    friction: Annotated["),
        ('    ("joint friction",', TRAIT + '    ("joint friction",'),
    ],
    "kernel/records.py": [
        ("    friction: whole\n    slip:", RECORD + "    friction: whole\n    slip:")
    ],
    "kernel/scene.py": [
        ("    put_delay(m, arrays,", "    m.band = float(io.dead_band)\n    put_delay(m, arrays,")
    ],
    "kernel/hardware.py": [
        ("def drive(m, s, t1, t2):", FUNCTION + "def drive(m, s, t1, t2):"),
        *(
            (
                QUANTIZED.format(x, n),
                QUANTIZED.format(x, n).replace("= ", "= without_small(m, ").replace(")\n", "))\n"),
            )
            for x, n in zip("xy", "12", strict=True)
        ),
    ],
    "kernel/hardware.pxd": [("cdef void drive(", DECLARED + "cdef void drive(")],
}
RUN = """
import dataclasses
import numpy as np
import hapticclay as hc
from hapticclay.kernel import native
from hapticclay.model import support
from hapticclay.simulation.many import kind_key

s = hc.constant_cut(control="sampled", t_max=0.05)
plain = hc.simulate(s)
runs = [
    hc.simulate(dataclasses.replace(s, hardware=hc.Hardware(dead_band=band)))
    for band in (1e-9, 0.02)
]
assert not native.is_there(), "a kernel built from other records is refused"
assert plain.p.tobytes() == runs[0].p.tobytes()
tau = np.abs(runs[1].tau)
assert (np.abs(plain.tau) < 0.02).any() and ((tau == 0.0) | (tau >= 0.02)).all()
assert not np.array_equal(plain.tau, runs[1].tau)
assert "| dead band |" in support.page() and "dead band 0.02 N.m" in repr(runs[1].scenario)
try:
    dataclasses.replace(hc.constant_cut(), hardware=hc.Hardware(dead_band=0.02))
except hc.ParameterError as error:
    print(error)
both = [hc.Hardware(dead_band=band) for band in (0.01, 0.02)]
kinds = {kind_key(dataclasses.replace(s, hardware=x)) for x in both}
assert len(kinds) == 2 and None not in kinds  # a batch does not make them of one pattern
with_name = hc.with_fields(s, {"hardware": True, "hardware.dead_band": "20 mN.m"})
assert with_name.hardware.dead_band == 0.02
"""


def test_an_imperfection_is_five_files_of_the_package(tmp_path):
    """Motors with a dead band: no torque within it is held, and what is not within it stays."""
    told = run_edited(tmp_path, EDITS, RUN)
    assert "must be 'sampled'" in told or "must be None" in told, told
    assert not missing_in("Add an imperfection of the hardware", EDITS)
