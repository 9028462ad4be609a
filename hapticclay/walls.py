"""Virtual walls: which are stable or passive, which can be rendered, what the hand feels."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("hapticclay", __file__)
