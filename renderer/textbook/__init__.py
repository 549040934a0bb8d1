"""The lecture's acceleration structures, written to be read: one ray at a time.

Every structure has the same three parts:

- a record of flat arrays (`CellTree`, `Grids`, `BoxTree`), with `primitives`, and `reach`,
  the largest distance of a ray's origin from the world's origin;
- a builder `build_*(extents, group)`, which uses boxes and hulls of primitives only;
- a traversal by one ray, an implementation of `one_ray.trace_ray`. With `any_hit` it gives
  the first hit found, which suffices for a shadow ray.

`validate.py` proves that no ray can miss a primitive in any of them. The production tracer
is in `renderer/accelerators/`; the two share the primitive tests and the BVH builder.
Bounding volumes by themselves are in `bounding_volumes.py`.
"""
