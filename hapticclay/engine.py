"""MuJoCo, imported whatever MUJOCO_GL says: a run draws nothing, and what draws complains for itself."""

import os


def load() -> None:
    """Imports mujoco, which refuses to be imported where MUJOCO_GL is misspelt or its library is missing.

    Raises:
        ImportError: mujoco is not installed.
    """
    try:
        import mujoco  # noqa: F401
    except (AttributeError, ImportError, OSError, RuntimeError):  # each backend has its own
        wanted = os.environ.get("MUJOCO_GL")
        if wanted is None:
            raise
        os.environ["MUJOCO_GL"] = "disable"
        try:
            import mujoco  # noqa: F401
        finally:
            os.environ["MUJOCO_GL"] = wanted


load()
