"""The report and the run record behind it, from journals written here."""

import json
import re
import time
from dataclasses import asdict, replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from bsa.core.comparison.record_errors import RecordErrors, SignalError
from bsa.core.comparison.signal_metrics import MISFIT
from bsa.core.encoding import encode_proposal, encode_task, encode_trial
from bsa.core.errors import BsaError
from bsa.core.feedback import Feedback
from bsa.core.metrics import PaperMetrics
from bsa.core.parameters import Parameter, ParameterSpace
from bsa.core.proposal import Proposal
from bsa.core.run.journal import Journal
from bsa.core.simulation import SimulationFailure
from bsa.core.task import CellModel, Experiment, Task
from bsa.core.trajectory import Step, StepKind, Trajectory
from bsa.core.trial import Trial
from bsa.experiments.report import page as report_page
from bsa.experiments.report.page import build_report
from bsa.experiments.report.rounds import chapters
from bsa.experiments.report.search_misfit import SEARCH_MISFIT, search_misfits
from bsa.experiments.report.thinning import thin_curve
from bsa.experiments.report.wording import change, clipped, factor, number, quantity, unit
from bsa.experiments.run_record import UNFINISHED, read_run

RADIUS, POROSITY = "Negative particle radius [m]", "Positive electrode porosity"
HOSTILE = "<script>alert(1)</script><img src=x onerror=y>\"' {{ 7*7 }} \u202e\x1b[31mred\x00 ]]>--></style></title>"


def curve(shift=0.0, samples=120):
    """A rest, then a discharge."""
    times = np.linspace(0, 3600.0, samples)
    current = np.where(times < 600, 0.0, 2.0)
    edge = int(np.searchsorted(times, 600))
    steps = (Step(StepKind.REST, 0, edge), Step(StepKind.CC_DISCHARGE, edge, samples))
    return Trajectory(times, current, 4.0 - 0.3 * times / 3600 + shift, None, steps)


def make_task(name="demo", experiments=1, protocol=(("Rest for 10 minutes", "Discharge at 1C"),)):
    space = ParameterSpace((Parameter(RADIUS, 5e-6, 1e-6, 2e-5, "log"), Parameter(POROSITY, 0.3, 0.1, 0.7)))
    records = tuple(Experiment(f"{name} {place}", curve(samples=900), protocol) for place in range(experiments))
    return Task(name, CellModel("Chen2020"), space, records, ("the record has no temperature",))


def metrics(objective):
    return PaperMetrics(objective, objective, 0.1, 0.2, objective, 0.01, 2 * objective, 0.001, 0.02)


def make_trial(task, index, phase, number_, objective, **values):
    failed = objective is None
    return Trial(
        index=index,
        phase=phase,
        round=number_,
        candidate={**task.space.initial, **values},
        metrics=None if failed else metrics(objective),
        failure=SimulationFailure("the solver <failed>", "Discharge at 1C", 1, 12.0) if failed else None,
        residuals=None,
        feedback=Feedback({}),
        curves=tuple(None if failed else curve(objective / 1e3) for _ in task.experiments),
        seconds=0.25,
    )


CONFIG = {"scaffold": {"name": "full"}, "backend": "rules", "seed": 7}


class Writer:
    """Writes a journal as the loop does."""

    def __init__(self, folder, task, config=CONFIG):
        self.folder, self.task = folder, task
        self.journal = Journal(folder)
        versions = {"pybamm": "26.10"}
        self.journal.append("run", format=1, identity="abc", config=config, versions=versions, task=encode_task(task))

    def trial(self, index, phase, number_, objective, **values):
        trial = make_trial(self.task, index, phase, number_, objective, **values)
        self.journal.append("trial", **encode_trial(trial, self.folder))

    def reply(self, text='{"hypothesis": "x"}', prompt="what now?"):
        usage = {"prompt_tokens": 90, "completion_tokens": 10, "reasoning_tokens": 0, "cost_usd": 0.5, "seconds": 2.0}
        turns = [
            {"role": "system", "text": "You tune cells.", "images": 0},
            {"role": "user", "text": prompt, "images": 1},
        ]
        self.journal.append(
            "reply", text=text, usage=usage, model="m", structured_by="text", notes=["retried once"], prompt=turns
        )

    def proposal(self, phase, number_, candidates=1, **fields):
        proposal = Proposal(tuple({} for _ in range(candidates)), **fields)
        self.journal.append("proposal", phase=phase, round=number_, **encode_proposal(proposal))

    def score(self, index, objective, rms_mv=()):
        records = [
            RecordErrors(experiment.name, {"voltage": SignalError("mV", rms, 2 * rms, rms)}).as_json()
            for experiment, rms in zip(self.task.experiments, rms_mv, strict=False)
        ]
        self.journal.append("score", index=index, metrics=asdict(metrics(objective)), records=records)


