"""Writes the package of a new plugin from templates; the module of each kind is the example of docs/plugins.md."""

import keyword
import re
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from ...core.contracts.kinds import KINDS, Kind, plural
from ...core.contracts.registry import OWN, installed
from ...core.errors import BsaError, unknown
from ...core.files import entries, write_text
from ...core.printable import shown
from ..tasks.find import packaged

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")

_USES: dict[Kind, str] = {
    "simulator": "bsa-run demo --set simulator.use={name}",
    "feedback": "bsa-run demo --scaffold full --set feedback.use={name}",
    "memory": "bsa-run demo --scaffold full --set 'memories=[{name}]'",
    "proposer": "bsa-run demo --set proposer.use={name}",
    "warm-up": "bsa-run demo --set warm_up.use={name}",
    "backend": "bsa-run demo --scaffold full --backend {name}",
    "route": "bsa-run demo --scaffold full --backend {name}:MODEL",
    "reader": "bsa-run --data FILE --parameters Chen2020 --reader {name}",
    "effect": "bsa discover --data FILE --parameters Chen2020 --out found --effect {name}",
    "task": "bsa-run {name}",
}
"""How each kind is used.

What is told in prompts needs the scaffold ``full``, which asks in every round: the default one is a fit that asks only
now and then.
"""


def package_files(kind: Kind, name: str, simulator: str = "pybamm") -> dict[str, str]:
    """The files of a package with one plugin.

    By path. The plugin's name is words of lower-case letters and digits, joined by hyphens; ``simulator`` is that which
    a task is made for.
    """
    module = f"bsa_{name.replace('-', '_')}"
    words = {
        "kind": kind,
        "name": name,
        "distribution": f"bsa-{name}",
        "module": module,
        "class": "".join(part.capitalize() for part in name.split("-")),
        "function": name.replace("-", "_"),
        "title": f"{'An' if kind[0] in 'aeiou' else 'A'} {kind} for battery-sim-agent: {name}",
        "kinds": plural(kind),
        "use": _USES[kind].format(name=name),
        "conformance": "".join(part.capitalize() for part in kind.split("-")) + "Conformance",
        "simulator": simulator,
    }
    templates = Environment(
        loader=PackageLoader(__package__, ""),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # Python and TOML of checked names, no HTML
    )
    made = {
        "pyproject.toml": "pyproject.toml",
        "README.md": "README.md",
        f"{module}.py": f"{kind}.py",
        f"tests/test_{module}.py": "test.py",
    }
    return {path: templates.get_template(f"{template}.j2").render(words) for path, template in made.items()}


def write_package(kind: str, name: str, folder: Path | None = None) -> list[Path]:
    """Write the package of a new plugin.

    ``kind`` is one of `KINDS`. The folder, ``bsa-NAME`` by default, must be empty or not
    be there. Gives the files. Raises `BsaError` if there is no such kind, the name cannot be used or is taken, or the
    folder holds something.
    """
    known = next((one for one in KINDS if one == kind), None)
    if known is None:
        raise unknown(f"there is no kind {shown(repr(kind))} of plugin.", kind, KINDS)
    if keyword.iskeyword(name):
        raise BsaError(
            f"a plugin cannot be named {shown(repr(name))}, which is a keyword of Python.",
            f"choose another name, or add a word to it: my-{name.lower()}.",
        )
    if not _NAME.fullmatch(name):
        raise BsaError(
            f"a plugin cannot be named {shown(repr(name))}.",
            "use words of lower-case letters and digits, joined by hyphens: my-plugin.",
        )
    taken = [listing.origin for listing in installed().listings() if listing.entry.name == name]
    if kind == "task" and packaged(name):
        taken.insert(0, OWN)
    if taken:
        raise BsaError(f'the name "{name}" is taken by {taken[0]}.', "choose another name.")
    folder = folder or Path(f"bsa-{name}")
    if entries(folder):
        raise BsaError(f"{shown(folder, 200)} is not empty.", "choose another --out folder.")
    files = package_files(known, name)
    for path in files:
        write_text(folder / path, files[path])
    return [folder / path for path in files]
