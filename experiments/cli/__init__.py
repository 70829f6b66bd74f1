"""The command line: one file a command, libraries imported when a command needs them."""
