"""JSON files read into frozen records, with the place of every mistake."""
