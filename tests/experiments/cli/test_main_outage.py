"""A language model that cannot be had: said in one line, exit code 3, and the same command goes on."""

from __future__ import annotations

import json
import shlex
import socket
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
import typer
from bsa.backends.rules.backend import RulesBackend
from bsa.core.errors import BsaError
from bsa.core.messages import Outage
from bsa.core.run.run_config import RunConfig
from bsa.experiments.campaign import running
from bsa.experiments.cli.exit_codes import OUTAGE
from bsa.experiments.cli.main import main
from bsa.experiments.cli.run import _execute
from bsa.experiments.request import RunRequest
from bsa.experiments.run import Resources
from bsa_toy_cell import toy_scaffold, toy_task


@pytest.fixture
def gone_after_a_look() -> Iterator[str]:
    """Address of a server that lists its model once, and is gone then."""

    class Listing(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            content = b'{"data": [{"id": "m"}]}'
            self.send_response(200)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *words: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Listing)

    def once() -> None:
        server.handle_request()
        server.server_close()

    thread = threading.Thread(target=once)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/v1"
    thread.join()


def test_a_server_that_is_not_there_is_told_before_any_simulation(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    options = {"base_url": f"http://127.0.0.1:{port}/v1"}
    config = RunConfig(scaffold=toy_scaffold(), backend="openai:m", backend_options=options)
    with pytest.raises(BsaError, match=f"nothing listens at 127.0.0.1:{port}") as refused:
        _execute(RunRequest(toy_task(), config, tmp_path / "run"), Resources(), False, True)
    assert refused.value.hint == "vllm serve m"
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
@pytest.mark.parametrize("as_json", [False, True])
def test_a_run_without_a_server_is_no_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], as_json: bool, gone_after_a_look: str
) -> None:
    """Nor is one that was begun refused without its server: the journal may hold every reply that it needs."""
    config = RunConfig(
        scaffold=toy_scaffold(warm_up=None), backend="openai:m", backend_options={"base_url": gone_after_a_look}
    )
    folder = tmp_path / "my run"
    for attempt in (1, 2):
        with pytest.raises(typer.Exit) as ended:
            _execute(RunRequest(toy_task(), config, folder), Resources(), as_json, True)
        assert ended.value.exit_code == OUTAGE == 3
        shown = capsys.readouterr()
        (line,) = [line for line in shown.err.splitlines() if line.startswith("Stopped:")]
        assert "nothing listens at 127.0.0.1" in line
        assert line.endswith(f"Go on with: bsa-run --resume {shlex.quote(str(folder))}")
        assert "converged" not in shown.out + shown.err
        result = json.loads((folder / "result.json").read_text())
        assert (result["status"], result["lost_calls"], result["simulations"]) == ("outage", attempt, 1)
        if as_json:
            assert json.loads(shown.out) == result
        else:
            assert f"{attempt} of {attempt} model calls lost" in shown.out


def test_a_command_that_a_model_stops_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise Outage("the language model gave no reply: nothing listens")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "plan_campaign", stopped)
    monkeypatch.setattr(sys, "argv", ["bsa", "bench", "suite", "--suite", "generated", "--cases", "1"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == OUTAGE
    assert "Stopped: the language model gave no reply: nothing listens. The same command goes on." in (
        capsys.readouterr().err
    )


def test_an_error_after_the_first_simulation_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise BsaError("it did not accept the key.", "export BSA_API_KEY=...")

    monkeypatch.setattr(RulesBackend, "complete", refused)
    folder = tmp_path / "run"
    request = RunRequest(toy_task(), RunConfig(scaffold=toy_scaffold()), folder)
    with pytest.raises(BsaError) as raised:
        _execute(request, Resources(), False, True)
    assert raised.value.hint == f"export BSA_API_KEY=... Then go on with: bsa-run --resume {folder}"
    # Nothing was written this time: another hint would be wrong.
    other = RunRequest(toy_task(), RunConfig(scaffold=toy_scaffold(), seed=5), folder)
    with pytest.raises(BsaError, match="belongs to another task") as raised:
        _execute(other, Resources(), False, True)
    assert "Then go on" not in raised.value.hint
