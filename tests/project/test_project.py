"""The frame: one version, one way of imports, pins inside ranges, sources resolved."""

from __future__ import annotations

import importlib.metadata
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import renderer
from renderer.scene_file.plugins import supported_plugins, supported_tags

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("renderer", "mitsuba_ref", "reports")


def test_one_version_everywhere():
    """Package, installed metadata, pyproject.toml and the newest changelog entry agree."""
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.findall(r"^## \[(\d[^]]*)\]", changelog, flags=re.MULTILINE)[0]
    assert newest == PROJECT["version"]
    assert importlib.metadata.version("lightproof") == PROJECT["version"]
    assert renderer.__version__ == PROJECT["version"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation


def test_the_renderer_alone_needs_no_mitsuba():
    """The default dependencies are the renderer's; the harness is an extra."""
    defaults = {Requirement(line).name for line in PROJECT["dependencies"]}
    harness = {
        Requirement(line).name for line in PROJECT["optional-dependencies"]["harness"]
    }
    assert not defaults & {"mitsuba", "drjit"}
    assert {"mitsuba", "drjit"} <= harness


def test_every_dependency_is_pinned_inside_its_range():
    """constraints.txt has an exact version for each, and pyproject.toml admits it.

    No package is named twice: of two ranges one would be out of date, unseen.
    """
    pins = {}
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            name, version = line.split("==")
            pins[canonicalize_name(name)] = Version(version)
    extras = PROJECT["optional-dependencies"].values()
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in extra)]
    wanted = [Requirement(line) for line in lines]
    names = [canonicalize_name(requirement.name) for requirement in wanted]
    assert not {name for name in names if names.count(name) > 1}
    for name, requirement in zip(names, wanted, strict=True):
        assert pins[name] in requirement.specifier


def run_import_linter(folder):
    """Check the contract of `folder`/pyproject.toml; the finished process."""
    lint_imports = Path(sys.executable).with_name("lint-imports")
    return subprocess.run(
        [lint_imports, "--no-cache"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_imports_go_one_way():
    """The contract of pyproject.toml holds for the code as it is."""
    finished = run_import_linter(ROOT)
    assert finished.returncode == 0, finished.stdout


def rooms_of(package):
    """The folders of a package and theirs, which contracts name, from its own folder."""
    folders = (ROOT / package).rglob("*/__init__.py")
    return [file.parent.relative_to(ROOT) for file in folders]


FOR_TYPES = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("renderer/a.py", "def f():\n    from mitsuba.scalar_rgb import load_file"),
        ("reports/studies.py", "import drjit"),
        ("renderer/a.py", "import mitsuba_ref"),
        ("mitsuba_ref/a.py", "from reports import command"),
        ("mitsuba_ref/records/a.py", "import mitsuba_ref.reference"),
        ("renderer/plugins/a.py", "import renderer.integrators.stages"),
        ("renderer/integrators/stages/a.py", "import renderer.replay"),
        ("renderer/kernels/jit/a.py", "import renderer.kernels.lanes"),
        ("renderer/scene_file/meshes/a.py", f"{FOR_TYPES}    import renderer.scene_file.b"),
    ],
)
def test_the_import_contract_catches(module, line, tmp_path):
    """The contract is not empty talk: three tiny packages that break it are caught.

    Without the line the same packages pass, `import mitsuba` in mitsuba_ref included.
    """
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    for room in [*rooms_of("renderer"), *rooms_of("mitsuba_ref")]:
        (tmp_path / room).mkdir(parents=True, exist_ok=True)
        theirs = room.parts[0] == "mitsuba_ref"
        (tmp_path / room / "__init__.py").write_text(
            "import mitsuba, renderer, drjit\n" if theirs else ""
        )
    (tmp_path / "reports" / "command.py").write_text("import mitsuba_ref.reference\n")
    # half of a circle
    half = "import renderer.scene_file.meshes\n"
    (tmp_path / "renderer" / "scene_file" / "b.py").write_text(half)
    clean = run_import_linter(tmp_path)
    assert clean.returncode == 0, clean.stdout

    (tmp_path / module).write_text(line + "\n")
    broken = run_import_linter(tmp_path)
    assert broken.returncode == 1
    assert "broken" in broken.stdout


