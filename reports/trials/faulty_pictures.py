"""Pictures with a known mistake, and the names that `lightproof compare` may give it.

Four ways to make them: pictures are edited; scenes are rendered with another description;
copies of the kernels have the mistake that the library renders too, with other random
numbers; and copies of `renderer.simple`, which shares no code with the kernels, have one
that was written apart from the library (homework.toml).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from scipy import ndimage

import renderer
from mitsuba_ref.diagnosis.image_mistakes import Floats
from mitsuba_ref.diagnosis.scene_mistakes import (
    AlgorithmMistake,
    algorithm_mistakes,
    reading_mistakes,
    render_algorithm_mistake,
)
from mitsuba_ref.mutations.defects.catalogue import read_mutations
from mitsuba_ref.mutations.mutation import Mutation, mutant_folder
from mitsuba_ref.records.request import RenderRequest
from renderer.rendering.picture.picture import srgb_from_linear
from renderer.scene.scene import build_scene
from renderer.scene_file import read_file_with
from renderer.scene_file.description import SceneDescription
from renderer.scene_file.images.image import linear_from_srgb
from reports.errors import ReportError
from reports.trials.scene_files import SCENES, scene_file

HOMEWORK = read_mutations(Path(__file__).with_name("homework.toml"))
SIZE = {"width": "64", "height": "48"}
SEED, SPP = 77, 16
HOMEWORK_SPP = 4  # a minute for a picture by the simple renderer
HOMEWORK_SECONDS = 900.0  # until such a picture is given up
ROOM = Path(__file__).with_name("room.xml")


@dataclass(frozen=True)
class FaultyPicture:
    """A picture with a mistake.

    Parameters
    ----------
    name
        Of the mistake, the one that should be found first.
    scene
        The scene file.
    parameters
        That replace its defaults.
    make
        Renders the picture.
    also
        Names that are as right in this picture.
    """

    name: str
    scene: Path
    make: Callable[[], Floats]
    parameters: Mapping[str, str] = field(default_factory=lambda: dict(SIZE))
    also: tuple[str, ...] = ()


def room(folder: Path) -> Path:
    """Write the scene "room": point lights, glass, an image; return its path."""
    shutil.copy(SCENES / "textured-room" / "textures" / "sunset.jpg", folder)
    return Path(shutil.copy(ROOM, folder))


def right_picture(scene: Path, seed: int, spp: int | None = SPP) -> Floats:
    """Render a scene of `SIZE` with our renderer."""
    loaded = renderer.load_file(scene, **SIZE)
    return np.asarray(renderer.render(loaded, spp, seed), np.float64)


EDITS: dict[str, Callable[[Floats], Floats]] = {
    "srgb-curve-applied": srgb_from_linear,
    "srgb-curve-inverted": lambda p: linear_from_srgb(np.clip(p, 0.0, 1.0)),
    "gamma-2.2-applied": lambda p: p ** (1.0 / 2.2),
    "gamma-2.2-inverted": lambda p: p**2.2,
    "tone-mapped": lambda p: p / (1.0 + p),
    "factor-pi": lambda p: np.pi * p,
    "factor-1/pi": lambda p: p / np.pi,
    "factor-2": lambda p: 2.0 * p,
    "exposure": lambda p: 0.93 * p,
    "channel-factors": lambda p: p * [1.08, 1.0, 0.95],
    "missing-channel": lambda p: p * [1.0, 1.0, 0.0],
    "swapped-channels": lambda p: p[..., ::-1],
    "grey": lambda p: np.repeat(p.mean(axis=2, keepdims=True), 3, axis=2),
    "mirrored-left-right": lambda p: p[:, ::-1],
    "mirrored-top-bottom": lambda p: p[::-1],
    "rotated-180": lambda p: p[::-1, ::-1],
    "shift": lambda p: ndimage.shift(p, (0, 1, 0), order=0, mode="nearest"),
    "wider-filter": lambda p: ndimage.gaussian_filter(p, (1.0, 1.0, 0.0)),
    "clamped": lambda p: np.minimum(p, 0.5),
}
EDITED = "cornell-box", "room", "smooth-mesh"
MISREAD = "cornell-box", "room", "smooth-mesh", "textured-room"
ALGORITHMS = "cornell-box", "room", "textured-room", "whitted-spheres"


def edited_pictures(folder: Path) -> Iterator[FaultyPicture]:
    """Yield pictures of three scenes that were edited after the render."""
    for word in EDITED:
        scene = scene_path(folder, word)
        for name, edit in EDITS.items():
            seed = SEED + zlib.crc32(f"{scene.parent.name} {name}".encode()) % 1000
            yield FaultyPicture(name, scene, partial(edited_picture, scene, edit, seed))


def edited_picture(scene: Path, edit: Callable[[Floats], Floats], seed: int) -> Floats:
    """Render a scene and edit its picture."""
    return np.asarray(edit(right_picture(scene, seed)), np.float64)


def misread_scenes(folder: Path) -> Iterator[FaultyPicture]:
    """Yield pictures of scenes that were read wrongly."""
    for word in MISREAD:
        scene = scene_path(folder, word)
        for name, _, _, edited in reading_mistakes(read_file_with(scene, SIZE)):
            # one segment sees lamps alone, and point lights are none
            black = ("black",) if name == "depth-limited" else ()
            yield FaultyPicture(name, scene, partial(misread_picture, edited), also=black)


def misread_picture(edited: SceneDescription) -> Floats:
    """Render a scene whose description was edited."""
    return np.asarray(renderer.render(build_scene(edited), SPP, SEED), np.float64)


def faulty_algorithms(folder: Path) -> Iterator[FaultyPicture]:
    """Yield pictures by kernels with a mistake, with other random numbers."""
    for word in ALGORITHMS:
        scene = scene_path(folder, word)
        # of point lights alone a factor of all values and one of light samples are one
        same = {"brdf-without-pi": ("factor-pi",)} if word == "room" else {}
        for mistake in algorithm_mistakes(read_file_with(scene, SIZE)):
            also = same.get(mistake.name, ())
            make = partial(faulty_picture, mistake, scene)
            yield FaultyPicture(mistake.name, scene, make, also=also)


def faulty_picture(mistake: AlgorithmMistake, scene: Path) -> Floats:
    """Render a scene with kernels that have a mistake."""
    request = RenderRequest(str(scene), dict(SIZE), spp=SPP, seed=SEED)
    found = render_algorithm_mistake(mistake, request)
    if found is None:
        raise ReportError(f"{mistake.name}: the kernels do not render")
    return found.pixels


def homework(folder: Path) -> Iterator[FaultyPicture]:
    """Yield pictures by `renderer.simple` with a mistake."""
    also = {"factor-1/2": ("light-choice-probability",), "clamped": ("samples-clamped",)}
    for mutation in HOMEWORK:
        name = mutation.name.partition("_")[0].replace("1-2", "1/2")
        scene = scene_path(folder, mutation.scene)
        make = partial(simple_picture, mutation, scene)
        yield FaultyPicture(name, scene, make, also=also.get(name, ()))


def simple_picture(mutation: Mutation, scene: Path) -> Floats:
    """Render a scene with a copy of `renderer.simple` that has a mistake."""
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "picture.npy"
        command = [sys.executable, "-m", "renderer.simple", str(scene), "-o", str(path)]
        command += [f"-D{name}={value}" for name, value in SIZE.items()]
        subprocess.run(
            [*command, "--quiet", f"--spp={HOMEWORK_SPP}"],
            cwd=mutant_folder(mutation),
            check=True,
            timeout=HOMEWORK_SECONDS,
        )
        return np.asarray(np.load(path), np.float64)


def scene_path(folder: Path, name: str) -> Path:
    """Return the file of a scene by its name; "room" is in `folder`."""
    return folder / "room.xml" if name == "room" else scene_file(name)


SOURCES: dict[str, Callable[[Path], Iterator[FaultyPicture]]] = {
    "edited pictures": edited_pictures,
    "scenes read wrongly": misread_scenes,
    "faulty kernels": faulty_algorithms,
    "homework": homework,
}
