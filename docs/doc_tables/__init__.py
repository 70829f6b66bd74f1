"""Tables of the documentation, each made from the rows in ``docs/results``."""
