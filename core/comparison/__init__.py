"""How far a simulation is from a record: residuals, noise, metrics."""
