"""``python -m bsa.experiments.discovery_bench --make DIR | --run DIR | --score DIR``."""

from __future__ import annotations

import argparse
from pathlib import Path


def main() -> None:
    """Make, run or score blind cases."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--make", type=Path)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--score", type=Path)
    parser.add_argument("--count", type=int, default=None)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--backend")
    parser.add_argument("--hide-names", action="store_true")
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--results", default="results.jsonl")
    given = parser.parse_args()
    if given.make:
        from .making import make_cases

        make_cases(given.make, given.count, given.seed, lambda text: print(text, flush=True))
    if given.run:
        from .running import run_cases

        run_cases(
            given.run,
            given.workers,
            given.backend,
            given.hide_names,
            given.only,
            given.results,
            lambda text: print(text, flush=True),
        )
    if given.score:
        from .scoring import as_markdown, case_table, mark_cases

        marked = mark_cases(given.score, given.results)
        print(as_markdown(marked))
        print(case_table(marked))


if __name__ == "__main__":
    main()
