"""A calibration from its first simulation to its answer: the loop, its journal, its budget."""
