"""PyBaMM as a simulator: models compiled once and solved thousands of times in worker processes."""
