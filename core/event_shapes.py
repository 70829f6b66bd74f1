"""What the events of a journal look like; every reader may rely on it."""

from dataclasses import dataclass, field
from typing import Any, Literal

from .encoding import TrialRecord
from .identifiability import Combination, Interval
from .messages import Usage
from .prediction import Band
from .record_errors import RecordErrors, SignalError, StepErrors
from .shape import check_json
from .trial import Phase


@dataclass(frozen=True)
class _Run:
    config: dict[str, Any] = field(default_factory=dict)
    task: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Turn:
    role: str
    text: str
    images: int


@dataclass(frozen=True)
class _Reply:
    text: str
    usage: Usage
    model: str
    structured_by: str
    notes: list[str]
    prompt: list[_Turn]


@dataclass(frozen=True)
class _LostCall:
    reason: str
    prompt: list[_Turn]
    refused: bool = False


@dataclass(frozen=True)
class _Ballot:
    problem: str
    changes: dict[str, Any]


@dataclass(frozen=True)
class _Vote:
    text: str
    rule: str
    ballots: list[_Ballot]


@dataclass(frozen=True)
class _Review:
    text: str
    verdict: Literal["accept", "edit", "refuse"]


@dataclass(frozen=True)
class _Proposal:
    phase: Phase
    round: int
    hypothesis: str
    rationale: str
    action: str
    updates: dict[str, str]
    details: dict[str, Any]
    lost: str
    finished: bool


@dataclass(frozen=True)
class _Score:
    index: int
    metrics: dict[str, float] | None
    records: list[RecordErrors] = field(default_factory=list)


@dataclass(frozen=True)
class _Predicted:
    record: str
    signals: dict[str, SignalError]
    steps: list[StepErrors]
    failure: str
    bands: dict[str, Band]
    simulations: int
    curve: dict[str, Any] | None


@dataclass(frozen=True)
class _HeldOut:
    base: int
    predictions: list[_Predicted]
    draws: int | None = None  # Of the posterior that their bands have; earlier versions did not write it.


@dataclass(frozen=True)
class _Suggestion:
    name: str
    protocol: list[list[str]]
    hours: float
    worst: str
    worst_share_of_range: float
    shares_of_range: dict[str, float]


@dataclass(frozen=True)
class _Appraised:
    base: int
    intervals: dict[str, Interval]
    combinations: list[Combination]
    correlated: list[list[str]]
    noise: float
    points: int
    unknown: list[str]
    unsettled: list[str]
    worst: str
    measure_next: list[_Suggestion]
    simulations: int
    reused: int
    seconds: float


@dataclass(frozen=True)
class _Appraisal:
    appraisal: _Appraised


@dataclass(frozen=True)
class _AppraisalSimulation:
    experiments: list[str]
    candidate: dict[str, float]
    outcome: dict[str, Any]


@dataclass(frozen=True)
class _Simulation:
    key: str
    # voltage, temperature: Of a measured record.
    voltage: str | None = None
    temperature: str | None = None
    residual: str | None = None  # Of a life.


@dataclass(frozen=True)
class _Refused:
    effect: str
    why: str


@dataclass(frozen=True)
class _Note:
    text: str


@dataclass(frozen=True)
class _End:
    status: str


_SHAPES = {
    "run": _Run,
    "trial": TrialRecord,
    "reply": _Reply,
    "lost-call": _LostCall,
    "vote": _Vote,
    "review": _Review,
    "proposal": _Proposal,
    "score": _Score,
    "appraisal": _Appraisal,
    "held-out": _HeldOut,
    "appraisal-simulation": _AppraisalSimulation,
    "simulation": _Simulation,
    "refused": _Refused,
    "note": _Note,
    "end": _End,
}


def check_event(kind: str, line: bytes) -> None:
    """Hold an event to its shape; a kind that is not known here passes.

    ``line`` is the event as it stands in the journal. Raises `ValueError` if a field is missing or of another type,
    with its name.
    """
    if kind in _SHAPES:
        check_json(_SHAPES[kind], line)