@pytest.fixture
def folder(tmp_path):
    """A small run in which everything happens once."""
    writer = Writer(tmp_path / "demo-1", make_task())
    writer.trial(0, "initial", 0, 40.0)
    writer.reply()
    writer.proposal("warm-up", 1, 2, rationale="look around")
    writer.trial(1, "warm-up", 1, 45.0, **{RADIUS: 6e-6})
    writer.trial(2, "warm-up", 1, None, **{POROSITY: 0.2})
    writer.reply()
    writer.proposal("search", 1, hypothesis="Diffusion is too slow.", details={"projected": [RADIUS]})
    writer.trial(3, "search", 1, 2.0, **{RADIUS: 1e-6})
    writer.journal.append("lost-call", reason="no server", prompt=[])
    writer.proposal("search", 2, 0, lost="no reply: no server")
    writer.reply(text="not json")
    writer.proposal("search", 3, hypothesis="Porosity.", details={"problems": ["nonsense"]})
    writer.trial(4, "search", 3, 3.0, **{RADIUS: 1e-6, POROSITY: 0.35})
    writer.journal.append("note", text="something worth saying")
    writer.score(0, 41.0)
    writer.score(3, 2.5)
    writer.journal.append("end", status="converged", best=3)
    writer.journal.close()
    return writer.folder


class TestRunRecord:
    def test_rounds_know_their_trials_replies_and_starting_point(self, folder):
        run = read_run(folder)
        assert [(r.phase, r.number, len(r.trials), len(r.exchanges)) for r in run.rounds] == [
            ("warm-up", 1, 2, 1),
            ("search", 1, 1, 1),
            ("search", 2, 0, 1),
            ("search", 3, 1, 1),
        ]
        assert [r.base.index for r in run.rounds] == [0, 0, 3, 3]
        assert [r.improved for r in run.rounds] == [False, True, False, False]
        assert run.rounds[2].exchanges[0].lost == "no server"

    def test_changes_are_those_of_the_simulation_that_the_model_was_told_of(self, tmp_path):
        writer = Writer(tmp_path / "run", make_task())
        writer.trial(0, "initial", 0, 40.0)
        writer.proposal("warm-up", 1, 1)
        writer.trial(1, "warm-up", 1, 30.0, **{RADIUS: 6e-6})
        writer.proposal("search", 1, details={"changed_from": 0})
        writer.trial(2, "search", 1, 35.0, **{POROSITY: 0.35})
        writer.proposal("search", 2, details={"changed_from": [7]})
        writer.trial(3, "search", 2, 36.0, **{RADIUS: 6e-6, POROSITY: 0.4})
        _, told, unknown = chapters(read_run(writer.folder))
        assert [one["name"] for one in told["main"]] == ["Positive electrode porosity"]
        assert (told["verdict"], told["before"]) == ("worse", "30")
        assert told["remarks"] == [
            "It changes simulation 0, the present one to the model; the lowest error before was that of simulation 1."
        ]
        assert [one["name"] for one in unknown["main"]] == ["Positive electrode porosity"]
        assert unknown["remarks"] == []

    def test_headline_numbers(self, folder):
        run = read_run(folder)
        assert (run.status, run.name, run.best.index, run.failed) == ("converged", "demo-1", 3, 1)
        assert (run.initial_metrics.objective, run.best_metrics.objective) == (41.0, 2.5)
        assert (run.usage.tokens, run.usage.cost_usd, len(run.exchanges)) == (300, 1.5, 4)
        assert run.simulator_s == pytest.approx(1.25)
        assert run.notes == ("the record has no temperature", "something worth saying")

    def test_a_score_of_an_earlier_best_does_not_count(self, tmp_path):
        writer = Writer(tmp_path, make_task())
        writer.trial(0, "initial", 0, 40.0)
        writer.score(0, 41.0)
        writer.score(0, 41.0)
        writer.journal.append("end", status="budget-spent", best=0)
        writer.journal.append("resumed", versions={})
        writer.proposal("search", 1)
        writer.trial(1, "search", 1, 5.0)
        run = read_run(tmp_path)
        assert (run.status, run.resumed, run.scored_exactly, run.best_metrics.objective) == (UNFINISHED, 1, False, 5.0)

    def test_trials_that_finished_out_of_order_are_sorted(self, tmp_path):
        writer = Writer(tmp_path, make_task())
        writer.trial(0, "initial", 0, 40.0)
        writer.proposal("warm-up", 1, 2)
        writer.trial(2, "warm-up", 1, 30.0)
        writer.trial(1, "warm-up", 1, 20.0)
        assert [trial.index for trial in read_run(tmp_path).trials] == [0, 1, 2]

    @pytest.mark.parametrize(
        "events",
        [
            [],
            [{"event": "trial", "index": 0}],
            [{"event": "run", "config": {}, "task": {}}],
            [{"event": "run", "config": {}, "task": {}}, {"event": "trial", "index": 0}],
            [{"event": "run", "config": {}, "task": encode_task(make_task())}],
        ],
    )
    def test_what_is_no_run_is_said_in_one_line(self, tmp_path, events):
        text = "".join(json.dumps(event) + "\n" for event in events)
        (tmp_path / "journal.jsonl").write_text(text, encoding="utf-8")
        with pytest.raises(BsaError) as caught:
            read_run(tmp_path)
        assert caught.value.hint
        assert "\n" not in str(caught.value)


