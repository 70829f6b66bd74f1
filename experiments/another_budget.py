"""More simulations, rounds or patience for a run that is taken up again."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.errors import BsaError
from ..core.printable import counted, shown
from ..core.run.budget import BUDGET, RAISED, begun_rounds, simulated
from ..core.run.journal import LOCK, Event, Journal
from ..core.run.loop import RunResult
from ..core.run.run_config import RunConfig

_WORDS = {
    "simulations": "{} simulations in all, before {}",
    "rounds": "{} rounds in all, before {}",
    "patience": "a patience of {} rounds, before {}",
}
_OPTIONS = {"simulations": "--simulations {}", "rounds": "--rounds {}", "patience": "--set patience={}"}


def asked_anew(settings: Mapping[str, Any], **budgets: int | None) -> dict[str, Any]:
    """What of the budget is asked for anew; None leaves what the run had. Raises `BsaError` on any other setting."""
    other = [key for key in settings if key not in RAISED]
    if other:
        raise BsaError(
            f"--set {shown(other[0])}: a run that is taken up again keeps its settings.",
            f"leave it out, or begin a run of its own; {', '.join(RAISED)} can be raised.",
        )
    return {**{key: value for key, value in budgets.items() if value is not None}, **settings}


def budget_of(config: RunConfig) -> dict[str, int]:
    """What a run that is taken up again may be given more of."""
    return {key: getattr(config, key) for key in RAISED}


def given_anew(known: Mapping[str, Any], config: RunConfig) -> dict[str, int]:
    """What of the budget is not what the run had."""
    return {key: value for key, value in budget_of(config).items() if value != known.get(key)}


def resuming_with(folder: Path, given: Mapping[str, int]) -> str:
    """The command that goes on with a run under another budget."""
    options = " ".join(_OPTIONS[key].format(value) for key, value in given.items())
    return f"bsa run --resume {shlex.quote(str(folder))} {options}"


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
            f"the run has made {counted(done, 'simulation')}, which is more than --simulations {config.simulations}.",
            f"give more than {done}: those that {path} holds count with the new ones.",
        )
    for key in ("rounds", "patience"):
        given, before = getattr(config, key), known.get(key, 0)
        if given < before:
            raise BsaError(
                f"{_OPTIONS[key].format(given)} is less than the {before} of the run.",
                "give more, or leave it out; --simulations may end the search sooner.",
            )


def write_budget(journal: Journal, earlier: list[dict[str, Any]], known: Mapping[str, Any], config: RunConfig) -> None:
    """Enter another budget into the journal and into its ``earlier`` events."""
    event = {**budget_of(config), "proposals": begun_rounds(earlier)}
    journal.append(BUDGET, **event)
    earlier.append({"event": BUDGET, **event})
    words = "; ".join(_WORDS[key].format(value, known.get(key)) for key, value in given_anew(known, config).items())
    journal.append("note", text=f"The run was taken up again with another budget: {words}.")
    journal.warnings.append(f"The run goes on with another budget: {words}.")


def nothing_added(folder: Path, earlier: Sequence[Event], config: RunConfig, result: RunResult) -> str:
    """What to say where a run was given more and its search ended by itself where it had ended before; else empty."""
    by_itself = result.status in ("finished", "converged") and not result.reason
    rebudgeted = bool(earlier) and earlier[-1]["event"] == BUDGET
    if not (rebudgeted and by_itself and len(result.trials) == simulated(earlier)):
        return ""
    said = "The search had ended by itself and not by its budget, so that nothing was added."
    if result.status == "converged" and result.lowest.objective > config.stop_below:
        more = resuming_with(folder, {"patience": 2 * config.patience})
        rounds = "round" if config.patience == 1 else f"{config.patience} rounds"
        return f"{said} Its last {rounds} gained nothing; to allow it more of them: {more}"
    return f"{said} Another search, as with another --seed, is a run of its own."
