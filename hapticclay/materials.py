"""Materials by name, with their sources."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("hapticclay", __file__)
