"""A plugin that is loaded before the one of jaxtyping imports numpy: tests sum in the order of runs."""

import runpy
from pathlib import Path

# By path: jaxtyping checks no package that is imported before it.
runpy.run_path(str(Path(__file__).parents[1] / "experiments" / "__init__.py"))
