"""The documentation builds as a site; a link that leads nowhere stops the build."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from bsa.experiments.cli.main import app
from typer.main import get_command

pytest.importorskip("zensical", reason='pip install -e ".[docs]" builds the documentation')

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.slow


def build(root: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(root / ".ci" / "docs"), str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_site_has_the_pages_the_commands_and_the_docstrings(tmp_path: Path) -> None:
    built = build(ROOT, tmp_path / "site")
    assert built.returncode == 0, built.stdout + built.stderr
    html = tmp_path / "site" / "html"
    for source in (ROOT / "docs").glob("*.md"):
        assert (html / source.stem / "index.html").is_file()
    commands = (html / "commands" / "index.html").read_text(encoding="utf-8")
    for name in get_command(app()).commands:  # type: ignore[attr-defined]
        assert f"bsa {name}" in commands
    assert "best values by name" in (html / "python" / "index.html").read_text(encoding="utf-8")
    assert "Calibrate a model" in (html / "api" / "bsa" / "index.html").read_text(encoding="utf-8")
    assert "MemoryConformance" in (html / "api" / "bsa.testing" / "index.html").read_text(encoding="utf-8")


def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path) -> None:
    root = tmp_path / "root"
    root.mkdir()
    for path in ROOT.iterdir():
        if path.name not in (".ci", "docs", "build", ".git"):
            (root / path.name).symlink_to(path)
    for folder in (".ci", "docs"):
        (root / folder).mkdir()
        for path in (ROOT / folder).iterdir():
            (root / folder / path.name).symlink_to(path)
    script, page = root / ".ci" / "docs", root / "docs" / "signals.md"
    for path in (script, page):
        content = path.read_text(encoding="utf-8")
        path.unlink()
        path.write_text(content, encoding="utf-8")
    page.write_text(f"{page.read_text(encoding='utf-8')}\n[nowhere](python.md#no-such-heading)\n", encoding="utf-8")
    built = build(root, tmp_path / "site")
    assert built.returncode != 0
    assert "anchor does not exist" in built.stdout + built.stderr
