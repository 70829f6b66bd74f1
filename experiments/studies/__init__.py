"""Studies: the tables and figures of the benchmark, one function each, resumable."""
