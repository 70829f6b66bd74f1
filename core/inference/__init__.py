"""What records say about parameters: observations, the problem, least squares, intervals, what to measure next."""
