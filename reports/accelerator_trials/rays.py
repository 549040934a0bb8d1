"""Moved to `reports.trials.rays`; for rooms that are not converted yet."""

from reports.trials.rays import *  # noqa: F403
