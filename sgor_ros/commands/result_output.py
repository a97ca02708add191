"""A result in words, and as JSON in a file or a pipe."""
from collections.abc import Mapping
import json
from pathlib import Path
import sys
from typing import Any

from ..io.writing import new_file
from ..io.writing import STDOUT


def tell(text: str, document: Mapping[str, Any], path: Path | None) -> None:
    """Print a result in words, and write it as JSON where that is asked for.

    On standard output JSON is alone, for a pipe; the words are on standard error then.
    """
    print(text, file=sys.stderr if path == STDOUT else sys.stdout)
    content = json.dumps(document, indent=2) + '\n'
    if path == STDOUT:
        sys.stdout.write(content)
    elif path is not None:
        with new_file(path) as place:
            place.write_text(content)
