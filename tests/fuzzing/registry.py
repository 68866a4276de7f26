"""The mutators: each makes one broken input in a folder and returns the commands that read it.

A mutator is a function (rng, folder) -> commands, each a list of words for `chainslam`, which is run inside `folder`;
the folder is empty and its own. All chance comes from `rng`, so that seed and number make the same input again.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from . import drawings, results, words, worlds

Mutator = Callable[[np.random.Generator, Path], list[list[str]]]
MUTATORS: dict[str, Mutator] = {
    "logs": results.logs,
    "runs": results.runs,
    "replays": results.replays,
    "campaigns": results.campaigns,
    "contrasts": results.contrasts,
    "merged": results.merged,
    "words": words.words,
    "world-bytes": worlds.damaged_file,
    "world-values": worlds.other_values,
    "world-words": worlds.other_words,
    "world-shapes": worlds.other_shapes,
    "world-drawings": drawings.svg,
    "world-codes": drawings.codes,
    "world-storeys": drawings.storeys,
}
