"""Loading: from a mesh file to the first sample of each pixel, against Mitsuba.

Mitsuba builds its tree when it loads a scene, this renderer when it renders: so what both
are timed for is a scene that is loaded and rendered with one sample per pixel.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import renderer
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.bench.timing import median_interval, take_turns
from reports.look.formatting import seconds
from reports.trials.large_meshes import ply_bytes
from reports.trials.meshes import StudyMesh, displaced_icosphere

FREQUENCIES = 16, 32, 64, 128, 224, 316  # meshes of 20 n^2 triangles, up to 2 million
QUICK = 16, 64
TIME = "time to the first picture"
THREADS = 2
SCENE = """<scene version="3.0.0"><integrator type="direct"/>
<sensor type="perspective"><transform name="to_world">
<lookat origin="0, -4, 0" target="0, 0, 0" up="0, 0, 1"/></transform>
<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/>
</film></sensor>
<emitter type="constant"/><shape type="{kind}"><string name="filename" value="{name}"/>
</shape></scene>"""


def obj(mesh: StudyMesh) -> bytes:
    """Return the mesh as an OBJ file."""
    lines = ["v {:g} {:g} {:g}".format(*point) for point in mesh.vertices]
    lines += ["f {} {} {}".format(*face) for face in mesh.faces + 1]
    return ("\n".join(lines) + "\n").encode()


FORMATS = {"ply": lambda mesh: ply_bytes(mesh.vertices, mesh.faces), "obj": obj}


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the seconds of both renderers for growing meshes in one format."""
    for frequency in QUICK if bench.quick else FREQUENCIES:
        mesh = displaced_icosphere(frequency)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"mesh.{case}"
            file.write_bytes(FORMATS[case](mesh))
            scene = file.with_name("scene.xml")
            scene.write_text(SCENE.format(kind=case, name=file.name))
            bench.show(f"{mesh.triangles} triangles")
            contenders = {"lightproof": _ours(scene), "mitsuba scalar_rgb": _theirs(scene)}
            contenders["lightproof"](0)  # compiles
            times = take_turns(contenders, 3 if bench.quick else 7, show=bench.show)
        for contender, found in times.items():
            yield Row(
                case=case,
                contender=contender,
                quantity=TIME,
                unit="s",
                at=mesh.triangles,
                value=float(np.median(found)),
                interval=median_interval(found),
            )


def _ours(scene: Path) -> Callable[[int], float | None]:
    def load(turn: int) -> None:
        loaded = renderer.load_file(scene)
        renderer.render(loaded, spp=1, threads=THREADS)

    return load


def _theirs(scene: Path) -> Callable[[int], float | None]:
    """Return what starts Mitsuba and lets it time itself: its start is not counted."""

    def load(turn: int) -> float:
        with TimedMitsuba("scalar_rgb", scene, {}, THREADS) as peer:
            start = float(peer.loaded["seconds"])
            return start + peer.render(0, 1).seconds

    return load


def verdict(table: Table) -> str:
    """Say how long the largest mesh takes."""
    rows = table.curve(quantity=TIME)
    times = (
        f"{row.contender} takes {seconds(row.value)} from {row.case.upper()}"  # type: ignore[arg-type]
        for row in rows
        if row.at == rows[-1].at
    )
    return f"A picture of {rows[-1].at:,.0f} triangles: {'; '.join(times)}." if rows else ""


STUDY = Study(
    title="Loading meshes",
    sentence="How long does it take from a mesh file to the first picture?",
    advice="Save large meshes as PLY.",
    minutes=6,
    quick_minutes=0.5,
    cases=tuple(FORMATS),
    axis="triangles",
    measure=measure,
    verdict=verdict,
)
