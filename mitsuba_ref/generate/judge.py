"""Both renderers on one scene, and the class of what they differ by."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.generate.changed_scenes import changed_scenes
from mitsuba_ref.generate.drawing import DrawnScene, scene_text
from mitsuba_ref.generate.faults import (
    KNOWN_FAULTS,
    MITSUBA_NOT_FINITE,
    NOT_FINITE,
    KnownFault,
)
from mitsuba_ref.generate.scene_edits import copy_shared_bsdfs
from mitsuba_ref.our_renderer.picture import RenderOurs, read_scene
from mitsuba_ref.records.proof_file import ReplayLimits
from mitsuba_ref.records.request import MIN_THREADS, RenderRequest
from mitsuba_ref.records.results import ReplayResult
from mitsuba_ref.reference.cache import ReferenceCache, RenderFunction
from mitsuba_ref.reference.errors import MitsubaCrashed, MitsubaError, MitsubaTimeout
from mitsuba_ref.replay.replay_comparison import TOLERANCE, relative_difference
from mitsuba_ref.replay.replay_scene import replay_scene
from renderer.advice.coincident_surfaces import coincident_surfaces
from renderer.errors import NotReplayable, SceneError
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import build_scene
from renderer.scene_file.description import Mesh

AGREE = "agree"
EDGE = "rounding at an edge"
AMPLIFIED = "amplified rounding"
COINCIDENT = "coincident surfaces"
FAULT = "known fault"
REFUSED = "cannot be replayed"
STOPPED = "not rendered"
UNKNOWN = "unknown"
CLASSES = (AGREE, EDGE, AMPLIFIED, COINCIDENT, FAULT, REFUSED, STOPPED, UNKNOWN)
UNCLASSED = (STOPPED, UNKNOWN)
"""What has to be looked at: a renderer refuses, ends or raises, or paths part."""

TIME_LIMIT = 60.0
"""Seconds for one answer of Mitsuba; a scene takes less than one."""

LIMITS = ReplayLimits(reason="scenes at random", traced=6)
ROUNDED = 3e-5
"""Relative: what a pixel without a trace may differ by in addition to its changes."""

STRICT = ReplayLimits(reason="without a look at causes")


@dataclass(frozen=True)
class Judgement:
    """What a replay of one scene says."""

    verdict: str  # one of `CLASSES`
    sentence: str
    quantity: str = ""  # the first that differs; the name of an error
    pixel: tuple[int, int] | None = None  # where: x, y
    brightness: float = 0.0  # mean of Mitsuba's picture
    error: float = 0.0  # relative, of that quantity; 0: it has none


def write_scene(scene: DrawnScene, folder: Path) -> Path:
    """Write a scene and its files; return the path of the scene."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in scene.files.items():
        (folder / name).write_bytes(content)
    path = folder / "scene.xml"
    path.write_text(scene_text(scene.root), encoding="utf-8")
    return path


def sample_count(root: Element) -> int:
    """Return the samples per pixel that a scene says."""
    found = root.find(".//sampler/integer[@name='sample_count']")
    return 1 if found is None else int(found.get("value", "1"))


