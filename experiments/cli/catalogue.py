"""``bsa list`` and ``bsa doctor``: what is here, where it comes from, and what would make more of it ready."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from ...core.contracts.kinds import KINDS, Kind, plural
from .text_table import print_table, print_wrapped

if TYPE_CHECKING:
    from ...core.contracts.registry import Listing, Unusable

list_app = typer.Typer(help="Show plugins, scaffolds, backends, tasks and parameters.", invoke_without_command=True)


@list_app.callback()
def everything(context: typer.Context) -> None:
    """Show plugins, scaffolds, backends, tasks and parameters."""
    if context.invoked_subcommand is None:
        plugins()
        scaffolds()
        print(
            "\nbsa list effects shows one kind of plugin; bsa list parameters --set NAME, the parameters of a set; "
            "bsa doctor, which backends are ready."
        )


@list_app.command()
def plugins() -> None:
    """Plugins of every kind, with the distribution of those that are not built in."""
    for kind in KINDS:
        _print_kind(kind)
    _print_unusable(_unusable())


def _of_kind(kind: Kind) -> Callable[[], None]:
    def show() -> None:
        _print_kind(kind)
        _print_unusable(item for item in _unusable() if item.concerns(kind))

    return show


for _kind in KINDS:
    list_app.command(plural(_kind), help=f"Plugins of the kind {_kind}.")(_of_kind(_kind))
    if plural(_kind) != _kind:
        list_app.command(_kind, hidden=True)(_of_kind(_kind))


@list_app.command()
def scaffolds() -> None:
    """The compositions of plugins that can be named with --scaffold."""
    from ...core.scaffold import built_in_names, load_scaffold

    print_wrapped("scaffolds", [(name, load_scaffold(name).summary, "") for name in built_in_names()])


@list_app.command()
def parameters(
    set_name: Annotated[str | None, typer.Option("--set", help="Parameter set; left out, the sets are listed.")] = None,
    contains: Annotated[str, typer.Option(help="Show only names that contain this text.")] = "",
) -> None:
    """The parameter sets, or the parameters of one."""
    from ...plugins.pybamm.cells import parameter_sets

    if set_name is None:
        lines = {name: name for name in parameter_sets.set_names()}
    else:
        values = parameter_sets.parameters(set_name)
        lines = {
            name: f"{name}: {value if isinstance(value, str) else f'{value:.6g}'}" for name, value in values.items()
        }
    for name, line in lines.items():
        if contains.casefold() in name.casefold():
            print(line)


def doctor() -> None:
    """Show which language models are ready here, what would make the others so, and the GPU and C compiler found."""
    from ...backends.gpu_memory import gpu_in_words
    from ...backends.readiness import survey
    from ...core.contracts.registry import installed
    from ...plugins.pybamm.modelling.machine_code import compiler

    checked = survey()
    surveyed = [
        (item.backend, f"{item.route}: {'ready' if item.ready else 'not ready'}", item.remedy or item.detail)
        for item in checked
    ]
    foreign = [
        (item.entry.name, "plugin: not checked", f"{item.entry.summary} ({item.origin})")
        for item in _listed("backend")
        if not item.own
    ]
    print_table("backends", [("rules", "built in: ready", "needs nothing"), *surveyed, *foreign])
    print_table(
        "routes", [(item.entry.name, item.origin, item.entry.summary) for item in installed().listings("route")]
    )
    if any(item.route == "transformers" and (item.ready or item.made_ready_by_opening) for item in checked):
        print_table("local models", [(gpu_in_words(),)])
    program = compiler()
    state, effect = ("found", program) if program else ("not found", "install gcc: simulations then take less time")
    print_table("simulations", [("C compiler", state, effect)])
    _print_unusable(item for item in _unusable() if item.concerns("backend") or item.concerns("route"))


def _listed(kind: Kind) -> list[Listing]:
    """The plugins of one kind by name; a route, which the registry counts among the backends too, is none of them."""
    from ...core.contracts.registry import installed

    found = [listing for listing in installed().listings(kind) if listing.kind == kind]
    return sorted(found, key=lambda listing: listing.entry.name)


def _unusable() -> list[Unusable]:
    from ...core.contracts.registry import installed
    from ..tasks.find import unusable_tasks

    return [*installed().unusable, *unusable_tasks()]


def _print_kind(kind: Kind) -> None:
    from ..tasks.find import task_summaries

    if kind == "task":
        rows = [(name, *found) for name, found in sorted(task_summaries().items())]
    else:
        rows = [(item.entry.name, item.entry.summary, "" if item.own else item.origin) for item in _listed(kind)]
    print_wrapped(plural(kind), rows)


def _print_unusable(items: Iterable[Unusable]) -> None:
    rows = [(f"{item.kind or 'plugin'} {item.name}", item.origin, item.reason) for item in items]
    print_table("not usable", rows)
