"""Every table of the documentation by its name, as a marker in the Markdown gives it."""

from collections.abc import Callable
from functools import partial

from bsa.experiments.studies.evaluation import evaluation_table
from bsa.experiments.studies.fade_trends import trends_table
from bsa.experiments.studies.life_cost import cost_table
from bsa.experiments.studies.life_discovery import mechanisms_table, modes_table
from bsa.experiments.studies.models import cards_table
from bsa.experiments.studies.whole_life import forecast_table

from . import ageing, discovery, published, real_cells, studies
from .columns import cell_columns
from .plain import as_printed
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
    "models": as_printed("models", cards_table),
    "evaluation": as_printed("evaluation", evaluation_table),
    "recovery": studies.recovery,
    "coverage": studies.coverage,
    "grid-cost": studies.grid_cost,
    "grid-scaling": studies.grid_scaling,
    "cells": cell_columns,
    "ageing": ageing.published_lives,
    "ageing-baselines": partial(ageing.methods, name="ageing_baselines"),
    "ageing-ablation": partial(ageing.methods, name="ageing_ablation"),
    "own-lives": partial(ageing.methods, name="own_lives"),
    "life-cost": as_printed("life_cost", cost_table),
    "whole-life": as_printed("whole_life", forecast_table),
    "fade-trends": as_printed("fade_trends", trends_table),
    "life-discovery": as_printed("life_discovery", mechanisms_table),
    "life-modes": as_printed("life_modes", modes_table),
    "discovery-summary": discovery.summary,
    "discovery-aims": discovery.aims,
    "discovery-blind": discovery.blind_cases,
    "discovery-hidden": discovery.hidden_in_measured,
    "discovery-repeats": discovery.repeated_tests,
    "discovery": discovery.earlier_cases,
    "discovery-time": discovery.time_taken,
    "discovery-sensitivity": discovery.sensitivity,
    "measured-cells": discovery.measured_cells,
    **real_cells.TABLES,
    "begun-elsewhere": published.begun_elsewhere,
    "low-fidelity": published.led_and_alone,
    "published-led": published.led,
}
