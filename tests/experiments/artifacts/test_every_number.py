"""No number without a test: each key that a real run or campaign writes is named in a test that works it out."""

from pathlib import Path

from chainslam.experiments.campaign.comparison.comparison import compare
from chainslam.experiments.campaign.comparison.findings import findings
from chainslam.experiments.campaign.comparison.hypothesis import hypothesis
from chainslam.experiments.campaign.comparison.tables import GATE, band_scores, mark_rows, step_rows, trial_row
from chainslam.experiments.campaign.plan import Campaign, Trial, config_of
from chainslam.experiments.campaign.work import Job, perform, unpack
from chainslam.experiments.scoring.keys import Steps

HERE = Path(__file__).parents[1]
BY_HAND = (
    *(f"scoring/test_{name}" for name in ("summary", "map_nees", "step_table", "innovations", "range_scores")),
    "artifacts/test_products",
    "scoring/maps/test_swept",
    *(f"campaign/scores/test_{name}" for name in ("score", "path_scores")),
    *(
        f"campaign/comparison/test_{name}"
        for name in ("tables", "comparison", "findings", "hypothesis", "left_out", "families")
    ),
)
"""The tests that hold each number against another way to work it out."""


def keys_of(value):
    """All keys of nested dictionaries and lists, but for names that are values themselves: corners, chains, arms."""
    if isinstance(value, dict):
        return set(value).union(*map(keys_of, value.values()))
    return set().union(*map(keys_of, value)) if isinstance(value, list | tuple) else set()


def test_every_number_that_is_written_is_named_in_a_test_that_works_it_out():
    campaign = Campaign(("paper-fig4",), ("block-ekf", "full-ekf"), ("nearest-robot", "nearest-start"), 1, ("closed",),
                        max_steps=3)  # fmt: skip
    records = []
    for strategy in campaign.strategies:
        for backend in campaign.backends:
            trial = Trial("paper-fig4", strategy, backend, "closed", 1)
            records.append(unpack(perform(Job(trial, config_of(campaign, trial))).record, trial))
    rows = [trial_row(record) for record in records]
    marks = [row for record in records for row in mark_rows(record)]
    steps = [step_rows([record]) for record in records]
    bands = [band_scores([record], mine) for record, mine in zip(records, steps, strict=True)]
    said = compare(campaign, rows, marks, bands)
    said |= {"hypothesis": hypothesis(marks), "findings": findings(said["pooled"], GATE)}
    summary = {key: value for key, value in records[0].summary.items() if key not in ("certificate", "distances")}
    written = keys_of([summary, *rows, *marks, *steps, said]) | set(Steps.__annotations__)
    tests = "".join((HERE / f"{name}.py").read_text() for name in BY_HAND)
    unnamed = sorted(key for key in written if f'"{key}"' not in tests and not key.startswith("step_ms_"))
    assert len(written) > 150
    assert unnamed == []
