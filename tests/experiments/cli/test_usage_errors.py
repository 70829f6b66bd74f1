"""What is wrong with a command line is said in one line, as every other mistake is."""

import sys

import pytest
import typer
from bsa.experiments.cli.main import main, run_main
from bsa.experiments.cli.usage_errors import usage_refused

WRONG = [
    ("run --temperature abc", '--temperature is "abc": a number was expected. Hint: --temperature DEGC: Ambient'),
    ("discover --max-effects 3", '--max-effects is "3": it must be 2 or less. Hint: --max-effects N: Effects in'),
    ("discover --max-efects 3", ' discover has no option --max-efects. Hint: did you mean "--max-effects"?'),
    ("bench suite --zzz", " bench suite --help shows how it is called."),
    ("rum", ' has no command "rum". Hint: did you mean "run"?'),
    ("list zz", ' list has no command "zz". Hint: commands: '),
    ("run --seed", "--seed has no value. Hint: write it behind the option."),
    ("run --join=3", "--join takes no value. Hint: write --join alone."),
    ("run a b", ' run takes no further argument, but got "b". Hint: '),
    ("export x --to bxp", '--to is "bxp", which is none of its values. Hint: did you mean "bpx"?'),
    ("export x --to csv", "Hint: choose one of bpx, parameter-values."),
    ("export", " export: RUN is missing. Hint: "),
]


def told(command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    """What a wrong command writes to standard error."""
    monkeypatch.setattr(sys, "argv", command.split())  # the program's name in what is told is that of the test runner
    with pytest.raises(SystemExit) as caught:
        run_main() if command.startswith("bsa-run") else main()
    assert caught.value.code == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    return shown.err


@pytest.mark.parametrize(("arguments", "words"), WRONG)
def test_a_wrong_command_line_is_one_line_with_a_hint(
    arguments: str, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (line,) = told(f"bsa {arguments}", capsys, monkeypatch).splitlines()
    assert line.startswith("BsaError: ")
    assert words in line


def test_so_it_is_of_the_short_command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    said = told("bsa-run --seeed 1", capsys, monkeypatch)
    assert said.endswith(' has no option --seeed. Hint: did you mean "--seed"?\n')


def test_a_command_without_its_subcommand_shows_its_help_page(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["bsa", "bench"])
    with pytest.raises(SystemExit):
        main()
    assert "Usage: " in "".join(capsys.readouterr())


def test_a_mistake_of_a_kind_that_is_not_known_keeps_its_words() -> None:
    with pytest.raises(Exception, match=r"the command: Invalid value: odd\. Hint: bsa --help"), usage_refused():
        raise typer.BadParameter("odd.")
