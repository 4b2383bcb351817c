"""Draws what a fit costs against views, resolution and texture size, from bench_inverse's report.

    python3 bench/inverse/plot_cost.py build/bench/inverse.json docs/images/fit_cost.svg

Three panels, both axes logarithmic; the thin line has slope 1 in the number of pixels or texels: whatever rises no steeper than it
grows no faster than linearly. Needs nothing beside Python.
"""

import json
import math
import pathlib
import sys

WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 250, 200, 44, 30, 36
PANELS = [
    ("views", "views", lambda entry: entry["views"], lambda entry: entry["views"]),
    ("resolution", "pixels a side of a view", lambda entry: entry["resolution"], lambda entry: entry["resolution"] ** 2),
    ("texture_size", "texels a side", lambda entry: entry["texture_size"], lambda entry: entry["texture_size"] ** 2),
]


def place(value, low, high, begin, end):
    return begin + (end - begin) * (math.log(value) - math.log(low)) / (math.log(high) - math.log(low))


def panel(entries, title, label, amount, left, low, high):
    sizes = [amount(entry) for entry in entries]
    seconds = [entry["seconds"] for entry in entries]
    x = [place(size, sizes[0] / 1.3, sizes[-1] * 1.3, left + LEFT, left + WIDTH) for size in sizes]
    y = [place(s, low, high, HEIGHT - BOTTOM, TOP) for s in seconds]
    linear = [place(min(high, max(low, seconds[0] * size / sizes[0])), low, high, HEIGHT - BOTTOM, TOP) for size in sizes]
    parts = [f'<path class="frame" d="M{left + LEFT} {TOP}V{HEIGHT - BOTTOM}H{left + WIDTH}"/>']
    parts.append('<path class="linear" d="M' + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, linear)) + '"/>')
    parts.append('<path class="curve" d="M' + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y)) + '"/>')
    for a, b, entry, s in zip(x, y, entries, seconds):
        parts.append(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3.5"/><text x="{a:.1f}" y="{b - 8:.1f}" text-anchor="middle">{s:.0f} s</text>')
        parts.append(f'<text class="tick" x="{a:.1f}" y="{HEIGHT - BOTTOM + 14}" text-anchor="middle">{label(entry)}</text>')
    parts.append(f'<text class="tick" x="{left + (LEFT + WIDTH) / 2:.0f}" y="{HEIGHT - 6}" text-anchor="middle">{title}</text>')
    return "\n".join(parts)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    cost = json.loads(pathlib.Path(sys.argv[1]).read_text()).get("cost")
    if not cost:
        sys.exit(f"{sys.argv[1]} has no part \"cost\" yet; bench_inverse measures it last")
    seconds = [entry["seconds"] for entry in cost]
    low, high = min(seconds) / 1.5, max(seconds) * 1.6
    body = "\n".join(
        panel(
            sorted((entry for entry in cost if entry["changed"] == changed), key=amount),
            title, label, amount, i * (WIDTH + 16), low, high,
        )
        for i, (changed, title, label, amount) in enumerate(PANELS)
    )
    style = (
        "text{font:11px system-ui,sans-serif;fill:#555}.tick{fill:#777}path{fill:none}.frame{stroke:#bbb}"
        ".linear{stroke:#bbb;stroke-dasharray:3 3}.curve{stroke:#2c7a6b;stroke-width:2}circle{fill:#2c7a6b}"
    )
    width = 3 * WIDTH + 2 * 16 + 12
    pathlib.Path(sys.argv[2]).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" width="{width}" height="{HEIGHT}">\n'
        f'<rect width="{width}" height="{HEIGHT}" fill="#fff"/>\n<style>{style}</style>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    main()
