"""Damage to files that keeps enough of their structure to get past the first check, and changes that mean nothing."""

import base64
import io
import json
import re
import struct
import zipfile
import zlib
from decimal import Decimal

NASTY_WORDS = (
    "-1", "0", "1", "-0", "2147483647", "2147483648", "-2147483649", "4294967295", "9007199254740993",
    "9223372036854775807", "9223372036854775808", "18446744073709551616", "1000000000000000", "250000000", "1e15",
    "1e308", "-1e308", "1e309", "1e-320", "5e-324", "nan", "inf", "-inf", "", "x", "0x10", "1_0", "1,5", "--1",
    "3.5", "1e", "+", "True", "null", "\u0663", "9" * 400, "0." + "0" * 400 + "1", "1" * 5000,
)  # fmt: skip
NASTY_NUMBERS = (
    0, 1, 2, 7, 8, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**33, 10**9, 10**15,
    2**48, 2**62, 2**63 - 1, 2**63, 2**64 - 1, 2**64 - 2, 2**64 - 8,
)  # fmt: skip
NASTY_FLOATS = (0.0, -0.0, 5e-324, 1e-300, 1e15, 1e38, 1e154, 1e200, 1e308, float("inf"), float("-inf"), float("nan"))
_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[^\s\"'<>=,;{}\[\]()/]+")


def early(rng, n):
    """A position below `n`, more often near the start, where the words that steer a reader stand."""
    return min(rng.randrange(n), rng.randrange(n)) if rng.random() < 0.5 else rng.randrange(n)


# ---------------------------------------------------------------- bytes