class Page(HTMLParser):
    """Collects tags and text, and checks that everything that opens is closed."""

    VOID = ("meta", "link", "br", "img", "rect", "path", "circle", "polyline")

    def __init__(self, html):
        super().__init__()
        self.tags, self.attributes, self.open, self.words = [], [], [], []
        self.feed(html)
        assert self.open == []
        self.text = re.sub(r"\s+", " ", " ".join(self.words))

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes

    def handle_starttag(self, tag, attributes):
        self.handle_startendtag(tag, attributes)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in self.VOID:
            return
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.words.append(data)


def page_of(folder):
    html = build_report(folder).read_text(encoding="utf-8")
    return Page(html), html


class TestPage:
    def test_says_what_a_tolerance_is_where_that_is_the_unit_of_the_headline(self, folder, monkeypatch):
        assert "One tolerance is" not in page_of(folder)[0].text
        monkeypatch.setattr(report_page, "objective_of", lambda task: MISFIT)
        assert "One tolerance is 1 mV, " in page_of(folder)[0].text

    def test_shows_what_happened(self, folder):
        page, _ = page_of(folder)
        for words in (
            "brought the total MAPE from 41 % to 2.5 %",
            "Diffusion is too slow.",
            "Negative particle radius 5 µm → 1 µm × 0.2",
            "Lost round. no reply: no server",
            "A reply was refused: nonsense",
            "at lower bound",
            "5, 1 failed",
            "the solver <failed>",
            "something worth saying",
            "retried once (3 times)",
            "converged",
            "pybamm 26.10",
        ):
            assert words in page.text, words

    def test_needs_nothing_else(self, folder):
        page, html = page_of(folder)
        assert not {"script", "link", "img", "iframe", "object", "base"} & set(page.tags)
        assert not {"src", "href", "srcset", "action"} & {name for name, _ in page.attributes}
        assert "http://" not in html
        assert "https://" not in html
        assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", html))
        assert "@import" not in html

    def test_the_file_that_defines_the_errors_is_where_the_page_says(self, folder):
        (named,) = re.findall(r"core/\S+\.py", page_of(folder)[0].text)
        assert (files("bsa") / named).is_file()

    def test_a_prompt_is_printed_once(self, folder):
        _, html = page_of(folder)
        assert html.count("You tune cells.") == 1

    def test_reads_without_sight(self, folder):
        page, html = page_of(folder)
        charts = html.count('<svg class="chart"')
        assert charts == html.count("<desc id=") == 2
        assert html.count("<caption>") == 3
        assert "th" in page.tags

    def test_everything_untrusted_is_escaped(self, tmp_path):
        task = make_task(HOSTILE)
        writer = Writer(tmp_path / "run", task, {**CONFIG, "scaffold": {"name": HOSTILE}, "backend": HOSTILE})
        writer.trial(0, "initial", 0, 40.0)
        writer.reply(HOSTILE, HOSTILE)
        writer.proposal(
            "search", 1, hypothesis=HOSTILE, rationale=HOSTILE, details={"problems": [HOSTILE], "projected": [HOSTILE]}
        )
        writer.trial(1, "search", 1, 4.0, **{RADIUS: 6e-6})
        writer.proposal("search", 2, 0, lost=HOSTILE)
        writer.journal.append("note", text=HOSTILE)
        writer.journal.append("end", status=HOSTILE, best=1)
        page, html = page_of(tmp_path / "run")
        assert not {"script", "img"} & set(page.tags)
        assert not re.search("[\x00-\x08\x0b-\x1f\x7f\u202e]", html)
        assert "49" not in re.findall(r"\{\{ 7\*7 \}\}|\b49\b", page.text)
        assert page.text.count("<script>alert(1)</script>") >= 8

    def test_details_of_an_unknown_shape_do_no_harm(self, tmp_path):
        writer = Writer(tmp_path, make_task())
        writer.trial(0, "initial", 0, 40.0)
        writer.proposal("search", 1, details={"problems": "x", "projected": 3})
        writer.trial(1, "search", 1, 4.0)
        page_of(tmp_path)

    @pytest.mark.parametrize("objectives", [[None], [None, 3.0], [3.0], [0.0, 0.0], [5.0, None], [2.0, 9.0]])
    def test_any_outcome_has_a_page(self, tmp_path, objectives):
        writer = Writer(tmp_path, make_task(experiments=2))
        for index, objective in enumerate(objectives):
            if index:
                writer.proposal("search", index)
            writer.trial(index, "search" if index else "initial", index, objective, **{POROSITY: 0.3 + 0.01 * index})
        page, html = page_of(tmp_path)
        assert "not finished" in page.text
        assert "nan" not in html.split("</style>")[1].lower().replace("running", "")

    def run_of(self, folder, *trials):
        """A run of trials with these objectives and misfits; its task."""
        task = make_task()
        writer = Writer(folder, task)
        for index, (objective, misfit) in enumerate(trials):
            trial = make_trial(task, index, "search" if index else "initial", index, objective)
            trial = replace(trial, residuals=np.full(9, misfit))
            writer.journal.append("trial", **encode_trial(trial, folder))
        return task

    def test_a_reported_starting_point_is_not_called_the_best_by_score(self, tmp_path):
        self.run_of(tmp_path, (32.0, 27.0), (13.75, 140.0))
        page, _ = page_of(tmp_path)
        assert "No candidate was better" not in page.text
        told = "The starting point is reported. These are the values of simulation 0"
        assert told in page.text
        assert page.text.count("Simulation 1 has the lowest total MAPE, 13.75 %, and a misfit of 140") == 1

    def test_the_misfit_of_the_search_stands_beside_the_errors(self, tmp_path):
        task = self.run_of(tmp_path, (32.0, 27.0), (32.05, 26.9))
        assert search_misfits(task, *read_run(tmp_path).trials)[SEARCH_MISFIT] == pytest.approx((27.0, 26.9))
        page, _ = page_of(tmp_path)
        assert "RMS misfit in the search 27 26.9 tolerances" in " ".join(page.text.split())

    def test_every_record_is_named_above_and_over_its_figure(self, tmp_path):
        writer = Writer(tmp_path, make_task(name="cell", experiments=3))
        writer.trial(0, "initial", 0, 40.0)
        _, html = page_of(tmp_path)
        for place in range(3):
            # No separator between the number of records and the first of them.
            number = "3 records: " if place == 0 else ""
            assert f"<span>{number}{place + 1}. cell {place}</span>" in html
            assert f"<h3>{place + 1}. cell {place}</h3>" in html

    @pytest.mark.parametrize(
        ("scored", "expected"),
        [
            ({0: (77.7, 66.6), 1: (4.52, 3.21)}, ["66.6 mV before, 3.21 mV after", "77.7 mV before, 4.52 mV after"]),
            ({1: (4.52, 3.21)}, ["Voltage RMSE of this record: 3.21 mV.", "Voltage RMSE of this record: 4.52 mV."]),
            ({}, []),
        ],
    )
    def test_errors_beside_a_curve_are_those_that_were_scored(self, tmp_path, scored, expected):
        writer = Writer(tmp_path, make_task(name="cell", experiments=2, protocol=None))
        writer.trial(0, "initial", 0, 40.0)
        writer.proposal("search", 1)
        writer.trial(1, "search", 1, 4.0)
        for index, rms_mv in scored.items():
            writer.score(index, 4.0, rms_mv)
        page, _ = page_of(tmp_path)
        assert page.text.count("of this record:") == 2 * len(expected)  # Below each figure, and read aloud.
        assert all(words in page.text for words in expected)

    def test_a_command_in_a_note_is_whole(self, tmp_path):
        writer = Writer(tmp_path, make_task())
        writer.trial(0, "initial", 0, 40.0)
        command = "bsa discover --data " + " ".join(f"record-{place}.csv" for place in range(100))
        writer.journal.append("note", text=f"To look for it: {command}")
        page, _ = page_of(tmp_path)
        assert command in page.text

    def test_measured_current_is_judged_by_voltage(self, tmp_path):
        writer = Writer(tmp_path, make_task(protocol=None))
        writer.trial(0, "initial", 0, 40.0)
        writer.proposal("search", 1)
        writer.trial(1, "search", 1, 4.0)
        page, _ = page_of(tmp_path)
        assert "brought the voltage RMSE from 40 mV to 4 mV" in page.text

    def test_a_long_run_stays_light(self, tmp_path):
        writer = Writer(tmp_path, make_task())
        rng = np.random.default_rng(1)
        writer.trial(0, "initial", 0, 40.0)
        for round_ in range(1, 100):
            lines = [f'"feature_{place}": {value:.6f},' for place, value in enumerate(rng.random(1000))]
            writer.reply(text=json.dumps({"analysis": "<&>" * 3000}), prompt="\n".join(lines))
            writer.proposal("search", round_, hypothesis="h" * 5000, rationale="r" * 300)
            writer.trial(round_, "search", round_, 40.0 / round_, **{RADIUS: 5e-6 + 1e-8 * round_})
        started = time.perf_counter()
        path = build_report(tmp_path)
        assert time.perf_counter() - started < 10
        assert path.stat().st_size < 1.5e6
        points = [len(line.split()) for line in re.findall(r'points="([^"]*)"', path.read_text(encoding="utf-8"))]
        assert max(points) <= 400

    def test_nothing_is_left_behind(self, folder):
        build_report(folder)
        assert sorted(path.name for path in folder.iterdir()) == ["journal.jsonl", "report.html"]


