"""Where tasks come from: task files, measured records, and the packaged demonstration."""
