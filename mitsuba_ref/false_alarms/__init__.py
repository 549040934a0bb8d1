"""How often the ladder of tests alarms when nothing is wrong."""
