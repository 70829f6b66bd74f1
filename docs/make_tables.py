"""Makes every table of README.md and docs/*.md again from the rows in docs/results: ``python docs/make_tables.py``.

With ``--check`` nothing is written, and the exit code is 1 where a table is not what its rows say.
"""

import argparse
import sys
from pathlib import Path

from bsa.core.errors import BsaError
from doc_tables.rebuild import rebuild

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Write the tables, or compare them."""
    parser = argparse.ArgumentParser(description="Make the tables of README.md and docs/*.md from docs/results.")
    parser.add_argument("--check", action="store_true", help="change nothing; exit code 1 where a table differs")
    check = parser.parse_args().check
    try:
        changed = rebuild(ROOT, write=not check)
    except BsaError as error:
        sys.exit(str(error))
    for path in changed:
        print(f"{path.relative_to(ROOT)} {'differs from its rows' if check else 'written'}")
    sys.exit(bool(check and changed))


if __name__ == "__main__":
    main()
