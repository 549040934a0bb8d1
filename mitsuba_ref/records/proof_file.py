"""proof.toml: what a scene shows, at which size, and how close the pictures must be."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.errors import SceneError


@dataclass(frozen=True)
class Size:
    """How large and how long to render."""

    width: int
    height: int
    spp: int

    @property
    def parameters(self) -> dict[str, str]:
        """The values for the scene file's `$width`, `$height` and `$spp`."""
        return {"width": str(self.width), "height": str(self.height), "spp": str(self.spp)}


@dataclass(frozen=True)
class ReplayLimits:
    """How far a replay may be off; the defaults are for all scenes without a reason."""

    divergent: float = 1e-3  # share of the pixels that may diverge
    rmse: float = 1e-5  # of the others, relative to the picture's mean
    reason: str = "default"


USUAL_LIMITS = ReplayLimits()


@dataclass(frozen=True)
class Proof:
    """The checked content of a proof.toml; the defaults are for a scene without one."""

    title: str = ""
    shows: str = ""
    deterministic: bool | None = None  # None: find out from Mitsuba's pictures
    demo: Size | None = None  # None: as the scene file says
    test: Size | None = None
    rmse_factor: float | None = None  # None: the default of `compare`
    reason: str = "default"
    replay: ReplayLimits = USUAL_LIMITS

    def size(self, name: str) -> Size | None:
        """Return the size called "demo" or "test"."""
        return self.demo if name == "demo" else self.test


def read_proof(scene: Path) -> Proof:
    """Read the proof.toml beside a scene file; without one, return the defaults.

    Raises
    ------
    SceneError
        One line that names the file, the key and what is possible.
    """
    path = scene.parent / "proof.toml"
    if not path.is_file():
        return Proof()
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SceneError(f"{path}: not a readable TOML file: {error}") from None
    table = _Table(data, str(path))
    tolerance = table.table("tolerance", required=False)
    proof = Proof(
        title=table.get("title", str, None),
        shows=table.get("shows", str, None),
        deterministic=table.get("deterministic", bool, False),
        demo=_size(table.table("demo")),
        test=_size(table.table("test")),
        rmse_factor=_factor(tolerance),
        # A tolerance without a reason is one that was tuned until the light went green.
        reason=tolerance.get("reason", str, None if tolerance.data else "default"),
        replay=_replay_limits(table.table("replay", required=False)),
    )
    tolerance.refuse_others()
    table.refuse_others()
    return proof


class _Table:
    """A TOML table that knows which of its keys were asked for."""

    def __init__(self, data: dict[str, Any], where: str) -> None:
        self.data = data
        self.where = where
        self.known: list[str] = []

    def get(self, key: str, kind: Any, default: Any) -> Any:
        """Return a value of the right type; a default of None means: it must be there."""
        self.known.append(key)
        value = self.data.get(key, default)
        if value is None:
            raise SceneError(f"{self.where}: {key} is missing")
        # True is an int for Python, but no width.
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            names = [k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,))]
            expected = " or ".join(names)
            raise SceneError(f"{self.where}: {key} = {value!r}; expected {expected}")
        return value

    def table(self, key: str, *, required: bool = True) -> _Table:
        """Return a nested table; without it, an empty one unless it is required."""
        return _Table(
            self.get(key, dict, None if required else {}), f"{self.where} [{key}]"
        )

    def refuse_others(self) -> None:
        """Refuse keys that nobody asked for: a typing error must not become a default."""
        for key in self.data:
            if key not in self.known:
                known = ", ".join(self.known)
                raise SceneError(f"{self.where}: unknown key {key!r}; known: {known}")


def _factor(tolerance: _Table) -> float | None:
    if not tolerance.data:
        return None
    factor = float(tolerance.get("rmse_factor", (int, float), None))
    if not factor >= 1.0:
        raise SceneError(f"{tolerance.where}: rmse_factor = {factor:g}; it is 1 or more")
    return factor


def _replay_limits(table: _Table) -> ReplayLimits:
    """Read the table [replay], which wider limits need together with a reason."""
    if not table.data:
        return USUAL_LIMITS
    limits = ReplayLimits(
        divergent=float(table.get("divergent", (int, float), ReplayLimits.divergent)),
        rmse=float(table.get("rmse", (int, float), ReplayLimits.rmse)),
        reason=table.get("reason", str, None),
    )
    for key in ("divergent", "rmse"):
        if not 0.0 <= getattr(limits, key) <= 0.1:
            value = getattr(limits, key)
            raise SceneError(f"{table.where}: {key} = {value:g}; it is 0 to 0.1")
    table.refuse_others()
    return limits


def _size(table: _Table) -> Size:
    values = {key: table.get(key, int, None) for key in ("width", "height", "spp")}
    for key, value in values.items():
        if value < 1:
            raise SceneError(f"{table.where}: {key} = {value}; it is 1 or more")
    table.refuse_others()
    return Size(**values)
