"""Whatever a stranger's reader gives goes through the same checks as a built-in one's."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bsa.core.contracts.registry import Registry
from bsa.core.errors import BsaError
from bsa.core.hooks import Entry, hookimpl
from bsa.core.reading.reading import read_record
from bsa.core.reading.samples import Samples
from bsa.core.record import ReadOptions
from bsa.core.trajectory import StepKind
from pydantic import BaseModel, Field

TIME = np.arange(0.0, 600.0, 10.0)


def cycled(**changes: Any) -> Samples:
    """Two charges and two discharges, current positive on charge, at 25 degC."""
    current = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0, 0.0], 10)
    voltage = 3.5 + np.cumsum(current) * 0.02
    signals: dict[str, Any] = {"time": TIME, "voltage": voltage, "current": current, "temperature": TIME * 0 + 298.15}
    return Samples("strange.zz", **{**signals, **changes})


class Options(BaseModel, extra="forbid"):
    channel: int = Field(1, ge=1, description="Which channel.")


class Reader:
    def __init__(self, answer: Any, matches: Any = True, options: Options | None = None) -> None:
        self.answer, self.match, self.options = answer, matches, options

    def matches(self, path: Path) -> Any:
        if isinstance(self.match, BaseException):
            raise self.match
        return self.match

    def read(self, path: Path, options: ReadOptions) -> Any:
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


def registry(*readers: Any) -> Registry:
    result = Registry()
    for number, reader in enumerate(readers):
        factory = reader if callable(reader) else lambda options, reader=reader: reader
        entry = Entry(f"zz-{number}" if number else "zz", factory, "Of a stranger.", Options, api=1)
        result.register(SimpleNamespace(bsa_readers=hookimpl(lambda entry=entry: [entry])), "zz", "zz-fault 0.1")
    return result.collect()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "strange.zz").touch()
    return tmp_path / "strange.zz"


def read(path: Path, samples: Any, **options: Any) -> Any:
    return read_record(path, ReadOptions(**options), registry(Reader(samples)))


def test_samples_become_a_record(path: Path) -> None:
    record = read(path, cycled())
    kinds = [step.kind for step in record.trajectory.steps]
    assert kinds[:3] == [StepKind.REST, StepKind.CC_CHARGE, StepKind.CC_DISCHARGE]
    assert record.trajectory.current[15] == -1.0
    assert record.ambient_k == pytest.approx(298.15)


def test_lists_are_arrays_too_and_rows_are_counted(path: Path) -> None:
    samples = cycled(time=TIME.tolist())
    assert samples.place(4) == "row 5"
    assert len(read(path, samples).trajectory) == 60


def test_the_options_of_a_record_hold_for_any_reader(path: Path) -> None:
    whole = read(path, cycled())
    first = read(path, cycled(), cycles=(1, 1), ambient_c=10.0)
    assert first.ambient_k == pytest.approx(283.15)
    assert len(first.trajectory) < len(whole.trajectory)
    turned = read(path, cycled(current=-cycled().current), current_sign="discharge-positive")
    assert np.array_equal(turned.trajectory.current, whole.trajectory.current)
    assert "was found to be charge-positive" in read(path, cycled(), current_sign="auto").notes[0]


HOLED = cycled().voltage.copy()
HOLED[20:40] = np.nan
HOLE = cycled().voltage.copy()
HOLE[5] = np.nan


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"temperature": TIME * 0 + 25.0}, "shows -248.1 degC (25 K), which cannot be"),
        ({"temperature": TIME * 0 + 571.3}, "is it in K? Then say --unit temperature=K"),
        ({"ambient_k": 25.0}, "an ambient temperature of -248.1 degC (25 K) cannot be"),
        ({"current": -cycled().current}, "so it is not charge-positive. Hint: say --current-sign discharge-positive"),
        (
            {"voltage": HOLED},
            'column "voltage" has no number in 20 of 60 rows, first in row 21; up to 3 are left out',
        ),
        ({"voltage": 1e3 * cycled().voltage}, "is it in mV? Then say --unit voltage=mV"),
        ({"voltage": cycled().voltage + 3.0}, "more than a single cell can have"),
        ({"current": 1e4 * cycled().current}, "is it in mA? Then say --unit current=mA"),
        ({"time": TIME * 0}, "never rises"),
    ],
)
def test_what_cannot_be_is_refused_in_the_same_words(path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(BsaError) as raised:
        read(path, cycled(**changes))
    assert words in str(raised.value)
    assert str(raised.value).startswith("strange.zz: ")


def test_a_hole_is_left_out_with_a_note(path: Path) -> None:
    assert read(path, cycled(voltage=HOLE)).notes[0] == "1 sample without a value was left out (row 6)."


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "reader zz of zz-fault 0.1: read returned None, not a Samples"),
        ((TIME, TIME), "(tuple), not a Samples"),
        (RuntimeError("boom"), "reader zz of zz-fault 0.1: boom in read"),
        (SystemExit(1), "reader zz of zz-fault 0.1: SystemExit: 1 in read"),
    ],
)
def test_a_reader_that_breaks_its_word_is_named(path: Path, answer: Any, words: str) -> None:
    with pytest.raises(BsaError) as raised:
        read(path, answer)
    assert words in raised.value.message


def test_signals_of_different_lengths_are_refused() -> None:
    with pytest.raises(BsaError, match=r"strange\.zz: voltage has shape \(3,\), but time has shape \(60,\)"):
        cycled(voltage=[1, 2, 3])
    with pytest.raises(BsaError, match=r"strange\.zz: current is no array of numbers"):
        cycled(current=["fast"] * 60)


def broken(options: Options) -> Reader:
    raise RuntimeError("boom")


@pytest.mark.parametrize(
    "fault",
    [Reader(cycled(), RuntimeError("boom")), Reader(cycled(), "yes"), broken, SimpleNamespace(read=print)],
)
def test_a_reader_that_cannot_be_asked_is_not_this_files(path: Path, fault: Any) -> None:
    found = registry(Reader(cycled()), fault)
    (note,) = read_record(path, registry=found).notes[:1]
    assert note.startswith("not asked whether it knows the file: reader zz-1 of zz-fault 0.1: ")
    with pytest.raises(BsaError, match=r"recognises the file strange\.zz \(not asked whether .*zz-fault 0\.1"):
        read_record(path, registry=registry(Reader(cycled(), matches=False), fault))
    if not isinstance(fault, Reader):
        with pytest.raises(BsaError, match=r"reader zz-1 of zz-fault 0\.1"):
            read_record(path, registry=found, reader="zz-1")


def test_a_readers_options_are_its_own(path: Path) -> None:
    made: list[Options] = []

    def factory(options: Options) -> Reader:
        made.append(options)
        return Reader(cycled())

    found = registry(factory)
    read_record(path, registry=found, reader_options={"channel": 3})
    assert made[-1] == Options(channel=3)
    with pytest.raises(BsaError, match=r'reader "zz": "chanel" is not a known key\. Hint: did you mean "channel"\?'):
        read_record(path, registry=found, reader_options={"chanel": 3})
    with pytest.raises(BsaError, match='reader "zz": "channel" is 0'):
        read_record(path, registry=found, reader="zz", reader_options={"channel": 0})


def test_an_ambient_temperature_that_degrees_fahrenheit_would_give_is_noted(path: Path) -> None:
    said = "the ambient temperature of 77.0 degC is a high one"
    warm = cycled(temperature=TIME * 0 + 77.0 + 273.15)
    assert any(said in note for note in read(path, warm).notes)
    assert not any("is a high one" in note for note in read(path, warm, ambient_c=77.0).notes)
    assert not any("is a high one" in note for note in read(path, cycled()).notes)
