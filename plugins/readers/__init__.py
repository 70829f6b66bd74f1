"""Readers: files of cyclers in, records of one cell out."""
