"""Moved to `reports.trials.structures`; for rooms that are not converted yet."""

from reports.trials.structures import *  # noqa: F403
