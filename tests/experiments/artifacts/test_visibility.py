"""`visibility.json`: the graph comes back as it was; what is no graph of this map is told in one line."""

import json

import numpy as np
import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.maps.visibility import VISIBILITY, graph_words, read_visibility, visibility_record
from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.records import Route
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """A short drive, and its folder."""
    folder = tmp_path_factory.mktemp("left")
    result = run_trial(TrialConfig("paper-fig4", errorless=True, max_steps=60))
    assert write_results(result, folder) == []
    return result, folder


def test_the_graph_that_was_written_is_read_again_with_its_kinds(left):
    result, folder = left
    graph, route = read_visibility(folder, result.last.map.ids)
    assert set(graph) == set(result.last.graph)
    assert sorted(graph.edges(data="kind")) == sorted(result.last.graph.edges(data="kind"))
    assert route == result.log.longest_route
    assert {kind for *_, kind in graph.edges(data="kind")} == {"neighbour", "sight"}


def test_the_longest_route_is_the_first_of_the_most_walls():
    seen = []
    result = run_trial(
        TrialConfig("paper-fig4", errorless=True, max_steps=90), lambda step: seen.append(step.decision.walls_to_follow)
    )
    longest = max(map(len, seen))
    route = result.log.longest_route
    assert route == Route(next(k for k, walls in enumerate(seen) if len(walls) == longest), seen[route.step])


def _edited(said, change):
    change(said)
    return said


@pytest.mark.parametrize(
    "change",
    [
        lambda said: said["graph"]["edges"][0].update(target=4711),
        lambda said: said["graph"]["edges"][0].update(kind="rumour"),
        lambda said: said["graph"]["nodes"].append({"id": 4711}),
        lambda said: said.pop("route"),
        lambda said: said.update(format=99),
    ],
)
def test_what_is_no_graph_of_this_map_is_one_line(left, tmp_path, change):
    result, folder = left
    said = _edited(json.loads((folder / VISIBILITY).read_text()), change)
    (tmp_path / VISIBILITY).write_bytes(json_bytes(said))
    with pytest.raises(UsageError, match=r"expected visibility\.json as this version writes it") as error:
        read_visibility(tmp_path, result.last.map.ids)
    assert "\n" not in str(error.value)


def test_the_words_count_what_the_graph_holds_and_name_walls_that_went(left):
    result, _ = left
    graph = result.last.graph
    record = visibility_record(result.last, result.log)["graph"]
    assert graph_words(graph, Route()).startswith(f"{len(record['nodes'])} walls, ")
    walls = (int(result.last.map.ids[0]), 4711)
    assert graph_words(graph, Route(7, walls)).endswith(f"at step 7: walls {walls[0]}, 4711 (of which 4711 went since)")
    assert np.all(np.isin(list(graph), result.last.map.ids))
