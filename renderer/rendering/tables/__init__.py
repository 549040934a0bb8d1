"""From scene and plan to the kernels' record: a row for each kind, with its methods."""
