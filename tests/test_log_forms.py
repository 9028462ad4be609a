"""Devices, logged in units, separators, encodings, formats and rates drawn at random.

40 of a hundred in the suite, all in a hunt.

The coefficients from the file are those from the arrays to 1e-9. A value is written with 17 digits
and multiplied by the size of its unit: 4e-16 for each; the fit stops at steps of 1e-12 and
magnifies rounding by its condition, some 1e3.
"""

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import cont2discrete

import hapticclay as hc
from tests.hunt import some

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048, "cm": 1e-2}
FORCES = {"N": 1.0, "mN": 1e-3, "lbf": 4.4482216152605, "kgf": 9.80665, "gf": 9.80665e-3,
          "ozf": 4.4482216152605 / 16.0, "kN": 1e3}  # fmt: skip
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
WORDS = {"s": "seconds", "ms": "Milliseconds", "mm": "millimeters", "N": "Newtons", "in": "inches"}
SPELLINGS = ("{} [{}]", "{} ({})", "{}_{}", "{} / {}", "{}, {}", "below", "comment")
ROWS = 1600


def device(rng):
    """Time, force and place of a mass with damper and spring; exact, the force linear in a step."""
    rate, mass = rng.choice([60.0, 125.0, 250.0, 500.0, 1000.0]), 10.0 ** rng.uniform(-1.5, 0.7)
    omega = rate * rng.uniform(0.04, 0.12)
    damper, spring = 2.0 * rng.uniform(0.35, 0.9) * omega * mass, mass * omega**2
    a = np.array([[0.0, 1.0], [-spring / mass, -damper / mass]])
    b, c = np.array([[0.0], [1.0 / mass]]), np.array([[1.0, 0.0]])
    A, B, C, D, _ = cont2discrete((a, b, c, np.zeros((1, 1))), 1.0 / rate, "foh")
    force = np.convolve(rng.standard_normal(ROWS + 8), np.ones(8), "valid")[:ROWS]
    state, place = np.zeros((2, 1)), []
    for f in force.tolist():
        place.append(float((C @ state + D * f).item()))
        state = A @ state + B * f
    return np.arange(ROWS) / rate, force, np.array(place), (1.0 / mass, damper / mass, omega**2)


def as_text(rng, columns, units):
    """A file of text, as bytes."""
    mark = rng.choice([",", ";", "\t", "|", " "])
    comma = mark != "," and rng.random() < 0.5
    way = rng.choice(SPELLINGS)
    if mark in " ," and way in ("{} / {}", "{}, {}"):
        way = "{}_{}"
    if way == "{}_{}" and units["pos"] == "in":  # an input, perhaps
        way = "{} [{}]"
    spelt = {k: WORDS.get(u, u) if rng.random() < 0.3 else u for k, u in units.items()}
    spelt = {k: u.replace("us", rng.choice(["us", "µs", "usec"])) for k, u in spelt.items()}
    names = [way.format(k, u) if "{" in way else k for k, u in spelt.items()]
    names = [f'"{x}"' if mark == " " and " " in x else x for x in names]
    lines = [mark.join(names)]
    if way == "below":
        row = [f"[{u}]" if rng.random() < 0.5 else u for u in spelt.values()]
        lines.append(mark.join(row))
    if way == "comment":
        lines.insert(0, "# " + ", ".join(f"{k} [{u}]" for k, u in spelt.items()) if mark == ","
                     else "# " + mark.join(f"{k}[{u}]" for k, u in spelt.items()))  # fmt: skip
    for row in np.column_stack(columns).tolist():
        cells = [repr(x).replace(".", ",") if comma else repr(x) for x in row]
        lines.append(mark.join(cells))
    if rng.random() < 0.3:
        lines.insert(0, rng.choice(["Rig 3", "# rig 3", "% rig 3", "2024-05-01 12:00"]))
    if rng.random() < 0.2 and mark != " ":
        lines = [f"{x}{mark}" for x in lines]
    encoding = rng.choice(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "utf-32"])
    return rng.choice(["\n", "\r\n", "\r"]).join([*lines, ""]).encode(encoding)


def written(rng, path, columns, units):
    """A file in some format; returns the units that it does not say."""
    form = rng.choice(["text"] * 5 + ["mat", "npz", "parquet", "h5"])
    named = dict(zip(units, columns, strict=True))
    if form == "text":
        path.write_bytes(as_text(rng, columns, units))
        return {}
    if form == "mat":
        savemat(path, {"log": named})
        path.rename(path.with_suffix(".mat"))
    elif form == "npz":
        with open(path, "wb") as file:
            np.savez(file, **named)
    elif form == "parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        fields = [pa.field(k, pa.float64(), metadata={"unit": u}) for k, u in units.items()]
        pq.write_table(pa.table([pa.array(x) for x in columns], schema=pa.schema(fields)), path)
        return {}
    else:
        import h5py

        with h5py.File(path, "w") as file:
            for k, x in named.items():
                file[k] = x
                file[k].attrs["units"] = str(units[k])
        return {}
    return units


@pytest.mark.parametrize("seed", some(range(100), 40))
def test_a_device_is_the_same_in_any_form(seed, tmp_path):
    rng = np.random.default_rng(seed)
    t, force, place, truth = device(rng)
    own = hc.studies.Measurement(t, force, place)
    band = (2.0 / t[-1], 0.06 / own.dt)
    units = {
        "time": rng.choice([*TIMES]),
        "force": rng.choice([*FORCES]),
        "pos": rng.choice([*LENGTHS]),
    }
    sizes = TIMES[units["time"]], FORCES[units["force"]], LENGTHS[units["pos"]]
    columns = [x / size for x, size in zip((t, force, place), sizes, strict=True)]
    missing = written(rng, tmp_path / "log", columns, units)
    (path,) = tmp_path.iterdir()
    data = hc.studies.Measurement.load(path, units=missing)
    for a, b in ((data.t, t), (data.input, force), (data.output, place)):
        np.testing.assert_allclose(a, b, rtol=1e-14, atol=1e-14 * np.abs(b).max())
    found, known = (hc.studies.identify_data(x, "S", band=band) for x in (data, own))
    for a, b, true in zip(found.coefficients, known.coefficients, truth, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-9)
        assert a.high - a.low == pytest.approx(b.high - b.low, rel=1e-6)  # of residuals, small
        assert b.value == pytest.approx(true, rel=0.05)  # force is linear in a step, not sampled