def flip_bits(rng, data):
    if not data:
        return data
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 8))):
        out[early(rng, len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def truncate(rng, data):
    if rng.random() < 0.3:
        return data[: max(0, len(data) - rng.randrange(1, 12))]
    return data[: rng.randrange(len(data) + 1)]


def splice(rng, data):
    """Copy, move or drop a run of bytes."""
    at, to = rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)
    n = rng.choice((1, 2, 4, 8, 50, rng.randrange(1, 400)))
    piece = data[at : at + n]
    kind = rng.randrange(4)
    if kind == 0:
        return data[:at] + data[at + n :]
    if kind == 1:
        return data[:to] + piece + data[to:]
    if kind == 2:
        return data[:to] + piece + data[to + len(piece) :]
    return data[:to] + rng.randbytes(min(n, 64)) + data[to + (n if rng.random() < 0.5 else 0) :]


def set_field(rng, data, fields=()):
    """Write a nasty number over a field, a known one (offset, width) where the format names some."""
    if fields and rng.random() < 0.8:
        at, width = rng.choice(fields)
    else:
        width = rng.choice((1, 2, 4, 8))
        at = early(rng, max(1, len(data) - width))
    if at + width > len(data):
        return data
    order = rng.choice(("little", "little", "big"))
    kind = rng.randrange(4)
    if kind == 0:
        number = int.from_bytes(data[at : at + width], order) + rng.choice((-1, 1, -2, 2, 256, -256))
        piece = (number % 2 ** (8 * width)).to_bytes(width, order)
    elif kind == 1 and width in (4, 8):
        value = rng.choice(NASTY_FLOATS)
        if width == 4 and abs(value) > 3.4e38 and abs(value) != float("inf"):
            value = 3.4e38
        piece = struct.pack(("<" if order == "little" else ">") + ("f" if width == 4 else "d"), value)
    else:
        piece = (rng.choice(NASTY_NUMBERS) % 2 ** (8 * width)).to_bytes(width, order)
    return data[:at] + piece + data[at + width :]


def damage_bytes(rng, data, fields=()):
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        edit = rng.choice((flip_bits, truncate, splice, set_field, set_field, set_field))
        data = edit(rng, data, fields) if edit is set_field else edit(rng, data)
    return data


# ---------------------------------------------------------------- text


def damage_text(rng, data, vocabulary=(), openings=()):
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.choice(
            ("number", "number", "number", "count", "count", "word", "word", "line", "line", "lines", "bytes",
             "polygon", "nest")
        )  # fmt: skip
        if kind in ("number", "count"):
            data = _edit_number(rng, data, kind == "count")
        elif kind == "word":
            data = _edit_word(rng, data, vocabulary)
        elif kind in ("line", "lines"):
            data = _edit_lines(rng, data, kind == "lines")
        elif kind == "polygon":
            data = _long_polygon(rng, data)
        elif kind == "nest":
            if openings and rng.random() < 0.5:
                at = rng.randrange(len(data) + 1)
                data = data[:at] + rng.choice(openings).encode() * rng.choice((2, 50, 3000)) + data[at:]
        else:
            data = rng.choice((flip_bits, truncate, splice))(rng, data)
    return data


def _pick(rng, pattern, data):
    found = list(pattern.finditer(data))
    return found[early(rng, len(found))] if found else None


def _edit_number(rng, data, is_count):
    hit = _pick(rng, _NUMBER, data)
    if hit is None:
        return data
    word = rng.choice(NASTY_WORDS)
    if is_count or rng.random() < 0.1:
        try:
            word = str(int(hit[0]) + rng.choice((-1, 1, -2, 2, 10)))
        except ValueError:
            word = str(float(hit[0]) * rng.choice((-1.0, 1e160, 1e-160, 1e300)))
    return data[: hit.start()] + word.encode() + data[hit.end() :]


def _edit_word(rng, data, vocabulary):
    hit, other = _pick(rng, _WORD, data), _pick(rng, _WORD, data)
    if hit is None or other is None:
        return data
    kind = rng.randrange(6)
    head, word, tail = data[: hit.start()], hit[0], data[hit.end() :]
    if kind == 0:
        return head + tail
    if kind == 1:
        return head + word + b" " + word + tail
    if kind == 2 and vocabulary:
        return head + rng.choice(vocabulary).encode() + tail
    if kind == 3:
        return head + word.swapcase() + tail
    if kind == 4:
        return head + word + rng.choice((b" ", b"\n", b"\t", b"\r", b"\0", b"\xff", b"\x1c", b"\x85")) + tail
    return head + other[0] + tail


def _edit_lines(rng, data, is_section):
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    at = early(rng, len(lines))
    n = rng.randrange(1, max(2, len(lines) // 2)) if is_section else 1
    piece, to = lines[at : at + n], rng.randrange(len(lines))
    kind = rng.randrange(6)
    if kind == 0:
        del lines[at : at + n]
    elif kind == 1:
        lines[at:at] = piece
    elif kind == 2:
        del lines[at : at + n]
        lines[to:to] = piece
    elif kind == 3:
        lines[to:to] = piece * rng.choice((1, 2, 40))
    elif kind == 4:
        lines[at : at + n] = [b" ".join(line.rstrip(b"\r\n") for line in piece) + b" "]
    else:
        lines[at] = lines[at].rstrip(b"\r\n")[: rng.randrange(1 + len(lines[at]))] + b"\n"
    return b"".join(lines)


def _long_polygon(rng, data):
    """A row of whole numbers becomes a longer one of the same numbers; a count in front is put right or left."""
    lines = data.splitlines()
    rows = [k for k, line in enumerate(lines) if len(re.findall(rb"(?<!\S)\d+(?!\S)", line)) >= 3]
    if not rows:
        return data
    at = rng.choice(rows)
    words = lines[at].split()
    lead = words[:1] if words[0].isalpha() else []
    ids = words[1:]
    times = rng.choice((2, 3, 10, 100, 300))
    kind = rng.randrange(3)
    if kind == 0:
        ids = ids * times
    elif kind == 1:
        ids = [rng.choice(ids) for _ in range(times)]
    else:
        ids = [word for word in ids for _ in range(times)]
    if not lead:
        lead = [str(len(ids)).encode()] if rng.random() < 0.8 else words[:1]
    lines[at] = b" ".join(lead + ids)
    return b"\n".join(lines) + b"\n"


# ---------------------------------------------------------------- JSON


def damage_json(rng, document):
    """A copy of the document with one or two values, keys or lengths changed."""
    document = json.loads(json.dumps(document))
    for _ in range(rng.choice((1, 1, 2))):
        places = []
        _places(document, places)
        if not places:
            break
        holder, key = rng.choice(places)
        kind = rng.randrange(8)
        if kind == 0:
            del holder[key]
        elif kind == 1 and isinstance(holder, dict):
            holder[f"{key}x"] = holder.pop(key)
        elif kind == 2 and isinstance(holder[key], list):
            holder[key] = holder[key] * rng.choice((0, 2, 50)) + holder[key][:-1]
        elif kind == 3:
            holder[key] = nested(rng)
        elif kind == 4:
            other, name = rng.choice(places)
            holder[key] = json.loads(json.dumps(other[name]))
        elif kind == 5 and isinstance(holder[key], int | float):
            holder[key] = holder[key] + rng.choice((-1, 1, 0.5, 2**31, -(2**63)))
        else:
            holder[key] = nasty_value(rng)
    return document


def nasty_value(rng):
    return rng.choice(
        (None, True, -1, 0, 2**31, 2**63, 2**64, 10**400, 1e308, 5e-324, float("nan"), float("inf"), "", "x", "\0",
         "a\nb", "\ud800", "9" * 5000, [], {}, [[]], [None], [1, "a"], {"a": {"a": []}})
    )  # fmt: skip


def nested(rng):
    value = 0
    kind = rng.randrange(2)
    for _ in range(rng.choice((3, 30, 200))):
        value = [value] if kind else {"a": value}
    return value


def _places(value, found):
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(items):
        found.append((value, key))
        _places(inner, found)


def damage_json_text(rng, data, openings=("[", '{"a":', "[[", '"')):
    if rng.random() < 0.6:
        try:
            return json.dumps(damage_json(rng, json.loads(data))).encode("utf-8", "surrogatepass")
        except (ValueError, RecursionError):
            return data
    return damage_text(rng, data, ("null", "true", "NaN", "Infinity", "1e999", '"'), openings)


# ---------------------------------------------------------------- containers


def zip_members(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(info.filename, archive.read(info)) for info in archive.infolist()]


def zip_bytes(members, method=zipfile.ZIP_DEFLATED):
    """A zip file that is the same every time."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, compress_type=method)
    return stream.getvalue()


def zip_fields(data):
    """Offset and width of what steers a reader of zip files."""
    fields = []
    layouts = (
        (b"PK\x03\x04", (4, 6, 8, 26, 28), (14, 18, 22)),
        (b"PK\x01\x02", (6, 8, 10, 28, 30, 32, 34), (16, 20, 24, 42)),
        (b"PK\x05\x06", (4, 6, 8, 10, 20), (12, 16)),
    )
    for mark, shorts, longs in layouts:
        at = data.find(mark)
        while at >= 0:
            fields += [(at + k, 2) for k in shorts] + [(at + k, 4) for k in longs]
            at = data.find(mark, at + 4)
    return fields


def damage_zip(rng, data, damage_member):
    """Damage to the container, or to a member that is packed again, so that checksums hold."""
    if rng.random() < 0.4:
        return damage_bytes(rng, data, zip_fields(data))
    members = zip_members(data)
    kind = rng.randrange(8)
    at = rng.randrange(len(members))
    name, content = members[at]
    if kind == 0:
        del members[at]
    elif kind == 1:
        members[at] = (rng.choice(members)[0] + rng.choice(("", "x")), content)
    elif kind == 2:
        members[at] = (name, rng.choice(members)[1])
    else:
        members[at] = (name, damage_member(rng, name, content))
    names = [member for member, _ in members]
    members = [member for k, member in enumerate(members) if member[0] not in names[:k]]
    methods = [zipfile.ZIP_DEFLATED] * 8 + [zipfile.ZIP_STORED] * 4 + [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2]
    method = rng.choice(methods)
    packed = zip_bytes(members, method)
    return damage_bytes(rng, packed, zip_fields(packed)) if rng.random() < 0.2 else packed


def damage_npy(rng, content):
    """Damage to the header text of an array, with its length put right, or to its items."""
    if content[:6] != b"\x93NUMPY" or len(content) < 10:
        return damage_bytes(rng, content)
    n = int.from_bytes(content[8:10], "little")
    header, body = content[10 : 10 + n], content[10 + n :]
    kind = rng.randrange(5)
    if kind == 0:
        types = ("<f8", ">f8", "<i4", "<i8", "<u8", "|O", "<U9", "<c16", "|b1", "<m8[s]", "|V8", "|S0", "<f2")
        header = re.sub(rb"'descr': '[^']*'", f"'descr': '{rng.choice(types)}'".encode(), header)
    elif kind == 1:
        shapes = ("()", "(0,)", "(-1,)", "(3, 0)", "(1000000000000000,)", "(2, 2, 2)", "(4294967296, 4294967296)")
        header = re.sub(rb"'shape': \([^)]*\)", f"'shape': {rng.choice(shapes)}".encode(), header)
    elif kind == 2:
        header = damage_text(rng, header, ("descr", "shape", "True", "fortran_order"), ("(", "[", "-"))
    elif kind == 3 and content:
        return damage_bytes(rng, content)
    else:
        body = damage_bytes(rng, body)
    return content[:8] + struct.pack("<H", min(len(header), 65535)) + header + body


def damage_base64(rng, text, damage=damage_bytes):
    try:
        return base64.b64encode(damage(rng, base64.b64decode(text, validate=True)))
    except ValueError:
        return text


def damage_zlib(rng, packed, damage=damage_bytes):
    """Damage inside the codec: unpacked, damaged, packed again."""
    return zlib.compress(damage(rng, zlib.decompress(packed)))


# ---------------------------------------------------------------- the same in other words


def same_float(rng, word):
    """Another spelling of a number that is read as the same double."""
    try:
        value = float(word)
    except ValueError:
        return word
    kind = rng.randrange(6)
    if kind == 0:
        return f"{value:.20e}"
    if kind == 1:
        return format(Decimal(value), "f")
    if kind == 2:
        return f"{value!r}".replace("e", "E")
    if kind == 3 and not word.startswith(("-", "+")):
        return "+" + word
    if kind == 4:
        return f"{value:.17g}"
    return ("0" + word) if word[:1].isdigit() else word


def same_spaces(rng, text, comment="", ends=("\n", "\r\n")):
    """Other white space between words, other line ends, blank lines and comments between lines."""
    out = []
    for line in text.splitlines():
        words = line.split(" ")
        out.append("".join(word + rng.choice((" ", " ", "  ", "\t", " \t ")) for word in words[:-1]) + words[-1])
        if rng.random() < 0.3:
            out[-1] += rng.choice((" ", "\t", ""))
        if comment and rng.random() < 0.2:
            out.append(comment)
    end = rng.choice(ends)
    return end.join(out) + end


def same_json(rng, data):
    separators = rng.choice(((",", ":"), (" , ", " : ")))
    return json.dumps(json.loads(data), indent=rng.choice((None, 0, 4)), separators=separators).encode()
