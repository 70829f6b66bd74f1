"""Long work in a process of its own, which reports how far it is and ends when it is cancelled."""

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import anyio
import anyio.to_thread
from mcp.server.mcpserver import Context

from ...core.errors import BsaError
from ...core.messages import RunStopped
from ...core.printable import counted
from ...core.run.journal import FILE_NAME
from ...core.run.later_simulations import ANALYSIS_SIMULATION

_LOOK_EVERY_S = 0.25
_ENDS_WITHIN_S = 30.0
"""A run that is interrupted waits for its simulation and writes its results; what takes longer is ended."""

Json = dict[str, Any]


async def carried_out(
    context: Context,
    function: Callable[..., Json],
    arguments: Mapping[str, Any],
    folder: Path | None = None,
    simulations: int | None = None,
) -> Json:
    """What a function of a module returns that is called in a process of its own, with arguments that can be pickled.

    The request is told of the progress, by the journal in ``folder``, that of the run, or without it in seconds. When
    it is cancelled, the process is interrupted as by Ctrl-C. Raises the `BsaError` that the function raised, and
    `RuntimeError` if the process ended without an answer.
    """
    spawning = multiprocessing.get_context("spawn")
    receiver, sender = spawning.Pipe(duplex=False)
    process = spawning.Process(target=_answer, args=(sender, function, dict(arguments)))
    process.start()
    sender.close()
    started, answered = time.monotonic(), False
    try:
        while not receiver.poll():
            await context.report_progress(*_progress(folder, simulations, time.monotonic() - started))
            await anyio.sleep(_LOOK_EVERY_S)
        kind, *content = receiver.recv()
        answered = True
    except EOFError:
        raise RuntimeError(f"the process ended with exit code {process.exitcode} and no answer") from None
    finally:
        with anyio.CancelScope(shield=True):
            await anyio.to_thread.run_sync(_end, process, answered)
        receiver.close()
    if kind == "refused":
        raise BsaError(*content)
    result: Json = content[0]
    return result


def _progress(folder: Path | None, simulations: int | None, seconds: float) -> tuple[float, float | None, str]:
    if folder is None:
        return seconds, None, f"{seconds:.0f} s"
    try:
        journal = (folder / FILE_NAME).read_bytes()
    except OSError:
        return 0.0, simulations, "starting"
    if not simulations:
        done = journal.count(b"\n")
        return done, None, f"{counted(done, 'step')} in {seconds:.0f} s"
    done = journal.count(b'\n{"event":"trial"')
    more = journal.count(f'\n{{"event":"{ANALYSIS_SIMULATION}"'.encode())
    analysis = f", then {more} to analyse the fit," if more else ""
    return done, simulations, f"{counted(done, 'simulation')}{analysis} in {seconds:.0f} s"


def _end(process: BaseProcess, answered: bool) -> None:
    if not answered and process.pid is not None and process.is_alive():
        os.kill(process.pid, signal.SIGINT)
    process.join(_ENDS_WITHIN_S)
    if process.is_alive():
        process.terminate()
        process.join()


def _answer(sender: Connection, function: Callable[..., Json], arguments: Json) -> None:
    """The process: its input and output are not the protocol's."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(sys.stderr.fileno(), 1)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        sender.send(("done", function(**arguments)))
    except BsaError as error:
        sender.send(("refused", error.message, error.hint))
    except (KeyboardInterrupt, RunStopped) as stopped:
        sender.send(("refused", _stopped(stopped), "the same call goes on with `resume`."))


def _stopped(why: KeyboardInterrupt | RunStopped) -> str:
    return f"stopped: {str(why) or 'interrupted'}."
