"""`import lightproof` is the API of `renderer` under the name of what is installed."""

from __future__ import annotations

import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from processes import run_python

import lightproof
import renderer

ROOT = Path(__file__).parents[2]


def test_every_public_name_is_the_object_of_the_renderer():
    assert lightproof.__all__ == renderer.__all__
    for name in renderer.__all__:
        assert getattr(lightproof, name) is getattr(renderer, name)
    assert lightproof.__version__ == renderer.__version__
    assert {*renderer.__all__, "__version__"} <= set(dir(lightproof))
    star: dict[str, object] = {}
    exec("from lightproof import *", star)
    assert {*renderer.__all__} <= star.keys()
    with pytest.raises(AttributeError, match="'lightproof' has no attribute 'rendre'"):
        _ = lightproof.rendre


def test_its_objects_are_pickled():
    image = lightproof.Image(np.ones((2, 3, 3), np.float32), spp=4)
    copy = pickle.loads(pickle.dumps(image))
    assert type(copy) is renderer.Image and copy.spp == 4
    assert np.array_equal(copy.pixels, image.pixels)
    assert pickle.loads(pickle.dumps(lightproof.render)) is renderer.render


def test_importing_it_is_as_fast_as_before_and_it_is_the_command():
    """Nothing that takes long is imported, not even NumPy."""
    program = "import lightproof, sys; assert 'numpy' not in sys.modules, 'numpy'"
    for words in (("-c", program), ("-m", "lightproof", "--version")):
        finished = run_python(*words, environment={"PYTHONPATH": str(ROOT)}, check=True)
    assert finished.stdout == f"lightproof {renderer.__version__}\n"


def test_it_is_installed():
    """A wheel has it too, in which the clone's folder is not on the path."""
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    assert setup["setuptools"]["py-modules"] == ["lightproof"]
    assert setup["mypy"]["modules"] == ["lightproof"]
