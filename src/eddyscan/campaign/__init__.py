"""Inspections by the thousand: campaigns of virtual ones, batches of real ones, on Dask."""
