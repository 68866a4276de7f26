"""Texts that a user reads use the terms of the field, not private words of this code.

Names that scripts rely on (options, keys, columns) keep their words: what stands in code is not looked at.
"""

import ast
import inspect
import re
from pathlib import Path
from textwrap import dedent

import pytest

import chainslam
from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.sim.worlds import listing

ROOT = Path(__file__).parents[2]
PAGES = "README.md", "docs/**/*.md"
"""What a user reads of the documentation, as globs ..."""
NOT_FOR_USERS = "docs/contributing/**", "docs/decisions/**", "docs/_build/**"
"""... but for these, which only contributors read."""
TEMPLATES = ("viz/reports/*.j2",)
SAYS = "viz", "experiments", "chainslam", "sim", "explore", "slam"
"""Packages whose messages, pictures, tables and reports a user reads."""

PRIVATE = {
    r"as told": "with inflated covariance",
    r"off-line cov\w*|misfits?|bows": "lack-of-fit variance, model discrepancy",
    r"crooked": "has lack of fit",
    r"floor of (?:a|the|its) (?:wall|covariance|variance)s?": "noise floor",
    r"overlaid (?:end|line|wall)s?|placed (?:end|wall)s?": "corner evidence, line at extent",
    r"cuts? (?:a|the|its) scans?|cuts? (?:in|of) (?:a|the) scan": "breakpoint, split",
    r"settl(?:e|es|ed|ing) (?:the |its )?(?:graph|estimate|line|wall|solution|map)s?": "solve, converge",
    r"carr(?:y|ies|ied|ying) (?:the |its )?(?:covariance|block)s?|shear(?:s|ed)?": "transport the covariance",
    r"lineari[sz](?:es?|ed) halfway|halfway (?:between the two|filter|update)": "midpoint linearisation",
    r"judged by (?:the rest|its others)": "leave-one-out distance",
    r"loose (?:beam|factor|line|segment|end|wall)s?": "pending relinearisation, unassigned",
    r"surpris(?:e|es|ed|ing)": "innovation statistics",
    r"unstated motions?": "unmodelled motion",
    r"place search(?:es)?": "global relocalisation",
    r"(?:second|two|three|several|many|firm|sure|number of) looks?": "observations, offline refinement",
    r"(?:firm )?sightings?|firm (?:wall|segment|observation)s?": "reliable observations",
    r"entered twice|(?:double|twofold) entr(?:y|ies)|walls twice": "duplicate landmark",
    r"own gauge|motions? of everything": "after gauge alignment, unobservable directions",
    r"in the blind": "by dead reckoning",
    r"(?:states?|tells?) of (?:itself|themselves)|(?:scans?|wheels|odometry) tell(?:s)? the motion": "reports",
    r"h(?:old|olds|eld) (?:\w+ ){0,3}against": "evaluated against, compared with",
    r"ways? driven|metres? of way|of its way|reachable way": "path, path length",
    r"floor swept|swept (?:floor|area|space)": "free-space coverage",
    r"errands?|pilots?": "behaviour, path tracker",
    r"sets? aside|setting aside": "blacklist",
    r"ends? (?:that )?(?:(?:is|are|was|were) )?given up": "blacklisted",
    r"giv(?:e|es|ing) up (?:on )?(?:an?|the|its) (?:open )?end": "blacklists",
    r"reviv(?:e|es|ed)|hopeless": "expiry of the blacklist",
    r"unwitnessed": "without ground truth",
    r"housekeeping": "pruning",
    r"(?:something|things?|obstacles?|anything) round|round (?:thing|obstacle)s?": "curved obstacles",
    r"verbs?": "methods",
    r"rooms? of (?:the|this) code|room imports": "packages",
    r"(?:by )?the wheels alone": "odometry alone",
    r"times apart": "except for timings",
    r"not its business|the house": "words of no field",
}
"""Private words, each with what the field says. Words with another, ordinary meaning only match where ours is meant."""
FOUND = re.compile("|".join(rf"(?P<_{k}>\b(?:{words})\b)" for k, words in enumerate(PRIVATE)), re.IGNORECASE)
CODE = (
    r"^(```+|~~~+).*?^\1|<!--.*?-->",  # blocks and comments
    r"(?<=\n\n)(?:(?: {4}|\t)[^\n]*(?:\n|\Z))+",  # indented blocks
    r"`[^`]*`|\]\([^)]*\)",  # code in a line, places of links
    r"(?<!\w)--?[a-z][\w-]*|\b\w*_\w+\b|\b\w+[./]\w[\w./]*",  # options, keys and files outside of it
)


