"""A scene file as Mitsuba reads it, with the few changes that a comparison needs.

Mitsuba's own parser reads the file; the changes are made on its parsed nodes before
anything is built, and each leaves a sentence that ends up in the report.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mitsuba_ref.reference.plugins.hair import take_hair_with_last_lobe
from mitsuba_ref.reference.plugins.known_faults import (
    LAST_LOBE,
    PIXELS_INSTEAD,
    RGB_INSTEAD,
    UNSAMPLED,
    VOLPATH,
    divide_lights_without_extent,
    give_spectra_colours,
    leave_lamps_to_bsdfs,
    take_volpath,
)
from mitsuba_ref.reference.user_plugins import register_user_plugins, twins_explained
from mitsuba_ref.reference.variant import VARIANT, load_mitsuba
from renderer.errors import SceneError
from renderer.replay.pixel_seeds import BLOCK_SIZE
from renderer.scene_file.document.named_files import check_named_files

BOX_INSTEAD = "reconstruction filter replaced by box"
PATH_INSTEAD = (
    "path, since the file names no integrator, without which Mitsuba does not render"
)
AROUND_INTEGRATORS = ("aov", "moment")
OURS_ALONE = ("implicit",)  # shapes that Mitsuba lacks


@dataclass(frozen=True, eq=False)
class EditedScene:
    """A scene that Mitsuba has built."""

    scene: Any  # mitsuba.Scene
    integrator: str  # the plugin that the file names
    changes: tuple[str, ...]  # what is otherwise than the file says, a phrase each
    bump_maps: bool  # whether there are some


def load_edited_scene(
    path: Path,
    parameters: Mapping[str, str],
    *,
    box_filter: bool = False,
    pixel_centres: bool = False,
    keep_shapes_apart: bool = False,
    fixed_blocks: bool = False,
    independent_samples: bool = False,
    colors_alone: bool = False,
    unsampled_lamps: bool = False,
    volpath_since: str = "",
    last_lobe: bool = False,
    plugins: str | None = None,
) -> EditedScene:
    """Load `path` in Mitsuba with changes.

    Parameters
    ----------
    path
        Mitsuba 3 XML.
    parameters
        Values for the file's `$name`, as with `-D name=value`.
    box_filter
        Replace the film's reconstruction filter by `box`, so that pixels are independent.
    pixel_centres
        Replace the sampler by one sample in the middle of each pixel.
    keep_shapes_apart
        Do not merge meshes, so that shape and primitive indices are those of the file.
    fixed_blocks
        Cut the film into blocks of Mitsuba's usual size whatever the number of workers:
        which random numbers a pixel gets follows from them.
    independent_samples
        Replace the sampler by `independent`.
    colors_alone
        Replace `aov` and `moment` by the integrator whose colours they show.
    unsampled_lamps
        Leave lamps of meshes to the directions that BSDFs choose.
    volpath_since
        Take `volpath` in place of `volpathmis`, for this reason; empty: do not.
    last_lobe
        Sample the last lobe of `hair` in its place.
    plugins
        A Python file that registers plugins of the user's (`user_plugins`).
    """
    refuse_code(path, parameters)
    mi = load_mitsuba()
    if plugins is not None:
        register_user_plugins(plugins)
    config = mi.parser.ParserConfig(VARIANT)
    changes = ["film in float32", "Embree's robust intersections"]
    if keep_shapes_apart:
        config.merge_meshes = False
        config.merge_equivalent = False
        changes.append("shapes not merged")
    with files_beside(mi, path):
        state = mi.parser.parse_file(
            config, str(path), **{name: str(value) for name, value in parameters.items()}
        )
        # names of old files as they are called since: only then can they be replaced
        mi.parser.transform_upgrade(config, state)
        nodes = SceneNodes(mi, state)
        nodes.refuse(OURS_ALONE)
        if nodes.add_integrator():
            changes.append(PATH_INSTEAD)
        integrator = nodes.plugin("Integrator") or ""
        # The default, float16, would round our reference to three digits.
        nodes.set_film("component_format", "float32")
        if nodes.make_film_rgb():
            changes.append(PIXELS_INSTEAD)
        if give_spectra_colours(mi, state):
            changes.append(RGB_INSTEAD)
        # Without it rays slip through shared edges (Mitsuba issue 1149).
        state.root.props["embree_use_robust_intersections"] = True
        if box_filter and nodes.replace("ReconstructionFilter", "box", {}):
            changes.append(BOX_INSTEAD)
        if pixel_centres:
            nodes.replace("Sampler", "stratified", {"jitter": False, "sample_count": 1})
            changes.append("one sample at each pixel's centre")
        if independent_samples and nodes.replace("Sampler", "independent", {}):
            changes.append("sampler replaced by independent")
        if colors_alone and nodes.unwrap_integrator():
            changes.append("without AOVs and second moments")
        if unsampled_lamps:
            leave_lamps_to_bsdfs(mi, state)
            nodes.add_dark_light()  # of a single light Mitsuba samples all the same
            changes.append(UNSAMPLED)
        if volpath_since:
            take_volpath(mi, state)
            changes.append(f"{VOLPATH}{volpath_since}")
        if last_lobe:
            take_hair_with_last_lobe(state)
            changes.append(LAST_LOBE)
        if fixed_blocks:
            nodes.set_block_size(BLOCK_SIZE)
            changes.append(f"film in blocks of {BLOCK_SIZE}")
        mi.parser.transform_all(config, state)
        with twins_explained(plugins):
            scene = mi.parser.instantiate(config, state)
    if divided := divide_lights_without_extent(mi, scene):
        changes.append(divided)
    bump_maps = any(node.props.plugin_name() == "bumpmap" for node in state.nodes)
    return EditedScene(scene, integrator, tuple(changes), bump_maps)


def refuse_code(path: Path, parameters: Mapping[str, object]) -> None:
    """Refuse a scene that Mitsuba would take code from; before each of its readings.

    Which files it may read our reader has decided, or `with_the_other_side`.

    Raises
    ------
    RuntimeError
        As Mitsuba's own refusals are.
    """
    if not path.exists():
        return  # Mitsuba's own words
    try:
        check_named_files(path, parameters, ["/"])
    except SceneError as error:
        raise RuntimeError(f"was not run: {error}") from None


class SceneNodes:
    """The nodes of a parsed scene by kind; missing ones of some kinds are added.

    Nodes are kept as indices: Mitsuba's list moves its nodes when it grows, and a node
    held across an `append` points to freed memory.
    """

    def __init__(self, mi: Any, state: Any) -> None:
        self._mi = mi
        self._nodes = state.nodes
        sensor = self._find("Sensor")
        if sensor is None:
            raise RuntimeError("the scene has no sensor")
        film = self._find("Film")
        if film is None:
            film = self._add("Film", "hdrfilm", parent=sensor)
        self._film = film
        self._parents = {"ReconstructionFilter": film, "Sampler": sensor}

    def plugin(self, kind: str) -> str | None:
        """Return the plugin's name of the first node of `kind`."""
        index = self._find(kind)
        return None if index is None else self._plugin(index)

    def refuse(self, plugins: Collection[str]) -> None:
        """Say that Mitsuba lacks a plugin, in clearer words than its own."""
        for index in range(len(self._nodes)):
            if (name := self._plugin(index)) in plugins:
                raise RuntimeError(
                    f'the reference has no such shape: "{name}" is lightproof\'s own; '
                    "there is nothing to compare it with but its tests"
                )

    def set_film(self, name: str, value: Any) -> None:
        """Set one property of the film."""
        self._nodes[self._film].props[name] = value

    def make_film_rgb(self) -> bool:
        """Let the film have three colours if it has luminance or XYZ; tell whether."""
        film = self._nodes[self._film].props
        asked = film["pixel_format"] if "pixel_format" in film else "rgb"
        if str(asked).lower() in ("rgb", "rgba"):
            return False
        film["pixel_format"] = "rgb"
        return True

    def add_integrator(self) -> bool:
        """Add a path tracer, our default, to a scene without integrator; return whether."""
        if self._find("Integrator") is not None:
            return False
        self._add("Integrator", "path", parent=0)
        return True

    def add_dark_light(self) -> None:
        """Add a light that can be sampled, and gives nothing."""
        index = self._add("Emitter", "point", parent=0)
        self._nodes[index].props["intensity"] = 0.0

    def unwrap_integrator(self) -> bool:
        """Leave out what stands around the colours' integrator; tell whether."""
        first, *_ = around = self._find_all("Integrator")
        inside = [k for k in around if self._plugin(k) not in AROUND_INTEGRATORS]
        if not inside or inside[0] == first:
            return False
        self._nodes[first].props = self._nodes[inside[0]].props
        return True

    def set_block_size(self, size: int) -> None:
        """Set the block size of all integrators: those inside of others have their own."""
        for index in self._find_all("Integrator"):
            self._nodes[index].props["block_size"] = size

    def replace(self, kind: str, plugin: str, values: Mapping[str, Any]) -> bool:
        """Make the node of `kind` a `plugin` with `values`; False if it is one already."""
        index = self._find(kind)
        if index is None:
            index = self._add(kind, plugin, parent=self._parents[kind])
        elif self._plugin(index) == plugin and not values:
            return False
        properties = self._properties(plugin)
        for name, value in values.items():
            properties[name] = value
        self._nodes[index].props = properties
        return True

    def _plugin(self, index: int) -> str:
        return str(self._nodes[index].props.plugin_name())

    def _find_all(self, kind: str) -> list[int]:
        wanted = getattr(self._mi.ObjectType, kind)
        return [i for i, node in enumerate(self._nodes) if node.type == wanted]

    def _find(self, kind: str) -> int | None:
        return next(iter(self._find_all(kind)), None)

    def _add(self, kind: str, plugin: str, *, parent: int) -> int:
        index = len(self._nodes)
        link = self._mi.Properties.ResolvedReference(index)
        self._nodes[parent].props[f"lightproof_{kind}"] = link
        node = self._mi.parser.SceneNode()
        node.type = getattr(self._mi.ObjectType, kind)
        node.props = self._properties(plugin)
        self._nodes.append(node)
        return index

    def _properties(self, plugin: str) -> Any:
        properties = self._mi.Properties()
        properties.set_plugin_name(plugin)
        return properties


@contextmanager
def files_beside(mi: Any, path: Path) -> Iterator[None]:
    """Let Mitsuba find the files that a scene names, as its `load_file` does."""
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.prepend(str(path.parent))
    mi.set_file_resolver(resolver)
    try:
        yield
    finally:
        mi.set_file_resolver(before)
