"""What a plugin promises, as pytest classes: subclass the one of your plugin's kind and give its name."""

# ruff: noqa: E402 (assertions are rewritten in what is imported after the call)

from ..core.extras import require

_KINDS = ("backend", "effect", "entry", "feedback", "memory", "proposer", "reader", "route", "simulator", "task")

# Their assertions then show values.
require("pytest", "testing", "bsa.testing").register_assert_rewrite(
    *(f"{__name__}.{module}" for module in (*_KINDS, "run_plugin"))
)

from .backend import BackendConformance
from .effect import EffectConformance
from .entry import EntryConformance
from .feedback import FeedbackConformance
from .memory import MemoryConformance
from .proposer import ProposerConformance, WarmUpConformance
from .reader import ReaderConformance
from .route import RouteConformance
from .sample_task import sample_task
from .simulator import SimulatorConformance
from .task import TaskConformance

__all__ = [
    "BackendConformance",
    "EffectConformance",
    "EntryConformance",
    "FeedbackConformance",
    "MemoryConformance",
    "ProposerConformance",
    "ReaderConformance",
    "RouteConformance",
    "SimulatorConformance",
    "TaskConformance",
    "WarmUpConformance",
    "sample_task",
]
