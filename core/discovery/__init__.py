"""Finds what a model is missing: where it disagrees with data, which effect explains it, and whether that is so."""
