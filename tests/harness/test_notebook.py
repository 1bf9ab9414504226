"""The notebook goes from a bag to plots: its cells run in order, as Jupyter would run them."""

import json
import os
import subprocess
import sys
from pathlib import Path

from harness.processes import REPOSITORY
from harness.python_package import directory

NOTEBOOKS = REPOSITORY / "examples" / "notebooks"
MOST_LINES = 20
# What Jupyter would show, in numbers: which frames have a dot on every axis, and how many dots are within the bands.
LOOK = """
shown = np.array([line.get_ydata() for axis in axes for line in axis.get_lines()])
within = np.abs(shown) < 3 * poses[:, 3:].T
has_bands = all(np.ptp(axis.collections[0].get_paths()[0].vertices[:, 1]) > 0.1 for axis in axes)
figure.savefig("plots.png")
print(shown.shape, np.isfinite(shown).sum(), within.sum(), has_bands, sep=";")
"""


def test_the_notebook_goes_from_a_bag_to_plots_in_twenty_lines(tmp_path: Path) -> None:
    notebook = json.loads((NOTEBOOKS / "bag_to_plots.ipynb").read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["metadata"]["kernelspec"]["name"]) == (4, "python3")
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    program = "\n".join("".join(cell["source"]) for cell in cells)
    assert 0 < sum(line.strip() != "" for line in program.splitlines()) <= MOST_LINES
    for file in NOTEBOOKS.glob("*.mcap"):
        (tmp_path / file.name).symlink_to(file)

    environment = os.environ | {"MPLBACKEND": "agg", "MPLCONFIGDIR": str(tmp_path), "PYTHONPATH": str(directory())}
    command = [sys.executable, "-W", "error", "-c", program + LOOK]
    done = subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )

    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "plots.png").stat().st_size > 10_000
    shape, dots, within, has_bands = done.stdout.strip().split(";")
    assert (shape, dots, has_bands) == ("(3, 200)", "600", "True")
    assert 600 >= int(within) > 590
