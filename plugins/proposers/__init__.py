"""Proposers without a language model: blind optimisers and numerical fits."""
