"""Scenes of Mitsuba 0.4 to 0.6 as those of Mitsuba 3: names, values, and what has no heir.

Property names follow the rule of Mitsuba 3's own reader (`xml_tree.current_name`). The
tables of `old_plugins` have what that rule does not cover.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from renderer.conversion.old_media import open_boundary, place_grid, upgrade_medium
from renderer.conversion.old_plugins import (
    BLENDED,
    HINTS,
    KEPT,
    NO_HEIR,
    PLUGINS,
    RENAMED,
    SUN_AND_SKY,
    UPRIGHT,
    UPRIGHT_BY_COMPASS,
    UV,
    VALUES,
)
from renderer.conversion.upgrade_record import (
    CHANGED,
    DROPPED,
    Change,
    UpgradeRecord,
)
from renderer.conversion.xml_edits import EditedXml, Node
from renderer.errors import SceneError
from renderer.scene_file.description import Location
from renderer.scene_file.document.xml_elements import parse_xml
from renderer.scene_file.document.xml_tree import current_name
from renderer.scene_file.numbers import parse_floats, split_list
from renderer.scene_file.plugins import TAGS, supported_plugins

VERSION = "3.0.0"
OLDEST = (0, 4)  # before it cameras looked the other way


def upgraded(path: Path) -> tuple[bytes, list[Change]]:
    """Return the text of a scene as Mitsuba 3 takes it, and what was changed in it.

    Parameters
    ----------
    path
        A scene, or a file that a scene includes, of Mitsuba 0.4 to 0.6.

    Returns
    -------
    The file's bytes in its own encoding, and the changes in the order of its lines.

    Raises
    ------
    SceneError
        If it cannot be read, is no XML, or has another version.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror}") from None
    parse_xml(content, str(path))  # says what is wrong with it
    for encoding in ("utf-8", "latin-1"):
        try:
            document = EditedXml(content.decode(encoding))
            break
        except UnicodeDecodeError:
            continue
    upgrade = _Upgrade(document, str(path))
    upgrade.run()
    changes = sorted(upgrade.changes, key=lambda change: change.line)
    return document.result().encode(encoding), changes


