"""Studies: each is a grid, and an analysis of the rows that it gives."""
