"""The documents name what there is: parameters, links, and the programs that they show."""

import re
import subprocess
from pathlib import Path

import pytest

from harness.processes import REPOSITORY, binary


def test_the_file_and_the_page_are_what_the_program_declares() -> None:
    def printed(form: str) -> str:
        command = [binary("tanker_pose"), "parameters", form]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout

    file = (REPOSITORY / "config" / "tanker_pose.yaml").read_text(encoding="utf-8")
    assert file == printed("--yaml")
    page = (REPOSITORY / "docs" / "parameters.md").read_text(encoding="utf-8")
    tables = printed("--markdown")
    assert tables.count("| fixed |") > 10 and tables in page


def anchors(page: Path) -> set[str]:
    """The fragments that GitHub gives the headings of a page."""
    headings = re.findall(r"(?m)^#+ (.+)$", page.read_text(encoding="utf-8"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_of_the_documents_leads_to_a_file_and_a_heading() -> None:
    pages = [
        *REPOSITORY.glob("*.md"),
        *REPOSITORY.glob("docs/**/*.md"),
        *REPOSITORY.glob("crates/*/README.md"),
        REPOSITORY / "tests" / "README.md",
    ]
    dead = []
    for page in pages:
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
            if "://" in link:
                continue
            path, _, fragment = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            if not target.exists() or (fragment and fragment not in anchors(target)):
                dead.append(f"{page.relative_to(REPOSITORY)}: {link}")
    assert len(pages) > 10 and not dead, dead


def test_the_readme_stays_short() -> None:
    assert (REPOSITORY / "README.md").stat().st_size <= 11_000


@pytest.mark.parametrize(
    ("language", "source"),
    [("python", "pose_subscriber.py"), ("cpp", "cpp/pose_subscriber.cpp")],
)
def test_the_documents_show_the_examples_as_they_are(language: str, source: str) -> None:
    page = (REPOSITORY / "docs" / "subscribe.md").read_text(encoding="utf-8")
    (shown,) = re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)
    program = (REPOSITORY / "examples" / source).read_text(encoding="utf-8")
    if language == "python":
        # How it is run stands in the page's table.
        program = re.sub(r'\A#!.*?\n"""\n\n', "", program, flags=re.DOTALL)
    assert shown == program
