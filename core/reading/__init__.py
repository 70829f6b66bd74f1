"""From a file to a checked record, whichever reader reads it."""
