"""Spoils a good input, by bytes and by words, the same way for the same random numbers."""
import re
import struct

# lengths, counts and signs as parsers stumble over them
NUMBERS = (0, 1, 2, 3, 7, 8, 9, 127, 128, 255, 256, 4096, 65535, 65536, 2**31 - 1, 2**31,
           2**32 - 1, 2**32, 2**53, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
WORDS = [b'nan', b'-nan', b'inf', b'-inf', b'1e300', b'-1e300', b'1e-320', b'-1', b'0', b'0.5',
         b'1e5', b'0x10', b'1_0', b'+1', b'-0', b'9' * 30, b'9' * 5000, b'', b'true', b'null',
         b'~', b'[]', b'{}', b'{1: 2}', b'[1, 2]', b'!!python/object:os.system', b'&a', b'*a',
         b'2001-99-99', b'1:2:3', b'\xff\xfe', b'\0', b'"', b"'", b'#', b'%', b',', b'\t',
         '\u0663'.encode(), b'x', b'y', b'z', b'label', b'_', b'F', b'I', b'U', b'list', b'float',
         *(str(number).encode() for number in NUMBERS)]
MOST = 1 << 16
"""Bytes of an input: what is spoilt grows, and long ones only cost time."""


def mutated(data, others, rng):
    """Return an input spoilt by one to eight steps; `others` are good inputs to take parts of."""
    data = bytearray(data)
    for _ in range(min(1 + int(rng.expovariate(0.7)), 8)):
        step = rng.choice(STEPS)
        data = bytearray(step(data, others, rng))[:MOST]
    return bytes(data)


def _place(data, rng):
    """Return an index; headers are at the beginning, so it is more often there."""
    size = max(len(data), 1)
    return rng.randrange(min(size, 300) if rng.random() < 0.6 else size)


def flip_bit(data, others, rng):
    if data:
        data[_place(data, rng)] ^= 1 << rng.randrange(8)
    return data


def set_byte(data, others, rng):
    if data:
        data[_place(data, rng)] = rng.choice((0, 1, 0x20, 0x7f, 0x80, 0xff, rng.randrange(256)))
    return data


def set_number(data, others, rng):
    code = rng.choice(('B', '<H', '>H', '<I', '>I', '<Q', '>Q', '<f', '<d'))
    size = struct.calcsize(code)
    if len(data) < size:
        return data
    at = min(_place(data, rng), len(data) - size)
    if code[-1] in 'fd':
        value = rng.choice((float('nan'), float('inf'), -1.0, 1e30, 0.5))
    else:
        value = rng.choice(NUMBERS) % (1 << 8 * size)
    struct.pack_into(code, data, at, value)
    return data


def cut(data, others, rng):
    return data[:rng.randrange(len(data) + 1)]


def delete(data, others, rng):
    at = _place(data, rng)
    return data[:at] + data[at + rng.choice((1, 2, 4, 8, rng.randrange(1, 200))):]


def insert(data, others, rng):
    at = _place(data, rng)
    return data[:at] + rng.randbytes(rng.choice((1, 2, 4, 8, 64))) + data[at:]


def repeat(data, others, rng):
    at = _place(data, rng)
    piece = data[at:at + rng.randrange(1, 100)]
    return data[:at] + piece * rng.choice((2, 3, 50)) + data[at:]


def splice(data, others, rng):
    other = rng.choice(others)
    return data[:rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1):]


def set_word(data, others, rng):
    found = list(re.finditer(rb'[^\s:,\[\]{}]+', data[:4000]))
    if not found:
        return data
    at = rng.choice(found)
    return data[:at.start()] + rng.choice(WORDS) + data[at.end():]


def swap_words(data, others, rng):
    found = list(re.finditer(rb'[^\s:,\[\]{}]+', data[:4000]))
    if len(found) < 2:
        return data
    one, two = sorted(rng.sample(found, 2), key=lambda word: word.start())
    return (data[:one.start()] + two[0] + data[one.end():two.start()] + one[0]
            + data[two.end():])


def change_lines(data, others, rng):
    lines = data.split(b'\n')
    at = rng.randrange(len(lines))
    what = rng.randrange(4)
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(at, lines[rng.randrange(len(lines))])
    elif what == 2:
        lines[at] = lines[at][:rng.randrange(len(lines[at]) + 1)]
    else:
        lines[at] = lines[at].replace(b' ', rng.choice((b'\t', b'  ', b',', b'', b'\r')))
    return b'\n'.join(lines)


STEPS = (flip_bit, set_byte, set_number, set_number, cut, delete, insert, repeat, splice, set_word,
         set_word, swap_words, change_lines)
