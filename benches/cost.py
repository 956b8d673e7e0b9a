"""Writes cost.md and cost.svg from cost.csv (make bench-cost)."""

import csv
import datetime
import math
import os
import pathlib
import subprocess

HERE = pathlib.Path(__file__).parent
rows = list(csv.DictReader(open(HERE / "cost.csv")))
model = next(
    (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")),
    "?",
)
rust = subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout.strip()
text = [
    f"`make bench-cost`, {datetime.date.today()}, {model}, {os.cpu_count()} cores; {rust}. Set B "
    "of W1, every y = 0 crossing located; a run of less than a quarter of a second is repeated, "
    "and the mean told.",
    "",
]
text += ["| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
text += ["| " + " | ".join(value or "" for value in row.values()) + " |" for row in rows]
(HERE / "cost.md").write_text("\n".join(text) + "\n")

# Okabe and Ito's colours, and a mark of its own for each: no reader needs to tell colours apart.
STYLES = {
    "dopri5": ("#d55e00", "circle"),
    "lsoda": ("#0072b2", "square"),
    "radau5": ("#009e73", "diamond"),
    "taylor": ("#cc79a7", "triangle"),
    "layered": ("#000000", "ring"),
}
PANELS = [
    ("t_end", "end time (ε = 1e-3, tolerance 1e-8)"),
    ("eps", "width of the layer, ε (end time 2e3, tolerance 1e-8)"),
    ("tolerance", "tolerance (end time 2e3, ε = 1e-3)"),
]
SIZE, LEFT, GAP, TOP = 300, 70, 70, 60


def mark(x, y, kind, colour):
    if kind == "square":
        return f'<rect x="{x - 3.5:.1f}" y="{y - 3.5:.1f}" width="7" height="7" fill="{colour}"/>'
    if kind == "diamond":
        return f'<path d="M{x:.1f} {y - 5:.1f}l5 5-5 5-5-5z" fill="{colour}"/>'
    if kind == "triangle":
        return f'<path d="M{x:.1f} {y - 5:.1f}l5 8.5h-10z" fill="{colour}"/>'
    fill, ring = (
        (colour, "") if kind == "circle" else ("#ffffff", f' stroke="{colour}" stroke-width="1.6"')
    )
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{fill}"{ring}/>'


def power(k):
    """10^k, its exponent raised."""
    return f'10<tspan dy="-4" font-size="9">{str(k).replace("-", "−")}</tspan>'


def numbers(row):
    """Of a run that came to its end: what was varied, and the seconds. None of one that was given
    up: that stands in the table."""
    try:
        return float(row["value"]), float(row["seconds"])
    except ValueError:
        return None


shown = [row for row in rows if numbers(row) and row["varied"] in dict(PANELS)]
seconds = [math.log10(numbers(row)[1]) for row in shown]
y0, y1 = math.floor(min(seconds)), math.ceil(max(seconds))
parts = []
for panel, (varied, title) in enumerate(PANELS):
    points = [
        (*map(math.log10, numbers(row)), row["method"]) for row in shown if row["varied"] == varied
    ]
    left = LEFT + panel * (SIZE + GAP)
    xs = sorted({x for x, _, _ in points})
    x0, x1 = xs[0] - 0.3, xs[-1] + 0.3

    def place(x, y):
        return left + (x - x0) / (x1 - x0) * SIZE, TOP + (y1 - y) / (y1 - y0) * SIZE

    for y in range(y0, y1 + 1):
        at = place(x0, y)[1]
        parts.append(f'<path d="M{left} {at:.1f}h{SIZE}" stroke="#dddddd"/>')
        parts.append(f'<text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{power(y)}</text>')
    # Every second power where they would stand too close.
    for x in range(math.ceil(x0), math.floor(x1) + 1, 2 if x1 - x0 > 6 else 1):
        at = place(x, y0)[0]
        parts.append(f'<path d="M{at:.1f} {TOP}v{SIZE}" stroke="#eeeeee"/>')
        parts.append(
            f'<text x="{at:.1f}" y="{TOP + SIZE + 18}" text-anchor="middle">{power(x)}</text>'
        )
    parts.append(
        f'<rect x="{left}" y="{TOP}" width="{SIZE}" height="{SIZE}" fill="none" stroke="#404040"/>'
    )
    parts.append(
        f'<text x="{left + SIZE / 2}" y="{TOP + SIZE + 42}" text-anchor="middle">{title}</text>'
    )
    for method, (colour, kind) in STYLES.items():
        line = [place(x, y) for x, y, m in sorted(points) if m == method]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in line)
        parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        )
        parts += [mark(x, y, kind, colour) for x, y in line]
middle = TOP + SIZE / 2
parts.append(
    f'<text transform="rotate(-90 18 {middle})" x="18" y="{middle}" text-anchor="middle">processor '
    'seconds of one run</text>'
)
for i, (method, (colour, kind)) in enumerate(STYLES.items()):
    parts.append(
        mark(LEFT + 100 * i + 6, 28, kind, colour)
        + f'<text x="{LEFT + 100 * i + 18}" y="32">{method}</text>'
    )
width, height = LEFT + 3 * (SIZE + GAP) - GAP + 20, TOP + SIZE + 60
head = (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        'font-family="sans-serif" font-size="12">')
# A page may be dark, and the words are black.
white = '<rect width="100%" height="100%" fill="#ffffff"/>'
(HERE / "cost.svg").write_text(head + white + "\n".join(parts) + "</svg>\n")
