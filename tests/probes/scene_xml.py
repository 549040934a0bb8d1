"""Properties of a scene file's elements, for tests that write many of them."""

from __future__ import annotations

from typing import Any

TAGS = {bool: "boolean", int: "integer", float: "float", str: "string"}


def props(**values: bool | int | float | str) -> str:
    """Return properties by the types of their values: `radius=2.0` becomes a <float>."""
    found = []
    for name, value in values.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        found.append(tag(TAGS[type(value)], **{name: text}))
    return "".join(found)


def tag(kind: str, **values: str) -> str:
    """Return elements of one kind: `tag("rgb", reflectance="1 0 0")`."""
    return "".join(
        f'<{kind} name="{name}" value="{value}"/>' for name, value in values.items()
    )


def element(
    tag: str, plugin: str, *inside: str, name: str = "", id: str = "", **values: Any
) -> str:
    """Return an element: `element("rfilter", "gaussian", stddev=0.4)`."""
    attributes = "".join(
        f' {key}="{value}"' for key, value in (("name", name), ("id", id)) if value
    )
    content = props(**values) + "".join(inside)
    return f'<{tag} type="{plugin}"{attributes}>{content}</{tag}>'


def to_world(steps: str) -> str:
    return f'<transform name="to_world">{steps}</transform>'


def to_uv(steps: str) -> str:
    return f'<transform name="to_uv">{steps}</transform>'
