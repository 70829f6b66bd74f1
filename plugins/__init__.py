"""What takes part in a run: simulators, feedback, memories, proposers, readers, effects."""
