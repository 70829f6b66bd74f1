"""A calibration from its first simulation to its answer: the loop, the journal, the budget."""
