"""Virtual clay, cut with a simulated haptic arm.

    import hapticclay as hc

    record = hc.simulate(hc.constant_cut(b=90.0))
    print(record.status)
    record.save("out")

All quantities are SI; axes are ordered (x, y); force signs are fixed in docs/equations.md.
"""

import os
from importlib.metadata import PackageNotFoundError, version

from .doors import attach

__getattr__, __dir__, __all__ = attach(
    __name__, __file__, doors=("walls", "theory", "studies", "materials", "ports")
)

try:
    __version__ = version("hapticclay")
except PackageNotFoundError:  # a checkout that was never installed
    __version__ = "unknown"

_here = os.path.dirname(os.path.abspath(__file__))
if os.path.isfile(os.path.join(os.path.dirname(_here), "setup.py")) and not os.path.isfile(
    os.path.join(_here, "native", "built.py")
):  # a clone that was never built, which a program in its folder gets before what is installed
    from .simulation.engines import give_notice

    give_notice("not built")
