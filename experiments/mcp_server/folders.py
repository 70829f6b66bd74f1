"""Which files an assistant may name: those inside the folders that the server was given."""

from collections.abc import Sequence
from pathlib import Path

from ...core.errors import BsaError, did_you_mean
from ...core.printable import shown
from ...core.reading.part_of_file import file_and_part


class Folders:
    """The folders that the tools may read and write, at least one; relative paths are meant in the first.

    Raises `BsaError` if one is not there.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        missing = [folder for folder in folders if not folder.is_dir()]
        if missing or not folders:
            what = f"there is no folder {shown(missing[0], 200)}." if missing else "no folder is given."
            raise BsaError(what, "bsa mcp --folder DIR names a folder that is there.")
        self._roots = [folder.resolve() for folder in folders]
        self.first = self._roots[0]  # Where relative paths begin and runs go.

    def inside(self, name: str) -> Path:
        """The path of a file or folder that an assistant names.

        Raises `BsaError` if it leads out of the folders, goes through ``..``, or a link stands on its way or, for a
        folder, in it.
        """
        path = self.first / name
        root = next((root for root in self._roots if path.is_relative_to(root)), None)
        if "\0" in name or ".." in path.parts or root is None:
            raise self._refused(name, "lies outside the folders of this server")
        steps = [path, *(parent for parent in path.parents if parent.is_relative_to(root))]
        if any(step.is_symlink() for step in steps) or (
            path.is_dir() and any(entry.is_symlink() for entry in path.rglob("*"))
        ):
            raise self._refused(name, "is or holds a symbolic link")
        return path

    def file(self, name: str) -> Path:
        """The path of a record that is there; as `inside`, with the nearest name in its folder where there is none.

        ``FILE#PART`` names one test of a file, as everywhere.
        """
        whole = self.inside(name)
        path, part = file_and_part(whole)
        self.inside(str(path))
        if not path.exists():
            beside = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
            hint = did_you_mean(path.name, beside) or "check the path; it begins in the first folder of this server."
            raise BsaError(f"there is no file {shown(path, 200)}.", hint)
        return path if part is None else whole

    def _refused(self, name: str, why: str) -> BsaError:
        roots = ", ".join(shown(root, 200) for root in self._roots)
        return BsaError(f"{shown(name, 200)} {why}.", f"give a path inside {roots}, without .. and links.")
