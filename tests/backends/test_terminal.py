import io

import pytest
from bsa.backends.terminal import Terminal
from bsa.core.messages import BudgetSpent


@pytest.mark.parametrize("end", [EOFError, NotImplementedError])
def test_where_there_is_no_other_source_lines_come_from_input_as_in_a_notebook(end, monkeypatch) -> None:
    given = iter(["yes"])

    def asked() -> str:
        for line in given:
            return line
        raise end

    monkeypatch.setattr("builtins.input", asked)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert not Terminal().has_screen
    assert Terminal().line() == "yes\n"
    with pytest.raises(BudgetSpent, match="nobody answers"):
        Terminal().line()


def test_lines_of_a_source_end_as_they_do_there() -> None:
    target = io.StringIO()
    terminal = Terminal(io.StringIO("a\n\nb"), target)
    terminal.say("?")
    assert [terminal.line() for _ in range(3)] == ["a\n", "\n", "b"]
    assert target.getvalue() == "?\n"
    with pytest.raises(BudgetSpent):
        terminal.line()
