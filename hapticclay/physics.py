"""MuJoCo and the folder of MJCF files.

MuJoCo is imported for any MUJOCO_GL: physics draws nothing, and views report their own errors.
"""

import os
from pathlib import Path

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

__all__ = ["mjcf_folder", "mujoco", "warnings_caught"]


class warnings_caught:
    """Collects the engine's warnings instead of writing MUJOCO_LOG.TXT, for a `with`."""

    def __enter__(self) -> list[str]:
        caught: list[str] = []
        self.before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(caught.append)
        return caught

    def __exit__(self, *error: object) -> None:
        mujoco.set_mju_user_warning(self.before)


def mjcf_folder() -> Path:
    """The folder of MJCF files: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).resolve().parent
    checkout = package.parent / "mjcf"
    return checkout if (checkout / "arm.xml").is_file() else package / "mjcf"
