"""The studies: one file each, which defines `STUDY`.

The name of a study is the name of its file with "-" instead of "_". A file whose name
begins with "_" is shared by several studies and is none itself.
"""
