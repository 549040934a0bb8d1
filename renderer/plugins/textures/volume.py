"""Volumes as textures: looked up at the position of a surface point, without uv."""

from __future__ import annotations

from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import select
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.records.media import Grids
from renderer.plugins.media.volumes import grid_tables, look_up_grid
from renderer.plugins.textures.kind import LUMINANCE, TextureKind
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import ConstantTexture, VolumeTexture
from renderer.scene_file.media_description import ConstantVolume
from renderer.scene_file.objects.media import read_volume


class VolumeTextures(NamedTuple):
    """Columns by texture id."""

    grid: NDArray[np.int32]  # (n,) index of the grid
    grids: Grids


def read(properties: Any, use: Use) -> VolumeTexture | ConstantTexture:
    """Read the properties of a file: the volume."""
    children = dict(properties.children("volume"))
    if list(children) != ["volume"]:
        properties.fail("volume", "nothing of that name", "one volume, named volume")
    volume = read_volume(children["volume"], properties.reading)
    _, high = use.limits
    if volume.maximum > high:
        properties.fail("volume", f"numbers up to {volume.maximum:g}", use.value)
    if isinstance(volume, ConstantVolume):
        return ConstantTexture(volume.rgb)
    return VolumeTexture(volume, properties.location)


def mean(texture: VolumeTexture, mean_of: Any = None) -> NoReturn:
    """Raise an error: the mean depends on the surface, and Mitsuba does not have it.

    Raises
    ------
    SceneError
        Always.
    """
    raise SceneError(
        f'{texture.location}: texture "volume" cannot give this parameter: how often its '
        "lobe is sampled depends on the mean, which a volume on a surface has not"
    )


def volume_table(textures: list[VolumeTexture | None], scene: Any) -> VolumeTextures:
    """Collect the grids of all textures."""
    present = [texture for texture in textures if texture is not None]
    number = {id(texture): k for k, texture in enumerate(present)}
    ids = [number.get(id(texture), 0) for texture in textures]
    grids = grid_tables([texture.volume for texture in present])
    return VolumeTextures(np.array(ids, np.int32), grids)


@kernel
def volume_color(volumes, texture, point, mask):
    """Return the colours at world space positions."""
    grid = gather_row(volumes.grid, 0, texture, mask)
    return look_up_grid(volumes.grids, grid, point.position, mask)


@kernel
def volume_scalar(volumes, texture, point, mask):
    """Return scalars; the luminance for three channels."""
    grid = gather_row(volumes.grid, 0, texture, mask)
    color = look_up_grid(volumes.grids, grid, point.position, mask)
    luminance = (
        color.x * np.float32(LUMINANCE[0])
        + color.y * np.float32(LUMINANCE[1])
        + color.z * np.float32(LUMINANCE[2])
    )
    return select(gather_row(volumes.grids.channels, 0, grid, mask) > 1, luminance, color.x)


VOLUME = TextureKind(
    "volume",
    VolumeTexture,
    read,
    volume_table,
    VolumeTextures,
    volume_color,
    volume_scalar,
    mean,
)
