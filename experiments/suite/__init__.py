"""Benchmark tasks: the published ones, our own, and random ones that no table describes."""
