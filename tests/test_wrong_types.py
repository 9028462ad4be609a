"""Public names given what they do not take: a ParameterError in one short line, and no other."""

import inspect
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.cli.commands import COMMANDS
from tests.waiting import alarm

MOST = 800  # characters of a message: name, value and bound
LONG_RUNS = ("studies.identify", "studies.drift_map")  # do with what they have


class Unprintable:
    def __repr__(self):
        raise RuntimeError


class Endless:
    """Its text does not end, as that of a list that holds itself."""

    def __repr__(self):
        return f"{self!r}"


def deep(kind, n=5000):
    value = 1.0
    for _ in range(n):
        value = [value] if kind is list else (value,) if kind is tuple else {"x": value}
    return value


WRONG = {
    "number": 1.0,
    "nan": float("nan"),
    "complex": 1j,
    "word": "y",
    "long word": "x" * 3000,
    "null byte": "a\0b",
    "bytes": b"x",
    "none": None,
    "object": object(),
    "unprintable": Unprintable(),
    "endless": Endless(),
    "empty list": [],
    "empty table": {},
    "mixed list": [1, "a"],
    "table": {"a": 1},
    "deep list": deep(list),
    "deep tuple": deep(tuple),
    "deep table": deep(dict),
    "0-d array": np.array(1.0),
    "0-d object": np.array(None, dtype=object),
    "cube": np.ones((2, 2, 2)),
    "function": lambda: 0,
    "400 digits": 10**400,
    "5000 digits": 10**5000,
}
ROOMS = {"hc": hc, **{n: getattr(hc, n) for n in ("theory", "walls", "studies", "materials")}}


def public():
    """Public functions, classes and class methods by name."""
    out = {}
    for room, module in ROOMS.items():
        for name in module.__all__:
            value = getattr(module, name)
            if not callable(value):
                continue
            out[f"{room}.{name}"] = value
            for inner in dir(value) if inspect.isclass(value) else ():
                method = inspect.getattr_static(value, inner)
                if not inner.startswith("_") and isinstance(method, classmethod | staticmethod):
                    out[f"{room}.{name}.{inner}"] = getattr(value, inner)
    return out


PUBLIC = public()


def ways(name, call, value):
    """Arguments to try: the value for all that must be given, and for each field of a class."""
    try:
        parameters = inspect.signature(call).parameters.values()
    except (TypeError, ValueError):
        return
    listed = [p for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    needed = {p.name: value for p in listed if p.default is p.empty}
    if needed:
        yield needed
    if inspect.isclass(call):
        yield from ({**needed, p.name: value} for p in listed if p.name not in needed)


@pytest.fixture(autouse=True)
def in_time():
    """What waits for ever fails rather than hangs."""
    with alarm():
        yield


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [n for n in PUBLIC if n not in LONG_RUNS])
def test_a_wrong_value_is_refused_or_taken(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for told, value in WRONG.items():
        for given_ in ways(name, PUBLIC[name], value):
            try:
                PUBLIC[name](**given_)
            except hc.ParameterError as error:
                said = str(error)
                assert len(said) < MOST and "\n" not in said, (told, list(given_))
            except (NotImplementedError, OSError) as error:
                # a base class, and readers of samples, whose errors are those of the system
                assert name in ("hc.Experiment.of", "hc.Samples.csv"), (told, error)
            except Exception as error:  # TypeError, AttributeError, RecursionError, ...
                pytest.fail(f"{name}, {told} for {list(given_)}: {error!r:.200}")


@pytest.mark.parametrize(
    "call, field",
    [
        (lambda: hc.Scenario.of({}, 1.0), "changes"),
        (lambda: hc.Scenario.of({}, {}, "b=1"), "changes"),
        (lambda: hc.Clay.of_groove(1.0), "groove"),
        (lambda: hc.studies.Distribution.parse("b", 3.0), "b"),
        (lambda: hc.studies.Range.parse("b", 10**400), "b"),
        (lambda: hc.with_fields(hc.constant_cut(), {"gain": deep(list)}), "gain"),
        (lambda: hc.with_fields(hc.constant_cut(), {"gain": np.array(1j)}), "gain"),
        (lambda: hc.constant_cut(force=np.array(1.0)), "force"),
    ],
)
def test_the_field_is_named(call, field):
    """Where no type says it; `tests.test_fields` asks the types."""
    with pytest.raises(hc.ParameterError) as error:
        call()
    assert error.value.field.startswith(field)


@given(
    st.recursive(
        st.one_of(st.integers(), st.floats(), st.text(), st.binary(), st.none(), st.booleans()),
        lambda x: st.lists(x) | st.dictionaries(st.text(), x) | st.tuples(x, x),
    ),
    st.text(),
)
def test_messages_are_one_short_line_that_begins_as_the_value(value, bound):
    """Of a short value the text is that of Python's repr."""
    said = str(hc.ParameterError("a", value, bound))
    whole = " ".join(repr(value).split())
    assert said.startswith("a = ") and len(said) <= 70 + len(bound)
    if len(whole) <= 60 and whole.isprintable():
        assert said == f"a = {whole}: {bound}"


@pytest.mark.parametrize("length", [3000, 10**6])
def test_long_words_are_cut_wherever_they_stand(length):
    word = "word" * (length // 4)
    for error in (hc.ParameterError(word, 1, "b"), hc.ParameterError("a", word, "b"),
                  hc.ParameterError("a", 1, f"must be {word}; did you mean 'b'?")):  # fmt: skip
        assert len(str(error)) < MOST
    assert str(error).endswith("did you mean 'b'?")
    for call in (
        lambda: hc.with_fields(hc.constant_cut(), {word: 1.0}),
        lambda: hc.Arm(**{word: 1.0}),
        lambda: hc.theory.gain_limit(word, 90.0),
        lambda: hc.studies.run_sweep(word, word),
    ):
        with pytest.raises(hc.ParameterError) as refused:
            call()
        assert len(str(refused.value)) < MOST
    with pytest.raises(AttributeError) as unknown:
        getattr(hc, word)
    assert len(str(unknown.value)) < MOST


def test_an_error_survives_a_process_as_it_is():
    import pickle

    error = hc.ParameterError("a" * 3000, "x" * 3000, "b" * 3000)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.field, again.value) == (str(error), error.field, error.value)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in ("bench", "version")])
@pytest.mark.parametrize("words", [["WORD"], ["--WORD", "1"], ["--out", "o", "--set", "WORD=1"]])
def test_a_command_given_a_long_word_is_one_short_line(
    tmp_path, monkeypatch, capsys, command, words
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["hapticclay"])
    assert app.main([command, *(x.replace("WORD", "w" * 3000) for x in words)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and len(said) < MOST + 20
