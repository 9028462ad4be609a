"""What compiled code does not forgive, made visible in CPython.

C has types where Python has none, and memory that nobody clears; a search for a border tries a
kick several times. So each guard makes CPython as strict: a field takes only what its declaration
says, a kick begins in a record full of NaN, and what is tried is tried twice.
"""

import contextlib
import math

from hapticclay.kernel import kick, march, methods, records, sampled

TYPES = {"double": float, "long long": int}


class WrongType(AssertionError):
    """A field was given a value of another type than declared."""


def check(kind, name, x):
    """Refuses a value that is not of the type of a field; int is not float, nor bool int."""
    if type(x) is not TYPES[kind.of]:
        raise WrongType(f"{name} = {x!r}: {type(x).__name__}, not {TYPES[kind.of].__name__}")


class Numbers(list):
    """An array of numbers of a record, whose length and type do not change."""

    def __init__(self, kind, name, values):
        super().__init__(values)
        self.kind, self.name = kind, name
        self.check(values)

    def check(self, values):
        if len(values) != self.kind.n:
            raise WrongType(f"{self.name}: {len(values)} numbers, not {self.kind.n}")
        for x in values:
            check(self.kind, self.name, x)

    def __setitem__(self, i, x):
        if isinstance(i, slice):
            x, after = [*x], [*self]
            after[i] = x
            self.check(after)
        else:
            check(self.kind, self.name, x)
        super().__setitem__(i, x)


def checked(record, name, x):
    """Sets a field of a record, if the value is of its type."""
    kind = type(record).kinds.get(name)
    if kind is not None and not (kind.is_record or kind.is_place):
        told = f"{type(record).__name__}.{name}"
        if kind.n:
            x = Numbers(kind, told, x)
        else:
            check(kind, told, x)
    object.__setattr__(record, name, x)


@contextlib.contextmanager
def checked_fields():
    """Lets records refuse what C would convert, or truncate, without a word."""
    for made in records.RECORDS:
        made.__setattr__ = checked
    try:
        yield
    finally:
        for made in records.RECORDS:
            del made.__setattr__


def spoil(record, *but):
    """Fills the floats of a record with NaN, but some fields."""
    for name, kind in type(record).kinds.items():
        if name in but:
            continue
        x = getattr(record, name)
        if kind.is_record:
            for each in x if kind.n else [x]:
                spoil(each)
        elif kind.of == "double":
            setattr(record, name, [math.nan] * kind.n if kind.n else math.nan)


@contextlib.contextmanager
def patched(*patches):
    """Replaces functions of modules: module, name, what makes the new one of the old one."""
    old = [(module, name, getattr(module, name)) for module, name, _ in patches]
    try:
        for module, name, make in patches:
            setattr(module, name, make(getattr(module, name)))
        yield
    finally:
        for module, name, f in old:
            setattr(module, name, f)


def spoiled_scratch():
    """Fills each kick, and each step of the accurate method, with NaN before it begins."""

    def begins(plain):
        def begin(k, *rest):
            spoil(k)
            plain(k, *rest)

        return begin

    def happens(plain):
        def event(m, s, *rest):
            spoil(s.e)
            plain(m, s, *rest)

        return event

    def marches(plain):
        def march(m, s, h):
            spoil(s.k)
            spoil(s.a)
            plain(m, s, h)

        return march

    return patched((kick, "begin", begins), (sampled, "event", happens), (march, "march", marches))


def repeated():
    """Evaluates each event and each step tried twice: neither changes the state."""

    def twice(plain):
        def call(*arguments):
            plain(*arguments)
            plain(*arguments)

        return call

    return patched((sampled, "event", twice), (methods, "attempt", twice))
