"""Mitsuba's rays for comparison: nearest hits and any hits of a mesh in one variant.

Rays and answers travel as .npz files; only the tracing between them is timed.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.reference.variant_process import Answerer, VariantProcess, answer_requests


@dataclass(frozen=True, eq=False)
class TracedRays:
    """What Mitsuba found for n rays."""

    t: NDArray[np.float32]  # (n,) infinite for a miss; all infinite for any hit
    prim: NDArray[np.int64]  # (n,) -1 for a miss; for any hit 0 where something is met


class TracedMitsuba(VariantProcess):
    """A triangle mesh in one JIT variant of Mitsuba; a context manager.

    Parameters
    ----------
    variant
        `llvm_ad_rgb`; scalar variants trace one ray a call.
    vertices, faces
        (V, 3) and (F, 3); primitive k of the answers is face k.
    rays
        Sets of rays by name: origins (n, 3), directions (n, 3), ends (n,).

    Raises
    ------
    MitsubaError
        Why this variant cannot trace here.
    """

    def __init__(
        self,
        variant: str,
        vertices: NDArray[np.float32],
        faces: NDArray[np.int32],
        rays: Mapping[str, tuple[NDArray[np.float32], ...]],
    ) -> None:
        self._folder = tempfile.TemporaryDirectory()
        work = Path(self._folder.name)
        np.savez(work / "mesh.npz", vertices=vertices, faces=faces)
        for name, (origin, direction, ends) in rays.items():
            np.savez(work / f"{name}.npz", origin=origin, direction=direction, ends=ends)
        try:
            super().__init__(
                "mitsuba_ref.speed.traced_mitsuba", variant, {"folder": str(work)}
            )
        except BaseException:
            self._folder.cleanup()
            raise

    def build(self, threads: int) -> float:
        """Build the tree over the mesh in memory once more; return the seconds it took.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or does not answer.
        """
        return float(self.ask({"build": True, "threads": threads})["seconds"])

    def trace(self, rays: str, *, any_hit: bool, coherent: bool, threads: int) -> float:
        """Trace one set of rays; return the seconds it took.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or does not answer.
        """
        answer = self.ask(
            {"rays": rays, "any_hit": any_hit, "coherent": coherent, "threads": threads}
        )
        return float(answer["seconds"])

    def found(self, rays: str, *, any_hit: bool, coherent: bool) -> TracedRays:
        """Return the answers for one set of rays.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or does not answer.
        """
        file = Path(self._folder.name) / "found.npz"
        self.ask(
            {"rays": rays, "any_hit": any_hit, "coherent": coherent, "found": str(file)}
        )
        with np.load(file) as arrays:
            return TracedRays(arrays["t"], arrays["prim"])

    def close(self) -> None:
        """End the process and remove its files."""
        super().close()
        self._folder.cleanup()


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Build the scene; return what traces it for each request."""
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(job["variant"])
    mi.set_log_level(mi.LogLevel.Error)
    folder = Path(job["folder"])
    with np.load(folder / "mesh.npz") as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
    mesh = mi.Mesh("study", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(vertices.ravel())
    parameters["faces"] = mi.UInt32(faces.ravel().astype(np.uint32))
    parameters.update()
    dr.eval(mesh.vertex_positions_buffer(), mesh.faces_buffer())
    dr.sync_thread()
    scenes = [mi.load_dict({"type": "scene", "mesh": mesh})]
    rays: dict[str, Any] = {}

    def build(threads: int) -> dict[str, Any]:
        dr.set_thread_count(threads)
        start = time.perf_counter()
        scenes[0] = mi.load_dict({"type": "scene", "mesh": mesh})
        dr.sync_thread()
        return {"seconds": time.perf_counter() - start}

    def rays_of(name: str) -> Any:
        if name not in rays:
            with np.load(folder / f"{name}.npz") as arrays:
                ray: Any = mi.Ray3f(
                    mi.Point3f(np.ascontiguousarray(arrays["origin"].T)),
                    mi.Vector3f(np.ascontiguousarray(arrays["direction"].T)),
                )
                ray.maxt = mi.Float(arrays["ends"])
            dr.eval(ray)
            dr.sync_thread()
            rays[name] = ray
        return rays[name]

    def answer(wanted: dict[str, Any]) -> dict[str, Any]:
        if "build" in wanted:
            return build(wanted["threads"])
        scene = scenes[0]
        ray, coherent = rays_of(wanted["rays"]), wanted["coherent"]
        if "threads" in wanted:
            dr.set_thread_count(wanted["threads"])
        start = time.perf_counter()
        # A JIT variant only notes the work: evaluate, and wait for the end.
        if wanted["any_hit"]:
            met = scene.ray_test(ray, coherent=coherent)
            dr.eval(met)
        else:
            hit = scene.ray_intersect_preliminary(ray, coherent=coherent)
            dr.eval(hit.t, hit.prim_index)
        dr.sync_thread()
        seconds = time.perf_counter() - start
        if "found" in wanted:
            if wanted["any_hit"]:
                prim = np.where(np.array(met), 0, -1)
                t = np.full(len(prim), np.inf, np.float32)
            else:
                t = np.array(hit.t)
                prim = np.where(np.isfinite(t), np.array(hit.prim_index).astype(int), -1)
            np.savez(wanted["found"], t=t, prim=prim)
        return {"seconds": seconds}

    return {"loaded": True}, answer


if __name__ == "__main__":
    answer_requests(load)
