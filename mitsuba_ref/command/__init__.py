"""The command `python -m mitsuba_ref`: scenes in, a table and verdicts out."""
