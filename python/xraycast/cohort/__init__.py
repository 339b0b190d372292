"""Many scans on many workers: what the console script xraycast-cohort does, on dask.distributed.

One scan is one task. A worker writes a scan's outputs to a folder of their own, which appears whole; the client alone
writes the ledger, a line an attempt.
"""