class _Upgrade(UpgradeRecord):
    """One document on its way."""

    def __init__(self, document: EditedXml, source: str) -> None:
        super().__init__(document, source)
        self._skies = 0  # suns and skies so far
        self._tags: dict[str, str] = {}  # of the elements that have an id, by it
        self._has_media = False
        for node in _every_node(document.root):
            self._has_media |= node.tag == "medium"
            if "id" in node.attributes and node.tag in TAGS:
                self._tags[node.attributes["id"]] = node.tag

    def run(self) -> None:
        root = self.document.root
        text = root.attributes.get("version", "")
        found = re.fullmatch(r"\s*(\d+)\.(\d+)\.\d+\s*", text)
        version = (int(found[1]), int(found[2])) if found else None
        if version is None or not OLDEST <= version < (2, 0):
            said = f"version {text}" if text else "no version"
            new = version is not None and version >= (2, 0)
            reason = "is read as it is" if new else "cannot be upgraded"
            raise SceneError(
                f"{self.source}:{root.line}: <{root.tag}> is of {said}, which {reason}; "
                "possible are 0.4.0 to 0.6.0"
            )
        self.set_value(root, "version", VERSION)
        self._object(root)

    # ------------------------------------------------------------------ elements

    def _object(self, node: Node) -> None:
        """Upgrade a plugin with all that is in it."""
        plugin = node.attributes.get("type", node.tag)
        new, difference = PLUGINS.get((node.tag, plugin), (plugin, ""))
        if (new, self._has_media) == ("path", True) and plugin != new:
            new = "volpath"
        kept = KEPT.get(node.tag) if new != plugin and difference else None
        gone: list[Node] = []  # children that are replaced or dropped here
        if plugin == "vertexcolors":
            self._vertex_colors(node)
            return
        weights = self._two_weights(node) if plugin in BLENDED else None
        if weights is not None:
            new, gone = BLENDED[plugin], [weights]
            self.set_value(node, "type", new)
        elif new != plugin:
            self.set_value(node, "type", new, difference)
        elif node.tag in TAGS and "$" not in plugin and node.tag != "scene":
            if plugin not in supported_plugins(node.tag):
                why = HINTS.get(plugin, HINTS.get(node.tag, "lightproof has none"))
                if node.tag == "integrator" and self._has_media:
                    why = why.replace(" path ", " volpath ")
                self.leave(node, f'{node.tag} "{plugin}"', why)
        if node.tag == "emitter" and plugin in SUN_AND_SKY:
            gone += self._sun_and_sky(node, plugin)
        elif node.tag == "medium":
            gone += upgrade_medium(self, node)
        elif plugin == "gridvolume":
            place_grid(self, node)
        elif node.tag == "shape":
            open_boundary(self, node, self._tags)
        uv = [child for child in node.children if child.attributes.get("name") in UV]
        self._uv_transform(uv)
        modes = [c for c in node.children if c.attributes.get("name", "")[:8] == "wrapMode"]
        if len(modes) == 2:
            self.drop(modes[1], "one mode for u and v")
        gone += [*uv, *modes[1:]]
        for child in node.children:
            if child not in gone:
                self._child(child, node.tag, new, kept)

    def _child(self, node: Node, tag: str, plugin: str, kept: set[str] | None) -> None:
        """Upgrade what is in a plugin: a property, or another plugin."""
        if node.tag == "include":
            file = node.attributes.get("filename", "")
            self.leave(node, f"include {file}", f"lightproof upgrade {file}")
            return
        if node.tag in ("default", "alias", "path"):
            return
        if node.tag in ("animation", "subsurface"):
            self.leave(node, f"<{node.tag}>", HINTS[node.tag])
            return
        old = node.attributes.get("name")
        if old is not None:
            name = current_name(plugin, old)
            name = RENAMED.get((tag, name), name)
            name = "wrap_mode" if name in ("wrap_mode_u", "wrap_mode_v") else name
            why = NO_HEIR.get((tag, name), "")
            if kept is not None and name not in kept:
                why = f'of the plugin that "{plugin}" replaces'
            if why:
                self.drop(node, why)
                return
            if plugin == "bitmap" and name == "gamma":
                self._gamma(node)
                return
            if name != old:
                self.set_value(node, "name", name)
            self._value(node, tag, name)
        special = _SPECIAL.get(node.tag)
        if special is not None:
            special(self, node)
        elif node.tag in TAGS and "type" in node.attributes:
            self._object(node)

    def _value(self, node: Node, tag: str, name: str) -> None:
        old = node.attributes.get("value", "")
        table = VALUES.get((tag, name), {})
        if old.lower() in table:
            new, difference = table[old.lower()]
            self.set_value(node, "value", new, difference)

    # -------------------------------------------------------- elements of their own kind

    def _transform(self, node: Node) -> None:
        for step in node.children:
            if step.tag == "lookAt":
                self.document.set_tag(step, "lookat")
                self.change(step, "<lookAt>", "<lookat>")

    def _srgb(self, node: Node) -> None:
        """Decode a colour of sRGB; <rgb> is linear."""
        text = node.attributes.get("value", "")
        if "$" in text:
            self.leave(node, f'<srgb value="{text}">', "its value is a parameter")
            return
        if re.fullmatch(r"\s*#[0-9a-fA-F]{6}\s*", text):
            digits = text.strip()[1:]
            encoded = [int(digits[at : at + 2], 16) / 255.0 for at in (0, 2, 4)]
        else:
            location = Location(self.source, node.line)
            encoded = list(parse_floats(text, (1, 3), location, "the srgb value"))
        linear = [
            v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in encoded
        ]
        value = " ".join(f"{v:.6g}" for v in linear)
        self.document.set_tag(node, "rgb")
        self.document.set_value(node, "value", value)
        self.change(node, f'<srgb value="{text}">', f'<rgb value="{value}">')

    def _spectrum(self, node: Node) -> None:
        self._intent(node)
        text = node.attributes.get("value", "")
        if ":" not in text and len(split_list(text)) == 3:
            # of the three bands that Mitsuba 0.6 has unless it is compiled otherwise
            self.document.set_tag(node, "rgb")
            self.change(node, f'<spectrum value="{text}">', f'<rgb value="{text}">')

    def _intent(self, node: Node) -> None:
        if "intent" in node.attributes:
            self.document.remove_attribute(node, "intent")
            self.add(node, DROPPED, "the attribute intent", "", "the property says it")

    def _blackbody(self, node: Node) -> None:
        """Turn the element into a plugin."""
        before = self.document.source(node)
        kelvin = node.attributes.get("temperature", "").strip().rstrip("Kk")
        name = current_name("", node.attributes.get("name", ""))
        lines = [
            f'<spectrum name="{name}" type="blackbody">',
            f'\t<float name="temperature" value="{kelvin}"/>',
            "</spectrum>",
        ]
        self.document.replace(node, lines)
        self.change(node, before, '<spectrum type="blackbody">')
        if (scale := node.attributes.get("scale", "1")) != "1":
            why = "scale the picture by it, or take an <rgb>"
            self.add(node, DROPPED, f"the blackbody's scale {scale}", "", why)

    def _vertex_colors(self, node: Node) -> None:
        before = self.document.source(node)
        others = "".join(
            f' {key}="{current_name("", value) if key == "name" else value}"'
            for key, value in node.attributes.items()
            if key != "type"
        )
        lines = [
            f'<texture type="mesh_attribute"{others}>',
            '\t<string name="name" value="vertex_color"/>',
            "</texture>",
        ]
        self.document.replace(node, lines)
        self.change(node, before, '<texture type="mesh_attribute">')

    def _two_weights(self, node: Node) -> Node | None:
        """Replace two weights that add up to 1 by the second one.

        Others are left, since a blend has no such sum.
        """
        weights = next(
            (c for c in node.children if c.attributes.get("name") == "weights"), None
        )
        if weights is None:
            return None
        text = weights.attributes.get("value", "")
        try:
            numbers = [float(word) for word in split_list(text)]
        except ValueError:  # a parameter
            return None
        if len(numbers) != 2 or abs(sum(numbers) - 1.0) > 1e-6:
            return None
        before = self.document.source(weights)
        after = f'<float name="weight" value="{split_list(text)[1]}"/>'
        self.document.replace(weights, [after])
        self.change(weights, before, after)
        return weights

    def _sun_and_sky(self, node: Node, plugin: str) -> list[Node]:
        """Set a sky upright whose y was up; return the children that are done with."""
        scaled, dark = SUN_AND_SKY[plugin]
        self._skies += 1
        if self._skies > 1:
            why = "a scene has one sunsky: give the first one its scale and parameters"
            self.leave(node, f'emitter "{plugin}"', why)
        named = {
            current_name(plugin, child.attributes.get("name", "")): child
            for child in node.children
        }
        done = []
        if scaled and "scale" in named:
            done.append(named["scale"])
            self.set_value(named["scale"], "name", scaled)
        directed = "sun_direction" in named
        step = UPRIGHT if directed else UPRIGHT_BY_COMPASS
        lines = [f'<float name="{dark}" value="0"/>'] if dark else []
        if "to_world" in named:
            self.document.insert(named["to_world"], [step])
            if directed:
                why = "it is in the world now, so apply to_world to it"
                self.leave(named["sun_direction"], "sunDirection", why)
        else:
            lines += ['<transform name="to_world">', f"\t{step}", "</transform>"]
        self.document.insert(node, lines)
        self.add(node, CHANGED, "y is up", f"z is up by {step}")
        return done

    def _gamma(self, node: Node) -> None:
        """Replace a gamma of 1, which says that texels are linear; drop any other one."""
        before = self.document.source(node)
        if node.attributes.get("value", "").strip() in ("1", "1.0"):
            self.document.replace(node, ['<boolean name="raw" value="true"/>'])
            self.change(node, before, '<boolean name="raw" value="true"/>')
        else:
            self.drop(node, "the file says how it is encoded")

    def _uv_transform(self, nodes: list[Node]) -> None:
        """Replace up to four numbers by a transform: first the scale, then the offset."""
        if not nodes:
            return
        values = {node.attributes["name"]: node.attributes.get("value") for node in nodes}
        u, v = values.get("uscale", "1"), values.get("vscale", "1")
        x, y = values.get("uoffset", "0"), values.get("voffset", "0")
        lines = ['<transform name="to_uv">', f'\t<scale x="{u}" y="{v}"/>']
        if {"uoffset", "voffset"} & values.keys():
            lines.append(f'\t<translate x="{x}" y="{y}"/>')
        self.document.replace(nodes[0], [*lines, "</transform>"])
        for node in nodes[1:]:
            self.document.remove(node)
        self.change(nodes[0], ", ".join(values), '<transform name="to_uv">')


_SPECIAL: dict[str, Callable[[_Upgrade, Node], None]] = {
    "transform": _Upgrade._transform,
    "srgb": _Upgrade._srgb,
    "spectrum": _Upgrade._spectrum,
    "rgb": _Upgrade._intent,
    "blackbody": _Upgrade._blackbody,
}


def _every_node(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from _every_node(child)
