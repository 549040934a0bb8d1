"""proof.toml: what a scene shows, at which size, and how close the pictures must be."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from renderer.errors import SceneError

Count = Annotated[int, Meta(ge=1)]
Share = Annotated[float, Meta(ge=0.0, le=0.1)]


class Size(Struct, frozen=True, forbid_unknown_fields=True):
    """How large and how long to render."""

    width: Count
    height: Count
    spp: Count

    @property
    def parameters(self) -> dict[str, str]:
        """The values for the scene file's `$width`, `$height` and `$spp`."""
        return {"width": str(self.width), "height": str(self.height), "spp": str(self.spp)}


class Tolerance(Struct, frozen=True, forbid_unknown_fields=True):
    """A limit other than the default."""

    rmse_factor: Annotated[float, Meta(ge=1.0)]
    # A tolerance without a reason is one that was tuned until the light went green.
    reason: str


class ReplayLimits(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How far a replay may be off; the defaults are for all scenes without a reason."""

    divergent: Share = 1e-3  # share of the pixels that may diverge
    rmse: Share = 1e-5  # of the others, relative to the picture's mean
    # Of so many pixels beyond a limit the causes are looked at, and if rounding explains
    # them all the scene passes. 0: a limit is a limit.
    traced: Annotated[int, Meta(ge=0, le=1000)] = 0
    reason: str


USUAL_LIMITS = ReplayLimits(reason="default")


class Proof(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The checked content of a proof.toml."""

    title: str
    shows: str
    deterministic: bool | None = False  # None: find out from Mitsuba's pictures
    demo: Size | None  # None: as the scene file says
    test: Size | None
    tolerance: Tolerance | None = None  # None: the default of `compare`
    replay: ReplayLimits = USUAL_LIMITS

    @property
    def rmse_factor(self) -> float | None:
        """How many times its floor the RMSE may be; None: the default of `compare`."""
        return self.tolerance.rmse_factor if self.tolerance else None

    @property
    def reason(self) -> str:
        """Why that much is right."""
        return self.tolerance.reason if self.tolerance else "default"

    def size(self, name: str) -> Size | None:
        """Return the size called "demo" or "test"."""
        return self.demo if name == "demo" else self.test


NO_PROOF = Proof(
    title="",
    shows="",
    deterministic=None,
    demo=None,
    test=None,
    replay=ReplayLimits(traced=16, reason="the scene has no limits in a proof.toml"),
)
"""For a scene without a proof.toml: the scene file decides."""

TABLES: dict[str, type[Struct]] = {
    "demo": Size,
    "test": Size,
    "tolerance": Tolerance,
    "replay": ReplayLimits,
}


def read_proof(scene: Path) -> Proof:
    """Read the proof.toml in the folder of a scene file; without one, return `NO_PROOF`.

    Raises
    ------
    SceneError
        One line that names the file, the key and what is possible.
    """
    path = scene.parent / "proof.toml"
    if not path.is_file():
        return NO_PROOF
    try:
        data = msgspec.toml.decode(path.read_bytes())
    except (OSError, UnicodeDecodeError, msgspec.DecodeError) as error:
        raise SceneError(f"{path}: not a readable TOML file: {error}") from None
    try:
        return msgspec.convert(data, Proof)
    except msgspec.ValidationError as error:
        raise SceneError(f"{path}: {_located(str(error), data)}") from None


def _located(message: str, data: dict[str, Any]) -> str:
    """Return "[table] key = value: expected ..." for msgspec's sentence."""
    what, _, place = message.partition(" - at `$.")
    *tables, last = place.rstrip("`").split(".")
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown or "missing" in what:  # of a whole table
        tables = [last] if last else []
        known = ", ".join(TABLES.get(last, Proof).__struct_fields__)
        what += f"; known: {known}" if unknown else ""
    else:
        value = data[tables[0]][last] if tables else data[last]
        what = f"{last} = {value!r}; {what}"
    return " ".join([*(f"[{table}]:" for table in tables), what])
