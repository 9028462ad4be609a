"""Gymnasium environments: hands and controllers that learn on the simulated arm.

    import gymnasium
    import hapticclay.gym

    env = gymnasium.make("hapticclay/CutLine-v0")

Importing this registers the environments. It needs Gymnasium: pip install 'hapticclay[gym]'.
"""

from ..doors import attach
from ..errors import needing

with needing("hapticclay.gym", "gymnasium", "gym"):
    from .registry import register_all

__getattr__, __dir__, __all__ = attach(__name__, __file__)

register_all()
