"""The version of this program, as files and checkpoints name it."""

VERSION = "0.1.0"
