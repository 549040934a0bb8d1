"""Methods of BSDFs and of the textures that give their parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.first_hit import show_albedo, show_seen_albedo
from renderer.jit import Packed, record_type
from renderer.kinds.bsdfs.kind import BsdfKind, BsdfMethods
from renderer.kinds.textures.kind import TextureKind, TextureMethods
from renderer.kinds.textures.look_up import look_up_kind
from renderer.kinds.textures.registry import TEXTURES
from renderer.records.kernel_scene import Bsdfs, Settings
from renderer.rendering.planning.plan import Plan
from renderer.rendering.tables.methods import (
    FLOAT,
    INT,
    NOTHING,
    ROWS,
    MethodSpec,
    MethodTables,
    work_types,
)
from renderer.scene.materials import MaterialTables, texture_kind_of
from renderer.stages.direct_light import reflect_light
from renderer.stages.scatter import scatter_kind
from renderer.stages.split import split_glass, split_mirror


def bsdf_tables(
    tables: MethodTables,
    materials: MaterialTables,
    plan: Plan,
    settings: Settings,
    arithmetic: Any,
    lit: bool,
) -> Bsdfs:
    """Return the tables of all BSDFs; those that a plan does not follow have no methods.

    `lit`: lights are sampled at smooth ones.
    """
    kinds, textures = materials.kinds, materials.textures()
    kinds_of_textures = [texture_kind_of(texture) for texture in textures]
    texture_kinds = [kind for kind in TEXTURES.values() if kind in kinds_of_textures]
    methods = tables.table(
        [_row(tables, materials, k, plan, settings, arithmetic, lit) for k in kinds], 5
    )
    needed = [kind if methods[k, 0] else None for k, kind in enumerate(kinds)]
    place = {kind.name: k for k, kind in enumerate(kinds)}
    bsdfs = Bsdfs(
        methods,
        sum(kind.smooth for kind in kinds),
        np.array([place[b.plugin] for b in materials.bsdfs] or [-1], np.int32),
        materials.values(),
        np.array([kind.row_count for kind in kinds], np.int32),
        materials.look_ups(needed, texture_kinds),
        materials.texture_ids(),
        np.array([texture_kinds.index(k) for k in kinds_of_textures if k], np.int32),
        np.zeros((0, 2), np.int64),
    )
    if bsdfs.look_ups.size == 0:
        return bsdfs
    return bsdfs._replace(
        texture_methods=_texture_methods(tables, bsdfs, textures, texture_kinds)
    )


def _row(
    tables: MethodTables,
    materials: MaterialTables,
    kind: BsdfKind,
    plan: Plan,
    settings: Settings,
    arithmetic: Any,
    lit: bool,
) -> tuple[Packed, list[MethodSpec | None]]:
    """Return the record of one kind, and the methods that a plan needs of it."""
    work, given = work_types(), record_type(settings)
    group = (work.points, INT, INT)
    lights = (given, FLOAT, work.points, work.light_samples, INT, INT)
    reflect = (reflect_light, (*lights, work.shadow_rays, INT), INT)
    along = (given, INT, work.points, ROWS, INT, INT, work.rays, INT)
    split = split_glass if kind.transmission is not None else split_mirror
    shown = (work.points, INT, ROWS)

    goes_on = (kind.smooth and plan.follow) or (kind.delta and plan.mirrors)
    scatters = goes_on and plan.kind.scatters
    splits = kind.delta and plan.mirrors and plan.kind.splits
    shows = kind.albedo is not None and plan.kind.first_hit
    form = kind.form(materials.tables_of(kind))
    record = tables.pack(BsdfMethods(form, arithmetic), kind.source)
    return record, [
        reflect if kind.smooth and lit else None,
        (scatter_kind, along, INT) if scatters else None,
        (split, (given, *group, work.rays, INT), INT) if splits else None,
        (show_albedo, shown, NOTHING) if shows and not kind.seen_albedo else None,
        (show_seen_albedo, shown, NOTHING) if shows and kind.seen_albedo else None,
    ]


def _texture_methods(
    tables: MethodTables, bsdfs: Bsdfs, textures: list[Any], kinds: list[TextureKind]
) -> NDArray[np.int64]:
    """Return the methods that look parameters up, a row for each kind of texture."""
    look_up = (record_type(bsdfs), INT, INT, INT, work_types().points, INT, INT)
    to_uv = np.array([t.to_uv[:2].ravel() for t in textures], np.float32)
    rows = []
    for kind in kinds:
        mine = [t if texture_kind_of(t) is kind else None for t in textures]
        record = TextureMethods(kind.table(mine), np.ascontiguousarray(to_uv.T))
        rows.append((tables.pack(record), [(look_up_kind, look_up, NOTHING)]))
    return tables.table(rows, 1)
