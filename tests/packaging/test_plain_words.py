"""The field's terms stand in code and documentation, and no other name for the same thing."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

OTHER_NAMES = {
    r"apprais": "post-fit analysis",
    r"\bdetours?\b|slowed.?climb": "continuation",
    r"\beas(?:ed|ing)\b": "task reduction, reduced",
    r"\bdrawn_in\b": "robust loss",
    r"\bspecimens?\b": "measured record",
    r"\bworkbench": "discovery setup",
    r"\bwarmth\b": "temperature misfit",
    r"\bbeliefs?\b": "prior",
    r"\bscouts?\b": "first-cycle fit",
    r"\bat.a.loss\b": "exhausted",
    r"\bthrift": "planning budget",
    r"\bexcursions?\b": "agent search",
    r"\bhangs? by\b": "depends on",
    r"\bmarks_of\b|\.marks?\(|effect's marks?\b": "sensitivity",
}
"""What must not stand anywhere, and the term that says it."""

WRITTEN = re.compile(r"""["_a-z]*appraisal(?:-simulation)?["(:=]|_Apprais\w+""")
"""How journals call the analysis since the first one; its name stands in them as it is."""


@cache
def lines() -> list[tuple[str, str]]:
    """Every line with its place."""
    rooms = ["core", "plugins", "backends", "experiments", "testing", "docs", "README.md", "CONTRIBUTING.md"]
    listed = subprocess.run(["git", "ls-files", *rooms], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    return [
        (f"{name}:{number}: {line.strip()}", WRITTEN.sub("", line))
        for name in listed.splitlines()
        if name.endswith((".py", ".md", ".j2")) and (ROOT / name).exists()
        for number, line in enumerate((ROOT / name).read_text(encoding="utf-8").splitlines(), 1)
    ]


@pytest.mark.parametrize(("other", "term"), OTHER_NAMES.items(), ids=OTHER_NAMES.values())
def test_a_thing_has_one_name(other: str, term: str) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout, so there is no list of the project's own files")
    assert lines()
    found = [place for place, line in lines() if re.search(other, line, re.IGNORECASE)]
    assert found == [], f"the term is: {term}"
