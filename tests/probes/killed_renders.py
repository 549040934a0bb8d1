"""A program that kills renders of one scene at random moments, and resumes each.

    python tests/probes/killed_renders.py FOLDER KILLS

It forks a process for each sitting, since starting Python and Numba takes longer than the
sitting. Checkpoints follow each other as fast as they can, so that most moments are within
the writing of one or between two. It ends with status 0 and a line, or says what is wrong.
"""

from __future__ import annotations

import os
import signal
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from renderer.process import worker_pool
from renderer.rendering.checkpoints.checkpoint import Checkpoint
from renderer.rendering.checkpoints.file import find_checkpoint

SCENE = Path(__file__).parents[2] / "scenes" / "cornell-box" / "scene.xml"
EVERY = 1e-3  # [s]
MOST = 5  # checkpoints that a sitting takes before the moment is drawn when it is killed
LONGEST = 0.02  # [s] from then on: more than copying and writing one takes
SPP = 500  # no multiple of a part of samples


def samples_in(path: Path) -> int:
    """Return how many samples the newest checkpoint holds, which must be whole."""
    stored, wrong = find_checkpoint(path)
    assert not wrong, wrong
    if stored is None:
        return 0
    samples = np.zeros(stored.arrays["samples"].shape, np.int64)
    stored.read_into({"samples": samples})
    return int(samples.sum())


def main(folder: Path, kills: int) -> None:
    """Kill `kills` sittings; compare each finished picture with the uninterrupted one."""
    warnings.simplefilter("ignore")  # that there is no checkpoint yet
    worker_pool.WAKE = 1e-3  # how often a render asks whether a checkpoint is due
    scene = renderer.load_file(SCENE, width=48, height=48)
    whole = renderer.render(scene, SPP, threads=2).pixels
    path = folder / "killed.ckpt"
    rng = np.random.default_rng(kills)

    def sitting(number: int) -> np.ndarray:
        return renderer.render(
            scene,
            SPP,
            threads=1 + number % 3,
            checkpoint=path,
            checkpoint_every=EVERY,
            resume=True,
        ).pixels

    def fork(number: int) -> tuple[int, int]:
        """Return a sitting's process, and a pipe that gets a byte for each checkpoint."""
        taken, told = os.pipe()
        process = os.fork()
        if process:
            os.close(told)
            return process, taken
        code = 1
        try:
            take = Checkpoint.take

            def telling_take(checkpoint: Checkpoint, state: Any) -> None:
                os.write(told, b".")
                take(checkpoint, state)

            Checkpoint.take = telling_take
            code = 0 if np.array_equal(sitting(number), whole) else 2
        finally:
            os._exit(code)

    killed, pictures, before, kept = 0, 0, 0, set()
    while killed < kills:
        process, taken = fork(killed)
        for _ in range(rng.integers(0, MOST, endpoint=True)):
            os.read(taken, 1)  # at once after its end
        time.sleep(rng.uniform(0.0, LONGEST))
        os.kill(process, signal.SIGKILL)
        status = os.waitpid(process, 0)[1]
        os.close(taken)
        samples = samples_in(path)
        assert samples >= before, "a checkpoint has fewer samples than the one before"
        before = samples
        kept.add(samples)
        if os.WIFSIGNALED(status):
            killed += 1
            continue
        assert os.WEXITSTATUS(status) == 0, f"status {os.WEXITSTATUS(status)}"
        pictures, before = pictures + 1, 0
        for file in folder.iterdir():
            file.unlink()
    assert np.array_equal(sitting(0), whole), "the picture is another one"
    assert len(kept) > 1, "no checkpoint was ever written"
    parts = [file.name for file in folder.iterdir() if file.name.endswith(".part")]
    assert not parts, parts
    sys.stdout.write(
        f"{killed} killed, {len(kept)} checkpoints found, {pictures + 1} pictures equal\n"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
