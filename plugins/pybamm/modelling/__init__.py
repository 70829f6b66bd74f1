"""The cell as a PyBaMM model whose searched parameters are inputs, under a protocol or a measured current."""
