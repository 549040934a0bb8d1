"""Methods of BSDFs and of the textures that give their parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from renderer.integrators.stages.branch_specular import split
from renderer.integrators.stages.direct_light import reflect_light
from renderer.integrators.stages.first_hit import show_albedo, show_normal
from renderer.integrators.stages.media_shadows import let_through
from renderer.integrators.stages.scatter import scatter_kind
from renderer.kernels.jit import Packed, record_type
from renderer.kernels.records.kernel_scene import (
    LOOK_UP_COLOR,
    LOOK_UP_GRADIENT,
    LOOK_UP_SCALAR,
    Bsdfs,
    Settings,
)
from renderer.plugins.bsdfs.kind import BsdfKind, BsdfMethods
from renderer.plugins.sampling.numbers_and_warps import Plain, along_u
from renderer.plugins.textures.gradient import look_up_gradient
from renderer.plugins.textures.kind import TextureMethods
from renderer.plugins.textures.look_up import look_up_color, look_up_scalar, nested_boards
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
from renderer.rendering.user_kernels.check import blame_users
from renderer.scene.materials import MaterialTables, kind_of, leaves, table_of
from renderer.scene.scene import Scene
from renderer.scene_file.description import BitmapTexture

# in the order of the columns of the table
_LOOK_UPS = {
    LOOK_UP_COLOR: look_up_color,
    LOOK_UP_SCALAR: look_up_scalar,
    LOOK_UP_GRADIENT: look_up_gradient,
}


def bsdf_tables(
    tables: MethodTables,
    scene: Scene,
    plan: Plan,
    settings: Settings,
    parameters: NDArray[np.float32],
    arithmetic: Any,
    lit: bool,
    derivatives: Callable[[], NDArray[np.int64]],
) -> Bsdfs:
    """Return the tables of all BSDFs; those that the plan does not use have no methods.

    `parameters` are the constant parameters. `lit`: smooth BSDFs take light samples.
    `derivatives` returns the methods that compute dp/du and dp/dv, for bump maps.
    """
    materials = scene.materials
    kinds, textures = materials.kinds, materials.textures()
    ends = [list(leaves(texture)) for texture in textures]  # leaves of nested textures
    looked_up = {id(leaf): table_of(leaf) for end in ends for leaf in end}
    texture_tables = list(dict.fromkeys(looked_up.values()))
    rows = [_row(tables, materials, k, plan, settings, arithmetic, lit) for k in kinds]
    try:
        methods = tables.table(rows, 7)
    except NumbaError as error:  # an error that no check of a user's kernel has found
        blame_users(error, kinds)
        raise
    needed = [kind if methods[k, 0] else None for k, kind in enumerate(kinds)]
    place = {kind.name: k for k, kind in enumerate(kinds)}
    derived = [
        (k, row)
        for k, kind in enumerate(needed)
        if kind is not None
        for row in kind.derived
    ]
    bsdfs = Bsdfs(
        methods,
        sum(kind.smooth for kind in kinds) if lit else 0,
        np.array([place[kind_of(b).name] for b in materials.bsdfs] or [-1], np.int32),
        parameters,
        np.array([kind.row_count for kind in kinds], np.int32),
        materials.look_ups(needed, texture_tables),
        materials.texture_ids(),
        np.array(
            [
                texture_tables.index(looked_up[id(t)]) if id(t) in looked_up else -1
                for t in textures
            ],
            np.int32,
        ),
        np.zeros((0, 1 + len(_LOOK_UPS)), np.int64),
        np.array(derived, np.int64).reshape(-1, 2),
        derivatives() if derived else np.zeros((0, 2), np.int64),
    )
    if bsdfs.look_ups.size == 0:
        return bsdfs
    to_uv = np.array([getattr(t, "to_uv", np.eye(3))[:2] for t in textures], np.float32)
    to_uv = np.ascontiguousarray(to_uv.reshape(-1, 6).T)
    nested = nested_boards(textures)
    look_up = (record_type(bsdfs), INT, INT, work_types().points, INT, INT)
    of_textures = []
    for k, (kind, _) in enumerate(texture_tables):
        each = zip(textures, bsdfs.texture_kind, strict=True)
        mine = [_of_two_texels(t) if its == k else None for t, its in each]
        record = tables.pack(TextureMethods(kind.table(mine, scene), to_uv, nested))
        requested = bsdfs.look_ups[bsdfs.look_ups[:, 1] == k, 3]
        of_textures.append(
            (
                record,
                [
                    (method, look_up, NOTHING) if request in requested else None
                    for request, method in _LOOK_UPS.items()
                ],
            )
        )
    return bsdfs._replace(texture_methods=tables.table(of_textures, len(_LOOK_UPS)))


def _row(
    tables: MethodTables,
    materials: MaterialTables,
    kind: BsdfKind,
    plan: Plan,
    settings: Settings,
    arithmetic: Any,
    lit: bool,
) -> tuple[Packed, list[MethodSpec | None]]:
    """Return the record of one kind, and the methods that the plan uses."""
    work, given = work_types(), record_type(settings)
    group = (work.points, INT, INT)
    lights = (given, FLOAT, work.points, work.light_samples, INT, INT)
    reflect = (reflect_light, (*lights, work.shadow_rays, INT), INT)
    along = (given, INT, work.points, ROWS, INT, INT, work.rays, INT)
    shown = (work.points, INT, ROWS)
    lets_through = plan.kind.media and kind.straight

    goes_on = (kind.smooth and plan.follow) or (kind.delta and plan.mirrors)
    scatters = goes_on and plan.kind.scatters
    splits = kind.delta and plan.mirrors and plan.kind.splits
    shows = kind.albedo is not None and plan.kind.first_hit
    turns = kind.normal is not None and plan.kind.first_hit
    form = kind.form(materials.tables_of(kind))
    rounded = along_u(arithmetic) if kind.oriented else arithmetic
    record = tables.pack(
        BsdfMethods(
            form,
            rounded,
            True if kind.both_sides else None,
            True if kind.in_plane and isinstance(rounded, Plain) else None,
        ),
        kind.source,
    )
    return record, [
        reflect if kind.smooth and lit else None,
        (scatter_kind, along, INT) if scatters else None,
        (split, (given, *group, work.rays, INT), INT) if splits else None,
        (show_albedo, shown, NOTHING) if shows and not kind.seen_albedo else None,
        (show_albedo, shown, NOTHING) if shows and kind.seen_albedo else None,
        (show_normal, shown, NOTHING) if turns else None,
        (let_through, group, NOTHING) if lets_through else None,
    ]


def _of_two_texels(texture: Any) -> Any:
    """Return a bitmap with a single row or column doubled, as in Mitsuba.

    The look-up is unchanged, but slopes under `to_uv` are multiplied by the image's size.
    """
    if not isinstance(texture, BitmapTexture) or min(texture.texels.shape[:2]) > 1:
        return texture
    height, width = (max(2 - n, 0) for n in texture.texels.shape[:2])
    padded = np.pad(texture.texels, ((0, height), (0, width), (0, 0)), mode="edge")
    return replace(texture, texels=padded)
