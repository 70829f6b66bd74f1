"""``bsa list`` and ``bsa doctor``: what is here, where it comes from, and what would make more of it ready."""

from collections.abc import Iterable, Sequence
from typing import Annotated

import typer

from .progress import printable

list_app = typer.Typer(help="Show plugins, scaffolds, backends, tasks and parameters.", invoke_without_command=True)


@list_app.callback()
def everything(context: typer.Context) -> None:
    """Show plugins, scaffolds, backends, tasks and parameters."""
    if context.invoked_subcommand is None:
        plugins()
        scaffolds()
        tasks()
        print("\nbsa list parameters --set NAME shows the parameters of a set; bsa doctor, which backends are ready.")


@list_app.command()
def plugins() -> None:
    """Everything that plugins offer, backends included, with its origin."""
    from ...core.registry import KINDS, installed

    registry = installed()
    for kind in KINDS:
        rows = [
            (listing.entry.name, listing.entry.summary, listing.origin)
            for listing in sorted(registry.listings(kind), key=lambda listing: listing.entry.name)
            if listing.kind == kind
        ]
        _table(f"{kind}s" if kind != "memory" else "memories", rows)
    _table(
        "not usable", [(f"{item.kind or 'plugin'} {item.name}", item.origin, item.reason) for item in registry.unusable]
    )


@list_app.command()
def backends() -> None:
    """The language models that can be named with --backend."""
    from ...core.registry import installed

    _table("backends", [(item.entry.name, item.entry.summary, item.origin) for item in installed().listings("backend")])


@list_app.command()
def scaffolds() -> None:
    """The compositions of plugins that can be named with --scaffold."""
    from ...core.scaffold import built_in_names, load_scaffold

    _table("scaffolds", [(name, load_scaffold(name).summary, "") for name in built_in_names()])


@list_app.command()
def tasks() -> None:
    """The tasks that can be named without a file."""
    from ...core.registry import installed
    from ..tasks.find import packaged_tasks

    offered = [(item.entry.name, item.entry.summary, item.origin) for item in installed().listings("task")]
    _table("tasks", [*((name, summary, "") for name, summary in packaged_tasks()), *offered])


@list_app.command()
def parameters(
    set_name: Annotated[str | None, typer.Option("--set", help="Parameter set; left out, the sets are listed.")] = None,
    contains: Annotated[str, typer.Option(help="Show only names that contain this text.")] = "",
) -> None:
    """The parameter sets, or the parameters of one."""
    from ...plugins.pybamm import parameter_sets

    if set_name is None:
        for name in parameter_sets.set_names():
            print(name)
        return
    for name, value in parameter_sets.parameters(set_name).items():
        if contains.casefold() in name.casefold():
            print(f"{name}: {value if isinstance(value, str) else f'{value:.6g}'}")


def doctor() -> None:
    """Show which language models are ready here, and the command that would make each other one so."""
    from ...backends.readiness import survey
    from ...core.registry import installed

    rows = [
        (item.backend, f"{item.route}: {'ready' if item.ready else 'not ready'}", item.remedy or item.detail)
        for item in survey()
    ]
    _table("backends", [("rules", "built in: ready", "needs nothing"), *rows])
    routes = [(item.entry.name, item.origin, item.entry.summary) for item in installed().listings("route")]
    broken = [
        (item.name, f"{item.origin}: not usable", item.reason)
        for item in installed().unusable
        if item.kind in (None, "backend", "route")
    ]
    _table("routes", [*routes, *broken])


def _table(title: str, rows: Sequence[tuple[str, str, str]] | Iterable[tuple[str, str, str]]) -> None:
    rows = list(rows)
    if not rows:
        return
    print(f"\n{title}")
    name_width = max(len(name) for name, _, _ in rows)
    middle_width = max(len(middle) for _, middle, _ in rows)
    for name, middle, last in rows:
        line = (
            f"  {name:{name_width}s}  {middle:{middle_width}s}  {last}" if last else f"  {name:{name_width}s}  {middle}"
        )
        print(printable(line, 400) if not line.startswith("  ") else line.rstrip())
