"""A pytest fixture for tests of other renderers: `assert_same_picture`.

pytest loads it where lightproof is installed; it imports nothing before a test uses it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture
def assert_same_picture() -> Callable[..., Any]:
    """Return a function that fails a test if pictures differ by more than noise.

    It takes what `mitsuba_ref.renderer_compare` takes, and returns the comparison::

        def test_my_renderer(assert_same_picture):
            assert_same_picture(render("scene.xml"), scene="scene.xml")
    """

    def check(pictures: Any, references: Any = None, **options: Any) -> Any:
        from mitsuba_ref.diagnosis.comparison import renderer_compare

        __tracebackhide__ = True
        found = renderer_compare(pictures, references, **options)
        if found.differs:
            pytest.fail("\n".join(found.sentences()), pytrace=False)
        return found

    return check
