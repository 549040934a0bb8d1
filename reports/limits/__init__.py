"""The atlas of limits: methods under stress, and the places where they give way.

`row` says what a row is, a package a chapter holds the rows, `atlas` collects them;
`measure` measures a row, `record` keeps it, `page` draws it. `our_hits`, `screen` and
`vectors` are what rows share.
"""
