"""What proposers and warm-ups promise."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import pytest

from ..core.hooks import ProposeContext
from ..core.messages import BackendFailure, JsonSchema, Message, Reply
from ..core.proposal import Proposal
from ..core.run.run_plugins import RunPlugins
from ..core.scaffold import Scaffold
from ..core.task import Task
from ..core.trial import Trial
from .run_plugin import SIMULATIONS, RunPluginConformance

REPLIES = {"nothing": "", "prose": "I would raise the radius.", "a list": "[]", "a wrong type": '{"updated_params": 7}'}
"""What models say at times; the text of a reply is untrusted."""


class _Answering:
    """A backend that always says the same, or loses every call."""

    name, sees_images = "conformance", False

    def __init__(self, text: str | None) -> None:
        self._text = text
        self.asked = False

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        self.asked = True
        if self._text is None:
            raise BackendFailure("no reply within its retries")
        return Reply(self._text)

    def close(self) -> None:
        pass


class ProposingConformance(RunPluginConformance):
    """Tests of whoever names candidates, by asking the language model or not."""

    hook: ClassVar[str]

    def proposed(self, plugins: RunPlugins, task: Task, initial: Trial, left: int) -> Proposal | None:
        """The plugin's answer after the initial trial."""
        context = ProposeContext(task, 1, (initial,), initial, 1, left, plugins.recall)
        found: Proposal | None = getattr(plugins, self.hook)(context)
        return found

    @pytest.fixture
    def initial(self, scaffold: Scaffold, task: Task, tmp_path: Path) -> Trial:
        """The simulated initial candidate."""
        return self.run(scaffold, task, tmp_path / "earlier", simulations=1).trials[0]

    def test_a_useless_reply_ends_nothing(self, scaffold: Scaffold, task: Task, tmp_path: Path) -> None:
        """Whatever the language model says, the run goes on to its end; one that never asks it runs once."""
        for reply, text in REPLIES.items():
            backend = _Answering(text)
            result = self.run(scaffold, task, tmp_path / reply, backend)
            assert 1 <= len(result.trials) <= SIMULATIONS, reply
            if not backend.asked:
                break

    def test_a_lost_call_is_a_lost_round(self, scaffold: Scaffold, task: Task, tmp_path: Path, initial: Trial) -> None:
        """Without a reply there are candidates all the same, or the reason why there are none."""
        plugins = self.made(scaffold, task, tmp_path, [], _Answering(None))
        proposal = self.proposed(plugins, task, initial, SIMULATIONS)
        plugins.close()
        assert proposal is None or proposal.candidates or proposal.lost or proposal.finished


class ProposerConformance(ProposingConformance):
    """Tests of a proposer; a subclass gives the fixture ``name``."""

    kind = "proposer"
    part: ClassVar[str] = "proposer"
    hook: ClassVar[str] = "propose"


class WarmUpConformance(ProposingConformance):
    """Tests of a warm-up; a subclass gives the fixture ``name``."""

    kind = "warm-up"
    part: ClassVar[str] = "warm_up"
    hook: ClassVar[str] = "warm_up"

    def test_it_perturbs_within_its_limit(self, plugins: RunPlugins, task: Task, initial: Trial) -> None:
        """No more candidates than may be simulated."""
        proposal = self.proposed(plugins, task, initial, 3)
        assert proposal is None or len(proposal.candidates) <= 3
