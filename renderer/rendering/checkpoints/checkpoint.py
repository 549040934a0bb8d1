"""The checkpoint of a render: read at its start, written at intervals."""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import CheckpointWarning, SceneError
from renderer.process.whole_file import remove_parts, target_of, why_not_writable
from renderer.process.worker_pool import WorkerPool
from renderer.rendering.checkpoints.file import (
    Arrays,
    Stored,
    find_checkpoint,
    older,
    write_checkpoint,
)
from renderer.rendering.checkpoints.identity import Identity, difference

MAY_DIFFER = "only threads, accel and, if the sampler is independent, spp may differ"


def is_kept(path: Path) -> bool:
    """Return whether there is a checkpoint at `path`, or an older one."""
    return path.exists() or older(path).exists()


def check_checkpoint_path(path: Path, *, resume: bool) -> None:
    """Check before a render that a checkpoint can be written and overwrites no other one.

    Raises
    ------
    SceneError
        If the folder is missing or not writable, or if the file exists and `resume` is
        false.
    """
    reason = why_not_writable(path)
    if reason is None and path.exists() and not path.is_file():
        reason = "is a device or a pipe; a checkpoint needs a file"
    if reason is not None:
        raise SceneError(f"{path}: {reason}")
    if not resume and is_kept(path):
        there = path if path.exists() else older(path)
        raise SceneError(
            f"{there} is there already: go on from it (--resume, or resume=True) or "
            "remove it"
        )


class Checkpoint:
    """Reads and writes the state of a render.

    Parameters
    ----------
    path : Path
        Of the file; the previous one is kept in the same folder, see `file.older`.
    every : float
        Seconds between the end of a write and the next one.
    of : Identity
        What is rendered.
    resume : bool
        Resume from the file. If there is no file, or only the older one is valid, a
        CheckpointWarning says so.

    Raises
    ------
    SceneError
        If the file belongs to another render, is damaged, or must not be resumed.
    """

    def __init__(self, path: Path, every: float, of: Identity, *, resume: bool) -> None:
        check_checkpoint_path(path, resume=resume)
        path = target_of(path)  # follow links: the older file is next to the target
        self._path, self._every, self._of = path, every, of
        self._found: Stored | None = None
        self._whole = False  # whether `path` has a valid file, to be kept at the next write
        self._copies: dict[str, NDArray[Any]] = {}
        self._writing: WorkerPool | None = None
        self._failure = ""
        self._last = time.monotonic()
        remove_parts(path)
        if resume:
            self._find()

    def _find(self) -> None:
        self._found, wrong = find_checkpoint(self._path)
        if self._found is None and wrong:
            raise SceneError(f"{'; '.join(wrong)}: there is nothing to go on from")
        if self._found is None:
            _warn(f"{self._path}: there is no checkpoint yet; this starts at the beginning")
            return
        if wrong:
            _warn(f"{'; '.join(wrong)}; this goes on from the older {self._found.path}")
        self._whole = self._found.path == self._path
        if (how := difference(self._found.of, self._of)) is not None:
            raise SceneError(
                f"{self._found.path} is of another render: {how}; {MAY_DIFFER}"
            )

    def restore(self, state: Arrays) -> bool:
        """Fill the arrays of a render's state; return false if there is nothing to resume.

        Raises
        ------
        SceneError
            If the file lacks an array, as after a render without a goal, or cannot be read
            any more.
        """
        if self._found is None:
            return False
        stored = self._found.arrays
        for name, array in state.items():
            if name not in stored:
                raise SceneError(
                    f"{self._found.path} has no {name}: it is of a render without "
                    "target_error and time_limit, and can only go on without them"
                )
            there = (np.dtype(stored[name].dtype), stored[name].shape)
            if there != (array.dtype, array.shape):
                raise SceneError(f"{self._found.path} has {name} of another size")
        try:
            self._found.read_into(state)
        except OSError as error:
            raise SceneError(f"{self._found.path} cannot be read: {error}") from error
        return True

    def due(self) -> bool:
        """Return whether the next checkpoint is due."""
        if self._writing is not None:
            if self._writing.done == 0:
                return False
            self.close()
        return time.monotonic() - self._last >= self._every

    def take(self, state: Arrays) -> None:
        """Copy a state that no thread changes; write it while the render continues."""
        self.close()
        for name, array in state.items():
            if name not in self._copies:
                self._copies[name] = np.empty_like(array)
            np.copyto(self._copies[name], array)
        self._writing = WorkerPool(1, 1, lambda job, thread: self._write(self._copies))
        self._writing.start()

    def save(self, state: Arrays) -> None:
        """Write a state that no thread changes; return when it is on the disk."""
        self.close()
        self._write(state)
        self._say_failure()

    def close(self) -> None:
        """Wait for the current write to end."""
        if self._writing is not None:
            while not self._writing.wait():
                pass
            self._writing = None
        self._say_failure()

    def _write(self, state: Arrays) -> None:
        """Write; errors such as a full disk do not end the render."""
        try:
            keep = self._whole and self._path.exists()
            write_checkpoint(self._path, self._of, state, keep=keep)
            self._whole = True
        except (OSError, MemoryError) as error:
            reason = getattr(error, "strerror", None) or error or "not enough memory"
            self._failure = f"{self._path} cannot be written: {reason}"
        self._last = time.monotonic()

    def _say_failure(self) -> None:
        if self._failure:
            failure, self._failure = self._failure, ""
            _warn(f"{failure}; what was there is kept")


def _warn(text: str) -> None:
    warnings.warn(text, CheckpointWarning, stacklevel=3)
