#!/usr/bin/env python3
"""Prints unicode_tables.cpp: what the tokenizer needs of the Unicode Character Database, from Python's own copy of it."""
import sys
import unicodedata as ud

ALL = range(sys.maxunicode + 1)


def ranges(wanted):
    out = []
    for c in ALL:
        if wanted(c):
            if out and out[-1][1] == c - 1:
                out[-1][1] = c
            else:
                out.append([c, c])
    return [tuple(r) for r in out]


def combining():
    out = []
    for c in ALL:
        k = ud.combining(chr(c))
        if k:
            if out and out[-1][1] == c - 1 and out[-1][2] == k:
                out[-1][1] = c
            else:
                out.append([c, c, k])
    return [tuple(r) for r in out]


def lower():
    """Runs (first, last, stride, lower - upper) of characters whose lower case is one other character."""
    out = []
    for c in ALL:
        low = chr(c).lower()
        if len(low) != 1 or ord(low) == c:
            continue
        delta = ord(low) - c
        if out and out[-1][3] == delta and c - out[-1][1] in (1, 2) and out[-1][2] in (0, c - out[-1][1]):
            out[-1][2] = c - out[-1][1]
            out[-1][1] = c
        else:
            out.append([c, c, 0, delta])
    return [(a, b, s or 1, d) for a, b, s, d in out]


def decompositions():
    """(character, first, second) of canonical decompositions; second is 0 in singletons. CJK compatibility ideographs, a
    thousand singletons that no prompt holds, are left out."""
    composing, others = [], []
    for c in ALL:
        d = ud.decomposition(chr(c))
        if not d or d[0] == '<' or 0xF900 <= c <= 0xFAFF or c >= 0x2F800:
            continue
        parts = [int(x, 16) for x in d.split()] + [0]
        row = (c, parts[0], parts[1])
        (composing if len(parts) == 3 and ud.normalize('NFC', chr(parts[0]) + chr(parts[1])) == chr(c) else others).append(row)
    return composing, others


def table(kind, name, rows):
    print(f'const std::array<{kind}, {len(rows)}> {name}{{{{')
    line = ' '
    for row in rows:
        item = ' {' + ', '.join(hex(x) if i < 2 or kind == 'Decomposition' else str(x) for i, x in enumerate(row)) + '},'
        if len(line) + len(item) > 110:
            print(line)
            line = ' '
        line += item
    print(line)
    print('}};\n')




composing, others = decompositions()
TABLES = [
    ('CodeRange', 'kLetters', ranges(lambda c: ud.category(chr(c))[0] == 'L')),
    ('CodeRange', 'kNumbers', ranges(lambda c: ud.category(chr(c))[0] == 'N')),
    ('CodeRange', 'kControls', ranges(lambda c: ud.category(chr(c)) in ('Cc', 'Cf', 'Co'))),
    ('CombiningRange', 'kCombining', combining()),
    ('LowerRun', 'kLower', lower()),
    ('Decomposition', 'kComposing', composing),
    ('Decomposition', 'kDecomposing', others),
]
print(f'''// Made by make_unicode_tables.py from the Unicode Character Database {ud.unidata_version}; see unicode_tables.h for what each table holds.
// clang-format off
#include "patina/diffusion/text/unicode_tables.h"

namespace patina::diffusion::unicode {{
''')
for kind, name, rows in TABLES:
    table(kind, name, rows)
print('}  // namespace patina::diffusion::unicode')
for kind, name, rows in TABLES:
    print(f'{name} {len(rows)}', file=sys.stderr)
