"""Lets a person accept, edit or refuse each proposal before it is simulated (``--review``)."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from ..core.contracts.reply_parsing import parse_object
from ..core.errors import BsaError
from ..core.messages import Backend, JsonSchema, Message, Reply, ReplyRefused
from ..core.printable import strip_control
from ..core.run.recording import REVIEW, BackendAround, Recorder
from .terminal import Terminal


@dataclass(frozen=True)
class Verdict:
    """What a reviewer decided."""

    kind: Literal["accept", "edit", "refuse"]  # The decision.
    text: str = ""  # The edited reply, or the reason of a refusal.

    def on(self, reply: Reply) -> Reply:
        """The reply as it passes on. Raises `ReplyRefused` if it does not."""
        if self.kind == "refuse":
            raise ReplyRefused(reply, self.text or "no reason given")
        return replace(reply, text=self.text) if self.kind == "edit" else reply


Reviewer = Callable[[str], Verdict]
"""Is shown a reply, free of control codes, and decides."""


class ReviewingBackend(BackendAround):
    """Asks another backend, and a person about its reply.

    ``reviewer`` decides, by default a person at the terminal. What the recorder has of an interrupted run is not asked
    for again.
    """

    def __init__(self, inner: Backend, reviewer: Reviewer | None = None, recorder: Recorder | None = None) -> None:
        super().__init__(inner)
        self._reviewer = reviewer or TerminalReviewer()
        self._recorder = recorder
        self.name = f"{inner.name}, reviewed"

    def recorded_by(self, recorder: Recorder) -> ReviewingBackend:
        """See `bsa.core.run.recording.Layer`: the model's own reply is recorded, and the verdict on it."""
        return ReviewingBackend(recorder.around(self._inner), self._reviewer, recorder)

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`. Raises `ReplyRefused` if the person refuses the reply."""
        reply = self._inner.complete(messages, schema, seed=seed)
        return self._verdict(reply, schema).on(reply)

    def _verdict(self, reply: Reply, schema: JsonSchema) -> Verdict:
        event = self._recorder.recorded(REVIEW) if self._recorder is not None else None
        if event is not None:
            return Verdict(event["verdict"], event["text"])
        verdict = self._reviewer(_shown(reply.text, schema))
        if self._recorder is not None:
            self._recorder.journal.append(REVIEW, verdict=verdict.kind, text=verdict.text)
        return verdict


def _shown(text: str, schema: JsonSchema) -> str:
    try:
        content = parse_object(text, schema.get("properties", ()))
    except BsaError:
        return strip_control(text)
    return strip_control(json.dumps(content, ensure_ascii=False, indent=2))


class TerminalReviewer:
    """A person at the terminal."""

    def __init__(self, terminal: Terminal | None = None) -> None:
        self._terminal = terminal or Terminal()
        self._say, self._line = self._terminal.say, self._terminal.line

    def __call__(self, shown: str) -> Verdict:
        """Show a reply and ask until there is a decision."""
        self._say(f"--- proposal ---\n{shown}")
        while True:
            self._say("accept [Enter], edit [e] or refuse [r]?")
            choice = self._line().strip().casefold()
            if choice in ("", "a", "accept", "y", "yes"):
                return Verdict("accept")
            if choice in ("e", "edit"):
                edited = self._edit(shown)
                if edited is not None:
                    return Verdict("edit", edited)
            if choice in ("r", "refuse", "n", "no"):
                self._say("why? (the model will read it)")
                return Verdict("refuse", strip_control(self._line().strip()))

    def _edit(self, shown: str) -> str | None:
        """The edited text, or None if it holds no object, or the editor was left with an error (``:cq``)."""
        editor = os.environ.get("VISUAL") or os.environ.get("EDITOR")
        try:
            opens = editor and self._terminal.has_screen
            edited = _in_editor(shlex.split(editor), shown) if opens else self._typed()
            parse_object(edited)
        except BsaError as error:
            self._say(str(error))
            return None
        return edited

    def _typed(self) -> str:
        self._say('write the reply, ended by "." on a line of its own:')
        lines: list[str] = []
        while (line := self._line()).strip() != ".":
            lines.append(line)
        return "".join(lines)


def _in_editor(editor: list[str], text: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proposal.json"
        path.write_text(text, encoding="utf-8")
        try:
            subprocess.run([*editor, str(path)], check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise BsaError(
                f'the editor "{editor[0]}" failed: {error}.', "set the variable EDITOR, or unset it."
            ) from None
        return path.read_text(encoding="utf-8", errors="replace")
