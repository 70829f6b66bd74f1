"""What holds for an entry of any kind: it is found by its name, and its options are described and checked."""

import subprocess
import sys
from functools import cache
from typing import Any, ClassVar

import pytest

from ..core.contracts.kinds import Kind
from ..core.contracts.registry import Listing, installed
from ..core.errors import BsaError

_HEAVY = "ax, botorch, litellm, matplotlib, python_calamine, pandas, pyarrow, pybamm, torch, transformers"


class EntryConformance:
    """Tests of one entry of the catalogue; a class for each kind builds on it.

    A subclass gives the fixture ``name``, and ``options`` where the tests are to use others than the defaults.
    """

    kind: ClassVar[Kind]

    @pytest.fixture
    def name(self) -> str:
        """Name of the plugin under test, as ``bsa list`` shows it."""
        pytest.fail(f"{type(self).__name__} lacks the fixture `name`")

    @pytest.fixture
    def options(self) -> dict[str, Any]:
        """The plugin's options; none is set."""
        return {}

    @pytest.fixture
    def listing(self, name: str) -> Listing:
        """The entry with its origin, as it is installed here."""
        return installed().find(self.kind, name)

    def test_all_of_its_distribution_can_be_used(self, listing: Listing) -> None:
        """Nothing that the plugin's distribution offers is passed over."""
        assert [item for item in installed().unusable if item.origin == listing.origin] == []

    def test_its_summary_is_one_line(self, listing: Listing) -> None:
        """``bsa list`` shows the summary in one line."""
        assert listing.entry.summary.strip()
        assert listing.entry.summary.isprintable()

    def test_its_options_have_defaults_and_descriptions(self, listing: Listing) -> None:
        """Every option can be left out, and says what it does."""
        config_type = listing.entry.config_type
        config_type()
        assert [name for name, field in config_type.model_fields.items() if not field.description] == []

    def test_an_unknown_option_is_refused(self, name: str) -> None:
        """A misspelt option is an error, not a default."""
        with pytest.raises(BsaError):
            installed().configure(self.kind, name, {"no such option": 1})

    def test_listing_imports_no_heavy_library(self) -> None:
        """Factories import their libraries, so that ``bsa list`` stays fast."""
        assert _imported_by_listing() == ""


@cache
def _imported_by_listing() -> str:
    """Heavy libraries that a fresh process has imported once it has listed all plugins."""
    code = (
        "import sys; from bsa.core.contracts.registry import installed; installed(); "
        f"print(*({{name for name in {_HEAVY.split(', ')!r}}} & set(sys.modules)))"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
