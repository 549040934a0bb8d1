"""The defects that the harness must find, by what they break."""
