"""One test of a file that holds several, named behind the file: ``rates.mat#T25/cRate_1C``."""

from pathlib import Path

_SIGN = "#"


def file_and_part(path: Path | str) -> tuple[Path, str | None]:
    """The file, and the sheet or test in it that is meant; None where the path names none.

    A file or folder whose own name has the sign in it is taken as it is.
    """
    whole = Path(path)
    if "\0" in str(path) or whole.exists():
        return whole, None
    text = str(path)
    named = [(Path(text[:place]), text[place + 1 :]) for place, sign in enumerate(text) if sign == _SIGN]
    found = next((one for one in named if one[0].is_file()), named[0] if named else (whole, ""))
    return found if found[1] else (whole, None)
