"""What the products of plugins must be: each is checked once, where it crosses the border.

Every function gives the product back, tidied where that is safe, or raises `Unfit`.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, get_args

from ..effect import Effect, EffectParameter
from ..errors import did_you_mean
from ..feedback import Feedback
from ..hooks import Recollection
from ..messages import Reply, StructuredBy, Usage
from ..parameters import Candidate, ParameterSpace
from ..printable import counted, described, listed, shown, with_article
from ..proposal import Proposal
from ..simulation import ExperimentRun, Outcome, SimulationFailure
from ..task import Experiment, Protocol
from ..task_reduction import TaskReduction
from ..trajectory import Trajectory
from .border import Unfit

T = TypeVar("T")

RESERVED_FILES = ("journal.jsonl", "result.json", "best_parameters.json", "report.html")
"""Files of a run that no exported one may replace."""


def instance(value: object, kind: type[T], what: str = "returned {}") -> T:
    """The value, if it is of this type; ``what`` says where the value stands in the product."""
    if isinstance(value, kind) and not (kind is not bool and isinstance(value, bool)):
        return value
    found = "None" if value is None else f"{described(value)} ({type(value).__name__})"
    raise Unfit(f"{what.format(found)}, not {with_article(kind.__name__)}")


def _number(value: object, what: str) -> float:
    try:
        number = float(value) if not isinstance(value, (str, bytes, bool)) else math.nan  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise Unfit(f"gave {what} = {described(value)}, which is not a finite number")
    return number


def _text(value: object, what: str) -> str:
    return instance(value, str, f"gave {what} = {{}}")


def _json(value: object, what: str, allow_nan: bool = True) -> int:
    """Characters of the value as JSON, which has no numbers that are not finite."""
    try:
        return len(json.dumps(value, ensure_ascii=False, allow_nan=allow_nan))
    except (TypeError, ValueError, RecursionError) as error:
        raise Unfit(
            f"gave {what} that is no JSON ({shown(error, 120)})",
            "give dicts with text keys, lists, texts and finite numbers; None stands for one that is not known.",
        ) from None


def _mapping(value: object, what: str) -> dict[Any, Any]:
    if not isinstance(value, Mapping):
        raise Unfit(f"gave {what} = {described(value)}, not a mapping", "give a dict.")
    return dict(value)


def _texts(values: object, what: str) -> tuple[str, ...]:
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise Unfit(f"gave {what} = {described(values)}, not a tuple of texts")
    return tuple(_text(value, f"one of the {what}") for value in values)


def _periods(values: object, what: str) -> None:
    if not isinstance(values, tuple) or not all(isinstance(value, tuple) and len(value) == 2 for value in values):
        raise Unfit(f"gave {what} = {described(values)}, not a tuple of pairs", "give (from, to) in seconds for each.")
    for value in values:
        for time in value:
            _number(time, f"a time of {what}")


def outcomes(
    pairs: object, candidates: int, experiments: Sequence[Experiment], signals: Sequence[Sequence[str]]
) -> Iterator[tuple[int, Outcome]]:
    """The outcomes of a simulator as they come: one for each candidate, with one run for each experiment.

    ``signals`` are the names of those that each experiment's simulation has.
    """
    if not hasattr(pairs, "__iter__"):
        found = "None" if pairs is None else described(pairs)
        raise Unfit(f"returned {found}, not pairs of place and Outcome", "yield place, outcome for each candidate.")
    missing = set(range(candidates))
    for pair in pairs:
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise Unfit(
                f"yielded {described(pair)}, not a pair of place and Outcome",
                "yield place, outcome for each candidate.",
            )
        place, found = pair
        if not isinstance(place, int) or place not in missing:
            again = isinstance(place, int) and 0 <= place < candidates
            raise Unfit(
                f"answered candidate {described(place)} " + ("twice" if again else f"of {candidates}"),
                f"places are 0 to {candidates - 1}, each answered once.",
            )
        missing.discard(place)
        yield place, outcome(found, experiments, signals)
    if missing:
        raise Unfit(
            f"gave no outcome for {len(missing)} of {counted(candidates, 'candidate')}, the first at place "
            f"{min(missing)}",
            "a failed simulation is an Outcome as well.",
        )


def outcome(product: object, experiments: Sequence[Experiment], signals: Sequence[Sequence[str]]) -> Outcome:
    """One run for each experiment, each with a trajectory of its signals or the reason why there is none."""
    found = instance(product, Outcome, "yielded {}")
    _number(found.seconds, "Outcome.seconds")
    if not isinstance(found.runs, tuple) or len(found.runs) != len(signals):
        count = len(found.runs) if isinstance(found.runs, (tuple, list)) else described(found.runs)
        raise Unfit(
            f"yielded an Outcome with {count} runs for {counted(len(signals), 'experiment')}",
            "Outcome.runs is a tuple.",
        )
    for run, experiment, names in zip(found.runs, experiments, signals, strict=True):
        _run(instance(run, ExperimentRun, "yielded an Outcome with a run that is {}"), names)
        _whole(run, experiment)
    return found


def _whole(run: ExperimentRun, experiment: Experiment) -> None:
    """Refuse a simulation under a measured drive that ends before its record and does not say why.

    Its first samples alone would have the least error. How long the last sample lasts is open, and under a protocol the
    simulated cell decides how long all of it does.
    """
    record = experiment.target
    if experiment.protocol is not None or run.failure is not None or run.trajectory is None:
        return
    if run.trajectory.duration < record.time[-2:][0] - record.time[0]:
        ours = f"{len(run.trajectory)} samples that end after {run.trajectory.duration:,.6g} s"
        theirs = f'the record "{shown(experiment.name)}" has {len(record)} in {record.duration:,.6g} s'
        raise Unfit(
            f"yielded {ours}, without a failure; {theirs}",
            "simulate to the end of the record, or say in SimulationFailure why it ends before.",
        )


def _run(run: ExperimentRun, signals: Sequence[str]) -> None:
    if run.failure is not None:
        failure = instance(run.failure, SimulationFailure, "yielded a run whose failure is {}")
        for name in ("cause", "step", "limit"):
            _text(getattr(failure, name), f"SimulationFailure.{name}")
        instance(failure.cycle, int, "gave SimulationFailure.cycle = {}")
        instance(failure.unfinished, bool, "gave SimulationFailure.unfinished = {}")
        _number(failure.reached_s, "SimulationFailure.reached_s")
    _texts(run.limits, "ExperimentRun.limits")
    _periods(run.at_limit, "ExperimentRun.at_limit")
    if run.trajectory is None:
        if run.failure is None:
            raise Unfit("yielded a run with neither a trajectory nor a failure")
        return
    trajectory = instance(run.trajectory, Trajectory, "yielded a run whose trajectory is {}")
    if len(trajectory) == 0:
        raise Unfit("yielded an empty trajectory", "where nothing was reached, the trajectory is None.")
    lacking = [name for name in signals if name not in trajectory.signals]
    if lacking:
        raise Unfit(f"yielded a trajectory without {listed(lacking)}", "it holds every signal of the task.")
    covered = [0, *(step.stop for step in trajectory.steps)]
    if trajectory.steps and [step.start for step in trajectory.steps] + [len(trajectory)] != covered:
        raise Unfit("yielded a trajectory whose steps do not cover its samples one after the other")
    if run.failure is None and not trajectory.steps:
        raise Unfit("yielded a trajectory without steps", "bsa.core.segmentation.segment cuts it into steps.")


def feedback(product: object, folder: Path) -> Feedback:
    """JSON-ready content, and images inside the run's folder."""
    found = instance(product, Feedback)
    _json(_mapping(found.content, "Feedback.content"), "Feedback.content", allow_nan=False)
    for image in found.images:
        if not isinstance(image, Path) or not image.is_relative_to(folder) or not image.is_file():
            raise Unfit(f"gave the image {described(image)}", "give paths of PNG files in the run's folder.")
    return found


