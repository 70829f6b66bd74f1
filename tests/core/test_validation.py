"""What is wrong with what people wrote, in plain words."""

from typing import Literal

import pytest
from bsa.core.errors import BsaError
from bsa.core.validation import validated
from pydantic import BaseModel, Field


class Settings(BaseModel, extra="forbid"):
    """All kinds of settings."""

    patience: int = Field(default=3, ge=1, le=9)
    share: float = Field(default=0.5, gt=0, lt=1)
    fast: bool = False
    name: str = ""
    files: list[str] = []
    weight: Literal["uniform", "robust"] = "uniform"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"patience": "five"}, "\"patience\" is 'five': a whole number was expected."),
        ({"patience": 1.5}, '"patience" is 1.5: a whole number was expected.'),
        ({"patience": 0}, '"patience" is 0: it must be 1 or more.'),
        ({"patience": 10}, '"patience" is 10: it must be 9 or less.'),
        ({"share": 0}, '"share" is 0: it must be more than 0'),
        ({"share": 1}, '"share" is 1: it must be less than 1'),
        ({"share": "much"}, "\"share\" is 'much': a number was expected."),
        ({"fast": "perhaps"}, "\"fast\" is 'perhaps': true or false was expected."),
        ({"name": 3}, '"name" is 3: text was expected.'),
        ({"files": "a"}, "\"files\" is 'a': a list was expected."),
        ({"weight": "robist"}, "\"weight\" is 'robist': it must be 'uniform' or 'robust'."),
    ],
)
def test_a_wrong_value_is_refused_with_what_was_expected(given: dict[str, object], words: str) -> None:
    with pytest.raises(BsaError) as found:
        validated(Settings, given, "settings")
    assert found.value.message.startswith(f"settings: {words}")
    assert "Input" not in found.value.message
