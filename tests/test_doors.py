"""Names of the package: an unknown one names the nearest, and where it stands."""

import pytest

import hapticclay as hc


@pytest.mark.parametrize(
    "module, name, said",
    [
        (hc, "simluate", "in hapticclay; did you mean hapticclay.simulate?"),
        (hc, "zwidth", "did you mean hapticclay.walls.zwidth?"),
        (hc, "identify_dta", "did you mean hapticclay.studies.identify_data?"),
        (hc.walls, "stable_wal", "in hapticclay.walls; did you mean hapticclay.walls.stable_wall?"),
        (hc.materials, "materal", "did you mean hapticclay.materials.material?"),
        (hc.theory, "gainlimit", "did you mean hapticclay.theory.gain_limit?"),
        (hc, "qqqq", "no name 'qqqq' in hapticclay"),
    ],
)
def test_an_unknown_name_names_the_nearest(module, name, said):
    with pytest.raises(AttributeError) as told:
        getattr(module, name)
    assert str(told.value).endswith(said)
    assert not hasattr(module, name) and name not in dir(module)


def test_a_name_behind_a_door_stays_there():
    """lazy_loader keeps what it found in the package that the stub's imports start from."""
    assert callable(hc.walls.zwidth) and callable(hc.materials.material)
    assert not hasattr(hc, "zwidth") and not hasattr(hc, "material")
    assert hc.walls.zwidth is vars(hc.walls)["zwidth"]
    assert set(hc.walls.__all__) <= set(dir(hc.walls))
