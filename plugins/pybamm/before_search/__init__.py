"""What is settled before a search: its ranges, usual rates and potentials, the mesh, and what has no influence."""
