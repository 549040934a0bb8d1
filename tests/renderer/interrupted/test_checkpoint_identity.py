"""A checkpoint's identity: every field of everything that a picture depends on is in it.

The fields are those of the records themselves, so that one that is added later is tested
as well.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import renderer
from renderer import scene_file
from renderer.integrators.registry import INTEGRATORS
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.rendering.checkpoints import identity
from renderer.rendering.checkpoints.identity import difference, identity_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions, names_of
from renderer.scene_file import description

ROOT = Path(__file__).parents[3]
FILES = [
    *sorted(ROOT.glob("tests/plugins/*.xml")),
    ROOT / "scenes/instances/scene.xml",
    ROOT / "scenes/mist/scene.xml",
]
IMPLICIT = {
    "type": "scene",
    "sensor": {"type": "perspective"},
    "shape": {"type": "implicit", "expression": "x**2 + y**2 + 2 * z**2 - 1"},
}

# What may differ: where a record comes from and what it is called, and of a plan how much
# is done and why. Whatever else a record holds, now or later, has to be in the digest.
OF_A_SCENE = {"location", "source", "files", "warnings", "simplified", "id"}
OF_A_SCENE |= {"emitter_names"}
OF_A_PLAN = {"spp", "rays", "lines", "no_roulette"}


@pytest.fixture(scope="module")
def plan():
    content = {"type": "scene", "sensor": {"type": "perspective"}}
    return make_plan(renderer.load_dict(content), sampler="independent")


def of(scene: Any, plan: Plan, **changes: Any) -> identity.Identity:
    """Return the identity of a description."""
    return identity_of(SimpleNamespace(description=scene), plan, RenderOptions(**changes))


def another(value: Any) -> Any:
    """Return a value that differs as little as its kind can."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return float(np.nextafter(value, 9.0))
    if isinstance(value, str):
        return value + "'"
    if isinstance(value, np.ndarray):
        changed = (
            np.append(value, np.ones(1, value.dtype)) if not value.size else value.copy()
        )
        if value.size:
            changed.flat[-1] = 0 if changed.flat[-1] else 1
        return changed
    if isinstance(value, tuple):
        plain = value and not isinstance(value[-1], tuple) and not is_record(value[-1])
        return (*value[:-1], another(value[-1])) if plain else value[:-1] or (1,)
    if isinstance(value, Mapping):
        number = [key for key, part in value.items() if isinstance(part, float)][-1:]
        return {**value, **({key: value[key] + 1.0 for key in number} or {"another": 1.0})}
    assert value is None, f"no other value of a {type(value).__name__}"
    return 1


@contextmanager
def changed_to(record: Any, name: str, value: Any) -> Iterator[None]:
    """Change one field of a frozen record for a while."""
    before = getattr(record, name)
    object.__setattr__(record, name, value)
    try:
        yield
    finally:
        object.__setattr__(record, name, before)


def is_record(value: Any) -> bool:
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def records_in(value: Any) -> Iterator[Any]:
    """Yield all records that a value holds, itself among them."""
    if is_record(value):
        yield value
        for field in dataclasses.fields(value):
            if field.name not in OF_A_SCENE:
                yield from records_in(getattr(value, field.name))
    elif isinstance(value, tuple):
        for part in value:
            yield from records_in(part)
    elif isinstance(value, Mapping):
        yield from records_in(tuple(value.values()))


def test_every_field_of_every_record_of_a_scene_counts(plan):
    """Each is changed by itself, in one scene of our own that holds the record.

    The camera's sampler does not: the plan holds the one that is used.
    """
    met: set[tuple[str, str]] = set()
    for file in ("IMPLICIT", *FILES):
        if file == "IMPLICIT":
            scene = scene_file.read_dict(IMPLICIT)
        else:
            scene = scene_file.read_file(file)
        usual = of(scene, plan)
        for record in records_in(scene):
            if isinstance(record, description.Sampler):
                met.add(("Sampler", ""))
                continue
            kind = type(record).__name__
            met.add((kind, ""))
            for field in dataclasses.fields(record):
                value = getattr(record, field.name)
                empty = value is None or (isinstance(value, tuple) and not value)
                case = (kind, f"{field.name} {empty}")
                if case in met or is_record(value) or field.name in OF_A_SCENE:
                    continue
                met.add(case)
                changed = another(value)
                if field.name == "plugin":  # of a BSDF, which has to be known
                    changed = next(name for name in BSDFS if name != value)
                with changed_to(record, field.name, changed):
                    seen = of(scene, plan) != usual
                assert seen, f"{kind}.{field.name} of {file} is left out of the identity"
        assert of(scene, plan) == usual
    kinds = {kind for kind, _ in met}
    there = {
        name
        for name, kind in vars(description).items()
        if getattr(kind, "__module__", "") == description.__name__
        and inspect.isclass(kind)
        and dataclasses.is_dataclass(kind)
    }
    never = {
        "Shape",
        "Sensor",
        "Location",
        "AreaLight",
        "Curves",
    }  # bases, and what is read alone
    assert sorted(there - kinds - never) == [], "no scene of FILES holds these records"


