"""A blind case of a measured cell: its records with an effect hidden in them, and its answer."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import zero_Celsius

from ...core.files import write_json
from ...core.record import Record
from ...plugins.readers.bdf import write
from .making import DESCRIPTION, Make
from .spikes import Spike, draw_spike, spiked


def hidden_in(fitted: Sequence[Record], held_out: Sequence[Record], base: Mapping[str, Any]) -> Make:
    """What makes cases of these records; the effect is in all of them, in those that are held out too.

    ``base`` are options of the discoveries that say what the base model is, see `DiscoverOptions`. Strengths go with
    the charge that the records move at most.
    """
    records = [*fitted, *held_out]
    capacity_ah = max(float(np.ptp(record.trajectory.discharge_capacity)) for record in records)

    def make(folder: Path, seed: int, number: int, attempt: int) -> dict[str, Any]:
        spike = draw_spike(seed, number, attempt, [record.trajectory for record in records], capacity_ah)
        folder.mkdir(parents=True, exist_ok=True)
        files = []
        for place, record in enumerate(records, start=1):
            file = f"record_{place}.csv" if place <= len(fitted) else f"holdout_{place - len(fitted)}.csv"
            write(replace(record, trajectory=spiked(record.trajectory, spike, capacity_ah)), folder / file)
            ambient_c = None if record.ambient_k is None else record.ambient_k - zero_Celsius
            files.append({"file": file, "ambient_c": ambient_c})
        write_json(folder / DESCRIPTION, {**base, "records": files, "held_out": len(held_out)}, indent=1)
        return _answer(spike, str(base["model"]))

    return make


def _answer(spike: Spike, model: str) -> dict[str, Any]:
    return {
        "setting": spike.setting,
        "model": model,
        "measured": True,
        "keys": [effect.key for effect in spike.effects],
        "names": [effect.name for effect in spike.effects],
        "strengths": {effect.key: [effect.strength, spike.strengths[effect.key]] for effect in spike.effects},
        "shifts": {},
        "outside": spike.outside,
        "outside_strength": spike.outside_strength,
        "truth_chi2": None,  # nobody knows the true model of a measured cell
    }
