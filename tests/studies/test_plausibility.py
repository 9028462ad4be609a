"""Results that no hand, device or clay has, and the unit that explains them."""

import numpy as np
import pytest

import hapticclay as hc

T = np.arange(6000) / 500.0


def device(mass=0.2, damper=2.0, spring=60.0):
    """Force and place of a device, steady state of many lines."""
    rng = np.random.default_rng(1)
    f = np.arange(4, 240) / 13.0
    s = 2j * np.pi * f
    waves = np.exp(np.outer(T, s)) * np.exp(1j * rng.uniform(0.0, 6.28, len(f)))
    return 0.1 * waves.sum(axis=1).real, 0.1 * (
        waves @ (1.0 / (mass * s**2 + damper * s + spring))
    ).real


FORCE, PLACE = device()


@pytest.mark.parametrize(
    "t, force, place, said",
    [
        (1.0, 1.0, 1e3, "the position in mm it is mass 0.2 kg"),
        (1e3, 1.0, 1.0, "the time in ms it is mass 0.2 kg"),
        (1.0, 1e3, 1.0, "the force in mN it is mass 0.2 kg"),
        (1e6, 1.0, 1.0, "the time in us it is mass 0.2 kg"),
        (1e3, 1.0, 1e3, "the position in mm and the time in ms it is mass 0.2 kg"),
    ],
)
def test_a_device_that_no_one_has_is_doubted_and_its_unit_named(t, force, place, said):
    """The numbers as if SI, of columns in smaller units."""
    data = hc.studies.Measurement(t * T, force * FORCE, place * PLACE)
    r = hc.studies.identify_data(data, "S", band=(0.4 / t, 15.0 / t))
    (doubt,) = [x for x in r.warnings if x.startswith("no hand or device, nor")]
    assert said in doubt and doubt.endswith("state the units"), doubt


def test_a_usual_device_is_not_doubted():
    r = hc.studies.identify_data(hc.studies.Measurement(T, FORCE, PLACE), "S", band=(0.4, 15.0))
    assert not any("no hand or device" in x for x in r.warnings)
    assert r.device == pytest.approx((0.2, 2.0, 60.0), rel=1e-2)


@pytest.mark.parametrize(
    "t, force, said",
    [(1.0, 1.0, ""), (1e3, 1.0, "the time in ms"), (1.0, 1e3, "the force in mN")],
)
def test_clay_that_no_one_has_is_doubted(t, force, said):
    """30 N.s/m with a yield force of 2 N: 30,014 with the time in milliseconds."""
    rng = np.random.default_rng(1)
    x = 0.35 + 0.03 * np.sin(2.2 * T) + 0.012 * np.sin(6.9 * T + 0.4)
    v = 0.066 * np.cos(2.2 * T) + 0.0828 * np.cos(6.9 * T + 0.4)
    f = 2.0 * np.sign(v) + 30.0 * v + 0.05 * rng.standard_normal(len(T))
    x = x + 2e-6 * rng.standard_normal(len(T))
    fitted = hc.studies.fit_flow(hc.studies.Measurement(t * T, force * f, x))
    doubt = [x for x in fitted.warnings if x.startswith("no clay")]
    assert bool(doubt) == bool(said) and all(f"with {said} it is" in x for x in doubt), doubt
