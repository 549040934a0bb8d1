"""The command `lightproof`, also `python -m renderer`, as a process of its own.

`cli.main` is the command itself. This file does what only a process of its own may do, such
as ending without freeing its kernels. It halves the processor's time of a warm start at one
sample (docs/performance.md).
"""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

# Numba and the kernels make 200,000 objects on their way in, among which Python's collector
# of cycles, which looks after every 700, finds nothing to free.
_OBJECTS_BETWEEN_COLLECTIONS = 1_000_000


def command(module: str = "renderer.command.cli") -> NoReturn:
    """Run the command line of this process and end it with the command's status.

    Parameters
    ----------
    module
        Whose `main` is the command.
    """
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
    # Ctrl-C before `main` looks after it ends the process, and Python has no traceback.
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from renderer.process.signals import make_streams_tolerant

    make_streams_tolerant()
    main: Callable[[], int] = _subcommand() or importlib.import_module(module).main
    signal.signal(signal.SIGINT, before)
    _end(main())


def _subcommand() -> Callable[[], int] | None:
    """Return what runs `lightproof WORD ...`, if a package has registered WORD.

    It does so by an entry point of the group `lightproof.commands`. A word that is the name
    of a file or a folder is a scene.
    """
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    if not word.isidentifier() or os.path.exists(word):
        return None
    from importlib.metadata import entry_points

    found = entry_points(group="lightproof.commands", name=word)
    for entry in found:
        del sys.argv[1]
        # what a missing package of an extra leads to is said in one line
        sys.argv[0] = f"lightproof-{word}"
        main: Callable[[], int] = entry.load()
        return main
    return None


def _end(status: int) -> NoReturn:
    """End the process without taking it apart: the system frees all memory faster.

    Python would free every object and LLVM every kernel, one by one. When `main` returns,
    pictures are in their places, and only logging and the streams have something left.
    """
    import logging

    # all is said and written; and a flush may wait for a reader that does not read
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    command()
