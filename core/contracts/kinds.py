"""The kinds of plugins. Nothing heavy is imported here: the command line needs their names before anything else."""

from typing import Literal

Kind = Literal["simulator", "feedback", "memory", "proposer", "warm-up", "backend", "route", "reader", "effect", "task"]

HOOKS: dict[Kind, str] = {
    "simulator": "bsa_simulators",
    "feedback": "bsa_feedback_builders",
    "memory": "bsa_memories",
    "proposer": "bsa_proposers",
    "warm-up": "bsa_warm_ups",
    "backend": "bsa_backends",
    "route": "bsa_routes",
    "reader": "bsa_readers",
    "effect": "bsa_effects",
    "task": "bsa_tasks",
}
"""The hook of a catalogue that lists each kind."""

KINDS: tuple[Kind, ...] = tuple(HOOKS)


def plural(kind: Kind) -> str:
    """The kind's name for several of them."""
    return {"memory": "memories", "feedback": "feedback"}.get(kind, f"{kind}s")
