"""``bsa mcp``: this package's functions as tools of an assistant that speaks the Model Context Protocol."""
