"""Damage that knows the format: what is around the wrong number stays right.

A damaged checksum or a broken stream of deflate is refused at once, and the code behind
that check never runs. So chunks get their checksums again, streams are opened, damaged and
closed, and headers lie while everything else is sound.
"""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable

from reports.trials.soaking.damage import (
    BINARY,
    TEXT,
    WORDS,
    Damage,
    flip_bits,
    head,
    poke,
    replace_number,
)

_PNG = b"\x89PNG\r\n\x1a\n"
_PLY_TYPES = b"char uchar short ushort int uint float double int8 uint64 string".split()


# --------------------------------------------------------------------------------- PNG


def png(rng: random.Random, content: bytes) -> bytes:
    """Damage a chunk, its order or its pixels, and make every checksum right."""
    chunks, place = [], len(_PNG)
    while place + 8 <= len(content):
        (length,) = struct.unpack_from(">I", content, place)
        kind = content[place + 4 : place + 8]
        chunks.append((kind, content[place + 8 : place + 8 + length]))
        place += 12 + length
    k = rng.randrange(len(chunks))
    kind, data = chunks[k]
    match rng.randrange(5):
        case 0:
            chunks[0] = chunks[0][0], poke(rng, chunks[0][1], rng.randrange(13))
        case 1:
            chunks[k] = kind, rng.choice(BINARY)(rng, data)
        case 2:
            chunks.insert(rng.randrange(len(chunks) + 1), chunks.pop(k))
        case 3:
            extra = rng.choice((b"PLTE", b"tRNS", b"gAMA", b"iCCP", b"acTL", b"sBIT", kind))
            where = rng.randrange(len(chunks))
            chunks.insert(where, (extra, rng.randbytes(rng.randrange(40))))
        case _:
            at = [k for k, (kind, _) in enumerate(chunks) if kind == b"IDAT"]
            for k in at:
                chunks[k] = b"IDAT", _inside(rng, chunks[k][1])
    return _PNG + b"".join(map(_chunk, chunks))


def _chunk(chunk: tuple[bytes, bytes]) -> bytes:
    content = b"".join(chunk)
    length, checksum = len(content) - 4, zlib.crc32(content)
    return struct.pack(">I", length) + content + struct.pack(">I", checksum)


def _inside(rng: random.Random, stream: bytes) -> bytes:
    """Damage what a stream of deflate holds, or leave its bits as they fall."""
    if rng.random() < 0.3:
        return flip_bits(rng, stream)
    opened = zlib.decompressobj()
    data = rng.choice(BINARY)(rng, opened.decompress(stream))
    return zlib.compress(data) + opened.unused_data


# --------------------------------------------------------------------------------- EXR


