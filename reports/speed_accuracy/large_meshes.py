"""Moved to `reports.trials.large_meshes`."""

from reports.trials.large_meshes import *  # noqa: F403