def proposal(product: object, space: ParameterSpace) -> Proposal:
    """Complete candidates of finite numbers, as plain floats in the order of the space; texts that are texts."""
    found = instance(product, Proposal)
    for name in ("hypothesis", "rationale", "action", "lost"):
        _text(getattr(found, name), f"Proposal.{name}")
    for name in ("finished", "advancing", "by_simulations"):
        instance(getattr(found, name), bool, f"gave Proposal.{name} = {{}}")
    for name in ("updates", "details"):
        _json(_mapping(getattr(found, name), f"Proposal.{name}"), f"Proposal.{name}")
    if not isinstance(found.candidates, (tuple, list)):
        raise Unfit(f"gave Proposal.candidates = {described(found.candidates)}, not a tuple of candidates")
    if len(found.reductions) not in (0, len(found.candidates)) or not all(
        reduction is None or isinstance(reduction, TaskReduction) for reduction in found.reductions
    ):
        raise Unfit(
            f"gave Proposal.reductions = {described(found.reductions)}", "give one TaskReduction or None a candidate."
        )
    if not (found.candidates or found.lost or found.finished):
        raise Unfit(
            "gave a Proposal without candidates and without a reason",
            "say in lost why the round is lost, or finished=True where the search is over.",
        )
    return replace(found, candidates=tuple(_candidate(candidate, space) for candidate in found.candidates))


