"""A person, a chat window or another program as the model: at the terminal, or by files in a folder."""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from filelock import FileLock

from ..core.contracts.reply_parsing import MAX_REPLY_CHARS
from ..core.errors import BsaError
from ..core.files import file_error, read_json, write_json
from ..core.json_object import json_object
from ..core.messages import (
    UNUSABLE,
    BackendFailure,
    BudgetSpent,
    JsonSchema,
    Message,
    Reply,
    Usage,
    without_alternatives,
)
from ..core.printable import one_line, strip_control
from .terminal import Terminal

_POLL_S = 0.2
_END_MARK = "."


class TerminalBackend:
    """Shows each prompt and reads the reply, up to the end of a JSON object or a line with a single dot."""

    name = "manual"
    sees_images = False

    def __init__(self, terminal: Terminal | None = None) -> None:
        self._terminal = terminal or Terminal()

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`.

        Raises `BudgetSpent` at the end of the input: there is nobody left to answer, and the run stops cleanly.
        """
        started = time.monotonic()
        for message in messages:
            # Memories hold what models said before, so even prompts are not trusted with the terminal.
            self._terminal.say(f"--- {message.role} ---\n{strip_control(message.text)}")
        self._terminal.say(f"--- wanted: one JSON object ---\n{json.dumps(without_alternatives(schema), indent=1)}")
        self._terminal.say(f'--- your reply, ended by "{_END_MARK}" on a line of its own ---')
        return Reply(self._read(), Usage(seconds=time.monotonic() - started), model="manual")

    def _read(self) -> str:
        text = ""
        while json_object(text) is None:
            try:
                line = self._terminal.line()
            except BudgetSpent:
                if text.strip():
                    break
                raise
            if line.strip() == _END_MARK:
                break
            text += line
        return text

    def close(self) -> None:
        """Nothing to release."""


class ExchangeBackend:
    """Leaves each prompt as ``prompt-NNN.json`` in a folder and waits for ``reply-NNN.txt``.

    A prompt appears whole or not at all. A reply counts once it holds a JSON object, or has not grown for two looks;
    whoever writes it elsewhere and renames it is on the safe side. The folder is made if missing; without
    ``timeout_s`` there is no end to the wait. Several processes may share a folder. Standard error is told what is
    waited for and why a reply was refused.
    """

    name = "manual"
    sees_images = True

    def __init__(self, folder: Path, timeout_s: float | None = None) -> None:
        self._folder = folder
        self._timeout_s = timeout_s
        self._mine: set[int] = set()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BsaError(
                f"the exchange folder {folder} cannot be made: {error.strerror}.", "choose another."
            ) from None

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`."""
        started = time.monotonic()
        turns = [
            {"role": message.role, "text": message.text, "images": [str(path.absolute()) for path in message.images]}
            for message in messages
        ]
        prompt: dict[str, Any] = {"messages": turns, "schema": without_alternatives(schema), "seed": seed}
        try:
            with FileLock(self._folder / "prompts.lock"):  # no other process that uses the folder gives the same number
                number = self._place(prompt)
        except OSError as error:
            raise file_error(error, self._folder) from None
        said = messages[-1].text if messages else ""
        refused = f"{one_line(said, 1500)} " if said.startswith(UNUSABLE) else ""
        reply = self._folder / f"reply-{number:03d}.txt"
        line = f"note: {refused}Waiting for {reply}, the reply to prompt-{number:03d}.json."
        print(line, file=sys.stderr, flush=True)
        return Reply(self._wait(reply, started), Usage(seconds=time.monotonic() - started), model="manual")

    def _place(self, prompt: dict[str, Any]) -> int:
        """The prompt's number; it is written, unless a run before this one left the same unanswered or unread."""
        numbers = sorted(int(path.stem[7:]) for path in self._folder.glob("prompt-*.json") if path.stem[7:].isdigit())
        taken = [int(path.stem[6:]) for path in self._folder.glob("reply-*.txt") if path.stem[6:].isdigit()]
        if numbers and numbers[-1] not in self._mine and self._holds(numbers[-1], prompt):
            number = numbers[-1]
        else:
            # A reply without a prompt answers something else; its number is passed over.
            number = max([*numbers, *taken], default=0) + 1
            content = {"number": number, "reply": f"reply-{number:03d}.txt", **prompt}
            write_json(self._folder / f"prompt-{number:03d}.json", content, indent=1)
        self._mine.add(number)
        return number

    def _holds(self, number: int, prompt: dict[str, Any]) -> bool:
        found = read_json(self._folder / f"prompt-{number:03d}.json")
        return found is not None and json.loads(json.dumps(prompt)).items() <= found.items()

    def _wait(self, path: Path, started: float) -> str:
        size = -1
        while True:
            if path.is_file():
                content = path.read_bytes()[: 4 * MAX_REPLY_CHARS]
                text = content.decode("utf-8", errors="replace")
                if text.strip() and (json_object(text) is not None or len(content) == size):
                    return text
                size = len(content)
            if self._timeout_s is not None and time.monotonic() - started > self._timeout_s:
                raise BackendFailure(f"nobody wrote {path.name} within {self._timeout_s:g} s")
            time.sleep(_POLL_S)

    def close(self) -> None:
        """Nothing to release."""
