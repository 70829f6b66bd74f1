"""Wires everything: the command line, runs, suites, grids, studies, reports."""
