"""The blind test of discovery: records in which an effect is hidden, and how often its name is found."""
