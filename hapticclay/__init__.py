"""Virtual clay, cut with a simulated haptic arm.

    import hapticclay as hc

    record = hc.simulate(hc.constant_cut(b=90.0))
    print(record.status)
    record.save("out")

All quantities are SI; axes are ordered (x, y); force signs are fixed in docs/equations.md.
"""

from importlib.metadata import PackageNotFoundError, version

from .doors import attach

__getattr__, __dir__, __all__ = attach(
    __name__, __file__, doors=("walls", "theory", "studies", "materials", "ports")
)

try:
    __version__ = version("hapticclay")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "unknown"
