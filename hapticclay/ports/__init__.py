"""Ports: the simulated arm as a haptic device for other programs."""

from ..doors import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