class TestThinning:
    @pytest.mark.parametrize("size", [2, 3, 50, 5000, 60000])
    def test_few_points_look_the_same(self, size):
        x = np.linspace(0, 800, size)
        y = 100 + 90 * np.sin(x / 90) + np.where(x > 400, 50, 0)
        kept = thin_curve(x, y, 400)
        assert len(kept) <= 400
        assert kept[0] == 0
        assert kept[-1] == size - 1
        away = np.abs(np.interp(x, x[kept], y[kept]) - y)
        assert np.median(away) < 0.3
        assert np.max(away[np.abs(x - 400) > 2]) < 2.0

    def test_noise_keeps_its_extremes(self):
        y = np.random.default_rng(0).normal(size=20000) * 20
        kept = thin_curve(np.linspace(0, 800, 20000), y, 400)
        assert len(kept) <= 400
        assert {int(np.argmax(y)), int(np.argmin(y))} <= set(kept.tolist())


class TestWording:
    @pytest.mark.parametrize(
        ("value", "text"),
        [
            (0.0157825, "0.01578"),
            (3.3e-14, "3.3 × 10⁻¹⁴"),
            (-1.5, "−1.5"),
            (0, "0"),
            (None, "–"),
            (float("nan"), "–"),
            (float("inf"), "–"),
            (33133.0, "33130"),
            (1e6, "1 × 10⁶"),
        ],
    )
    def test_numbers(self, value, text):
        assert number(value) == text

    def test_units(self):
        assert unit("mol.m-3") == "mol m⁻³"
        assert quantity(5.2e-6, "m") == "5.2 µm"
        assert quantity(1e-14, "m2.s-1") == "1 × 10⁻¹⁴ m² s⁻¹"

    def test_changes_never_claim_perfection(self):
        assert change(44.5, 0.002) == "−99.996 %"
        assert change(10.0, 5.0) == "−50 %"
        assert change(10.0, 10.0) == "unchanged"
        assert change(0.0, 5.0) == change(None, 5.0) == "–"
        assert change(1.0, 1e-9) == "−99.9999 % or more"
        assert factor(2.0, 3.0) == "× 1.5"
        assert factor(0.0, 3.0) == factor(-1.0, 3.0) == "–"

    def test_clipping_keeps_both_ends(self):
        text = clipped("a" * 100 + "z" * 100, 60)
        assert text.startswith("a" * 40)
        assert text.endswith("z" * 20)
        assert "140 characters left out" in text


def test_a_report_goes_where_it_is_wanted_and_over_no_foreign_file(tmp_path, run_toy):
    run_toy(tmp_path / "run")
    wanted = tmp_path / "elsewhere" / "page.html"
    assert build_report(tmp_path / "run", wanted) == wanted
    assert wanted.read_text() == (tmp_path / "run" / "report.html").read_text()
    (tmp_path / "mine.html").write_text("mine")
    with pytest.raises(BsaError, match=r"mine\.html holds something"):
        build_report(tmp_path / "run", tmp_path / "mine.html")
    assert (tmp_path / "mine.html").read_text() == "mine"
