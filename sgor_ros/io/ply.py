"""Polygon files, .ply: the vertices of ascii and binary ones.

Read here because a header is a claim, and because the reader that there is (plyfile) is GPL.
"""
from dataclasses import dataclass
from dataclasses import field
from pathlib import Path

from ..core.common.settings import InputError
from .columns import ascii_columns
from .columns import binary_columns
from .columns import bytes_a_point
from .columns import Columns
from .columns import Field

LONGEST_HEADER = 1 << 16
TYPES = {'char': 'i1', 'uchar': 'u1', 'short': 'i2', 'ushort': 'u2', 'int': 'i4', 'uint': 'u4',
         'float': 'f4', 'double': 'f8', 'int8': 'i1', 'uint8': 'u1', 'int16': 'i2',
         'uint16': 'u2', 'int32': 'i4', 'uint32': 'u4', 'float32': 'f4', 'float64': 'f8'}
ORDERS = {'ascii': '<', 'binary_little_endian': '<', 'binary_big_endian': '>'}


@dataclass
class _Element:
    """What the header tells of vertices, faces and the like."""

    name: str
    count: int
    fields: list[Field] = field(default_factory=list)
    lists: bool = False


def read_ply(path: Path) -> Columns:
    """Read the columns of the vertices.

    Raises
    ------
    InputError
        Saying what of the header is broken, or does not go with what is there.
    """
    content = path.read_bytes()
    lines, start = _header(content)
    kind, elements = _elements(lines)
    names = [element.name for element in elements]
    if 'vertex' not in names:
        raise InputError(f'no element vertex; there are {", ".join(names) or "none"}')
    before = elements[:names.index('vertex')]
    vertex = elements[len(before)]
    if vertex.lists:
        raise InputError('its vertices have a property list, which no scan has')
    if kind == 'ascii':
        rows = content[start:].splitlines()
        first = sum(element.count for element in before)
        return ascii_columns(vertex.fields, vertex.count,
                             b'\n'.join(rows[first:first + vertex.count]))
    if any(element.lists for element in before):
        raise InputError('an element with a property list lies before its vertices')
    first = start + sum(element.count * bytes_a_point(element.fields) for element in before)
    return binary_columns(vertex.fields, vertex.count, memoryview(content)[first:])


def _header(content: bytes) -> tuple[list[list[str]], int]:
    """Return the words of each line, and where the data begin."""
    lines: list[list[str]] = []
    start = 0
    while start < min(len(content), LONGEST_HEADER):
        end = content.find(b'\n', start)
        end = len(content) if end < 0 else end
        words = content[start:end].decode('utf-8', 'replace').split()
        start = end + 1
        if not lines and words != ['ply']:
            break
        if words == ['end_header']:
            return lines, min(start, len(content))
        lines.append(words)
    raise InputError('no header of a .ply file: it has no lines ply and end_header')


def _elements(lines: list[list[str]]) -> tuple[str, list[_Element]]:
    """Return the format and what the file holds, in its order."""
    kind = lines[1][1] if len(lines) > 1 and lines[1][:1] == ['format'] and lines[1][1:] else ''
    if kind not in ORDERS:
        raise InputError(f'format {kind}: not one of {", ".join(ORDERS)}')
    elements: list[_Element] = []
    for words in lines[2:]:
        match words:
            case [] | ['comment' | 'obj_info', *_]:
                pass
            case ['element', name, count] if count.isdecimal() and len(count) < 20:
                elements.append(_Element(name, int(count)))
            case ['property', 'list', _, _, _] if elements:
                elements[-1].lists = True
            case ['property', of, name] if elements and of in TYPES:
                elements[-1].fields.append(Field(name, ORDERS[kind] + TYPES[of]))
            case _:
                raise InputError(f'{" ".join(words)[:60]}: not a line of a header')
    return kind, elements
