"""Which field of a cloud holds the class ids, where that is left to us."""
from collections.abc import Sequence
from typing import Any

from ..core.scan.point_clouds import LABEL_FIELDS

AUTO, NONE = 'auto', 'none'


def field_names(message: Any) -> list[str]:
    """Return the names of the fields of a cloud."""
    return [field.name for field in message.fields]


def label_field_of(message: Any, wanted: str) -> str:
    """Return the field to read class ids from; empty: from none.

    Parameters
    ----------
    message : sensor_msgs/msg/PointCloud2
    wanted : str
        What the user says: a name, whether the cloud has it or not; ``'auto'`` for the first of
        `LABEL_FIELDS` that the cloud has; ``'none'`` or empty for none.
    """
    return chosen_field(wanted, LABEL_FIELDS, field_names(message))


def chosen_field(wanted: str, known: Sequence[str], there: Sequence[str]) -> str:
    """Return the field that is wanted; of ``'auto'`` the first known one that is there."""
    if wanted in ('', NONE):
        return ''
    if wanted != AUTO:
        return wanted
    return next((name for name in known if name in there), '')


def choice_in_words(message: Any, wanted: str) -> str:
    """Return what `label_field_of` chose for a cloud, for a log; empty: there was no choice."""
    if wanted != AUTO:
        return ''
    chosen = label_field_of(message, wanted)
    if chosen:
        return f'class ids are read from the field {chosen}'
    return ('works without labels: none of the fields '
            f'{", ".join(LABEL_FIELDS)} is among {", ".join(field_names(message)) or "none"}')
