"""One test of a file that holds several, named behind the file: ``rates.mat#T25/cRate_1C``."""

from pathlib import Path

_SIGN = "#"


def file_and_part(path: Path | str) -> tuple[Path, str | None]:
    """The file, and the sheet or test in it that is meant; None where the path names none.

    A file whose own name has the sign in it is taken as it is.
    """
    whole = Path(path)
    head, _, part = str(path).partition(_SIGN)
    if not part or "\0" in head or whole.exists():
        return whole, None
    return Path(head), part
