"""MuJoCo, imported whatever MUJOCO_GL says: a run draws nothing, and what draws complains for itself."""

import os

try:
    import mujoco
except (AttributeError, ImportError, OSError, RuntimeError):  # each backend has its own
    wanted = os.environ.get("MUJOCO_GL")
    if wanted is None:
        raise
    os.environ["MUJOCO_GL"] = "disable"
    try:
        import mujoco
    finally:
        os.environ["MUJOCO_GL"] = wanted

__all__ = ["mujoco"]
