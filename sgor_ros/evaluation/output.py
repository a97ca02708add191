"""The files that a benchmark leaves, and what it was made with."""
from collections.abc import Sequence
import csv
import json
from pathlib import Path
import subprocess
from typing import Any

from ..io.environment import describe_environment

PACKAGES = ('sgor_ros', 'numpy', 'scipy', 'numba', 'small_gicp', 'kiss_matcher', 'kiss-icp',
            'open3d-cpu', 'open3d')


def save(folder: Path, text: str, records: Sequence[dict[str, Any]], setup: dict[str, Any]
         ) -> None:
    """Write table.md, rows.csv and run.json.

    Parameters
    ----------
    folder : Path
        Made where there is none.
    text : str
        Tables and the rules that they follow.
    records : sequence of dict
        Lines of the CSV file.
    setup : dict
        Options and settings; versions, machine and revision are added.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'table.md').write_text(text + '\n')
    with open(folder / 'rows.csv', 'w', newline='') as file:
        writer = csv.DictWriter(file, list(records[0]))
        writer.writeheader()
        writer.writerows(records)
    document = {**setup, **describe_run()}
    (folder / 'run.json').write_text(json.dumps(document, indent=2, default=str) + '\n')


def describe_run() -> dict[str, Any]:
    """Return versions, machine and revision."""
    return {'environment': describe_environment(PACKAGES), 'revision': revision()}


def revision() -> str:
    """Return the git commit that the package runs from, or that there is none."""
    done = subprocess.run(['git', '-C', str(Path(__file__).parent), 'describe', '--always',
                           '--dirty', '--abbrev=12'], capture_output=True, text=True, check=False)
    return done.stdout.strip() or 'not a checkout'
