"""Writes cost.md and cost.svg from cost.csv (make bench-cost)."""

import csv
import datetime
import math
import os
import pathlib

HERE = pathlib.Path(__file__).parent
rows = list(csv.DictReader(open(HERE / "cost.csv")))
model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
text = [f"{datetime.date.today()}, {model}, {os.cpu_count()} cores.", ""]
text += ["| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
text += ["| " + " | ".join(value or "" for value in row.values()) + " |" for row in rows]
(HERE / "cost.md").write_text("\n".join(text) + "\n")

COLOURS = {"dopri5": "#b03060", "lsoda": "#305090", "radau5": "#508030"}
parts, size, gap = [], 260, 60
for panel, varied in enumerate(["t_end", "eps", "tolerance"]):
    points = []
    for row in rows:
        try:
            if row["varied"] == varied:
                points.append((math.log10(float(row["value"])), math.log10(float(row["seconds"])), row["method"]))
        except ValueError:
            pass  # given up: in the table, not in the picture
    left, top = gap + panel * (size + gap), 30
    xs = [p[0] for p in points]
    ys = [p[1] for p in points]
    x0, x1, y0, y1 = min(xs), max(xs), math.floor(min(ys)), math.ceil(max(ys))
    place = lambda x, y: (left + (x - x0) / (x1 - x0) * size, top + (y1 - y) / (y1 - y0) * size)
    parts.append(f'<rect x="{left}" y="{top}" width="{size}" height="{size}" fill="none" stroke="#888"/>')
    parts.append(f'<text x="{left + size / 2}" y="{top + size + 38}" text-anchor="middle">{varied}</text>')
    for y in range(y0, y1 + 1):
        parts.append(f'<text x="{left - 5}" y="{place(x0, y)[1] + 4:.1f}" text-anchor="end">1e{y}</text>')
    for x in sorted(set(xs)):
        parts.append(f'<text x="{place(x, y0)[0]:.1f}" y="{top + size + 18}" text-anchor="middle">1e{x:.0f}</text>')
    for method, colour in COLOURS.items():
        line = [place(x, y) for x, y, m in sorted(points) if m == method]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in line)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in line]
for i, (method, colour) in enumerate(COLOURS.items()):
    parts.append(f'<text x="{gap + 90 * i}" y="18" fill="{colour}">{method}</text>')
parts.append(f'<text x="{gap + 290}" y="18">seconds of one run</text>')
width, height = 3 * (size + gap) + gap, size + 80
head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="11">'
(HERE / "cost.svg").write_text(head + "\n".join(parts) + "</svg>\n")
