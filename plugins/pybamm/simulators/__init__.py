"""The plugin and the simulators of discoveries, in worker processes."""