def test_what_names_a_scene_changes_nothing(plan):
    scene = scene_file.read_file(ROOT / "scenes" / "cornell-box" / "scene.xml")
    usual = of(scene, plan)
    for record in records_in(scene):
        for field in dataclasses.fields(record):
            if field.name in OF_A_SCENE:
                with changed_to(record, field.name, "another"):
                    same = of(scene, plan) == usual
                assert same, f"{type(record).__name__}.{field.name} makes another identity"


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Plan)])
def test_every_field_of_a_plan_counts(plan, name):
    """But how much is done, where the first samples do not depend on it, and why."""
    scene = scene_file.read_file(ROOT / "scenes" / "cornell-box" / "scene.xml")
    value = getattr(plan, name)
    if name == "method":
        changed = next(key for key in INTEGRATORS if key != value)
    elif name == "sampler":
        changed = dataclasses.replace(value, seed=7)
    elif name == "rays":
        changed = None
    else:
        changed = another(value)
    other = dataclasses.replace(plan, **{name: changed})
    same = of(scene, other) == of(scene, plan)
    assert same == (name in OF_A_PLAN), f"{name}: {value} and {changed}"


@pytest.mark.parametrize("name", [f.name for f in dataclasses.fields(description.Sampler)])
def test_every_field_of_a_sampler_counts(plan, name):
    """But the number of samples, where the first points do not depend on it."""
    scene = scene_file.read_file(ROOT / "scenes" / "cornell-box" / "scene.xml")
    value = getattr(plan.sampler, name)
    sampler = dataclasses.replace(plan.sampler, **{name: another(value)})
    other = dataclasses.replace(plan, sampler=sampler)
    same = of(scene, other) == of(scene, plan)
    assert same == (name == "sample_count"), f"{name}: {value} and {another(value)}"


def test_all_that_is_handed_over_counts(plan):
    """Every argument: the structures of `accel` where what they do is counted, too."""
    scene = renderer.load_file(ROOT / "scenes" / "cornell-box" / "scene.xml")
    work = make_plan(scene, integrator="work")
    camera = np.arange(6.0)
    cases: dict[str, tuple[Any, Any, Plan]] = {
        "accel": ("bvh", "brute", work),
        "seed": (0, 1, plan),
        "measured_camera": (None, camera, plan),
    }
    assert cases.keys() == {"accel", *names_of("identity")}
    for name, (one, two, of_plan) in cases.items():
        first, second = (
            identity_of(scene, of_plan, RenderOptions(**{name: value}))
            for value in (one, two)
        )
        assert first != second, name
    usual = of(scene.description, plan, measured_camera=camera)
    for k in range(6):
        moved = camera.copy()
        moved[k] += 1e-9
        assert of(scene.description, plan, measured_camera=moved) != usual, k
    assert of(scene.description, plan, accel="bvh") == of(scene.description, plan)


def test_whatever_differs_is_named(plan):
    """Each line by itself, changed or missing, there or here."""
    scene = scene_file.read_file(ROOT / "scenes" / "cornell-box" / "scene.xml")
    ours = of(scene, plan)
    assert difference(ours, ours) is None
    for part, names in ours.items():
        for name in names:
            changed = {**ours, part: {**names, name: "another"}}
            less = {**ours, part: {key: names[key] for key in names if key != name}}
            for theirs in (changed, less):
                found = difference(theirs, ours)
                assert found is not None and found.startswith(f"{name} "), (name, found)
    extra = {**ours, "said": {**ours["said"], "spp": "4"}}
    for theirs, here, what in (
        (extra, ours, "spp is 4 there and not said here"),
        (ours, extra, "spp is not said there and 4 here"),
    ):
        assert difference(theirs, here) == what


def test_every_source_of_a_picture_counts(tmp_path, monkeypatch):
    """Its content and its name; not those of the command line."""
    monkeypatch.setattr(identity, "_PACKAGE", tmp_path)

    def program() -> str:
        return identity.made_by.__wrapped__()["lightproof"]

    def write(name: str, content: str) -> None:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)

    met = {program()}
    for step in (
        lambda: write("kernels/a.py", "1"),
        lambda: write("kernels/a.py", "2"),
        lambda: write("rendering/film/b.py", "1"),
        lambda: (tmp_path / "kernels/a.py").rename(tmp_path / "kernels/c.py"),
        lambda: write("scene.py", ""),
    ):
        step()
        assert program() not in met
        met.add(program())
    last = program()
    write("command/cli.py", "1")
    write("simple/a.py", "1")
    assert program() == last
