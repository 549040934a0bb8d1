"""The lecture's accelerators, written to be read: one ray at a time, one file each.

Every structure has the same three parts, so that a reader who knows one knows them all:

- a record of flat arrays (`CellTree`, `Grids`, `BoxTree`), with `primitives`, and `reach`,
  the distance from the world's origin up to which rays may start;
- a builder `build_*(extents, group)`, which sees boxes and hulls and no shapes;
- a traversal of one ray, an implementation of `one_ray.trace_ray`. Its argument `any_hit`
  makes it return the first hit found, which is all that a shadow ray needs.

`validate.py` proves that no ray can miss a primitive in any of them. The production tracer
is in `renderer/accelerators/`; it shares the tests of primitives, and the builder of the
BVH. Bounding volumes by themselves are in `bounding_volumes.py`.
"""
