"""What the documents say is so."""

import os
import re
import subprocess
import sys
from pathlib import Path

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


def test_python_in_the_readme_compiles():
    readme = (ROOT / "README.md").read_text("utf-8")
    blocks = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    assert blocks
    for block in blocks:
        compile(block, "README.md", "exec")


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
