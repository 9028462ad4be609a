"""What commands share: experiments on the command line, bars, tables, numbers, Ctrl-C, files."""

from __future__ import annotations

import contextlib
import re
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound
from ..files import atomic
from .unused import Unused, undrawn

if TYPE_CHECKING:
    from ..results import Result
    from ..views.figure import Figure


ENDS = ("SIGTERM", "SIGHUP")  # signals that end a command as Ctrl-C does


def default_folder(command: str, subject: Any) -> Path:
    """The folder for what a command writes about a scenario or an arm, which has its name."""
    name = re.sub(r"[^\w.+-]+", "-", subject.name).strip(".-")
    return Path("out", command, name or "scenario")


def progress_bar(items: Any = None, **look: Any) -> Any:
    """A tqdm bar that shows itself on a terminal after two seconds and vanishes at the end."""
    from tqdm import tqdm

    return tqdm(items, **{"delay": 2.0, "disable": None, "leave": False, **look})


@contextlib.contextmanager
def fraction_bar(title: str) -> Iterator[Callable[..., None]]:
    """Yields show(fraction, title=None), which moves a progress bar to a fraction of the work."""
    form = "{desc} {percentage:3.0f}% |{bar}| {elapsed} <{remaining}"
    with progress_bar(total=1.0, desc=title, bar_format=form) as bar:

        def show(fraction: float, title: str | None = None) -> None:
            if title:
                bar.set_description(title)
            bar.update(max(0.0, min(1.0, fraction)) - bar.n)

        yield show


def announce(runs: str, seconds: float, crew: int, size: float, folder: Path) -> None:
    """Prints the time, and the room on disk [bytes], that runs in a crew of processes will take."""
    from tqdm import tqdm

    free = shutil.disk_usage(folder.parent).free
    print(
        f"hapticclay: {runs}: about {tqdm.format_interval(seconds)} on {crew} "
        f"process{'es' if crew > 1 else ''}, {tqdm.format_sizeof(size, 'B')} in {folder} "
        f"({'only ' if free < size else ''}{tqdm.format_sizeof(free, 'B')} free)",
        file=sys.stderr,
    )


@contextlib.contextmanager
def ctrl_c() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C sets in place of raising; a second Ctrl-C raises.

    Under `ends`, SIGTERM and SIGHUP count too. Only the main thread hears signals: in another the
    event is never set. Where Ctrl-C is ignored, as under nohup, it remains so.
    """
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed
        return
    before = signal.getsignal(signal.SIGINT)

    def note(number: int, frame: object) -> None:
        if number == signal.SIGINT and before is not signal.default_int_handler:
            return  # nohup, and shells for jobs in the background, ignore Ctrl-C
        pressed.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def ends() -> Iterator[list[int]]:
    """Lets SIGTERM and SIGHUP end a command as Ctrl-C does; yields the signals received.

    A signal goes to whoever listens for Ctrl-C at that moment, or raises KeyboardInterrupt. One
    that was ignored, as SIGHUP under nohup, remains so.
    """
    received: list[int] = []

    def end(number: int, frame: Any) -> None:
        received.append(number)
        listener = signal.getsignal(signal.SIGINT)
        if not callable(listener):
            raise KeyboardInterrupt
        listener(number, frame)

    numbers = [getattr(signal, name) for name in ENDS if hasattr(signal, name)]
    mine = threading.current_thread() is threading.main_thread()
    kept = [n for n in numbers if mine and signal.getsignal(n) is signal.SIG_DFL]
    for n in kept:
        signal.signal(n, end)
    try:
        yield received
    finally:
        for n in kept:
            signal.signal(n, signal.SIG_DFL)


@dataclass(frozen=True)
class FigureLook:
    """How a command draws its figures.

    Attributes:
        format: Formats of the figures: png, svg, pdf; several may be given.
        dpi: Resolution of PNG files [pixels/inch]; by default 100, and 300 in print.
        style: For a screen, or for print: one column of 8.5 cm, or two of 17.5 cm.
    """

    format: tuple[Literal["png", "svg", "pdf"], ...] = ("png",)
    dpi: Annotated[float | None, Bound(10.0, 2400.0)] = None
    style: Literal["screen", "print", "print-wide"] = "screen"

    unused: ClassVar[tuple[Unused, ...]] = (undrawn("no-plots"), undrawn("no-maps"))


@dataclass(frozen=True)
class FigureOptions(FigureLook):
    """How a command writes its figures.

    Attributes:
        format: Formats of the figures: png, svg, pdf; several may be given.
        dpi: Resolution of PNG files [pixels/inch]; by default 100, and 300 in print.
        style: For a screen, or for print: one column of 8.5 cm, or two of 17.5 cm.
        data: Also write the numbers that each figure shows, as CSV.
    """

    data: bool = False


def save_figures(
    figures: Mapping[str, Figure], folder: Path, options: FigureLook | None = None
) -> dict[str, list[Path]]:
    """Writes figures as folder/NAME.png or in other formats, and returns the files by name."""
    o = options or FigureOptions()
    data = isinstance(o, FigureOptions) and o.data
    written = {
        name: figure.save(folder / name, o.format, o.dpi, o.style, data)
        for name, figure in figures.items()
    }
    return {name: files for name, files in written.items() if files}


def deliver(
    found: Result,
    out: Path,
    figures: FigureLook | None = None,
    *,
    text: str | None = None,
    pages: Mapping[str, Callable[[], str]] | None = None,
    **asked: Any,
) -> None:
    """Writes a result as NAME.json, its figures and pages, and prints it, or `text` in its place.

    Without `figures` none are drawn; `asked` is the question, which NAME.json repeats. Where
    files of an earlier result are replaced, it says so.
    """
    replaced = (out / f"{found.written_as}.json").exists()
    try:
        found.write(out, asked)
        for name, page in (pages or {}).items():
            with atomic(out / name) as f:
                f.write(page().encode())
        if figures is not None:
            save_figures(found.figures(), out, figures)
    finally:  # a full disk must not hide the result
        print(found.text() if text is None else text, end="\n" if text != "" else "")
    print(f"written to {out}{', in place of the files that were there' * replaced}")


def film_progress(images: Iterable[Any], count: int) -> Iterator[Any]:
    """Shows how many images of a film are made."""
    return iter(progress_bar(images, total=count, desc="film", unit="frame"))
