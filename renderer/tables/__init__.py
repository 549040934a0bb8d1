"""From scene and plan to the kernels' record: tables of what is needed, and its methods.

Each kind of shape, BSDF, texture and light that the scene has becomes a row with its record
and the addresses of its kernels, compiled here for just those records.
"""
