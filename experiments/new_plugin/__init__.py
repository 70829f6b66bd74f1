"""``bsa new-plugin``: a small package of one's own, with a plugin that works and a test that passes."""