def _candidate(candidate: object, space: ParameterSpace) -> Candidate:
    values = _mapping(candidate, "a candidate")
    unknown = [name for name in values if name not in space.names]
    if unknown:
        nearest = did_you_mean(str(unknown[0]), space.names)
        raise Unfit(f"gave a candidate with {listed(unknown)}, which is not searched", nearest)
    missing = [name for name in space.names if name not in values]
    if missing:
        raise Unfit(
            f"gave a candidate without {listed(missing)}",
            "a candidate holds a value for every searched parameter; begin with dict(context.best.candidate).",
        )
    return {name: _number(values[name], f'candidate["{name}"]') for name in space.names}


def recollection(product: object) -> tuple[Recollection | None, int]:
    """A heading, JSON-ready content and its number of characters."""
    if product is None:
        return None, 0
    found = instance(product, Recollection)
    _text(found.title, "Recollection.title")
    instance(found.priority, int, "gave Recollection.priority = {}")
    return found, _json(_mapping(found.content, "Recollection.content"), "Recollection.content")


def reply(product: object) -> Reply:
    """Text, what it cost, and how it was held to the schema."""
    found = instance(product, Reply)
    _text(found.text, "Reply.text")
    _text(found.model, "Reply.model")
    usage = instance(found.usage, Usage, "gave Reply.usage = {}")
    known = [name for name in Usage.__dataclass_fields__ if name != "cost_usd" or usage.cost_usd is not None]
    for name in known:
        if _number(getattr(usage, name), f"Usage.{name}") < 0:
            raise Unfit(f"gave Usage.{name} = {getattr(usage, name)}, which is negative")
    if found.structured_by not in get_args(StructuredBy):
        forms = ", ".join(get_args(StructuredBy))
        raise Unfit(f"gave Reply.structured_by = {described(found.structured_by)}", f"it is one of {forms}.")
    return replace(found, notes=_texts(found.notes, "Reply.notes"))


def effect(product: object, entry: str) -> Effect:
    """An effect of its entry's name, with parameters."""
    found = instance(product, Effect)
    for name in ("name", "title", "equation", "signature", "citation", "variant"):
        _text(getattr(found, name), f"Effect.{name}")
    if entry != found.name and not entry.startswith(found.name + "."):
        raise Unfit(
            f'returned the effect "{shown(found.name)}"',
            f'name the effect "{entry}" as its entry, or the entry "{shown(found.name)}.VARIANT".',
        )
    if not isinstance(found.parameters, tuple) or not found.parameters:
        raise Unfit("returned an effect without parameters", "the first parameter is the strength.")
    for parameter in found.parameters:
        instance(parameter, EffectParameter, "returned an effect with a parameter that is {}")
    return found


def protocols(product: object) -> Mapping[str, Protocol]:
    """Cycles of steps by name."""
    if product is None:
        return {}
    found = _mapping(product, "the product")
    return {
        _text(name, "a protocol's name"): tuple(_texts(cycle, f"steps of {shown(name)}") for cycle in cycles)
        for name, cycles in found.items()
    }


def yes_or_no(product: object) -> bool:
    """A checked answer to a question; that of a plugin that has none is no."""
    return product is not None and instance(product, bool)


def experiments(product: object, count: int) -> tuple[Experiment, ...] | None:
    """So many experiments, the very tuple that came: what was compiled for it is kept under its identity."""
    if product is None:
        return None
    found = instance(product, tuple)
    for part in found:
        instance(part, Experiment, "returned a tuple with {}")
    if len(found) != count:
        raise Unfit(f"returned {len(found)} experiments for the {count} of the task")
    return found


def files(product: object) -> Mapping[str, Any]:
    """Contents by plain file name."""
    if product is None:
        return {}
    found = _mapping(product, "the product")
    for name, content in found.items():
        _text(content, f"the content of {shown(name)}")
        plain = _text(name, "a file name")
        if (
            not plain
            or Path(plain).name != plain
            or plain.startswith(".")
            or not plain.isprintable()
            or plain in RESERVED_FILES
        ):
            raise Unfit(
                f'gave the file name "{shown(plain)}"', "give plain file names that the run itself does not use."
            )
    return found
