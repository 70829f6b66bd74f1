"""The one exception a user can cause, and the search for what they meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class BsaError(Exception):
    """A mistake that the user can mend.

    The command line prints the message and the hint on one line each and exits with code 2;
    no traceback is shown.

    Parameters
    ----------
    message : str
        What is wrong, with the offending value.
    hint : str, optional
        What to do about it.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} Hint: {self.hint}" if self.hint else self.message

    def __reduce__(self) -> tuple[type[BsaError], tuple[str, str]]:
        # Exceptions cross process borders by pickling their `args`, which lack the hint.
        return type(self), (self.message, self.hint)


class SamplesError(BsaError):
    """Samples of which no trajectory can be made: of a record the user mends them, of a simulation its authors do."""


def did_you_mean(name: str, choices: Iterable[str]) -> str:
    """Name the closest valid choice, as the start of a hint.

    ``'did you mean "..."?'``, or an empty string when nothing comes close.
    """
    by_folded = {choice.casefold(): choice for choice in choices}
    folded = name.casefold()
    starts = [key for key in by_folded if key.startswith(folded)]
    close = difflib.get_close_matches(folded, by_folded, n=1, cutoff=0.6) or starts[:1]
    return f'did you mean "{by_folded[close[0]]}"?' if close else ""


def unknown(message: str, name: str, choices: Iterable[str], listed: str = "choose one of {}.") -> BsaError:
    """The error of a name that is none of the choices; its hint is the closest one, or all of them as ``listed``."""
    known = list(choices)
    return BsaError(message, did_you_mean(name, known) or listed.format(", ".join(known)))
