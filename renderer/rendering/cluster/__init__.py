"""Renders on the workers of a Dask cluster, with the same bits as in one process.

Imported when a cluster is used: Dask is an extra, `lightproof[cluster]`.
"""
