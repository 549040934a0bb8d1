"""The atlas of limits: methods under stress, and the places where they give way.

`row` says what a row is, a package a chapter holds the rows, `atlas` collects them;
`measure` measures a row, `record` keeps it, `page` draws it. A new row stands in the
file of its family, and tests and page find it there. `our_hits`, `screen` and
`vectors` are what rows share.
"""
