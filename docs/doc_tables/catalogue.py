"""Every table of the documentation by its name, as a marker in the Markdown gives it."""

from collections.abc import Callable
from functools import partial

from . import ageing, discovery, published, real_cells, studies
from .columns import cell_columns
from .reach import reach
from .results import Results

TABLES: dict[str, Callable[[Results], str]] = {
    "reach": reach,
    "published": published.main,
    "published-summary": published.summary,
    "published-start": published.start,
    "published-oregan": published.oregan,
    "baselines": published.baselines,
    "random": studies.random_cells,
    "noise": studies.noise,
    "no-harm": studies.no_harm,
    "ablation": studies.ablation,
    "agent-alone": studies.agent_alone,
    "by-hand": studies.by_hand,
    "models": studies.models,
    "evaluation": studies.evaluation,
    "runtime": studies.runtime,
    "recovery": studies.recovery,
    "coverage": studies.coverage,
    "warm-up": studies.warm_up,
    "grid-cost": studies.grid_cost,
    "grid-scaling": studies.grid_scaling,
    "cells": cell_columns,
    "ageing": ageing.published_lives,
    "ageing-baselines": partial(ageing.methods, name="ageing_baselines"),
    "ageing-ablation": partial(ageing.methods, name="ageing_ablation"),
    "own-lives": partial(ageing.methods, name="own_lives"),
    "life-cost": ageing.life_cost,
    "whole-life": ageing.whole_lives,
    "fade-trends": ageing.trends,
    "life-discovery": ageing.mechanisms,
    "life-modes": ageing.modes,
    "discovery-blind": discovery.blind_cases,
    "discovery-blind-cases": discovery.each_blind_case,
    "discovery": discovery.earlier_cases,
    "discovery-cases": discovery.each_earlier_case,
    "discovery-time": discovery.time_taken,
    "discovery-sensitivity": discovery.sensitivity,
    "discovery-shortlists": discovery.shortlists,
    "measured-cells": discovery.measured_cells,
    "real-cells": real_cells.fitted_and_held_out,
    "knees": real_cells.by_weight,
    "jacobian": real_cells.by_jacobian,
    "low-fidelity": published.led_and_alone,
    "published-led": published.led,
    "low-fidelity-cells": real_cells.led_and_alone,
    "nearest-potentials": real_cells.by_potentials,
    "nearest-set": real_cells.by_start,
    "starts": real_cells.by_initial_state,
    "pulse-tests": real_cells.by_rests,
    "bands": real_cells.by_band,
    "unseen-cells": real_cells.unseen,
    "paper-cells": real_cells.as_in_the_paper,
    "impedance": real_cells.with_spectra,
}
