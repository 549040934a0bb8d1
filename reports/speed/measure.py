"""Moved to `reports.trials.contenders`; goes with `reports.speed_accuracy`."""

from reports.trials.contenders import *  # noqa: F403
