"""What the documents say is so."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

from ispm.viewer.controls import HELP

ROOT = Path(__file__).parents[2]


def test_settings_table_of_the_readme_is_up_to_date():
    script = [sys.executable, "scripts/settings_table.py", "--check"]
    run = subprocess.run(script, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert run.returncode == 0, "run: python scripts/settings_table.py"


def test_changelog_and_readme_name_the_commands_there_are():
    from ispm.cli.commands import COMMANDS

    readme = (ROOT / "README.md").read_text("utf-8")
    named = set(re.findall(r"^\| `ispm (\w+)", readme, re.MULTILINE))
    assert named == {module.__name__.rpartition(".")[2] for module in COMMANDS}


def test_page_of_every_name_is_up_to_date():
    script = [sys.executable, "scripts/api_page.py", "--check"]
    run = subprocess.run(script, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert run.returncode == 0, "run: make docs"


def test_links_between_documents_lead_to_headings_that_there_are():
    anchors = {path: headings(path) for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))}
    count = 0
    for path in anchors:
        for file, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)#([^)]+)\)", path.read_text("utf-8")):
            target = (path.parent / file).resolve() if file else path
            assert anchor in anchors[target], f"{path.name}: {file}#{anchor}"
            count += 1
    assert count > 30


def headings(path):
    """The anchors of a document's headings, as GitHub makes them: each once, code's are no headings."""
    text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    found = []
    for title in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        anchor = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        repeats = sum(re.sub(r"-\d+$", "", other) == anchor for other in found)
        found.append(f"{anchor}-{repeats}" if repeats else anchor)
    return found


def test_the_keys_of_the_page_are_those_of_its_document_and_of_the_window():
    page = (ROOT / "ispm" / "viewer" / "page" / "app.js").read_text("utf-8")
    keys = json.loads(re.search(r"const KEYS = (\[\[.*?\]\]);", page, re.DOTALL)[1])
    text = (ROOT / "docs" / "viewer.md").read_text("utf-8")
    assert [f"| {key} | {does} |" for key, does in keys] == re.findall(
        r"^\| (?!key|-).*\|$", text, re.MULTILINE
    )
    assert tuple(map(tuple, keys)) == HELP


def test_files_that_documents_name_exist():
    named = []
    for document in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        text = document.read_text("utf-8")
        named += [ROOT / name for name in re.findall(r"`((?:ispm|tests|scripts|docs)/[\w./-]+\.\w+)`", text)]
        links = re.findall(r"(?<!!)\[[^]]*\]\((?!https?:)([^)#]+)\)", text)
        named += [document.parent / link for link in links]
    assert len(named) > 50
    assert [str(path) for path in named if not path.exists()] == []


def test_the_method_has_a_cost_and_files_for_every_stage():
    text = (ROOT / "docs" / "method.md").read_text("utf-8")
    stages = re.split(r"^## ", text, flags=re.MULTILINE)[1:-1]  # the last tells faults
    assert len(stages) >= 14
    for stage in stages:
        for part in ("*What.*", "*Why.*", "*Cost.*", "*Files.*"):
            assert part in stage, f"{stage.splitlines()[0]}: has no {part}"


def test_no_source_file_is_a_monolith():
    # A file over 400 lines asks to be split.
    long = {
        str(path.relative_to(ROOT)): count
        for path in (ROOT / "ispm").rglob("*")
        if path.suffix in (".py", ".wgsl") and (count := len(path.read_text("utf-8").splitlines())) > 400
    }
    assert long == {}