KEY = r"[A-Z][A-Za-z]+\d{4}[a-z]?"


def reference_entries():
    """Key and text of each entry in docs/references.md."""
    text = (ROOT / "docs" / "references.md").read_text(encoding="utf-8")
    return re.findall(rf"^- \*\*({KEY})\*\*: (.*(?:\n  .*)*)", text, flags=re.MULTILINE)


def citations(text):
    """Keys in `text`, written as [Key2000], [Key2000, eq. 3] or [Key2000; Other2001]."""
    brackets = re.findall(rf"\[({KEY}(?:[,;][^\]]*)?)\](?!\()", text)
    return {key for bracket in brackets for key in re.findall(KEY, bracket)}


def test_citations_are_recognised():
    """The three forms count; links, indices and plain words do not."""
    text = "[Veach1997] [Pharr2023,\n  ch. 3] [Kay1986; Ize2013] [Page2000](x) Wang2004"
    assert citations(text) == {"Veach1997", "Pharr2023", "Kay1986", "Ize2013"}


def test_every_cited_source_has_its_entry():
    """A reader who meets a key finds the paper."""
    known = {key for key, _ in reference_entries()}
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    sources += [*(ROOT / "scenes").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    sources += [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    sources += (ROOT / "scenes").rglob("*.md")
    sources += (ROOT / "reports" / "atlas").glob("*.toml")
    sources.remove(Path(__file__))  # its examples are not citations
    unknown = {
        f"{path.relative_to(ROOT)}: {key}"
        for path in sources
        for key in citations(path.read_text(encoding="utf-8")) - known
    }
    assert not unknown


def test_reference_entries_are_sound():
    """No key twice, and the year in a key is the year of the publication."""
    entries = reference_entries()
    keys = [key for key, _ in entries]
    assert len(keys) == len(set(keys)) > 20
    for key, text in entries:
        assert re.search(r"\d{4}", key)[0] in text


def test_links_in_the_documents_lead_somewhere():
    """Every relative link names a file of this repository; a moved file shows here."""
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    documents += (ROOT / "scenes").rglob("*.md")
    dead = [
        f"{document.relative_to(ROOT)}: {target}"
        for document in documents
        for target in re.findall(r"\]\(([^)#\s]+)", document.read_text(encoding="utf-8"))
        if "://" not in target and not (document.parent / target).exists()
    ]
    assert not dead


def test_the_page_of_scene_files_names_every_plugin_that_is_supported():
    """Its table is the list of the scene reader, by tag; `work` is no plugin of a file."""
    table = (ROOT / "docs" / "scene-files.md").read_text(encoding="utf-8")
    table = table.partition("## Plugins")[2].partition("\n\nAn unknown plugin")[0]
    tags = {
        "shapes": ["shape"],
        "BSDFs": ["bsdf"],
        "textures": ["texture"],
        "emitters": ["emitter"],
        "sensor, film": ["sensor", "film", "rfilter"],
        "samplers": ["sampler"],
        "integrators": ["integrator"],
        "media": ["medium", "phase", "volume"],
    }
    named = {
        row: sorted(re.findall(r"`(\w+)`", text))
        for row, text in re.findall(r"^\| (\w.*?) \| (.*) \|$", table, flags=re.MULTILINE)
    }
    named["integrators"].remove("work")
    assert named == {
        row: sorted(plugin for tag in of for plugin in supported_plugins(tag))
        for row, of in tags.items()
    }
    named_tags = {tag for of in tags.values() for tag in of}
    assert {"scene", *named_tags} == set(supported_tags())
