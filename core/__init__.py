"""The ideas: parameters, trajectories, trials, hooks, the loop."""