def prose(text):
    """Return a text without what stands in code, in one line."""
    for pattern in CODE:
        text = re.sub(pattern, " # ", text, flags=re.MULTILINE | re.DOTALL)
    return " ".join(text.split())


def private(text):
    """Return the private words of a text, each with a few words beside it and what the field says."""
    words, fields = prose(text), tuple(PRIVATE.values())
    return [
        f"...{words[max(match.start() - 40, 0) : match.end() + 30]}...: {fields[int(match.lastgroup[1:])]}"
        for match in FOUND.finditer(words)
    ]


def pages(root=ROOT):
    """Return the pages that a user reads."""
    hidden = {path for pattern in NOT_FOR_USERS for path in root.glob(pattern + "/*.md")}
    return sorted({path for pattern in PAGES for path in root.glob(pattern)} - hidden)


def literals(tree):
    """Return the texts of a module that are no docstrings, those of an f-string as one."""
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    parts -= {id(node) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)}
    about = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (parts | about):
            yield node.value
        elif isinstance(node, ast.JoinedStr) and id(node) not in about:
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "#" for part in node.values)


def is_text(node):
    """Return whether a statement is a string."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def docstrings(tree):
    """Return what stands below public classes, functions and fields."""
    yield ast.get_docstring(tree) or ""
    for before, node in zip([None, *tree.body], tree.body, strict=False):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            yield from docstrings(node)
        elif is_text(node) and isinstance(before, ast.AnnAssign) and before.target.id[0] != "_":
            yield node.value.value


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_uses_the_terms_of_the_field(page):
    assert private(page.read_text()) == []


@pytest.mark.parametrize("name", ["--help", *COMMANDS])
def test_the_help_of_a_command_uses_the_terms_of_the_field(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")
    with pytest.raises(SystemExit):
        main([name] if name == "--help" else [name, "--help"])
    said = capsys.readouterr().out
    assert "--help" in said
    assert private(said) == []


@pytest.mark.parametrize("name", chainslam.__all__)
def test_a_public_docstring_uses_the_terms_of_the_field(name):
    offered = getattr(chainslam, name)
    if inspect.isclass(offered) or inspect.isfunction(offered):
        (tree,) = ast.parse(dedent(inspect.getsource(inspect.unwrap(offered)))).body
        assert private("\n".join(docstrings(tree))) == []


def test_the_listings_use_the_terms_of_the_field():
    listed = [entry.description for entry in (*chainslam.BACKENDS.values(), *chainslam.STRATEGIES.values())]
    assert private("\n".join((*listed, *listing().values()))) == []


@pytest.mark.parametrize("package", SAYS)
def test_messages_tables_and_reports_use_the_terms_of_the_field(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        texts = [text for text in literals(ast.parse(path.read_text())) if " " in text]
        assert [words for text in texts for words in private(text)] == [], path


def test_templates_of_reports_use_the_terms_of_the_field():
    templates = [path for pattern in TEMPLATES for path in ROOT.glob(pattern)]
    assert templates
    for path in templates:
        assert private(path.read_text()) == [], path


@pytest.mark.parametrize(
    "text",
    ["the wall is crooked", "Second looks merge\nit", "it was held close against a map", "3 open ends, set aside",
     "a pose in its own gauge", "the scans tell the motion", "firm sightings of it", "the house is dark"],
)  # fmt: skip
def test_private_words_are_found_across_lines_and_in_any_case(text):
    assert len(private(text)) == 1


@pytest.mark.parametrize(
    "text",
    ["`crooked` marks it", "| `set_aside` |", "Use `--second-looks` or --second-looks.", "set_aside is a key",
     "see [it](own gauge.md)", "    .venv/bin/chainslam crooked\n", "text\n\n    the crooked wall\n\nmore",
     "```\nheld against\n```", "look at two rooms with a noise floor", "hold the robot", "find your way",
     "a loose coupling",
     "it is told in one line", "the floor that it saw", "the rest of the scan", "Bowser"],
)  # fmt: skip
def test_names_in_code_and_ordinary_words_are_none(text):
    assert private("\n\n" + text) == []


def test_pages_for_contributors_are_none_of_a_users():
    shown = {str(path.relative_to(ROOT)) for path in pages()}
    assert {"README.md", "docs/index.md"} <= shown
    assert not [name for name in shown if name.startswith(("docs/contributing", "docs/decisions"))]
