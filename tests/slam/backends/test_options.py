"""What can be set of a back end reaches it by the registry, from a trial's configuration."""

from dataclasses import fields, replace

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.slam.backends import BACKENDS, BackendOptions

START, P0 = np.zeros(3), 1e-4 * np.eye(3)


@pytest.mark.parametrize("name", list(BACKENDS))
def test_each_back_end_takes_the_options_of_its_type(name):
    known = {each.name: getattr(BackendOptions(), each.name) for each in fields(BackendOptions) if each.name != "own"}
    types = [type(each) for each in known.values()]
    assert types.count(BACKENDS[name].options) == (BACKENDS[name].options is not None)
    options = BackendOptions(**{name: replace(each) for name, each in known.items()})
    backend = BACKENDS[name].make(START, P0, options)
    assert any(backend.config is own for own in vars(options).values()) == (BACKENDS[name].options is not None)


@pytest.mark.parametrize("name", ["full-ekf", "graph"])
def test_a_trials_options_are_its_back_ends(name):
    options = BackendOptions()
    options = replace(
        options, ekf=replace(options.ekf, at_wall=False), graph=replace(options.graph, relinearise_place_m=0.05)
    )
    backend = build(TrialConfig("paper-fig5", name, backend_options=options)).backend
    assert any(backend.config is own for own in vars(options).values())
