"""Moved to `reports.trials.tracing`; for rooms that are not converted yet."""

from reports.trials.tracing import *  # noqa: F403
