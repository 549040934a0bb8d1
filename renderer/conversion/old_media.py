"""Participating media of Mitsuba 0.4 to 0.6 as those of Mitsuba 3.

Media had coefficients of scattering and absorption and have extinction and albedo now. A
grid lay in the box that its file gives, and lies in [0, 1]^3 now unless it is told to. A
boundary without a BSDF let light pass, and is diffuse now.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from renderer.conversion.upgrade_record import APPROXIMATED, UpgradeRecord
from renderer.conversion.xml_edits import Node
from renderer.errors import SceneError
from renderer.scene_file.description import NOWHERE
from renderer.scene_file.document.xml_tree import current_name
from renderer.scene_file.numbers import parse_floats

# Of the preset "skin1": what the one of the two is that a file leaves out [1 / length].
_ABSENT = {"sigma_s": (74.0, 88.0, 101.0), "sigma_a": (3.2, 17.0, 48.0)}
_GRID = "its numbers are in the middles of cells now, not at their corners"
_BOUNDARY = ("interior", "exterior")

Numbers = tuple[float, ...]


def upgrade_medium(record: UpgradeRecord, node: Node) -> list[Node]:
    """Give a medium extinction and albedo; return the children that are done with."""
    named = {
        current_name("", child.attributes.get("name", "")): child for child in node.children
    }
    for name in ("material", "g"):
        if name in named:
            why = "give the sigma_t and albedo that follow from it"
            record.leave(node, record.document.source(named[name]), why)
            return []
    pair = [named[name] for name in _ABSENT if name in named]
    done = pair or [named[name] for name in ("sigma_t",) if name in named]
    if not done or done[0].tag == "volume":
        return []
    try:
        if pair:
            scattering, absorption = (
                _numbers(named[name]) if name in named else absent
                for name, absent in _ABSENT.items()
            )
            lines = _extinction_and_albedo(scattering, absorption)
        else:
            extinction = _numbers(done[0])
            if done[0].tag == "float" or max(extinction) <= 1.0:
                return []  # its name alone has changed
            lines = _extinction(extinction)
    except (SceneError, ValueError) as error:
        record.leave(node, record.document.source(done[0]), str(error))
        return []
    before = " ".join(record.document.source(child) for child in done)
    record.document.replace(done[0], lines)
    for child in done[1:]:
        record.document.remove(child)
    record.change(done[0], before, " ".join(line.strip() for line in lines))
    return done


def _numbers(node: Node) -> Numbers:
    text = node.attributes.get("value", "")
    if "$" in text or ":" in text:
        what = "a parameter" if "$" in text else "a list over wavelengths"
        raise ValueError(f"its value is {what}; expected three numbers")
    numbers = parse_floats(text, (1, 3), NOWHERE, "the value")
    return numbers * 3 if len(numbers) == 1 else numbers


def _extinction_and_albedo(scattering: Numbers, absorption: Numbers) -> list[str]:
    extinction = tuple(s + a for s, a in zip(scattering, absorption, strict=True))
    albedo = (
        s / total if total > 0.0 else 0.0
        for s, total in zip(scattering, extinction, strict=True)
    )
    return [*_extinction(extinction), f'<rgb name="albedo" value="{_text(albedo)}"/>']


def _extinction(numbers: Numbers) -> list[str]:
    """Return the lines of sigma_t; a colour above 1 is possible in a volume alone."""
    return [
        '<volume name="sigma_t" type="constvolume">',
        f'\t<rgb name="value" value="{_text(numbers)}"/>',
        "</volume>",
    ]


def _text(numbers: Iterable[float]) -> str:
    return ", ".join(f"{number:.6g}" for number in numbers)


def place_grid(record: UpgradeRecord, node: Node) -> None:
    """Put a grid into the box of its file."""
    names = {child.attributes.get("name") for child in node.children}
    if names & {"min", "max"}:
        why = "place the grid by to_world, which acts on [0, 1]^3"
        record.leave(node, "min and max of a grid", why)
        return
    line = '<boolean name="use_grid_bbox" value="true"/>'
    record.document.insert(node, [line])
    record.add(node, APPROXIMATED, 'volume "gridvolume"', line, _GRID)


def open_boundary(record: UpgradeRecord, node: Node, tags: Mapping[str, str]) -> None:
    """Give a shape that is a boundary and has no BSDF one that lets light pass.

    Parameters
    ----------
    tags
        Of the elements of the file, by their ids.
    """
    inside, boundary = set(), False
    for child in node.children:
        if child.attributes.get("name") in _BOUNDARY:
            boundary = True
        elif child.tag == "ref":  # one to another file may be to a BSDF
            inside.add(tags.get(child.attributes.get("id", ""), "bsdf"))
        else:
            inside.add(child.tag)
    if boundary and not inside & {"bsdf", "emitter", "sensor", "subsurface"}:
        line = '<bsdf type="null"/>'
        record.document.insert(node, [line])
        record.change(node, "a boundary of media without a BSDF", line)
