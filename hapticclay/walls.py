"""Virtual walls: which are stable or passive, which can be rendered, what the hand feels."""

from .doors import attach

__getattr__, __dir__, __all__ = attach("hapticclay", __file__, __name__)
