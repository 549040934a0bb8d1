"""A scene as flat arrays, before it is known how it will be rendered."""
