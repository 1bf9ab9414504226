"""The documents' program does what it says: extracted, run, heard, and ended by Ctrl-C."""

import re
import sys
from pathlib import Path

from harness import messages
from harness.conftest import StartEstimator
from harness.estimator import Estimator
from harness.peer import RELIABLE
from harness.processes import REPOSITORY, Process
from harness.waiting import wait_until


def test_the_documents_name_all_that_is_fixed_and_nothing_else() -> None:
    page = (REPOSITORY / "docs" / "parameters.md").read_text(encoding="utf-8")
    (sentence,) = re.findall(r"Fixed once the node runs are (.*?)\.", page)
    lines = (REPOSITORY / "config" / "tanker_pose.yaml").read_text(encoding="utf-8").splitlines()
    fixed = {line.split(":")[0].strip() for line in lines if "# (fixed)" in line}
    assert set(re.findall(r"`(\w+)`", sentence)) == fixed


def anchors(page: Path) -> set[str]:
    """The fragments that GitHub gives the headings of a page."""
    headings = re.findall(r"(?m)^#+ (.+)$", page.read_text(encoding="utf-8"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_of_the_documents_leads_to_a_file_and_a_heading() -> None:
    pages = [*REPOSITORY.glob("*.md"), *REPOSITORY.glob("docs/**/*.md"), REPOSITORY / "tests" / "README.md"]
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


def test_the_python_subscriber_logs_the_pose_and_ends_quietly_on_ctrl_c(
    start_estimator: StartEstimator, domain: int, tmp_path: Path
) -> None:
    page = (REPOSITORY / "docs" / "subscribe.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    script = tmp_path / "follower.py"
    script.write_text(program, encoding="utf-8")
    estimator: Estimator = start_estimator(qos=RELIABLE)
    estimator.use_camera()

    follower = Process([sys.executable, str(script)], domain, tmp_path / "follower", {})
    try:
        wait_until(
            lambda: re.search(r"\d m ahead, sigma \d", follower.log),
            "the subscriber to log a pose",
            pause=lambda: estimator.expect_pose(messages.exact_frame(estimator.next_index())),
        )
        estimator.peer.spin_for(0.5)  # what is under way has arrived
        follower.stop()
    finally:
        follower.kill_if_running()

    assert "Traceback" not in follower.log, follower.log
