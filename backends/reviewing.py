"""Lets a person accept, edit or refuse each proposal before it is simulated (``--review``)."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TextIO

from ..core.errors import BsaError
from ..core.messages import Backend, BudgetSpent, JsonSchema, Message, Reply
from ..core.reply_parsing import parse_object, strip_control

UPDATES = "updated_params"
REFUSED = "refused"
"""Key under which a refused reply holds the reviewer's reason."""


@dataclass(frozen=True)
class Verdict:
    """What a reviewer decided.

    Attributes
    ----------
    kind : {'accept', 'edit', 'refuse'}
        The decision.
    text : str
        The edited reply, or the reason of a refusal.
    """

    kind: Literal["accept", "edit", "refuse"]
    text: str = ""


Reviewer = Callable[[str], Verdict]
"""Is shown a reply, free of control codes, and decides."""


class ReviewingBackend:
    """Asks another backend, and a person about its reply.

    A refused reply stays in the journal with its changes taken out: ``{"refused": "<reason>", ...,
    "updated_params": {}}`` and a note that begins with ``refused``. The proposer finds no change in it and asks
    the model again, which reads the reason; or the round is lost. The changes refused are in the note.

    Parameters
    ----------
    inner : Backend
        Is asked.
    reviewer : callable, optional
        Decides; a person at the terminal if unset.
    """

    def __init__(self, inner: Backend, reviewer: Reviewer | None = None) -> None:
        self._inner = inner
        self._reviewer = reviewer or TerminalReviewer()
        self.name = f"{inner.name}, reviewed"
        self.sees_images = inner.sees_images

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`."""
        reply = self._inner.complete(messages, schema, seed=seed)
        verdict = self._reviewer(_shown(reply.text, schema))
        if verdict.kind == "edit":
            note = f"edited by the reviewer; the model wrote: {reply.text}"
            return replace(reply, text=verdict.text, notes=(*reply.notes, note))
        if verdict.kind == "refuse":
            return _refused(reply, schema, verdict.text)
        return replace(reply, notes=(*reply.notes, "accepted by the reviewer"))

    def close(self) -> None:
        """Release the model."""
        self._inner.close()


def _shown(text: str, schema: JsonSchema) -> str:
    try:
        content = parse_object(text, schema.get("properties", ()))
    except BsaError:
        return strip_control(text)
    return strip_control(json.dumps(content, ensure_ascii=False, indent=2))


def _refused(reply: Reply, schema: JsonSchema, reason: str) -> Reply:
    content: dict[str, Any] = {}
    try:
        content = parse_object(reply.text, schema.get("properties", ()))
    except BsaError as error:
        content["analysis"] = error.message
    changes = json.dumps(content.get(UPDATES), ensure_ascii=False)
    refusal = {REFUSED: reason or "no reason given", **content, UPDATES: {}}
    note = f"refused by the reviewer ({refusal[REFUSED]}); the model wrote: {changes}"
    return replace(reply, text=json.dumps(refusal, ensure_ascii=False), notes=(*reply.notes, note))


class TerminalReviewer:
    """A person at the terminal.

    Parameters
    ----------
    source, target : text stream, optional
        Where to read and write; standard input and standard error.
    """

    def __init__(self, source: TextIO | None = None, target: TextIO | None = None) -> None:
        self._source = source
        self._target = target

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
        """The edited text, or None if it holds no object."""
        editor = os.environ.get("VISUAL") or os.environ.get("EDITOR")
        if editor and self._source is None:
            edited = _in_editor(shlex.split(editor), shown)
        else:
            self._say('write the reply, ended by "." on a line of its own:')
            lines: list[str] = []
            while (line := self._line()).strip() != ".":
                lines.append(line)
            edited = "".join(lines)
        try:
            parse_object(edited)
        except BsaError as error:
            self._say(str(error))
            return None
        return edited

    def _line(self) -> str:
        line = (self._source or sys.stdin).readline()
        if not line:
            raise BudgetSpent("the input ended: nobody reviews any more")
        return line

    def _say(self, text: str) -> None:
        print(text, file=self._target or sys.stderr, flush=True)


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