class Judge:
    """Renders scenes with both renderers and compares them.

    Parameters
    ----------
    render_ours
        Our renderer, or one with a defect.
    render_reference
        Mitsuba, in a separate process.
    folder
        For scenes and pictures; what is in it may be overwritten.
    limits
        Whether causes are looked at.
    """

    def __init__(
        self,
        render_ours: RenderOurs,
        render_reference: RenderFunction,
        folder: Path,
        limits: ReplayLimits = LIMITS,
    ) -> None:
        self._render_ours = render_ours
        self._references = ReferenceCache(render_reference, folder / "references")
        self._folder = folder
        self._limits = limits

    def judge(self, scene: DrawnScene) -> Judgement:
        """Return what a replay says, known faults among it.

        A difference is a known fault's if the scene without what brings it about has none.
        """
        return self._explained(scene, self._judge(scene), set())

    def _explained(self, scene: DrawnScene, found: Judgement, tried: set[str]) -> Judgement:
        """Return what was found of a scene, or the known faults that explain it.

        One fault is left out alone, then several. `tried` has the texts of the scenes that
        were judged: the same faults in another order leave the same scene.
        """
        if found.verdict not in UNCLASSED:
            return found
        own = scene._replace(root=copy.deepcopy(scene.root))
        if copy_shared_bsdfs(own.root) and self._judge(own).verdict not in UNCLASSED:
            return found  # sharing them is what differs, which is no known fault
        tried.add(scene_text(own.root))  # a fault that is not in it leaves it so
        left = []
        for fault, undone in _without_faults(own, found):
            if (text := scene_text(undone.root)) not in tried:
                tried.add(text)
                after = self._judge(undone)
                if after.verdict not in UNCLASSED:
                    return replace(found, verdict=FAULT, quantity=fault.name)
                left.append((fault, undone, after))
        for fault, undone, after in left:
            more = self._explained(undone, after, tried)
            if more.verdict not in UNCLASSED:
                names = f"{fault.name}, {more.quantity}"
                return replace(found, verdict=FAULT, quantity=names)
        return found

    def _judge(self, scene: DrawnScene) -> Judgement:
        path = write_scene(scene, self._folder / "scene")
        try:
            return self._replay(path, sample_count(scene.root))
        finally:
            for file in (*path.parent.iterdir(), *self._references.folder.glob("*.npz")):
                file.unlink()

    def _replay(self, path: Path, spp: int) -> Judgement:
        request = RenderRequest(path=str(path), threads=MIN_THREADS)
        try:
            result, ours, theirs = replay_scene(
                request,
                spp,
                self._render_ours,
                self._references,
                self._limits,
                time_limit=TIME_LIMIT,
            )
            found = _class_of(result, ours, theirs)
            finite = found.verdict == UNKNOWN and result.pixels > 0
            untraced = finite and self._limits.traced > 0 and not result.traced
            if untraced:
                found = self._untraced(found, ours, theirs, request.with_spp(spp))
            may_be_rounding = untraced or found.verdict in (EDGE, AMPLIFIED)
            if may_be_rounding and _has_coincident_surfaces(request):
                found = replace(found, verdict=COINCIDENT)
            if found.quantity == "face" and _has_twin_faces(request):
                found = replace(found, verdict=COINCIDENT)
        except NotReplayable as error:
            return Judgement(REFUSED, str(error), "NotReplayable")
        except (MitsubaCrashed, MitsubaTimeout) as error:
            return Judgement(STOPPED, str(error), type(error).__name__)
        except (MitsubaError, SceneError) as error:
            return Judgement(STOPPED, _without(error, path), type(error).__name__)
        except Exception as error:  # a fault of ours: it is what is looked for
            return Judgement(STOPPED, f"{error!r}"[:400], type(error).__name__)
        with np.errstate(over="ignore", invalid="ignore"):
            return replace(found, brightness=float(theirs.mean(dtype=np.float64)))

    def _untraced(
        self, found: Judgement, ours: Picture, theirs: Picture, request: RenderRequest
    ) -> Judgement:
        """Return the class of a scene whose paths cannot be traced, by changes of it.

        Rounding explains a pixel that they change as much as it differs, and one that most
        of them make equal: a wrong formula stays wrong.
        """
        path = Path(request.path)
        change, equal = np.zeros(ours.shape[:2]), np.zeros(ours.shape[:2])
        differs = relative_difference(ours, theirs)
        limit = np.where(differs > TOLERANCE, TOLERANCE, ROUNDED)
        tried = 0
        for root in changed_scenes(ElementTree.parse(path).getroot()):
            changed = path.with_name("changed.xml")
            changed.write_text(scene_text(root), encoding="utf-8")
            moved = replace(request, path=str(changed), box_filter=True, replay=True)
            try:
                again = self._render_ours(moved).pixels
                reference = self._references.get(moved, read_scene(moved).files)
            except (MitsubaError, SceneError):  # a number was the largest that there may be
                continue
            change = np.fmax(change, relative_difference(again, ours))
            equal += relative_difference(again, reference.pixels) <= limit
            tried += 1
        explained = (change > TOLERANCE) | (differs <= ROUNDED + change)
        explained |= equal > tried / 2
        if explained.all():
            return replace(found, verdict=EDGE if differs.max() > TOLERANCE else AMPLIFIED)
        left = np.where(explained, 0.0, differs)
        y, x = (int(k) for k in np.unravel_index(left.argmax(), left.shape))
        words = f"; changes of about a rounding do not explain {np.count_nonzero(left)}"
        error = float(left[y, x])
        return replace(found, sentence=found.sentence + words, pixel=(x, y), error=error)


def _without_faults(
    scene: DrawnScene, found: Judgement
) -> Iterator[tuple[KnownFault, DrawnScene]]:
    """Yield faults that may explain a difference, each with the scene without it."""
    for fault in KNOWN_FAULTS:
        if fault.explains(found.quantity, found.error):
            undone = scene._replace(root=copy.deepcopy(scene.root))
            fault.undo(undone.root)
            yield fault, undone


def _without(error: Exception, path: Path) -> str:
    """Return a message without the folder, which differs from run to run."""
    return str(error).replace(f"{path.parent}/", "")[:400]


Picture = NDArray[np.float32]


def _class_of(result: ReplayResult, ours: Picture, theirs: Picture) -> Judgement:
    sentence = result.sentence
    if result.verdict == "not-finite":
        both = ~np.isfinite(ours) & ~np.isfinite(theirs)
        if both.any() and np.allclose(
            np.where(both, 0.0, ours), np.where(both, 0.0, theirs), rtol=1e-3, atol=1e-6
        ):
            return Judgement(AGREE, "the same values are not finite in both", NOT_FINITE)
        y, x = (int(k) for k in np.argwhere(~np.isfinite(ours + theirs))[0][:2])
        quantity = NOT_FINITE if not np.isfinite(ours).all() else MITSUBA_NOT_FINITE
        return Judgement(UNKNOWN, sentence, quantity, (x, y))
    if result.partings:  # of a pixel that rounding does not explain
        first = result.partings[0]
        alike = all(other.quantity == first.quantity for other in result.partings)
        error = max(other.error or math.inf for other in result.partings)
        error = error if alike and error < math.inf else 0.0
        return Judgement(UNKNOWN, sentence, first.quantity, (first.x, first.y), error=error)
    if result.explained:
        # without a move of a ray, differences have grown from bounce to bounce
        return Judgement(EDGE if "by moves of" in sentence else AMPLIFIED, sentence)
    if result.verdict == "pass":
        return Judgement(AGREE, sentence)
    at = (result.listed[0].x, result.listed[0].y) if result.listed else None
    return Judgement(UNKNOWN, sentence, "picture", at)


def _has_coincident_surfaces(request: RenderRequest) -> bool:
    scene = build_scene(read_scene(request))
    return any(coincident_surfaces(scene, make_plan(scene)))


def _has_twin_faces(request: RenderRequest) -> bool:
    """Tell whether two faces of a mesh have the same corners: either may be hit."""
    for shape in read_scene(request).every_shape:
        if isinstance(shape, Mesh):
            corners = np.sort(shape.vertices[shape.faces].reshape(-1, 3, 3), axis=1)
            if len(np.unique(corners.reshape(-1, 9), axis=0)) < len(shape.faces):
                return True
    return False
