"""What is said of a run in which no reply of the language model could be used."""

from ..core.printable import counted
from ..core.run.loop import RunResult


def none_usable(result: RunResult) -> bool:
    """Whether the language model replied, and never so that anything could be made of it."""
    return result.unusable_replies == result.llm_calls - result.lost_calls > 0


def only_lost_rounds(result: RunResult) -> bool:
    """Whether nothing was searched for that reason: more rounds would be lost likewise."""
    return none_usable(result) and not any(trial.phase == "search" for trial in result.trials)


def reply_notes(result: RunResult) -> list[str]:
    """A sentence on what to do where no reply could be used."""
    if not none_usable(result):
        return []
    return [
        f"The language model replied {counted(result.unusable_replies, 'time')}, and no reply could be used. Another "
        "model (--backend) may do better, or a scaffold that asks less of it (--scaffold digest) or nothing "
        "(--scaffold least-squares)."
    ]
