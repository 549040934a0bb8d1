"""What was drawn so far: plugins, their properties, and pairs of both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations
from xml.etree.ElementTree import Element


def plugins_of(root: Element) -> list[str]:
    """Return "tag plugin" of each plugin of a scene, sorted, each once."""
    return sorted({_key(e) for e in root.iter() if "type" in e.attrib})


def features_of(root: Element) -> Iterator[str]:
    """Yield what a scene has: plugins, "tag plugin.property", and pairs with " + "."""
    plugins = plugins_of(root)
    yield from plugins
    yield from (pair(a, b) for a, b in combinations(plugins, 2))
    for element in root.iter():
        if "type" not in element.attrib:
            continue
        names = sorted({child.get("name", child.tag) for child in element})
        properties = [f"{_key(element)}.{name}" for name in names]
        yield from properties
        yield from (pair(a, b) for a, b in combinations(properties, 2))


def pair(a: str, b: str) -> str:
    """Return the name of two features in one scene, or in one element."""
    return " + ".join(sorted((a, b)))


def _key(element: Element) -> str:
    tag = "texture" if element.tag == "spectrum" else element.tag
    return f"{tag} {element.get('type')}"


class Coverage:
    """Counts features of scenes, and says how much a further one of each is wanted."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    def add(self, root: Element) -> None:
        """Count the features of a scene."""
        self.counts.update(set(features_of(root)))

    def weight(self, feature: str, present: Sequence[str]) -> float:
        """Return the weight of a choice: the less it was drawn, the larger, up to 1.

        Parameters
        ----------
        feature
            "tag plugin".
        present
            Those that the scene has already: pairs with them count as much as it alone.
        """
        pairs = sum(self.counts[pair(feature, other)] for other in present)
        return 1.0 / (1.0 + self.counts[feature] + pairs / max(1, len(present)))

    def share(self, feature: str) -> float:
        """Return the probability with which a property that may be absent is given."""
        return 0.2 + 0.6 / (1.0 + self.counts[feature])

    @property
    def sentence(self) -> str:
        """How much was drawn, in one line."""
        pairs = [feature for feature in self.counts if " + " in feature]
        single = [feature for feature in self.counts if " + " not in feature]
        properties = sum("." in feature for feature in single)
        return (
            f"drawn: {len(single) - properties} plugins, {properties} properties, "
            f"{len(pairs)} pairs"
        )
