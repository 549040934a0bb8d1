"""How commands that are over soon fail: one line on standard error, and a status."""

from __future__ import annotations

import sys
from collections.abc import Callable

from renderer.errors import SceneError, printable

WRONG_USE, INTERRUPTED = 2, 130


def run_command(
    begin: str,
    run: Callable[[], int],
    refusals: tuple[type[Exception], ...] = (SceneError,),
) -> int:
    """Return the status of a command; say in one line why it refuses or cannot write.

    Parameters
    ----------
    begin
        Of that line, such as "lightproof check".
    run
        Does the work and returns the status.
    refusals
        Exceptions whose message is for the user.
    """
    try:
        return run()
    except KeyboardInterrupt:
        return INTERRUPTED
    except refusals as error:
        message = str(error)
    except OSError as error:
        message = f"{error.filename or 'output'}: {error.strerror}"
    sys.stderr.write(f"{begin}: {printable(message)}\n")
    return WRONG_USE
