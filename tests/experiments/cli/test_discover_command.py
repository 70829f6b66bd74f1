from dataclasses import replace
from pathlib import Path

import numpy as np
from bsa.core.cell import SPECTRUM as SIGNALS
from bsa.core.task import Experiment, Task
from bsa.experiments.cli.discover_command import discover_command
from bsa_toy_cell import toy_task

CURVES, SPECTRUM, LATER = Path("my cell.csv"), Path("z.csv"), Path("b.csv")


def task_of(fitted: list[Path], held_out: list[Path]) -> Task:
    """A task whose records called z are spectra."""
    task = toy_task()
    (given,) = task.experiments

    def record(path: Path) -> Experiment:
        target = given.target
        if path.name.startswith("z"):
            target = replace(target, signals={**target.signals, **{one.name: np.ones(len(target)) for one in SIGNALS}})
        return replace(given, name=path.name, target=target)

    return replace(task, experiments=tuple(map(record, fitted)), held_out=tuple(map(record, held_out)))


def command(fitted: list[Path], held_out: list[Path], **options: object) -> str:
    typed = {f"--{name.replace('_', '-')}": value for name, value in options.items()}
    return discover_command(task_of(fitted, held_out), fitted, held_out, typed)


def test_the_command_names_records_and_options_as_they_were_given() -> None:
    said = command(
        [CURVES], [LATER], parameters="Chen2020", options=["a=1", "b=2"], no_scale=True, sheet=None, model=None
    )
    options = "--parameters Chen2020 --options a=1 --options b=2 --no-scale"
    assert said == f"bsa discover --data 'my cell.csv' --holdout b.csv {options}"


def test_spectra_are_left_out_with_what_was_said_of_each_record() -> None:
    """A discovery refuses spectra, and as many temperatures as there are no records."""
    later = Path("z2.csv")
    said = command([CURVES, SPECTRUM], [LATER, later], temperature=[25.0, 20.0, 10.0, 5.0], current_offset=[0.01])
    words = "--temperature 25.0 --temperature 10.0 --current-offset 0.01"
    assert said == f"bsa discover --data 'my cell.csv' --holdout b.csv {words}"
    assert command([SPECTRUM], [LATER]) == ""


def test_initial_states_of_charge_are_those_of_the_fitted_records() -> None:
    said = command([CURVES, SPECTRUM], [LATER], initial_soc=[0.9, 0.5])
    assert said == "bsa discover --data 'my cell.csv' --holdout b.csv --initial-soc 0.9"


def test_of_joined_files_one_word_stands_for_all() -> None:
    said = command([CURVES, LATER], [SPECTRUM], join=True, temperature=[25.0, 20.0])
    assert said == "bsa discover --data 'my cell.csv' b.csv --join --temperature 25.0"


def test_a_temperature_of_zero_degrees_is_said() -> None:
    assert command([CURVES], [], temperature=[0.0]) == "bsa discover --data 'my cell.csv' --temperature 0.0"
