"""Scene descriptions: fields, units, files, text, experiments."""

from . import experiments  # noqa: F401  # so that every file may name one
