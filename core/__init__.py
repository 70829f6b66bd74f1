"""The ideas: parameters, trajectories, trials and hooks; in rooms below, what is done with them."""
