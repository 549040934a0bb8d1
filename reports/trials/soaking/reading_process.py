"""A process that reads and renders damaged files: one number in, one line of JSON out.

It stays alive from file to file, so that a file costs thousandths of a second. `Reader`
kills it when a file takes too long, and starts another when one kills it.
"""

from __future__ import annotations

import gc
import json
import os
import random
import re
import resource
import shutil
import sys
import time
import traceback
import warnings
from pathlib import Path

import numpy as np

import renderer
from renderer.errors import SceneError
from reports.trials.soaking.formats import DAMAGE
from reports.trials.soaking.sound_files import PLUGINS, ROOT, SCENES, SoundFile, sound_files

MEMORY = 1 << 30  # [bytes] of address space beyond what the warm process has
PIXELS = 1 << 14  # larger films are read, and not rendered
DEPTH = 64  # bounces, and samples of light at one point; sound scenes may have any number
INSTANCES = 16  # in a file that scenes include
_INSTANCE = re.compile(r'<shape type="instance".*?</shape>', re.DOTALL)
REFUSED, PICTURE, LARGE = "refused", "rendered", "read; too large to render"


def damaged(number: int) -> tuple[SoundFile, bytes]:
    """Return the sound file that the case is about, and its damaged content."""
    # every other case is a scene, of which there are more than formats
    kinds = [[one for one in sound_files() if (not one.scene) == odd] for odd in (0, 1)]
    sound = kinds[number % 2][number // 2 % len(kinds[number % 2])]
    rng = random.Random(number)
    return sound, DAMAGE[Path(sound.name).suffix](rng, sound.content)


def outcome(folder: Path, sound: SoundFile, content: bytes) -> tuple[str, str]:
    """Return what a file led to, and the sentence of a fault or ""."""
    path = place(folder, sound)
    path.unlink(missing_ok=True)  # ext4 waits for the disk if a file is cut to be rewritten
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of NumPy
            return _rendered(path, sound), ""
    except SceneError as error:
        text = str(error)
        if not text.isprintable() or len(text) < 10:
            return "a message that is no sentence", repr(text[:200])
        return REFUSED, ""
    except MemoryError:
        return "out of memory", _where()
    except Exception as error:
        kind = type(error).__name__
        if isinstance(error, _Fault):
            return str(error), str(error)
        return f"{kind} instead of a SceneError", f"{kind}: {str(error)[:160]} {_where()}"


class _Fault(Exception):
    """A picture with a number that is not finite."""


def _rendered(path: Path, sound: SoundFile) -> str:
    if sound.scene:
        scene = renderer.load_string(sound.scene, base_dir=path.parent)
    else:
        scene = renderer.load_file(path)
    description = scene.description
    film, method = description.camera.film, description.integrator
    # without a limit, paths end by roulette
    deepest = method.max_depth if method.max_depth >= 0 else method.rr_depth
    widest = max(method.emitter_samples, method.bsdf_samples)
    if film.width * film.height > PIXELS or max(deepest, widest) > DEPTH:
        return LARGE
    image = renderer.render(scene, spp=1, threads=1)
    if not np.isfinite(image.pixels).all():
        raise _Fault("a picture that is not finite")
    return PICTURE


def _where() -> str:
    """Return the innermost place in this project's sources of the error in flight."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    ours = [f for f in frames if "/renderer/" in f.filename] or list(frames)
    return f"({ours[-1].filename.rpartition('/renderer/')[2]}, in {ours[-1].name})"


def place(folder: Path, sound: SoundFile) -> Path:
    """Return where the file goes; around a scene are the files that it names."""
    if sound.scene:
        return folder / sound.name
    home = folder / sound.folder.relative_to(ROOT)
    if not home.exists():
        for whole in (PLUGINS, SCENES):
            shutil.copytree(whole, folder / whole.relative_to(ROOT))
        for path in folder.glob("scenes/*/meshes/*.xml"):
            path.write_text(_with_few_instances(path.read_text()))
    return home / "damaged.xml"


def _with_few_instances(included: str) -> str:
    """Return it with some of its instances: 400 were a tenth of the time of all files."""
    instances = _INSTANCE.findall(included)
    for one in instances[INSTANCES:]:
        included = included.replace(one, "", 1)
    return included


def main() -> None:
    """Answer numbers until the input ends."""
    folder = Path(sys.argv[1])
    # what libraries print must not come between the lines
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    for sound in sound_files():  # kernels are compiled or come from their cache
        found, fault = outcome(folder, sound, sound.content)
        if sound.scene and found != PICTURE:
            raise SystemExit(f"{sound.name} is sound and was not rendered: {found} {fault}")
    gc.collect()
    gc.freeze()  # kernels and modules stay: looking through them took 5 % of the time
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    limit = size + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    answers.write("ready\n")
    for line in sys.stdin:
        start = time.process_time()
        sound, content = damaged(int(line))
        found, fault = outcome(folder, sound, content)
        seconds = time.process_time() - start
        answers.write(json.dumps([found, fault, seconds]) + "\n")


if __name__ == "__main__":
    main()
