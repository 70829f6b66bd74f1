"""The agent decides what to change, least squares decides how much."""
