"""Write gallery.md and every-plugin.md from the scenes and from what the reader requests.

`make docs` runs this file, and a test compares the pages. The parameters of a plugin are
those that its reader requests when it reads the files of scenes/ and tests/plugins.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))  # of this clone, whatever is installed

from renderer.scene_file import read_dict, read_file  # noqa: E402
from renderer.scene_file.objects import media, objects  # noqa: E402
from renderer.scene_file.plugins import supported_plugins  # noqa: E402
from renderer.scene_file.properties import Properties  # noqa: E402

DOCS = ROOT / "docs"
SCENES = sorted((ROOT / "scenes").glob("*/scene.xml"))
READ = [*SCENES, *sorted((ROOT / "tests" / "plugins").glob("*.xml"))]
READ.append(DOCS / "isosurfaces" / "scene.xml")
PLAIN = {"sensor": {"type": "perspective"}, "integrator": {"type": "path"}}
MORE: tuple[dict[str, Any], ...] = (  # plugins that none of these files names
    {"integrator": {"type": "depth"}},
    *(
        {"sensor": {"type": "perspective", "sampler": {"type": name}}}
        for name in ("multijitter", "orthogonal", "ldsampler")
    ),
)

Parameters = dict[str, tuple[str, str]]  # type and default, by the parameter's name
Requested = dict[tuple[str, str], Parameters]  # by tag and plugin
Scenes = dict[tuple[str, str], list[str]]  # of `scenes/` that have it

METHODS = {
    "number": "float",
    "integer": "integer",
    "boolean": "boolean",
    "string": "string",
    "vector": "point or vector",
    "choice": "string",
}
TRANSFORMS = ("transform", "uv_transform")
TEXTURES = {
    "read_texture": "colour or texture",
    "read_scalar_texture": "float or texture",
}
VOLUMES = {"_volume": "colour or volume"}
# types of what is read in another way
OTHERS = {
    "albedo": "colour",
    "color": "colour",
    "expression": "string",
    "ext_ior": "float or name of a material",
    "focal_length": "string",
    "function": "Python function",
    "grid": "array",
    "int_ior": "float or name of a material",
    "intensity": "colour",
    "irradiance": "colour",
    "radiance": "colour",
    "sun_direction": "vector",
    "to_world": "transform",
}
OF_TAGS = {  # where another tag's property has the same name
    ("phase", "weight"): "float, colour or volume",
    ("volume", "value"): "colour",
    ("volume", "data"): "array",
}
CONSTANTS: dict[str, Parameters] = {
    "rawconstant": {"value": ("float or three floats", "")},
    "srgb": {"color": ("colour", "")},
    "uniform": {"value": ("float", "")},
}
ANY_NAME = {"bumpmap": ("heights", "any")}  # the texture may have any name
MOST_SCENES = 4
DEPENDS = "depends on others"  # a default

# ---------------------------------------------------------------------------- gallery

GALLERY = """# Gallery

Every scene of the repository, rendered by lightproof (`python docs/draw_pictures.py`). Each
is also a test: the README of a scene says what it shows, and its `proof.toml` how close two
renderers must come on it. A scene is rendered by the name of its folder:

```sh
python -m renderer scenes/cornell-box -o cornell-box.png
```

## Scenes

{scenes}
## A shape of our own

### isosurfaces

![isosurfaces](pictures/isosurfaces.jpg)

A torus, a heart and a gyroid in a ball, each an expression g(x, y, z) = 0 in the file.
[Scene file](isosurfaces/scene.xml), [more about it](isosurfaces/README.md).
"""


def gallery() -> str:
    """Return the page with a picture and a sentence for each scene."""
    return GALLERY.format(scenes="\n".join(map(shown_scene, SCENES)))


def shown_scene(path: Path) -> str:
    """Return the section of one scene."""
    name = path.parent.name
    proof = tomllib.loads((path.parent / "proof.toml").read_text(encoding="utf-8"))
    return (
        f"### {name}\n\n![{name}](pictures/{name}.jpg)\n\n{proof['shows']}\n"
        f"[Scene file](../scenes/{name}/scene.xml), "
        f"[more about it](../scenes/{name}/README.md).\n"
    )


# ---------------------------------------------------------------------------- plugins

EVERY_PLUGIN = """# Every plugin

The plugins of scene files, with their parameters, types and defaults. A parameter of the
type "colour or texture" takes a colour, a spectrum or any texture. [Every plugin compared
with Mitsuba](plugins.md) has the numbers of each: how far its paths are from Mitsuba's, and
how much light each material keeps. Each file of `tests/plugins` shows a plugin with all of
its parameters.

