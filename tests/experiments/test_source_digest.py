"""Edited sources have another digest, wherever they lie; other files have none."""

from bsa.experiments import source_digest
from bsa.experiments.source_digest import package_digest


def test_folders_and_modules_of_the_package_count_by_their_content(tmp_path, monkeypatch):
    monkeypatch.setattr(source_digest, "_ROOT", tmp_path)
    (tmp_path / "core" / "deep").mkdir(parents=True)
    (tmp_path / "experiments").mkdir()
    for name in ("core/deep/a.py", "core/table.yaml", "core/picture.png", "experiments/run.py", "experiments/notes.md"):
        (tmp_path / name).write_text("1")

    def digest_after(name=None):
        if name is not None:
            (tmp_path / name).write_text("2")
        package_digest.cache_clear()
        return package_digest("core", "experiments/*.py")

    digest = digest_after()
    assert digest == digest_after("core/picture.png") == digest_after("experiments/notes.md")
    for name in ("core/deep/a.py", "core/table.yaml", "experiments/run.py"):
        assert digest != (digest := digest_after(name))
    assert package_digest("no-such-room") == ""
    package_digest.cache_clear()
