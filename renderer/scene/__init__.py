"""A scene as flat arrays, independent of the options of a render."""