{sections}"""
SECTIONS = {
    "bsdf": "Materials",
    "texture": "Textures",
    "shape": "Shapes",
    "emitter": "Lights",
    "medium": "Participating media",
    "phase": "Phase functions",
    "volume": "Volumes",
    "sensor": "Sensors",
    "film": "Films",
    "sampler": "Samplers",
    "integrator": "Integrators",
}


def every_plugin() -> str:
    """Return the page of all plugins."""
    requested, scenes = requested_parameters()
    sections = []
    for tag, title in SECTIONS.items():
        sections.append(f"## {title}\n")
        for plugin in supported_plugins(tag):
            found = requested.get((tag, plugin), CONSTANTS.get(plugin, {}))
            left_out = ANY_NAME.get(plugin, ())
            found = {name: row for name, row in found.items() if name not in left_out}
            seen = scenes.get((tag, plugin), [])
            sections.append(shown_plugin(tag, plugin, found, seen))
    return EVERY_PLUGIN.format(sections="\n".join(sections))


def shown_plugin(tag: str, plugin: str, parameters: Parameters, scenes: list[str]) -> str:
    """Return the section of one plugin: picture, parameters, proof, scenes."""
    lines = [f"### {plugin}", ""]
    if (DOCS / "pictures" / f"{tag}-{plugin}.jpg").exists():
        lines += [f"![{plugin}](pictures/{tag}-{plugin}.jpg)", ""]
    lines += [*_table(parameters), ""]
    proof = ROOT / "tests" / "plugins" / f"{plugin}.xml"
    where = []
    if proof.exists():
        where.append(f"Proved with [{plugin}.xml](../tests/plugins/{plugin}.xml).")
    if scenes:
        named = ", ".join(f"[{name}](gallery.md#{name})" for name in scenes[:MOST_SCENES])
        where.append(f"Seen in {named}.")
    if where:
        lines += [" ".join(where), ""]
    return "\n".join(lines)


def _table(parameters: Parameters) -> Iterator[str]:
    if not parameters:
        yield "No parameters."
        return
    yield "| parameter | type | default |"
    yield "|---|---|---|"
    for name, (kind, default) in parameters.items():
        shown = f"nested `{name}`" if name.startswith("<") else f"`{name}`"
        yield f"| {shown} | {kind} | {default} |"


def requested_parameters() -> tuple[Requested, Scenes]:
    """Return what the readers of all plugins request in the files of `READ`, and where."""
    requested: Requested = {}
    scenes: Scenes = {}
    reading = ""  # the name of a scene of `scenes/`

    def note(properties: Properties, name: str, kind: str, default: object = None) -> None:
        element = properties.element
        found = requested.setdefault((element.tag, element.plugin), {})
        other = OF_TAGS.get((element.tag, name), OTHERS.get(name, ""))
        before = found.get(name, (other, ""))
        shown = "" if default is None else _shown(default)
        if kind == before[0] and shown != before[1]:
            shown = DEPENDS
        if len(kind) >= len(before[0]):  # "float or texture" says more than "float"
            found[name] = kind, shown
        else:
            found[name] = before

    def noted(method: Any, kind: str) -> Callable[..., Any]:
        def function(properties: Properties, name: str, *more: Any, **named: Any) -> Any:
            value = method(properties, name, *more, **named)
            default = more[0] if more else named.get("default")
            choices = more[1] if method.__name__ == "choice" and len(more) > 1 else ()
            words = ", ".join(f"`{choice}`" for choice in choices) or kind
            note(properties, name, words, default)
            return value

        return function

    finish = Properties.finish

    def finished(properties: Properties) -> None:
        for name in properties._asked:
            note(properties, name, "")
        element = properties.element
        seen = scenes.setdefault((element.tag, element.plugin), [])
        if reading and reading not in seen:
            seen.append(reading)
        finish(properties)

    for name, kind in METHODS.items():
        setattr(Properties, name, noted(getattr(Properties, name), kind))
    for name in TRANSFORMS:
        setattr(Properties, name, noted(getattr(Properties, name), "transform"))
    for module, functions in ((objects, TEXTURES), (media, VOLUMES)):
        for name, kind in functions.items():  # before plugins import them
            setattr(module, name, noted(getattr(module, name), kind))
    Properties.finish = finished  # type: ignore[method-assign]
    for path in READ:
        reading = path.parent.name if path in SCENES else ""
        read_file(path)
    reading = ""
    for plugins in MORE:
        read_dict({"type": "scene", **PLAIN, **plugins})
    return requested, scenes


def _shown(default: object) -> str:
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, float | int):
        return f"{default:g}"
    if isinstance(default, tuple):
        return ", ".join(map(_shown, default))
    return f"`{default}`" if default else ""


if __name__ == "__main__":
    (DOCS / "gallery.md").write_text(gallery(), encoding="utf-8")
    (DOCS / "every-plugin.md").write_text(every_plugin(), encoding="utf-8")
