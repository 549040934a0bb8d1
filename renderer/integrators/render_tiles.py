"""The render loop over tiles and samples; it calls an integrator's `trace`."""

from __future__ import annotations

from renderer.integrators.stages.film import add_to_tile, clear, close_sums, open_sums
from renderer.kernels.jit import call, entry_kernel, kernel
from renderer.kernels.records.batch import CAPACITY, Tile, has_places


@kernel
def _level_at(sample, end_sample, room):
    """Return the level of the next group: 4^level samples per pixel traced together.

    `room` is the number of slots. A group begins at a multiple of its size, even where a
    job or a checkpoint begins elsewhere.
    """
    level, together = 0, 4
    while (
        together * CAPACITY <= room
        and sample % together == 0
        and sample + together <= end_sample
    ):
        level, together = level + 1, together * 4
    return level


@entry_kernel
def render_tiles(
    address, scene, rfilter, tiles, first_sample, end_sample, work, sums, border, squares
):
    """Add samples first_sample .. end_sample - 1 of some tiles to the tiles' sums.

    Parameters
    ----------
    address, scene
        Address of an integrator's `trace` and its kernel scene, from `compile_method`.
    rfilter : FilterTable
    tiles : int64 (n, 5)
        As in `Film.tiles`.
    first_sample, end_sample : int
    work : Workspace
        Of this thread. Its number of slots limits the samples traced together.
    sums : float64 (n, channels + 1, rows, columns)
        Of each tile, including its border.
    border : int
        In pixels, from `filter_border`.
    squares : int
        Squares of a tile traced together; `work` must have room for them.
    """
    for k in range(tiles.shape[0]):
        x, y, width, height = tiles[k, 0], tiles[k, 1], tiles[k, 2], tiles[k, 3]
        open_sums(rfilter, sums[k], work.splats)
        sample = first_sample
        while sample < end_sample:
            level = _level_at(sample, end_sample, work.radiance.shape[1])
            clear(work.radiance, level)
            tile = Tile(x, y, width, height, tiles[k, 4], level, 0, 1)
            all_squares = 1 << 2 * level
            for square in range(0, all_squares, squares):
                together = min(squares, all_squares - square)
                batch = Tile(x, y, width, height, tiles[k, 4], level, square, together)
                if has_places(batch):
                    call(address, scene, (batch, sample, work))
            add_to_tile(
                rfilter, tile, work.film, work.radiance, sums[k], work.splats, border
            )
            sample += 1 << 2 * level
        close_sums(rfilter, sums[k], work.splats)
