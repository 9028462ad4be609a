"""Studies that need many runs."""

from ..doors import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