def exr(rng: random.Random, content: bytes) -> bytes:
    """Damage one attribute of the header, its size, an offset, or a chunk's stream."""
    values, place = [], 8
    while content[place]:
        for _ in range(2):  # name and type
            place = content.index(0, place) + 1
        (size,) = struct.unpack_from("<i", content, place)
        values.append((place + 4, size))
        place += 4 + size
    start, size = rng.choice(values)
    match rng.randrange(6):
        case 0 | 1 | 2:
            return poke(rng, content, start + 4 * rng.randrange(max(1, size // 4)))
        case 3:
            return poke(rng, content, start - 4)  # its size
        case 4:
            return poke(rng, content, place + 1 + 8 * rng.randrange(4))  # an offset
        case _:
            return content[: place + 1] + flip_bits(rng, content[place + 1 :])


# -------------------------------------------------------------------------- serialized


def serialized(rng: random.Random, content: bytes) -> bytes:
    """Damage what the stream of the first mesh holds, or where the file says it is."""
    (_, version) = struct.unpack_from("<HH", content)
    width = 8 if version == 4 else 4
    (meshes,) = struct.unpack_from("<I", content, len(content) - 4)
    table = len(content) - 4 - width * meshes
    if rng.random() < 0.3:
        return poke(rng, content, rng.randrange(table, len(content)))
    opened = zlib.decompressobj()
    data = opened.decompress(content[4:table])
    rest = content[table - len(opened.unused_data) : table]
    if rng.random() < 0.6:  # flags, name and the two counts are at the beginning
        data = poke(rng, data, rng.randrange(40))
    else:
        data = rng.choice(BINARY)(rng, data)
    stream = zlib.compress(data)
    moved = len(stream) - (table - len(rest) - 4)
    form = "<" + str(meshes) + ("Q" if version == 4 else "I")
    offsets = list(struct.unpack_from(form, content, table))
    offsets[1:] = [max(0, offset + moved) for offset in offsets[1:]]
    places = struct.pack(form, *offsets) + struct.pack("<I", meshes)
    return content[:4] + stream + rest + places


# --------------------------------------------------------------- other headers that lie


def ply(rng: random.Random, content: bytes) -> bytes:
    """Change a word of the header: a count, a type, a name, the encoding."""
    end = content.index(b"end_header\n") + len(b"end_header\n")
    lines = content[:end].split(b"\n")
    k = rng.randrange(1, len(lines) - 1)
    words = lines[k].split()
    j = rng.randrange(len(words))
    numbers = [i for i, word in enumerate(words) if word.isdigit()]
    if numbers:
        words[numbers[0]] = rng.choice(WORDS).encode()
    elif words[0] == b"property":
        words[j] = rng.choice(_PLY_TYPES)
    else:
        words[j] = rng.choice((b"binary_big_endian", b"ascii", b"comment", b"list", b"x"))
    lines[k] = b" ".join(words)
    return b"\n".join(lines) + content[end:]


def jpeg(rng: random.Random, content: bytes) -> bytes:
    """Damage one segment, and leave the marks and lengths of all as they are."""
    segments, place = [], 2
    while place + 4 <= len(content) and content[place] == 0xFF:
        (length,) = struct.unpack_from(">H", content, place + 2)
        segments.append((place + 4, place + 2 + length))
        if content[place + 1] == 0xDA:
            break
        place += 2 + length
    start, end = rng.choice(segments)
    return poke(rng, content, rng.randrange(start, max(end, start + 1)))


def radiance(rng: random.Random, content: bytes) -> bytes:
    """Change a number of the header's text, or a run of the pixels."""
    end = content.index(b"\n", content.index(b"\n\n") + 2) + 1
    if rng.random() < 0.5:
        return replace_number(rng, content[:end]) + content[end:]
    return content[:end] + rng.choice(BINARY)(rng, content[end:])


def xml(rng: random.Random, content: bytes) -> bytes:
    """Put extreme words into attributes, so that the document stays well-formed."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        pieces = content.split(b'value="')
        k = rng.randrange(len(pieces))
        if k == 0:
            continue
        value, _, rest = pieces[k].partition(b'"')
        words = value.replace(b",", b" ").split() or [b""]
        words[rng.randrange(len(words))] = rng.choice(WORDS).encode()
        pieces[k] = b" ".join(words) + b'"' + rest
        content = b'value="'.join(pieces)
    return content


def _known(damage: Damage, times: int, others: tuple[Damage, ...] = BINARY) -> Damage:
    """Return damage that knows the format so many times as often as each other one."""
    choices = (*others, *(damage,) * times)

    def damaged(rng: random.Random, content: bytes) -> bytes:
        return rng.choice(choices)(rng, content)

    return damaged


DAMAGE: dict[str, Callable[[random.Random, bytes], bytes]] = {
    ".png": _known(png, 12),
    ".exr": _known(exr, 12),
    ".serialized": _known(serialized, 12),
    ".ply": _known(ply, 6, (*BINARY, *TEXT)),
    ".jpg": _known(jpeg, 12),
    ".hdr": _known(radiance, 8),
    ".bmp": _known(head(54), 8),
    ".tga": _known(head(18), 8),
    ".vol": _known(head(48), 8),
    ".binary": _known(head(12), 4),
    ".obj": _known(replace_number, 4, TEXT),
    ".spd": _known(replace_number, 4, TEXT),
    ".xml": _known(xml, 40, TEXT),
}
"""By the end of a file's name."""
