"""The inliner on made-up laws: same values, no calls left."""

import dis

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticclay.stepping import inline

SCALE = 3.0


def swap(a, b):
    t = a * SCALE
    return b, t


def branch(a, b):
    """Reassigns its argument."""
    if a > b:
        a, b = swap(a, b)
    else:
        a = -a
    return (a, (b, a + b))


def loop(n, c, x, y):
    total = 0.0
    for i in range(n):
        x, (y, z) = branch(x, y)
        y, x = swap(x, y)
        total += single(z, i)
        x *= 0.3
        y *= 0.3
    return x, y, total


def single(z, i):
    return z / (1.0 + i)


@pytest.fixture
def fused(monkeypatch):
    monkeypatch.setattr(inline, "PACKAGE", __name__)
    return inline.inline(loop)


@given(n=st.integers(0, 6), x=st.floats(-10, 10), y=st.floats(-10, 10))
def test_same_values_bit_for_bit(n, x, y):
    old, inline.PACKAGE = inline.PACKAGE, __name__
    try:
        fused = inline.inline(loop)
    finally:
        inline.PACKAGE = old
    assert fused(n, 0.0, x, y) == loop(n, 0.0, x, y)


def test_no_law_is_called(fused):
    names = {i.argval for i in dis.get_instructions(fused) if i.opname.startswith("LOAD_GLOBAL")}
    assert names == {"range"}


def test_a_function_without_source_is_left_alone():
    space: dict = {}
    exec("def f(x):\n    return x", space)
    assert inline.inline(space["f"]) is space["f"]


@pytest.mark.perf
def test_inlining_the_loop_is_quick():
    """A ratio:

    against compiling the module it comes from (20 times that; it is done once per process).
    """
    import time
    from pathlib import Path

    from hapticclay.stepping import leapfrog, loop

    source = Path(loop.__file__).read_text()
    ratios = []
    for _ in range(3):
        begin = time.perf_counter()
        compile(source, "loop.py", "exec")
        middle = time.perf_counter()
        inline.inline(leapfrog.glide_constant)
        ratios.append((time.perf_counter() - middle) / (middle - begin))
    assert min(ratios) < 200


def sometimes(a, stiff):
    b = a * 2.0
    if stiff:
        b, _ = swap(b, a)
    else:
        b = b + 1.0
    return b


def often(items, stiff):
    out = 0.0
    for a in items:
        out = sometimes(a + out, stiff)
    return out


def test_what_never_happens_is_left_out(monkeypatch):
    monkeypatch.setattr(inline, "PACKAGE", __name__)
    lean, whole = inline.inline(often, frozenset({"stiff"})), inline.inline(often)
    read = [
        {i.argval for i in dis.get_instructions(f) if i.opname == "LOAD_FAST"}
        for f in (lean, whole)
    ]
    assert "stiff" not in read[0] and "stiff" in read[1]
    assert lean([1.0, 2.0], 0.0) == whole([1.0, 2.0], 0.0) == often([1.0, 2.0], 0.0) == 11.0
