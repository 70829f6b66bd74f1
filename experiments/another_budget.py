"""Another number of simulations or rounds for a run that is taken up again."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.budget import BUDGET, begun_rounds, simulated
from ..core.errors import BsaError
from ..core.journal import LOCK, Event, Journal
from ..core.loop import RunResult
from ..core.run_config import RunConfig

NOTHING_ADDED = (
    "The search had ended by itself and not by its budget, so that nothing was added. Another search, as with another "
    "--seed, is a run of its own."
)


def budget_of(config: RunConfig) -> dict[str, int]:
    """What a run that is taken up again may be given more of."""
    return {"simulations": config.simulations, "rounds": config.rounds}


def given_anew(known: Mapping[str, Any], config: RunConfig) -> dict[str, int]:
    """What of the budget is not what the run had."""
    return {key: value for key, value in budget_of(config).items() if value != known.get(key)}


def resuming_with(folder: Path, given: Mapping[str, int]) -> str:
    """The command that goes on with a run under another budget."""
    allowed = " ".join(f"--{key} {value}" for key, value in given.items())
    return f"bsa run --resume {shlex.quote(str(folder))} {allowed}"


def check_budget(path: Path, earlier: Sequence[Event], known: Mapping[str, Any], config: RunConfig) -> None:
    """Refuse a budget that is smaller than what the journal at ``path`` holds. Raises `BsaError`."""
    if (path.parent / LOCK).exists():
        raise BsaError(
            f"{path.parent} is a run of a grid, whose cells are compared by their budgets.",
            "give the grid other simulations or rounds; or copy the folder without its file lock, and resume the copy.",
        )
    done = simulated(earlier)
    if config.simulations < done:
        raise BsaError(
            f"the run has made {done} simulations, which is more than --simulations {config.simulations}.",
            f"give more than {done}: those that {path} holds count with the new ones.",
        )
    if config.rounds < known.get("rounds", 0):
        raise BsaError(
            f"--rounds {config.rounds} is less than the {known['rounds']} of the run.",
            "give more, or leave it out; --simulations may end the search sooner.",
        )


def write_budget(journal: Journal, earlier: list[dict[str, Any]], known: Mapping[str, Any], config: RunConfig) -> None:
    """Enter another budget into the journal and into its ``earlier`` events."""
    event = {**budget_of(config), "proposals": begun_rounds(earlier)}
    journal.append(BUDGET, **event)
    earlier.append({"event": BUDGET, **event})
    given = given_anew(known, config)
    words = "; ".join(f"{value} {key} in all, before {known.get(key)}" for key, value in given.items())
    journal.append("note", text=f"The run was taken up again with another budget: {words}.")
    journal.warnings.append(f"The run goes on with another budget: {words}.")


def added_nothing(earlier: Sequence[Event], result: RunResult) -> bool:
    """Whether a run was just given another budget and its search ended by itself where it had ended before."""
    by_itself = result.status in ("finished", "converged") and not result.reason
    rebudgeted = bool(earlier) and earlier[-1]["event"] == BUDGET
    return rebudgeted and by_itself and len(result.trials) == simulated(earlier)
