"""Records of hundreds of cycles: a table with a line for each cycle, and the curves of a few of them."""
