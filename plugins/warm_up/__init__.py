"""What is tried before the search, to learn what each parameter does (Algorithm 1, phase 1)."""
