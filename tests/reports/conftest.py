"""What tests of pages share: one browser for all of them."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from headless_browser import Browser, find_browser


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    executable = find_browser()
    if executable is None:
        # CI installs a browser; without one it must not look as if this were checked.
        missing = "no Chromium found (Debian: apt-get install chromium)"
        if os.environ.get("CI") == "true":
            pytest.fail(missing)
        pytest.skip(missing)
    with Browser(executable, tmp_path_factory.mktemp("profile")) as running:
        yield running
