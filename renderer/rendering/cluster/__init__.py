"""One render on the workers of a Dask cluster, with the bits of one process.

Imported when a cluster is used: Dask is an extra, `lightproof[cluster]`.
"""
