"""All kinds of BSDF: one line makes a kind known to the reader, the plan and the stages."""

from __future__ import annotations

from renderer.bsdfs.conductor import CONDUCTOR
from renderer.bsdfs.dielectric import DIELECTRIC
from renderer.bsdfs.diffuse import DIFFUSE
from renderer.bsdfs.kind import BsdfKind, make_known

BSDFS: dict[str, BsdfKind] = {}


def register(kind: BsdfKind) -> None:
    """Make a kind of BSDF known; one of the same name is replaced."""
    make_known(kind)
    BSDFS[kind.name] = kind


for _kind in (DIFFUSE, CONDUCTOR, DIELECTRIC):
    register(_kind)
