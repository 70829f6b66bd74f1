"""Which cell is simulated: parameter sets and files, their curves, and the charge between cut-offs."""
