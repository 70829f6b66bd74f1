"""What a proposer remembers and what it knew beforehand."""
