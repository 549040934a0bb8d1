"""How much memory there is to take, and the refusal of what would take more.

A process that takes more than there is gets killed by the kernel, without a word and with
everything that it held. So code that is about to allocate much calls `require` first.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from renderer.errors import NotAllowed, SceneError

# No more than this is granted without a look at how much there is: so much is always
# there, and the look takes 50 microseconds.
SMALL = 1 << 20  # [bytes]

# What version 1 of control groups says where there is no limit is near 2^63.
_NO_LIMIT = 1 << 60  # [bytes]

_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12} | {
    "ki": 2**10,
    "mi": 2**20,
    "gi": 2**30,
    "ti": 2**40,
}
_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*([kmgt]?i?)b?", re.IGNORECASE)

# Where readers of files and renders look. Not an argument of theirs: between the command
# line and a reader are the plugins, users' own among them, that know nothing of memory.
_limit: ContextVar[int | None] = ContextVar("memory limit", default=None)


def parse_size(value: int | float | str) -> int:
    """Return a size in bytes: a number of them, or text such as `4GiB`, `500 MB` or `2G`.

    Raises
    ------
    SceneError
        If it is no such text, or not positive.
    """
    if isinstance(value, str):
        match = _SIZE.fullmatch(value.strip())
        if match is None or match[2].lower() not in _UNITS:
            raise SceneError(
                f"memory is {value!r}; sizes such as 4GiB or 500MB are possible"
            )
        value = float(match[1]) * _UNITS[match[2].lower()]
    if isinstance(value, bool) or not 1 <= value < 2**63:
        raise SceneError(f"memory is {value!r}; sizes from 1 byte on are possible")
    return int(value)


def shown(size: float) -> str:
    """Return a size for people: `3.2 GiB`."""
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if size < 1024:
            return f"{size:.0f} {unit}" if unit == "bytes" else f"{size:.3g} {unit}"
        size /= 1024
    return f"{size:,.3g} TiB" if size < 1000 else f"{size:,.0f} TiB"


@contextmanager
def limited_to(limit: int | float | str | None) -> Iterator[None]:
    """Let nothing inside take the process beyond a limit, nor beyond what holds already.

    Raises
    ------
    SceneError
        As `parse_size`.
    """
    limits = [] if limit is None else [parse_size(limit)]
    if (outer := _limit.get()) is not None:
        limits.append(outer)
    token = _limit.set(min(limits, default=None))
    try:
        yield
    finally:
        _limit.reset(token)


def room() -> int:
    """Return how many bytes more this process may take.

    That is what is left of the limit; without one, what the machine has free, and what the
    control groups that the process is in leave of theirs.
    """
    if (limit := _limit.get()) is not None:
        return max(0, limit - resident())
    return max(0, min([_free_of_machine(), *_free_of_groups()]))


def whose_room() -> str:
    """Return what the room is a part of, for messages."""
    limit = _limit.get()
    if limit is None:
        return f"this machine has {shown(room())} free"
    return f"of the {shown(limit)} allowed {shown(room())} are left"


def require(size: int, what: str) -> None:
    """Refuse what would take more than there is.

    Parameters
    ----------
    size
        Bytes that are about to be taken, at their peak.
    what
        What takes them and where, the beginning of the message.

    Raises
    ------
    NotAllowed
        With both numbers.
    """
    if size > SMALL and size > room():
        raise NotAllowed(
            f"{what} takes about {shown(size)} of memory; {whose_room()} "
            "(--memory SIZE sets the limit)"
        )


def resident() -> int:
    """Return the bytes of memory that this process has now."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):  # not Linux: the most that it ever had
        try:
            import resource
        except ImportError:
            return 0
        most: int = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most if os.uname().sysname == "Darwin" else 1024 * most
    return pages * os.sysconf("SC_PAGE_SIZE")


def _free_of_machine() -> int:
    """Return what can be had without swapping; much if the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return 2**62


def _free_of_groups(root: Path = Path("/sys/fs/cgroup")) -> list[int]:
    """Return what each control group around this process leaves of its limit.

    A container sees its own group as the root; both versions of the interface are read. The
    cache of files counts as used there, but what of it is inactive gives way.
    """
    try:
        groups = Path("/proc/self/cgroup").read_text()
    except OSError:
        return []
    return [free for files in _files_of_groups(groups, root) for free in _free_of(*files)]


@functools.lru_cache(maxsize=1)
def _files_of_groups(groups: str, root: Path) -> list[tuple[Path, Path, Path, str]]:
    """Return (limit, usage, counts, what gives way) of each group around a process.

    Kept: a process is moved to another group seldom, and its limits are needed with
    each file that is read, where finding them took most of the time.
    """
    found = []
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers not in ("", "memory") and "memory" not in controllers.split(","):
            continue
        version_2 = controllers == ""
        top = root if version_2 else root / "memory"
        limit, usage, inactive = (
            ("memory.max", "memory.current", "inactive_file")
            if version_2
            else ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        )
        inner = top / path.lstrip("/")
        found += [
            (folder / limit, folder / usage, folder / "memory.stat", inactive)
            for folder in (inner, *inner.parents)
            if folder == top or top in folder.parents
        ]
    return found


def _free_of(limit: Path, usage: Path, counts: Path, inactive: str) -> list[int]:
    """Return what one group leaves of its limit; nothing if it has none."""
    try:
        text = limit.read_text().strip()
        if text == "max" or int(text) >= _NO_LIMIT:
            return []
        found = dict(line.split() for line in counts.read_text().splitlines())
        return [int(text) - int(usage.read_text()) + int(found.get(inactive, 0))]
    except (OSError, ValueError):
        return []
