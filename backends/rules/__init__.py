"""A deterministic reasoner that needs no model: it reads the prompt and answers in the same JSON."""
