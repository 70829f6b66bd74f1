"""Grids: many runs as one file, resumable cell by cell, on one machine or on a cluster."""
