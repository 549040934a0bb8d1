"""Mitsuba's pictures out of a process that is started when needed and ended when silent.

After a crash or a time limit the next request starts another process.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from mitsuba_ref.records.request import TIME_LIMIT, RenderRequest
from mitsuba_ref.reference.cache import write_entry
from mitsuba_ref.reference.errors import MitsubaRefused
from mitsuba_ref.reference.json_process import Answerer, JsonProcess, answer_requests
from mitsuba_ref.reference.render import render_reference
from renderer.errors import PluginError

MODULE = "mitsuba_ref.reference.picture_process"
"""What the process runs: a name, so that a test can put a broken Mitsuba there."""


class MitsubaWorker:
    """Starts the process at the first request and ends it with the `with` block."""

    def __init__(self, time_limit: float = TIME_LIMIT) -> None:
        self.time_limit = time_limit
        self._process: JsonProcess | None = None

    def __enter__(self) -> Self:
        """Return the worker itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.stop()

    def render(self, request: RenderRequest, path: Path) -> None:
        """Render `request` and write the cache entry `path`.

        Raises
        ------
        MitsubaRefused, MitsubaCrashed, MitsubaTimeout
            When Mitsuba refuses the scene, dies, or is silent for `time_limit` seconds.
        MitsubaError
            When our own code in Mitsuba's process failed.
        PluginError
            When the request's file of plugins did, or does not register what it should.
        """
        if self._process is None:
            self._process = JsonProcess(
                MODULE, {}, name="Mitsuba", time_limit=self.time_limit
            )
        self._process.time_limit = self.time_limit
        try:
            self._process.ask({"request": asdict(request), "path": str(path)})
        except (MitsubaRefused, PluginError):
            raise  # the process has answered, and renders the next scene
        except BaseException:
            self.stop()  # Ctrl-C too: a late answer must not meet a later request
            raise

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.close()


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Return what renders each request into the file that it names."""

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        request = RenderRequest(**wanted["request"])
        write_entry(render_reference(request), Path(wanted["path"]))
        return {}

    return {}, render


if __name__ == "__main__":
    answer_requests(load)
