"""Point clouds of PCL, .pcd: ascii, binary, compressed.

Read here because a header is a claim: the readers that there are believe it (Open3D crashes by
it; pypcd4 returns fewer points than it tells, and refuses tabs, COUNT left out and VERSION .5).
"""
from pathlib import Path
import struct

from ..core.common.settings import InputError
from .columns import ascii_columns
from .columns import binary_columns
from .columns import bytes_a_point
from .columns import Columns
from .columns import Field
from .columns import field_by_field

LONGEST_HEADER = 1 << 16
CODES = {'F': ('f', (4, 8)), 'I': ('i', (1, 2, 4, 8)), 'U': ('u', (1, 2, 4, 8))}
KINDS = ('ascii', 'binary', 'binary_compressed')
MOST_EXPANSION = 88
"""Times that LZF can shorten: 264 bytes by three."""

Header = dict[str, list[str]]


def read_pcd(path: Path) -> Columns:
    """Read the columns of a file.

    Raises
    ------
    InputError
        Saying what of the header is broken, or does not go with what is there.
    """
    content = path.read_bytes()
    header, start = _header(content)
    fields, points = _fields(header), _points(header)
    kind = header['DATA'][0] if header['DATA'] else ''
    if kind == 'ascii':
        return ascii_columns(fields, points, content[start:])
    if kind == 'binary':
        return binary_columns(fields, points, memoryview(content)[start:])
    if kind == 'binary_compressed':
        return field_by_field(fields, points, _unpacked(
            content, start, points * bytes_a_point(fields)))
    raise InputError(f'DATA {kind}: not one of {", ".join(KINDS)}')


def _header(content: bytes) -> tuple[Header, int]:
    """Return the words of each line by the first of them, and where the data begin."""
    header: Header = {}
    start = 0
    while start < min(len(content), LONGEST_HEADER):
        end = content.find(b'\n', start)
        end = len(content) if end < 0 else end
        words = content[start:end].decode('utf-8', 'replace').split()
        start = end + 1
        if words and not words[0].startswith('#'):
            header[words[0]] = words[1:]
            if words[0] == 'DATA':
                return header, min(start, len(content))
    raise InputError('no header of a .pcd file: it has no line DATA')


def _fields(header: Header) -> list[Field]:
    names = header.get('FIELDS') or header.get('COLUMNS')    # as it was called before 0.7
    if not names:
        raise InputError('its header has no line FIELDS')
    sizes, types = _whole(header, 'SIZE'), header.get('TYPE', [])
    counts = _whole(header, 'COUNT') if 'COUNT' in header else [1] * len(names)
    for line, values in (('SIZE', sizes), ('TYPE', types), ('COUNT', counts)):
        if len(values) != len(names):
            raise InputError(f'its header has {len(names)} FIELDS, but {len(values)} of {line}')
    fields = []
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        code, known = CODES.get(kind, ('', ()))
        if size not in known:
            raise InputError(f'field {name}: no type of TYPE {kind} and SIZE {size}')
        fields.append(Field(name, f'<{code}{size}', count))
    return fields


def _points(header: Header) -> int:
    (width,), (height,) = _whole(header, 'WIDTH', 1), _whole(
        {'HEIGHT': ['1'], **header}, 'HEIGHT', 1)
    if 'POINTS' in header:
        points, = _whole(header, 'POINTS', 1)
        if points != width * height:
            raise InputError(f'its header tells of POINTS {points}, but of WIDTH x HEIGHT '
                             f'{width} x {height}')
    return width * height


def _whole(header: Header, line: str, count: int | None = None) -> list[int]:
    """Return the numbers of a line of the header."""
    words = header.get(line)
    if words is None:
        raise InputError(f'its header has no line {line}')
    if not all(word.isdecimal() and len(word) < 20 for word in words):
        raise InputError(f'{line} {" ".join(words)[:60]}: not whole numbers')
    if count is not None and len(words) != count:
        raise InputError(f'{line} {" ".join(words)[:60]}: expected {count} number')
    return [int(word) for word in words]


def _unpacked(content: bytes, start: int, expected: int) -> bytes:
    """Return what two sizes and LZF packed."""
    if len(content) < start + 8:
        raise InputError('it ends before its data; truncated')
    packed, size = struct.unpack_from('<II', content, start)
    there = len(content) - start - 8
    if packed > there:
        raise InputError(f'{packed} compressed bytes are told, {there} are there; truncated')
    if size != expected:
        raise InputError(f'its data unpack to {size} bytes, but its header tells of {expected}')
    if size > MOST_EXPANSION * packed:
        raise InputError(f'{packed} compressed bytes cannot be {size}')
    return _lzf(content[start + 8:start + 8 + packed], size)


def _lzf(packed: bytes, size: int) -> bytes:
    """Unpack LZF: runs of bytes as they are, and repetitions of what has been.

    A first byte below 32 announces a run. Otherwise its upper three bits, and a further byte where
    all are set, are the length, its lower five and the last byte how far back it was.
    """
    out = bytearray()
    at, end = 0, len(packed)
    while at < end and len(out) <= size:
        first = packed[at]
        if first < 32:
            out += packed[at + 1:at + 2 + first]
            at += 2 + first
            continue
        length, more = first >> 5, int(first >> 5 == 7)
        if at + 1 + more >= end:
            break
        if more:
            length += packed[at + 1]
        back = ((first & 31) << 8) + packed[at + 1 + more] + 1
        at, length = at + 2 + more, length + 2
        if back > len(out):
            raise InputError('its compressed data are broken')
        begin = len(out) - back
        piece = out[begin:begin + length]
        # what reaches beyond its own end repeats itself
        out += (piece * (length // len(piece) + 1))[:length] if len(piece) < length else piece
    if len(out) != size:
        raise InputError(f'its data unpack to {len(out)} bytes in place of {size}; truncated')
    return bytes(out)
