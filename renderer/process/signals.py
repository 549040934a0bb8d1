"""What surrounds a command's process: interrupts, standard streams, its working folder."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO, cast

from renderer.errors import SceneError

# ------------------------------------------------------------------------------ signals
# Ctrl-C put off while C++ calls back into Python, through which no exception can pass.


@contextmanager
def put_off_interrupts() -> Iterator[None]:
    """Call the handler of SIGINT after the block instead of within it.

    Python runs handlers in the main thread alone, so other threads need nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    count = 0

    def note(number: int, frame: Any) -> None:
        nonlocal count
        count += 1

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        for _ in range(count):
            signal.raise_signal(signal.SIGINT)


# --------------------------------------------------------------------- standard streams
# Standard output and error that are closed, on a full disk, or a pipe without a reader.
#
# What a program says about its work must not decide about the work: a picture is written
# although the line about it cannot be.


class TolerantStream:
    """A text stream that goes on in silence after the first write that fails.

    Parameters
    ----------
    stream : TextIO
        Where the text goes. Characters that its encoding lacks are written as escapes.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | ValueError | None = None  # of the first write that failed

    def write(self, text: str) -> int:
        """Write a text, or nothing after a failure; return its length."""
        if self.failure is None:
            try:
                self._write(text)
            except (OSError, ValueError) as error:  # ValueError: closed by the program
                self._fail(error)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        """Hand on what is buffered. A full disk is often reported here."""
        if self.failure is None:
            try:
                self._stream.flush()
            except (OSError, ValueError) as error:
                self._fail(error)

    def __getattr__(self, name: str) -> Any:
        """Return what the stream itself has, such as `isatty` and `encoding`."""
        return getattr(self._stream, name)

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:  # a file name that is not UTF-8, or another encoding
            encoding = self._stream.encoding
            self._stream.write(text.encode(encoding, "backslashreplace").decode(encoding))

    def _fail(self, error: OSError | ValueError) -> None:
        self.failure = error
        # The buffer still holds the text; Python would fail on it again at its end.
        with suppress(OSError, ValueError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self._stream.fileno())
            os.close(null)
        if self is sys.stdout and not isinstance(error, BrokenPipeError):
            reason = getattr(error, "strerror", None) or error
            sys.stderr.write(f"warning: standard output cannot be written: {reason}\n")
            sys.stderr.flush()


def make_streams_tolerant() -> None:
    """Let no failure of standard output or standard error end this process.

    For programs alone: it replaces `sys.stdout` and `sys.stderr`. If a stream is closed
    (`2>&-`), its number is opened on the null device: the next file that is opened would
    otherwise have that number, and hold what a library prints.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))
    for name in ("stdout", "stderr"):
        if not isinstance(getattr(sys, name), TolerantStream):
            setattr(sys, name, cast("TextIO", TolerantStream(getattr(sys, name))))


def output_is_lost() -> bool:
    """Return whether standard output could not be written, after a last try."""
    sys.stdout.flush()
    return getattr(sys.stdout, "failure", None) is not None


# ----------------------------------------------------------------------- working folder
# A working directory that was deleted: absolute paths still work there.


def leave_deleted_folder(
    options: argparse.Namespace, *, needs_output: bool = False
) -> None:
    """Go to the root folder if the working directory was deleted; for programs alone.

    Python and Numba need the working directory's name and fail without one.

    Parameters
    ----------
    options
        Of the command line. All paths in it must be absolute then.
    needs_output
        Whether a picture without `options.output` would go to the working directory.

    Raises
    ------
    SceneError
        Naming the first relative path, or the output that is missing.
    """
    try:
        os.getcwd()
        return
    except FileNotFoundError:
        pass
    for value in vars(options).values():
        for path in value if isinstance(value, list | tuple) else [value]:
            if isinstance(path, Path) and not path.is_absolute():
                raise SceneError(
                    f"{path}: the working directory was deleted; give absolute paths"
                )
    if needs_output and not options.output:
        raise SceneError("the working directory was deleted; name the picture with -o")
    os.chdir(os.sep)
