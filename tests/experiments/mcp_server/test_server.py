"""A client of the protocol uses the tools over standard input and output, as an assistant does."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import anyio
import pandas as pd
import pytest
from bsa.core.errors import BsaError
from bsa.core.run.journal import read_events
from bsa.experiments.mcp_server.functions import simulations_of
from bsa.experiments.tasks.find import PACKAGED

pytest.importorskip("mcp", reason='pip install "battery-sim-agent[mcp]"')

from bsa.experiments.mcp_server import server
from bsa.experiments.mcp_server.folders import Folders
from mcp.client.client import Client
from mcp.client.stdio import StdioServerParameters, stdio_client

Use = Callable[[Callable[[Client], Awaitable[None]]], None]


@pytest.fixture
def use(tmp_path: Path) -> Use:
    """Carries out what a client does with a server that has the folder of the test."""
    code = "from bsa.experiments.cli.main import main; main()"
    command = StdioServerParameters(
        command=sys.executable, args=["-c", code, "mcp", "--folder", str(tmp_path)], env=dict(os.environ)
    )

    async def with_client(act: Callable[[Client], Awaitable[None]]) -> None:
        with anyio.fail_after(300):
            async with Client(stdio_client(command)) as client:
                await act(client)

    return lambda act: anyio.run(with_client, act)


async def called(client: Client, tool: str, **arguments: Any) -> dict[str, Any]:
    result = await client.call_tool(tool, arguments)
    assert not result.is_error, result.content
    found: dict[str, Any] = json.loads(result.content[0].text)  # type: ignore[union-attr]
    return found


async def refused(client: Client, tool: str, **arguments: Any) -> str:
    result = await client.call_tool(tool, arguments)
    assert result.is_error
    return str(result.content[0].text)  # type: ignore[union-attr]


@pytest.mark.slow
def test_tools_are_described_and_mistakes_are_told_with_a_hint(use: Use, tmp_path: Path) -> None:
    (tmp_path / "cell.csv").write_bytes((PACKAGED / "demo.csv").read_bytes())
    (tmp_path / "cell.yaml").write_text("name: x")

    async def act(client: Client) -> None:
        tools = {tool.name: tool for tool in (await client.list_tools()).tools}
        assert set(tools) == {"read_record", "simulate", "sensitivities", "calibrate", "discover", "report"}
        assert all(tool.description for tool in tools.values())
        assert "Chen2020" in json.dumps(tools["calibrate"].input_schema)
        record = await called(client, "read_record", path="cell.csv")
        assert {"CC discharge", "CC charge"} <= {step["kind"] for step in record["steps"]}
        assert record["duration_s"] > 3600
        for path in ("/etc/passwd", "../cell.csv"):
            assert "lies outside the folders of this server. Hint: " in await refused(client, "read_record", path=path)
        assert "there is no file" in await refused(client, "read_record", path="no.csv")
        assert 'did you mean "cell.csv"?' in await refused(client, "read_record", path="Cell.csv")
        assert 'did you mean "parameters"?' in await refused(
            client, "simulate", data="cell.csv", values={}, cell={"paramters": "Chen2020"}
        )
        assert "values" not in tools["simulate"].input_schema["required"]
        assert await refused(client, "simulate") == 'simulate: "data" is missing. Hint: add it.'
        said = await refused(client, "read_record", pat="cell.csv")
        assert said == """read_record: 'pat' is not an argument. Hint: did you mean "path"?"""
        said = await refused(client, "calibrate", dat="cell.csv")
        assert said == """calibrate: 'dat' is not an argument. Hint: did you mean "data"?"""
        assert "holds no run" in await refused(client, "report", folder=".")
        assert "is a task file" in await refused(client, "simulate", data="cell.yaml", values={})
        cell = {"parameters": "Chen2020", "search": "../x.yaml"}
        assert "no preset" in await refused(client, "calibrate", data="cell.csv", cell=cell)
        cell = {"parameters": "../x.json"}
        assert "lies outside the folders" in await refused(client, "discover", data="cell.csv", cell=cell)
        assert "data is missing. Hint: " in await refused(client, "discover")
        assert "there is no file" in await refused(client, "discover", data="demo", cell={"parameters": "Chen2020"})
        assert "no name" in await refused(client, "calibrate", data="demo", scaffold="/tmp/mine.yaml")

    use(act)
    assert {path.name for path in tmp_path.iterdir()} == {"cell.csv", "cell.yaml"}


def test_two_calls_at_once_have_two_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Path] = []

    async def noted(context: Any, function: Any, arguments: Any, folder: Path, simulations: int) -> dict[str, Any]:
        given.append(folder)
        await anyio.sleep(0.05)
        assert arguments["options"]["out"] == folder
        return {}

    async def both() -> None:
        tools = server.Tools(Folders([tmp_path]))
        async with anyio.create_task_group() as group:
            for _ in range(2):
                group.start_soon(tools.calibrate, None, "demo")

    monkeypatch.setattr(server, "carried_out", noted)
    anyio.run(both)
    assert given == [tmp_path / "runs" / "demo-1", tmp_path / "runs" / "demo-2"]
    assert list((tmp_path / "runs").iterdir()) == [], "what is not written into goes again"


@pytest.mark.slow
def test_an_assistant_tries_values_and_calibrates(use: Use, tmp_path: Path) -> None:
    seen: list[tuple[float, float | None]] = []

    async def note(progress: float, total: float | None, message: str | None) -> None:
        seen.append((progress, total))

    async def act(client: Client) -> None:
        (tmp_path / "cell.csv").write_bytes((PACKAGED / "demo.csv").read_bytes())
        assert "a record needs a parameter set" in await refused(client, "simulate", data=["cell.csv"], values={})
        assert "holds no run" in await refused(client, "discover", resume="nowhere")
        said = await refused(client, "simulate", data="oscillator", values={"Mass": 1.0})
        assert 'is not searched in this task. Hint: did you mean "Mass [kg]"?' in said
        tried = await called(client, "simulate", data="oscillator", values={"Mass [kg]": 1.2})
        assert tried["values"]["Mass [kg]"] == 1.2
        assert tried["failure"] is None
        assert tried["errors"]
        assert len(tried["curves"][0]["displacement"]) <= 200
        learnt = await called(client, "sensitivities", data="oscillator")
        assert set(learnt["changes"]) == {"Mass [kg]", "Stiffness [N.m-1]", "Damping [N.s.m-1]"}
        assert any(abs(change) > 0 for change in learnt["changes"]["Mass [kg]"].values())
        arguments = {"data": "oscillator", "simulations": 30, "scaffold": "least-squares"}
        result = await client.call_tool("calibrate", arguments, progress_callback=note)
        found = json.loads(result.content[0].text)  # type: ignore[union-attr]
        assert Path(found["folder"]) == tmp_path / "runs" / "oscillator-1"
        assert Path(found["report"]).is_file()
        assert found["parameters"]["Mass [kg]"] == pytest.approx(1.2, rel=0.05)
        assert await called(client, "report", folder="runs/oscillator-1") == found

    use(act)
    assert seen
    assert {total for _, total in seen} == {30}
    assert 0 < max(progress for progress, _ in seen) <= 30


@pytest.mark.slow
def test_an_assistant_has_a_hidden_effect_found(use: Use, resistive_cell: pd.DataFrame, tmp_path: Path) -> None:
    resistive_cell.to_csv(tmp_path / "cell.csv", index=False)
    seen: list[str | None] = []

    async def note(progress: float, total: float | None, message: str | None) -> None:
        seen.append(message)

    async def act(client: Client) -> None:
        arguments = {
            "data": "cell.csv",
            "cell": {"parameters": "Chen2020", "model": "SPM", "scale": False},
            "reading": {"current_sign": "discharge-positive", "temperature": 25},
            "effect": ["contact-resistance", "voltage-offset"],
        }
        result = await client.call_tool("discover", arguments, progress_callback=note)
        assert not result.is_error, result.content
        found = json.loads(result.content[0].text)  # type: ignore[union-attr]
        assert found["effects"] == ["contact-resistance"]
        ((low, high),) = found["intervals_95"].values()
        assert low < 0.02 < high
        assert Path(found["folder"]) == tmp_path / "runs" / "cell-1"
        assert Path(found["report"]).is_file()
        told = await called(client, "report", folder="runs/cell-1")
        assert told["verdict"] == found["verdict"]

    use(act)
    assert any("steps in" in str(message) for message in seen)


@pytest.mark.slow
def test_a_calibration_that_is_cancelled_stops_and_can_go_on(use: Use, tmp_path: Path) -> None:
    async def act(client: Client) -> None:
        with anyio.CancelScope() as scope:

            async def cancel(progress: float, total: float | None, message: str | None) -> None:
                if progress > 2:
                    scope.cancel()

            arguments = {"data": "oscillator", "simulations": 2000, "scaffold": "random", "out": "stopped"}
            await client.call_tool("calibrate", arguments, progress_callback=cancel)
        assert scope.cancelled_caught
        with anyio.fail_after(60):
            while not ended(tmp_path / "stopped"):
                await anyio.sleep(0.2)
        assert (await called(client, "report", folder="stopped"))["status"] == "interrupted"
        assert simulations_of(tmp_path / "stopped") == 2000

    use(act)
    trials = [event for event in read_events(tmp_path / "stopped") if event["event"] == "trial"]
    assert 2 < len(trials) < 2000


def ended(folder: Path) -> bool:
    """Whether the run has written that it ended, and its results."""
    return any(event["event"] == "end" for event in read_events(folder)) and (folder / "report.html").is_file()


@pytest.mark.parametrize(
    ("cell", "reading", "given"),
    [({"model": "SPM"}, {}, "model goes"), ({}, {"temperature": 25.0}, "temperature goes"), ({}, {}, "")],
)
def test_a_task_has_its_own_cell_and_its_own_way_of_reading(
    tmp_path: Path, cell: Any, reading: Any, given: str
) -> None:
    tools = server.Tools(Folders([tmp_path]))
    asked = server.Cell.model_validate(cell), server.Reading.model_validate(reading)
    if not given:
        assert tools._data("demo", *asked) == "demo"
        return
    with pytest.raises(BsaError, match=f'{given} with records, but "demo" is a task'):
        tools._data("demo", *asked)


@pytest.mark.slow
def test_a_run_that_asks_a_backend_or_reads_elsewhere_is_not_gone_on_with(use: Use, tmp_path: Path) -> None:
    inside = str(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("time / s\n")

    def discovery(**others: Any) -> dict[str, Any]:
        options = {"data": [inside], "parameters": "Chen2020", **others}
        return {"event": "run", "kind": "discovery", "options": options}

    events = {
        "asks": {"event": "run", "config": {"backend": "manual", "backend_options": {"exchange": "/elsewhere"}}},
        "reads": discovery(data=["/etc/passwd"]),
        "references": discovery(reference=["/etc/passwd"]),
        "joins": discovery(data=[{"path": inside, "joined": ["/etc/passwd"]}]),
        "begins": discovery(data=["a.csv"]),
        "searches": discovery(search="own.yaml"),
        "starts": discovery(parameters="../run"),
        "links": discovery(data=[f"{tmp_path / 'link.csv'}#part"]),
    }
    (tmp_path / "link.csv").symlink_to("/etc/passwd")
    for name, event in events.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "journal.jsonl").write_text(json.dumps(event) + "\n")

    async def act(client: Client) -> None:
        assert 'asks the backend "manual"' in await refused(client, "calibrate", resume="asks")
        for name in ("reads", "references", "joins"):
            assert "lies outside the folders" in await refused(client, "discover", resume=name)
        for name in ("begins", "searches", "starts"):
            assert "begins where the server was started" in await refused(client, "discover", resume=name)
        assert "is or holds a symbolic link" in await refused(client, "discover", resume="links")

    use(act)
