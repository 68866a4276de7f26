"""The documentation site: it builds without a warning, and asks nothing of the network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "docs" / "_ext"))


def test_the_help_of_a_command_loses_its_boxes_and_no_word():
    import command_help

    found = command_help.help_of(["measure"])
    assert "interval; without corners, list all." in " ".join(found.split())
    assert not re.search("[│╭╰\x1b]", found)


SETTINGS = f"""
import sys
sys.path.append({str(ROOT / "docs" / "_ext")!r})
extensions = ["myst_parser", "mathml"]
myst_enable_extensions = ["dollarmath"]
html_math_renderer = "mathml"
"""


def built(folder, page):
    """The page as HTML, made with the renderer of formulas alone, and what Sphinx warned of."""
    (folder / "conf.py").write_text(SETTINGS)
    (folder / "index.md").write_text(page)
    words = [sys.executable, "-m", "sphinx", "-q", str(folder), str(folder / "site")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return (folder / "site" / "index.html").read_text(), done.stderr


def test_a_formula_is_mathml_without_a_script(tmp_path):
    page, warned = built(
        tmp_path, "# Page\n\nIn a line $P_k$.\n\n$$a \\cos\\theta = \\begin{bmatrix} 1 & b \\end{bmatrix}$$\n"
    )
    assert warned == ""
    inline, displayed = re.findall(r"<math.*?</math>", page, flags=re.S)
    assert "".join(inline.split()).endswith("<msub><mi>P</mi><mi>k</mi></msub></math>")
    assert 'display="block"' in displayed
    assert "<mtable>" in displayed
    assert re.search(r'<mo lspace="0.17em" rspace="0.17em">cos</mo>\s*<mi>θ</mi>', displayed)
    assert not re.search("<script[^>]*math", page, flags=re.I)


@pytest.mark.parametrize("formula", [r"\unheardof{a}", r"\hat X_0"])
def test_a_formula_that_cannot_be_set_is_a_warning_with_its_line(tmp_path, formula):
    page, warned = built(tmp_path, f"# Page\n\n$${formula}$$\n")
    assert "index.md:3: WARNING: expected TeX that docutils can read, found:" in warned
    assert "<math" not in page


@pytest.mark.long
def test_the_site_builds_without_a_warning_and_needs_no_network(tmp_path):
    words = ["-m", "sphinx", "-q", "-E", "-W", "--keep-going", "-d", str(tmp_path / "doctrees")]
    done = subprocess.run(
        [sys.executable, *words, str(ROOT / "docs"), str(tmp_path / "site")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    fetched = (
        r"""(?:<(?:script|img|iframe)[^>]*\ssrc|<link[^>]*(?:stylesheet|icon|preload)[^>]*\shref)=["'](?:https?:)?//"""
    )
    assert [page.name for page in pages if re.search(fetched, page.read_text())] == []
    styles = [
        style for style in (tmp_path / "site").rglob("*.css") if re.search(r"url\(.?(https?:)?//", style.read_text())
    ]
    assert styles == []
    help_page = (tmp_path / "site" / "reference" / "command-line.html").read_text()
    assert "--strategy" in help_page
    # Every formula of a page is in it as MathML, with the site's own font, whose MATH table sets it.
    for name in ("scores", "consistency"):
        source = (ROOT / "docs" / "concepts" / f"{name}.md").read_text()
        formulas = re.findall(r"\$\$.+?\$\$|\$[^$]+\$", source, flags=re.S)
        page = (tmp_path / "site" / "concepts" / f"{name}.html").read_text()
        assert len(re.findall("<math ", page)) == len(formulas) > 20
        assert not re.search("<script[^>]*math", page, flags=re.I)
    (font,) = re.findall(r'url\("([^"]+\.ttf)"\)', (tmp_path / "site" / "_static" / "chainslam.css").read_text())
    assert "MATH" in TTFont(tmp_path / "site" / "_static" / font)
