"""What depends on Mitsuba's version: one file names it, and another version is followed."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from small_scenes import diffuse, floor, point_light, rectangle, scene, sensor

import renderer
from mitsuba_ref.command.cli import main
from mitsuba_ref.reference import variant
from renderer import mitsuba_version
from renderer.errors import SceneError
from renderer.mitsuba_version import NEWEST, RULES, followed_version
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.planning.plan import offset_rule
from renderer.rendering.tables.render_mode import mode_for

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# a version, and the factors of 2^-24 that are its ray and its shadow epsilon
OF_A_VERSION = re.compile(r"\b3\.9(\.\d+)?\b|\b15_?000\b|\b1_?500(\.0)? ?\* ?(2|_ULP)\b")
UNKNOWN = "Mitsuba 3.10.0 is unknown; known: 3.9.1; possible: pip install mitsuba==3.9.1"


@pytest.fixture
def installed(monkeypatch):
    """Makes a version, or none, the installed one."""

    def install(version):
        monkeypatch.setattr(mitsuba_version, "installed_version", lambda: version)
        monkeypatch.setattr(variant, "installed_version", lambda: version)

    return install


@pytest.fixture
def other(monkeypatch):
    """Adds a version whose rays start, and whose shadow rays end, far off."""
    rules = NEWEST._replace(version="2.9", ray_epsilon=0.02, shadow_epsilon=0.1)
    monkeypatch.setitem(RULES, rules.version, rules)
    return rules


def test_one_file_names_the_version_and_its_numbers():
    """Not even in comments: with two versions at once it would be wrong for one."""
    found = {
        str(file.relative_to(ROOT))
        for package in ("renderer", "mitsuba_ref")
        for ending in ("py", "toml")
        for file in (ROOT / package).rglob(f"*.{ending}")
        if OF_A_VERSION.search(file.read_text(encoding="utf-8"))
    }
    assert found == {"renderer/mitsuba_version.py"}


def test_the_newest_known_version_is_the_one_that_is_installed_with_the_harness():
    lines = map(Requirement, PROJECT["optional-dependencies"]["harness"])
    pin = next(line.specifier for line in lines if line.name == "mitsuba")
    assert str(pin) == f"=={NEWEST.version}"
    assert [*RULES] == sorted(RULES, key=lambda v: [int(part) for part in v.split(".")])


def test_the_installed_version_is_followed_if_it_is_known(installed, other):
    for version, followed in ((None, NEWEST), ("3.10.0", NEWEST), (other.version, other)):
        installed(version)
        assert followed_version() == followed.version


def test_an_unknown_version_ends_a_comparison_before_it_begins(installed, capsys):
    installed("3.10.0")
    with pytest.raises(SceneError, match=re.escape(UNKNOWN)):
        variant.load_mitsuba.__wrapped__()  # it was kept, where a test has loaded it
    assert main([str(ROOT / "scenes" / "cornell-box")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"lightproof-validate: {UNKNOWN}") and said.count("\n") == 1


def test_without_mitsuba_there_is_no_version_to_refuse(installed):
    installed(None)
    variant.check_version()


def test_an_unknown_version_is_no_option():
    with pytest.raises(SceneError, match=f"mitsuba_version: {re.escape(UNKNOWN)}"):
        renderer.render(below(0.5), mitsuba_version="3.10.0")


def below(height):
    """Return a point of a floor under a light at height 1, with a small screen between."""
    screen = rectangle((0, 0, height), (0.01, 0, 0), (0, 0.01, 0), diffuse(0.0))
    camera = sensor((0, -3, 1), (0, 0, 0))
    parts = floor(), screen, point_light((0, 0, 1))
    return renderer.load_dict(scene(camera, "direct", *parts))


def test_a_replay_follows_the_version_that_is_named(other):
    loaded = below(0.5)
    plan = make_plan(loaded, sampler="mitsuba", mitsuba_version=other.version)
    assert plan.offset == (0.0, other.ray_epsilon, other.shadow_epsilon)
    assert mode_for(plan, None).arithmetic.ray_epsilon == other.ray_epsilon
    assert f"Mitsuba {other.version}, in their order" in "\n".join(plan.lines)


def test_our_own_way_depends_on_no_version(installed, other):
    """Neither on the installed one, nor on the one that is named."""
    usual = make_plan(below(0.5))
    installed(other.version)
    assert make_plan(below(0.5)) == usual
    assert make_plan(below(0.5), mitsuba_version=other.version) == usual
    assert offset_rule("tight", other.version) == offset_rule("tight", NEWEST.version)


@pytest.mark.parametrize(
    ("height", "of"), [(0.01, "the way off the surface"), (0.95, "the gap at the light")]
)
def test_numbers_of_a_version_reach_the_picture(other, height, of):
    """A screen 0.01 over the floor is jumped over, one 0.05 before the light left out."""
    loaded = below(height)
    for version, lit in ((NEWEST.version, False), (other.version, True)):
        image = renderer.render(loaded, ray_offset="mitsuba", mitsuba_version=version)
        assert (image.pixels.max() > 0.0) == lit, of


def test_the_page_names_places_that_exist():
    page = (ROOT / "docs" / "mitsuba-versions.md").read_text(encoding="utf-8")
    places = re.findall(r"`([\w/]+\.py)::([\w.]+)`", page)
    assert len(places) > 20
    for path, symbol in places:
        found = [file for file in (ROOT / path, ROOT / "renderer" / path) if file.exists()]
        assert found, path
        name = re.escape(symbol.rpartition(".")[2])
        assert re.search(rf"\b(def|class) {name}\b|^{name} = ", found[0].read_text(), re.M)
