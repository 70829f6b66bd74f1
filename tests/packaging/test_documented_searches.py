"""The files of docs/search-spaces.md are read as they stand there."""

import re
from pathlib import Path

import pytest
from bsa.core.errors import BsaError
from bsa.core.task import CellModel
from bsa.experiments.discovery_case import spreads_of
from bsa.plugins.pybamm.before_search.presets import presets, resolve_space

PAGE = (Path(__file__).parents[2] / "docs" / "search-spaces.md").read_text(encoding="utf-8")
BASE = CellModel("Chen2020")


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Path of each file of the page, by its name."""
    for content in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL):
        name = re.match(r"# (\S+)", content).group(1)  # type: ignore[union-attr]
        (tmp_path / name).write_text(content)
    return {path.name: str(path) for path in tmp_path.iterdir()}


def test_every_preset_is_named() -> None:
    named = re.findall(r"^\| `([\w-]+)`.*\| .{20}", PAGE, re.MULTILINE)[: len(presets())]
    assert sorted(named) == sorted(presets())


def test_the_example_of_a_search_is_a_search_space(files: dict[str, str]) -> None:
    space = resolve_space("Chen2020", files["my_search.yaml"])
    radius, porosity, thickness, exchange, shape, charge = space
    assert (radius.lower, radius.upper, radius.scale) == (radius.initial / 2, radius.initial * 2, "log")
    assert (porosity.lower, porosity.upper, porosity.scale) == (0.2, 0.5, "linear")
    assert (thickness.initial, thickness.scale) == (80e-6, "log")
    assert exchange.initial == 1.0
    assert (shape.initial, shape.deviation, shape.prior) == (0.0, 0.01, True)
    assert (charge.lower, charge.upper) == (0.0, 1.0)


def test_the_example_of_what_is_uncertain_is_read(files: dict[str, str]) -> None:
    spreads = spreads_of(files["my_uncertain.yaml"], BASE)
    assert spreads["Separator porosity factor"] == (0.1, 0.5, 2.0)
    assert len(spreads) == 2


def test_a_mistake_in_what_is_uncertain_is_told_by_its_key(tmp_path: Path) -> None:
    file = tmp_path / "uncertain.yaml"
    for written, said in (
        ("factors: 5", '"factors" is 5: keys with values were expected'),
        ("factors: {Separator porosity factor: [0.1]}", '"factors.Separator porosity factor" is [0.1]'),
        ("factor: {}", 'did you mean "factors"?'),
        ("- a", "keys with values were expected"),
    ):
        file.write_text(written)
        with pytest.raises(BsaError) as caught:
            spreads_of(str(file), BASE)
        assert said in str(caught.value)
        assert not re.search("Uncertainty|SearchFile|dictionary|instance", str(caught.value))
