"""One path of the renderer, stage by stage, written down."""
