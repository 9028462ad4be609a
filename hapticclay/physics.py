"""MuJoCo and the folder of MJCF files.

MuJoCo is imported for any MUJOCO_GL: physics draws nothing, and views report their own errors.
"""

import os
import threading
from pathlib import Path
from typing import Any

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
    """Collects the engine's warnings of a thread, for a `with`, in place of MUJOCO_LOG.TXT.

    The engine tells one function of the warnings of all threads. Where several collect, the newest
    one hands on what is not its own, and the last to end puts back what was there before the first.
    There is no lock, which would take as long as the rest: two that begin at one instant may drop a
    warning.
    """

    __slots__ = ("before", "caught", "over", "thread")

    def __enter__(self) -> list[str]:
        self.caught: list[str] = []
        self.thread, self.over = threading.get_ident(), False
        before = mujoco.get_mju_user_warning()
        self.before = before and _at_work(before)
        mujoco.set_mju_user_warning(self)
        return self.caught

    def __call__(self, text: str) -> None:
        if threading.get_ident() == self.thread:
            self.caught.append(text)
        elif type(self.before) is warnings_caught:
            self.before(text)

    def __exit__(self, *error: object) -> None:
        self.over = True
        if mujoco.get_mju_user_warning() is self:
            before = self.before
            mujoco.set_mju_user_warning(before and _at_work(before))


def _at_work(told: Any) -> Any:
    """What the engine tells of warnings, without collectors that have ended."""
    newest = told = _first_at_work(told)
    while type(told) is warnings_caught:
        before = told.before = _first_at_work(told.before)
        told = before
    return newest


def _first_at_work(told: Any) -> Any:
    while type(told) is warnings_caught and told.over:
        told = told.before
    return told


def mjcf_folder() -> Path:
    """The folder of MJCF files: beside the package in a checkout, inside it when installed."""
    package = Path(__file__).resolve().parent
    checkout = package.parent / "mjcf"
    return checkout if (checkout / "arm.xml").is_file() else package / "mjcf"
