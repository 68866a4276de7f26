"""How Sphinx builds the site: `make docs`. Nothing is fetched, neither while it is built nor while it is read."""

import sys
from importlib.metadata import distribution
from importlib.metadata import version as version_of
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent / "_ext")]

project = "chainslam"
author = "The chainslam authors"
copyright = "The chainslam authors, MIT licence"
version = release = version_of("chainslam")

extensions = ["myst_parser", "sphinx.ext.autodoc", "command_help", "plain_types", "mathml", "film_player"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
highlight_language = "none"
nitpicky = False
default_role = "code"

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = f"chainslam {version}"
# ziamath ships STIX Two Math: browsers need a font with a MATH table to stretch brackets and place indices.
MATH_FONT = distribution("ziamath").locate_file("ziamath/fonts/STIXTwoMath-Regular.ttf")
html_math_renderer = "mathml"
html_static_path = ["_static", str(MATH_FONT)]
html_css_files = ["chainslam.css"]
html_show_sphinx = False
html_copy_source = False
