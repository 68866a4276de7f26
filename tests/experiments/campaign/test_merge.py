"""Two campaigns put together leave the tables of the one that has the seeds of both."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.campaign import merge as merging
from chainslam.experiments.campaign.merge import merge
from chainslam.experiments.campaign.plan import Campaign
from chainslam.experiments.campaign.store import read_campaigns
from chainslam.experiments.commands.cli import main
from chainslam.experiments.usage import UsageError
from tests.experiments.campaign.running import run

WHOLE = Campaign(("paper-fig4",), ("full-ekf",), ("nearest-robot",), 2, arms=("closed",), max_steps=6)
LATER = replace(WHOLE, trials=1, first_seed=2)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    base = tmp_path_factory.mktemp("merge")
    parts = {"whole": WHOLE, "first": replace(WHOLE, trials=1), "later": LATER}
    return {name: run(base / name, campaign) for name, campaign in parts.items()}


def untimed(folder):
    return [(folder / name).read_bytes() for name in ("marks.csv", "steps.csv", "comparison.json")]


def test_merged_halves_are_the_whole_and_overlaps_that_agree_are_taken_once(folders, tmp_path):
    words = ["compare", "--merge", str(folders["later"]), str(folders["first"]), "--out", str(tmp_path / "halves")]
    assert main(words) == 0
    assert untimed(tmp_path / "halves") == untimed(folders["whole"])
    assert len(read_campaigns(tmp_path / "halves")) == 2
    merge([tmp_path / "halves", folders["whole"]], tmp_path / "again")
    assert untimed(tmp_path / "again") == untimed(folders["whole"])


def test_what_does_not_belong_together_is_refused(folders, tmp_path):
    other = run(tmp_path / "other", replace(LATER, p0="large"))
    broken = run(tmp_path / "broken", LATER)
    path = next(broken.rglob("trials/**/*.npz"))
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **arrays | {"pose_trace": 2.0 * arrays["pose_trace"]})
    for pair, word in (((folders["first"], other), "p0"), ((folders["later"], broken), "differ")):
        with pytest.raises(UsageError, match=word):
            merge(pair, tmp_path / "out")
    path.unlink()
    with pytest.raises(UsageError, match="run it again"):
        merge([folders["first"], broken], tmp_path / "out")
    with pytest.raises(UsageError, match="two or more"):
        merge([folders["first"]], tmp_path / "out")
    with pytest.raises(UsageError, match="empty folder"):
        merge([folders["first"], folders["later"]], folders["whole"])


def test_a_merge_that_was_killed_goes_on_when_it_is_begun_again(folders, tmp_path, monkeypatch):
    def killed(path, content):
        if path.suffix == ".npz":
            raise KeyboardInterrupt
        write(path, content)

    out, parts = tmp_path / "out", [folders["first"], folders["later"]]
    write = merging.write
    with monkeypatch.context() as patch:
        patch.setattr(merging, "write", killed)
        with pytest.raises(KeyboardInterrupt):
            merge(parts, out)
    assert [path.name for path in out.iterdir() if path.is_file() and path.suffix == ".json"] == ["config.json"]
    merge(parts, out)
    assert untimed(out) == untimed(folders["whole"])
    with pytest.raises(UsageError, match="empty folder"):
        merge(parts[::-1], out)
