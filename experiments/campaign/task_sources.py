"""From the tasks that a grid names to tasks in the store, with the words by which tables group them."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

from ...core.errors import BsaError, did_you_mean
from ...core.files import read_json, write_json
from ...core.run.run_config import hash_of
from ..suite.case import SuiteCase
from ..suite.selection import choose, load_suite
from ..suite.starts import start_name, started
from .calibration import TaskLabel
from .grid_file import SuiteFilter, TaskChoice
from .identity import versions_of_study
from .store import Store

_USUAL_CASES = 40
"""Cases of a suite that is drawn, where nobody says how many."""

_NUMBER = re.compile(r"(\d{1,4})$")
"""The number of a case at the end of its key."""

Say = Callable[[str], None]

OWN = "own"
"""Mode of a task that belongs to no suite."""


def gather(
    choices: Sequence[TaskChoice], store: Store, near: Path, say: Say = lambda line: None, make: bool = True
) -> list[TaskLabel]:
    """The tasks that are chosen, each made at most once and kept.

    Task files are looked for in ``near``, the grid's folder, first. ``say`` is told of each target that is made, which
    takes seconds; without ``make`` tasks of a suite that are not in the store are not made.
    """
    found: list[TaskLabel] = []
    for choice in choices:
        if isinstance(choice, SuiteFilter):
            cases = product(suite_cases(choice).values(), choice.starts)
            found += [_case(case, choice.search, start, store, say, make) for case, start in cases]
        else:
            found.append(_own(choice, store, near))
    return list(dict.fromkeys(found))


def _own(name: str, store: Store, near: Path) -> TaskLabel:
    from ..tasks.find import find_task
    from ..tasks.task_file import is_task_file

    path = Path(name)
    beside = near / path
    task = find_task(str(beside if is_task_file(path) and beside.is_file() else path))
    digest = store.put_task(task)
    chemistry = str(task.cell.parameter_set) or task.domain.name
    return TaskLabel(
        task.name, OWN, chemistry, digest=digest, simulator=task.simulator, effects=tuple(task.cell.effects)
    )


def _count(cases: int | str | list[str] | None) -> int:
    """How many cases of a drawn suite there are to choose from: up to the last one that is named."""
    if isinstance(cases, int):
        return cases
    named = cases.split(",") if isinstance(cases, str) else cases or []
    numbers = [int(found[1]) for key in named if (found := _NUMBER.search(key.strip()))]
    return max(_USUAL_CASES, *(1 + number for number in numbers), 0)


def suite_cases(wanted: SuiteFilter) -> dict[str, SuiteCase]:
    """The cases that a filter takes, by key. Raises `BsaError` if the filter leaves nothing."""
    count = _count(wanted.cases)
    cases = load_suite(
        wanted.suite,
        wanted.folder,
        seed=wanted.draw,
        count=count if wanted.chemistry is None else 8 * count,
        noise_v=wanted.noise_mv / 1e3,
    )
    for attribute, value in (("mode", wanted.mode), ("parameter_set", wanted.chemistry), ("rates", wanted.rates)):
        allowed = [value] if isinstance(value, str) else value
        if allowed:
            known = {getattr(case, attribute) for case in cases.values()}
            cases = {key: case for key, case in cases.items() if getattr(case, attribute) in allowed}
            if not cases:
                raise _none_has(wanted, attribute.replace("_", " "), allowed, known)
    return choose(cases, wanted.cases, wanted.draw)


def _none_has(wanted: SuiteFilter, what: str, allowed: Sequence[str], known: Iterable[str]) -> BsaError:
    said = f"no case of the {wanted.suite} suite has the {what} {' or '.join(allowed)}"
    nearest = next(filter(None, (did_you_mean(name, known) for name in allowed)), "")
    return BsaError(f"{said}.", nearest or f"it has {', '.join(sorted(known))}.")


def _case(case: SuiteCase, search: str | None, start: int, store: Store, say: Say, make: bool) -> TaskLabel:
    label = TaskLabel(start_name(case.key, start), case.mode, case.parameter_set, case.rates)
    asked = {"case": asdict(case), "search": search, "start": start, "versions": versions_of_study()}
    note = store.root / "tasks" / f"{hash_of(asked, 32)}.case.json"
    known = read_json(note)
    if known is not None:
        digest, trouble = str(known.get("digest", "")), str(known.get("trouble", ""))
        if trouble or store.has_task(digest):
            return replace(label, digest=digest, trouble=trouble)
    if not make:
        return label
    from ..suite.build import NoTarget, build_task

    say(f"making the target of {label.key} ({case.parameter_set}, {case.rates})")
    try:
        label = replace(label, digest=store.put_task(started(build_task(case, search), start)))
    except BsaError as error:
        label = replace(label, trouble=error.message)
        if not isinstance(error, NoTarget):  # a full disk, perhaps: the next command tries again
            return label
    write_json(note, {"digest": label.digest, "trouble": label.trouble})
    return label
