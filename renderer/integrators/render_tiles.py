"""The loop over tiles and samples: what calls an integrator's `trace`."""

from __future__ import annotations

from renderer.kernels.jit import call, entry_kernel
from renderer.kernels.records.tile import Tile
from renderer.stages.film import add_to_tile, clear, close_sums, open_sums


@entry_kernel
def render_tiles(
    address, scene, rfilter, tiles, first_sample, end_sample, work, sums, border
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
        Of this thread.
    sums : float64 (n, channels + 1, rows, columns)
        Of each tile with its border.
    border : int
        From `filter_border`.
    """
    for k in range(tiles.shape[0]):
        tile = Tile(tiles[k, 0], tiles[k, 1], tiles[k, 2], tiles[k, 3], tiles[k, 4])
        open_sums(rfilter, sums[k], work.splats)
        for sample in range(first_sample, end_sample):
            clear(work.radiance)
            call(address, scene, (tile, sample, work))
            add_to_tile(
                rfilter, tile, work.film, work.radiance, sums[k], work.splats, border
            )
        close_sums(rfilter, sums[k], work.splats)
