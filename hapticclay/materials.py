"""Materials by name, with their sources."""

from .doors import attach

__getattr__, __dir__, __all__ = attach("hapticclay", __file__, __name__)
