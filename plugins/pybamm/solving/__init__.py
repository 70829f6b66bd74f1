"""Experiments of every kind, compiled once and solved for any candidate."""
