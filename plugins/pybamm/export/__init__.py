"""A calibrated or augmented cell for others: scripts that need pybamm alone, and BPX."""
