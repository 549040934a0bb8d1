"""Moved to `reports.trials.meshes`; for rooms that are not converted yet."""

from reports.trials.meshes import *  # noqa: F403
