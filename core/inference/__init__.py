"""What records say about parameters: least squares, intervals, predictions, what to measure next."""
