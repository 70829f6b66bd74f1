"""YAML from outside the program: plain values, of bounded size and depth, and one line on what is wrong."""

from pathlib import Path
from typing import Any

import yaml

from .errors import BsaError
from .files import file_error

YAML_SUFFIXES = (".yaml", ".yml")
"""How the name of a YAML file ends."""

_TAG = "tag:yaml.org,2002:"

_LONGEST = 2**20
"""Characters: far more than a person writes, and read in seconds."""

_DEEPEST = 50
"""Levels: far more than a person writes, far less than Python's stack takes."""

_MOST_VALUES = 100_000
"""Values with every alias written out: a few lines of aliases to aliases would otherwise make billions."""

_KINDS = ("null", "bool", "int", "float", "str", "seq", "map")
"""What JSON can hold. A date stays the text that it is: a journal could not keep it."""


class _Loader(yaml.SafeLoader):
    """The safe loader for plain values, with bounds, and with one kind of error for whatever cannot be read."""

    yaml_constructors = {  # noqa: RUF012  (PyYAML's own way)
        tag: make
        for tag, make in yaml.SafeLoader.yaml_constructors.items()
        if tag is None or tag.removeprefix(_TAG) in _KINDS
    }
    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, pattern) for tag, pattern in resolvers if tag != f"{_TAG}timestamp"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0
        self._count = 0
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Count the values as they are read, an alias as all that it stands for."""
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        is_alias = self.check_event(yaml.AliasEvent)
        before = self._count
        self._depth += 1
        if self._depth > _DEEPEST:
            raise yaml.MarkedYAMLError(problem=f"more than {_DEEPEST} levels", problem_mark=mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if is_alias and id(node) not in self._sizes:
            raise yaml.MarkedYAMLError(problem="an alias inside what it stands for", problem_mark=mark)
        self._count += self._sizes[id(node)] if is_alias else 1
        if self._count > _MOST_VALUES:
            raise yaml.MarkedYAMLError(problem=f"more than {_MOST_VALUES} values", problem_mark=mark)
        self._sizes.setdefault(id(node), self._count - before)
        return node

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """Make a value; PyYAML's own constructors raise whatever Python does at a number of 6,000 digits."""
        try:
            return super().construct_object(node, deep)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            shown = str(node.value)[:40]
            tag = str(node.tag).removeprefix(_TAG)
            raise yaml.MarkedYAMLError(problem=f'"{shown}" is no {tag}', problem_mark=node.start_mark) from None


def parse_yaml(text: str, where: str) -> Any:
    """The content of a YAML text.

    The text is untrusted; ``where`` is what it is called in a message. Raises `BsaError` if it is not YAML or goes
    beyond the bounds, with the line.
    """
    if len(text) > _LONGEST:
        raise BsaError(f"{where} has more than {_LONGEST} characters.", "it is no file that a person writes.")
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        line = f" at line {mark.line + 1}" if mark is not None else ""
        what = f": {problem}" if problem else ""
        raise BsaError(
            f"{where} is not valid YAML{line}{what}.", "check indentation, colons, brackets and quotes there."
        ) from None


def read_yaml(path: Path) -> Any:
    """The content of a YAML file written by a person.

    Raises `BsaError` if the file is missing, is not YAML or goes beyond the bounds, with the line.
    """
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(_LONGEST + 1)
    except FileNotFoundError:
        raise BsaError(f"{path} does not exist.", "check the path.") from None
    except OSError as error:
        raise file_error(error, path) from None
    except UnicodeDecodeError as error:
        raise BsaError(f"{path} cannot be read: {error}.", "give a UTF-8 text file.") from None
    return parse_yaml(text, str(path))
