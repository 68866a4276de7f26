"""The mutators: each makes one broken input in a folder and returns the commands that read it.

A mutator is a function (rng, folder) -> commands, each a list of words for `chainslam`; the folder is empty and its
own. All chance comes from `rng`, so that seed and number make the same input again.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

Mutator = Callable[[np.random.Generator, Path], list[list[str]]]
MUTATORS: dict[str, Mutator] = {}
