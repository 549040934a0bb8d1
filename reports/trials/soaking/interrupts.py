"""Ctrl-C at random moments of the command: the picture so far or nothing, and one line.

Each moment is an interrupt of a program of its own, from its start to after its end. Faults
are a traceback, a picture that cannot be read, another file than the picture, a status that
is not that of an interrupt, and a program that goes on. Python itself, before it comes to
the first line of the program, answers as Python does; that is counted apart.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from reports.bench.steps import Step
from reports.trials.soaking.sound_files import SCENES

SCENE = SCENES / "cornell-box" / "scene.xml"
SPP = 512
PATIENCE = 60.0  # [s] until a program hangs that was interrupted
ENDS = (".exr", ".png", ".npy")
TRACEBACK = "Traceback (most recent call last)"
INTERRUPTED = 130


def interrupt_steps(done: int, deadline: float, spp: int = SPP) -> Generator[Step]:
    """Interrupt moment after moment, from number `done` on, until `deadline`.

    Parameters
    ----------
    done, deadline
        The first moment's number; when to stop, by `time.monotonic`.
    spp
        Samples per pixel of 64 x 64 pixels: how long the program runs.
    """
    for _ in range(2):  # the second has its kernels from the cache
        start = time.monotonic()
        _run(0, None, spp)
        whole = time.monotonic() - start
    while time.monotonic() < deadline:
        moment = random.Random(done).random() * 1.1 * whole
        ended, fault = _run(done, moment, spp)
        case = f"moment {done}, after {moment:.3f} s of {whole:.2f} s: "
        faults = (case + fault,) if fault else ()
        yield Step(1, {ended: 1}, {"seconds of a whole run": whole}, faults)
        done += 1


def _run(number: int, moment: float | None, spp: int) -> tuple[str, str]:
    """Run the command, interrupt it, and look; return what it was and the fault or ""."""
    rng = random.Random(-number - 1)
    name = f"picture{rng.choice(ENDS)}"
    words = ["-D", "width=64", "-D", "height=64", "--spp", str(spp)]
    words += ["--threads", str(rng.choice((1, 2))), "-o", name, str(SCENE)]
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, "-m", "renderer", *words],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONFAULTHANDLER": "1"},  # where a crash was
            # a shell's background job ignores SIGINT, and its children inherit that
            preexec_fn=_listens,
        )
        try:
            if moment is not None:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(moment)
                process.send_signal(signal.SIGINT)  # nothing if it has ended
            _, said = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return "hangs", f"still running {PATIENCE:g} s after the interrupt"
        finally:
            process.kill()
        return _judged(Path(folder), name, process.returncode, said)


def _listens() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _judged(folder: Path, name: str, status: int, said: str) -> tuple[str, str]:
    """Return what the interrupt led to, and the sentence of a fault or ""."""
    files = sorted(path.name for path in folder.iterdir())
    if files not in ([], [name]):
        return "another file", f"files {files}"
    if files and (fault := _unreadable(folder / name)):
        return "a picture that cannot be read", fault
    if status == -signal.SIGINT or (TRACEBACK in said and "/renderer/" not in said):
        return "ended before its first line", "with a picture" if files else ""
    if TRACEBACK in said:
        return "a traceback", " | ".join(said.strip().splitlines()[-12:])
    if status == 0 and files:
        return "was done before", ""
    if status != INTERRUPTED:
        return "a wrong status", f"status {status}: {said.strip()[-200:]}"
    if ("wrote nothing" in said) == bool(files):
        return "a wrong message", f"files {files}: {said.strip()[-200:]}"
    return ("wrote the picture so far" if files else "wrote nothing"), ""


def _unreadable(path: Path) -> str:
    """Return why a picture is not whole, or ""."""
    try:
        if path.suffix == ".exr":
            with OpenEXR.File(str(path)) as file:
                pixels = next(iter(file.channels().values())).pixels
        elif path.suffix == ".png":
            pixels = np.asarray(Image.open(path))
        else:
            pixels = np.load(path)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    whole = pixels.size >= 64 * 64 and bool(np.isfinite(pixels).all())
    return "" if whole else f"{pixels.size} numbers, or not finite"
