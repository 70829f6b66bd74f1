"""Blind cases as cells: a discovery on its records, or a ranking of the effects that may be hidden in them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...core.errors import BsaError
from ...core.files import file_digest
from ...core.messages import Outage
from ...core.run.run_config import hash_of
from ...core.shape import decoding
from ..campaign.cell import Axes
from ..campaign.identity import all_effects, versions_of_study, without_placement
from ..campaign.results import check_grid_folder
from ..campaign.running import Plan
from ..campaign.store import Store
from ..campaign.study_cell import StudyCell
from ..discover import discover
from ..discovery_case import DiscoverOptions
from ..processor_time import processor_s
from .making import DESCRIPTION, POINTS
from .shortlists import shortlist

Kind = Literal["discovery", "shortlist"]


def carry_out(folder: Path, case: Path, kind: Kind, options: Mapping[str, Any]) -> dict[str, Any]:
    """What is found of a blind case, and the processor time that it takes."""
    asked = options_of(case, out=folder, **options)
    began_s = processor_s()
    found = shortlist(asked) if kind == "shortlist" else _discovered(asked)
    return {**found, "cpu_s": processor_s() - began_s}


def _discovered(options: DiscoverOptions) -> dict[str, Any]:
    discovery = discover(options)
    if discovery.ranking is not None and discovery.ranking.lost:
        raise Outage(discovery.ranking.note)
    content, base = discovery.to_json(), discovery.findings.gap.nearest
    return {
        "summary": f"{discovery.verdict} {', '.join(discovery.names)}",
        "verdict": discovery.verdict,
        "names": list(discovery.names),
        "rivals": [list(rival.names) for rival in discovery.findings.rivals],
        "effects": content["effects"] or content["partial"],
        "gap": content["gap"],
        "base_chi2": float(np.sum(np.square(base.errors / base.sigma))),
        "simulations": discovery.simulations,
        "wall_s": discovery.wall_s,
    }


def plan_cases(folder: Path, name: str, kind: Kind, only: Sequence[str] | None = None, **asked: Any) -> Plan[StudyCell]:
    """Every case of a folder as a cell; the sealed answers are not opened.

    The folder was made by `make_cases`, and is the store, too; ``only`` are the names of the cases to run, all by
    default. Raises `BsaError` if the folder holds no case, or no such case, or its campaign's folder holds something
    else.
    """
    cases = [path for path in sorted(folder.absolute().glob("case_*")) if (path / DESCRIPTION).exists()]
    if not cases:
        raise BsaError(f"{folder} holds no blind case.", "bsa bench discovery make makes some.")
    unknown = set(only or ()) - {case.name for case in cases}
    if unknown:
        raise BsaError(f'{folder} has no case "{min(unknown)}".', f"{cases[0].name} to {cases[-1].name} are there.")
    campaign = campaign_folder(folder, name)
    check_grid_folder(campaign)
    cells = [_cell(case, kind, asked) for case in cases]
    return Plan({"name": name}, cells, Store(folder), campaign, only)


def campaign_folder(folder: Path, name: str) -> Path:
    """Where the rows of a campaign on blind cases lie. Raises `BsaError` if the name is a path."""
    if Path(name).name != name:
        raise BsaError(f'"{name}" is no name of results in {folder}.', "give a name, without a path.")
    return Store(folder).grid(name)


def _cell(case: Path, kind: Kind, asked: Mapping[str, Any]) -> StudyCell:
    options = options_of(case, out=case, **asked)
    backend = options.backend or "none"
    determining = {
        "kind": kind,
        "files": {
            path.name: file_digest(path) for path in (case / DESCRIPTION, *(file.path for file in options.files))
        },
        "asked": {**asked, "backend_options": without_placement(options.backend_options)},
        "versions": versions_of_study((*all_effects(), ("backend", backend.partition(":")[0]))),
    }
    seed = asked.get("seed", 0)
    axes = Axes(task=case.name, mode="blind", chemistry=options.parameters, scaffold=kind, backend=backend, seed=seed)
    told = {"case": case, "kind": kind, "options": asked}
    return StudyCell(axes, carry_out, told, hash_of(determining))


def options_of(folder: Path, **asked: Any) -> DiscoverOptions:
    """What is asked of a case: its last records are held out, one by default; ``asked`` are other options."""
    with decoding(folder / DESCRIPTION, "a blind case", "make the cases anew."):
        base = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        records = [{"path": folder / r["file"], "read": {"ambient_c": r["ambient_c"]}} for r in base.pop("records")]
        fitted = len(records) - base.pop("held_out", 1)
        content = {"data": records[:fitted], "holdout": records[fitted:], "points": POINTS, **base, **asked}
        return DiscoverOptions.model_validate(content)
