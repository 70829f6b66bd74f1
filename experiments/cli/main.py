"""The commands put together, and errors turned into one line with a hint."""

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

import typer

from ...core.errors import BsaError
from ...core.files import file_error
from ...core.messages import Outage
from ...core.printable import one_line
from ...core.redaction import redact
from .exit_codes import INTERRUPTED, OUTAGE, USER_ERROR
from .shared_options import Version

_LONGEST = 4000
"""Characters of a message at most; the longest of ours list every parameter of a set."""

_CONTEXT = {"help_option_names": ["-h", "--help"]}


def app() -> typer.Typer:
    """The ``bsa`` command with all its subcommands."""
    from .bench import bench_app
    from .campaign import grid, report
    from .catalogue import doctor, list_app
    from .data import data
    from .discover import discover
    from .export import export
    from .mcp import mcp
    from .new_plugin import new_plugin
    from .predict import predict
    from .run import run
    from .several_files import RecordsCommand
    from .usage_errors import UsageGroup

    result = typer.Typer(
        name="bsa", cls=UsageGroup, no_args_is_help=True, context_settings=_CONTEXT, pretty_exceptions_enable=False
    )
    result.callback()(_bsa)
    result.command("run", cls=RecordsCommand)(run)
    result.command("predict", cls=RecordsCommand)(predict)
    result.command("data")(data)
    result.command("export")(export)
    result.command("grid")(grid)
    result.command("report")(report)
    result.command("discover", cls=RecordsCommand)(discover)
    result.add_typer(bench_app, name="bench")
    result.add_typer(list_app, name="list")
    result.command("doctor")(doctor)
    result.command("new-plugin")(new_plugin)
    result.command("mcp")(mcp)
    return result


def main() -> NoReturn:
    """``bsa``."""
    _carry_out(app())


def run_main() -> NoReturn:
    """``bsa-run``: the same as ``bsa run``."""
    from .run import run
    from .several_files import RecordsCommand

    single = typer.Typer(context_settings=_CONTEXT, pretty_exceptions_enable=False)
    single.command(cls=RecordsCommand)(run)
    _carry_out(single)


def _bsa(version: Version = False) -> None:
    """Parameterise physics-based battery models against cycler data, by reasoning and by numerics."""


def _carry_out(commands: typer.Typer) -> NoReturn:
    os.environ.setdefault("PYBAMM_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # see core/threads.py, which would load numpy here
    signal.signal(signal.SIGTERM, _as_interrupt)
    try:
        commands()
    except BsaError as error:
        _refuse(error)
    except Outage as outage:
        print(f"Stopped: {one_line(str(outage), _LONGEST)}. The same command goes on.", file=sys.stderr)
        sys.exit(OUTAGE)
    except KeyboardInterrupt:
        print("Interrupted.", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except SystemExit as end:
        # Typer makes an exit of an interrupt, without a word.
        if isinstance(getattr(end.__context__, "__cause__", None), KeyboardInterrupt):
            print("Interrupted.", file=sys.stderr)
        raise
    except BrokenPipeError:
        # The reader of our output has gone (`bsa list | head`); nothing is wrong.
        sys.stdout = None
    except OSError as error:
        _refuse(file_error(error))
    sys.exit(0)


def _refuse(error: BsaError) -> NoReturn:
    # Names of files and what they hold are other people's words.
    print(f"BsaError: {one_line(redact(str(error)), _LONGEST)}", file=sys.stderr)
    sys.exit(USER_ERROR)


def _as_interrupt(number: int, frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt
