"""The loop over tiles and samples: what calls an integrator's `trace`."""

from __future__ import annotations

from renderer.integrators.stages.film import add_to_tile, clear, close_sums, open_sums
from renderer.kernels.jit import call, entry_kernel, kernel
from renderer.kernels.records.batch import CAPACITY, Tile, has_places


@kernel
def _level_at(sample, end_sample, room):
    """Return the level of the next samples: 4^level samples of a pixel go together.

    `room` is the number of slots. A group begins at a multiple of its size, even if a job
    or a checkpoint does not.
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
    """Add samples first_sample .. end_sample - 1 of some tiles to their sums.

    Parameters
    ----------
    address, scene
        An integrator's `trace` and the record that it works on, as of `compile_method`.
    rfilter : FilterTable
    tiles : int64 (n, 5)
        As in `Film.tiles`.
    first_sample, end_sample : int
    work : Workspace
        Of this thread; how many slots it has limits the samples that go together.
    sums : float64 (n, channels + 1, rows, columns)
        Of each tile with its border.
    border : int
        From `filter_border`.
    squares : int
        Squares of a tile that are traced together; `work` has room for so many.
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
