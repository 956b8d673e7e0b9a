"""Runs the peers and our methods beside each other (make bench-peers): one table with ratios, and
its picture.

    python run.py BUILD [ROUNDS]
    python run.py draw

BUILD holds the programs (run.sh makes them). Every program is run in each round, one after the
other, and of each the least processor time is taken: other work on the machine then costs little. A
program that is not there is said to be not run. Writes results.csv, results.md, results.svg beside
this file. `draw` makes the picture anew of the table.
"""

import csv
import os
import pathlib
import platform
import resource
import subprocess
import sys
import datetime

HERE = pathlib.Path(__file__).parent
BUILD = pathlib.Path(sys.argv[1])
ROUNDS = int(sys.argv[2]) if len(sys.argv) > 2 else 3
PYTHON = BUILD / "python/bin/python"
OURS = BUILD / "units"

# The commands that are timed: name, command, units of work, the row that it is compared with, and
# the limit of the ratio.
W1 = ["W1 A", "W1 B"]
W3 = ["W3 A", "W3 B"]
CRATES = BUILD / "crates-units"
PEERS = [
    ("Boost.odeint dopri5", [BUILD / "boost_dopri5"], W1 + ["W2 B"]),
    ("CVODE Adams", [BUILD / "cvode_adams"], W1),
    ("SciPy LSODA, compiled field, no crossings", [PYTHON, HERE / "scipy_lsoda.py"], W1),
    # Its Radau IIA replaces the tolerance by 0.1 tol^(2/3); so does our row "radau5-replaced".
    ("differential-equations Radau5", [CRATES, "radau5"], W1),
    ("differential-equations dopri5", [CRATES, "dopri5"], W1),
    # Its steps do not see the layer (heyoka_taylor.py): the second row has as many events as make
    # its error what was asked for.
    ("heyoka Taylor, layer's edge as event", [PYTHON, HERE / "heyoka_taylor.py"], W1),
    (
        "heyoka Taylor, layer resolved by events",
        [PYTHON, HERE / "heyoka_taylor.py", "resolved"],
        W1,
    ),
    ("__float128 Taylor", [BUILD / "quad_taylor"], W3),
]
METHODS = {
    "dopri5": (W1 + ["W2 B"], "Boost.odeint dopri5", 0.8),
    "layered": (W1 + ["W2 B"], "Boost.odeint dopri5", 0.4),
    # A system from a file: beside the compiled one.
    "dopri5-file": (W1, "ours, dopri5", 3.0),
    "dopri5-lanes-file": (["W2 B"], "ours, dopri5-lanes-avx512", 1.3),
    # The same runs as if each had parameters of its own.
    "dopri5-lanes-parameters": (["W2 B"], "Boost.odeint dopri5", 1 / 12),
    "dopri5-lanes-portable": (["W2 B"], "Boost.odeint dopri5", None),
    "dopri5-lanes-avx2": (["W2 B"], "Boost.odeint dopri5", 1 / 12),
    "dopri5-lanes-avx512": (["W2 B"], "Boost.odeint dopri5", 1 / 12),
    "lsoda": (W1, "CVODE Adams", 1 / 7),
    "radau5": (W1, None, None),
    "radau5-replaced": (W1, "differential-equations Radau5", 1 / 1.5),
    # With an error at the end of W0 below the crate's in both sets.
    "radau5-matched": (W1, "differential-equations Radau5", 1 / 1.5),
    "taylor": (W1, "heyoka Taylor, layer resolved by events", 1 / 1.2),
    # The same system from its file, whose series are not compiled.
    "taylor-file": (W1, "heyoka Taylor, layer resolved by events", 1 / 1.2),
    "taylor-extended": (W3, "__float128 Taylor", 1 / 10),
}


def run(command):
    """What the program printed, and its processor time."""
    # Not os.times, which counts in hundredths.
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        return None, str(error)
    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    if done.returncode != 0:
        return None, (done.stderr.strip().splitlines() or ["no reason given"])[-1]
    return done.stdout.split(), after - before


def arguments(command, unit):
    """A peer's command for a unit of work."""
    if command[0] == PYTHON:
        return [*command, *unit.split(), "1"]
    return [command[0], *unit.split(), *command[1:], "1"]


def error(command):
    """Of the state at the end of W0, or why there is none."""
    words, why = run([str(c) for c in command])
    if words is None:
        return "not run: " + why
    exact, why = run([str(OURS), *words[1:3], "taylor-extended", "1"])
    if exact is None:
        return "not known: " + why
    largest = max(abs(float(a) - float(b)) for a, b in zip(words[-3:], exact[-3:]))
    return f"{largest:.1e}, {words[4]} steps"


def main():
    jobs = [
        (name, arguments(command, unit), unit, False)
        for name, command, units in PEERS
        for unit in units
    ]
    errors = {}
    for name, command, units in PEERS:
        errors |= {
            (name, unit): error(arguments(command, unit.replace("W1", "W0")))
            for unit in units
            if unit in W1
        }
    for method, (units, _, _) in METHODS.items():
        if not method.endswith("-file"):
            errors |= {
                (f"ours, {method}", unit): error(
                    [OURS, *unit.replace("W1", "W0").split(), method, "1"]
                )
                for unit in units
                if unit in W1
            }
        jobs += [
            (f"ours, {method}", [OURS, *unit.split(), method, "1"], unit, True) for unit in units
        ]
    best, missing = {}, {}
    for _ in range(ROUNDS):
        for name, command, unit, ours in jobs:
            words, seconds = run([str(c) for c in command])
            if words is None:
                missing[name, unit] = seconds
                continue
            # Ours whole, from start to exit, and the crates' program, whose own clock counts
            # hundredths; the others by their own clock, without compilation at run time.
            seconds = seconds if ours or command[0] == CRATES else float(words[3])
            if (name, unit) not in best or seconds < best[name, unit][0]:
                best[name, unit] = (seconds, int(words[4]), int(words[5]))
    rows = []
    for name, _, unit, ours in jobs:
        if (name, unit) not in best:
            rows.append(
                [
                    unit,
                    name,
                    "",
                    "",
                    "",
                    "",
                    "",
                    "",
                    "not run: " + missing.get((name, unit), ""),
                    "",
                ]
            )
            continue
        seconds, steps, crossings = best[name, unit]
        boost = best.get(("Boost.odeint dopri5", unit))
        against, target = METHODS[name.removeprefix("ours, ")][1:] if ours else (None, None)
        other = best.get((against, unit))
        ratio = seconds / other[0] if other else None
        verdict = (
            "" if ratio is None or target is None else ("met" if ratio <= target else "missed")
        )
        to_boost = f"{seconds / boost[0]:.2f}" if boost else ""
        rows.append(
            [
                unit,
                name,
                f"{seconds:.3f}",
                to_boost,
                against or "",
                f"{ratio:.3f}" if ratio else "",
                f"{target:.3f}" if target else "",
                verdict,
                f"{steps} steps, {crossings} crossings",
                errors.get((name, unit), ""),
            ]
        )
    rows.sort(key=lambda row: ["W1 A", "W1 B", "W2 B", *W3].index(row[0]))
    head = [
        "unit",
        "program",
        "seconds",
        "to Boost",
        "against",
        "ratio",
        "target",
        "verdict",
        "work",
        "error at t = 10 (W0)",
    ]
    with open(HERE / "results.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])
    model = next(
        (
            line.split(":")[1].strip()
            for line in open("/proc/cpuinfo")
            if line.startswith("model name")
        ),
        "?",
    )
    compiler = subprocess.run(
        ["g++", "--version"], capture_output=True, text=True
    ).stdout.splitlines()[0]
    rust = subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout.strip()
    text = [
        f"{datetime.date.today()}, {model}, {os.cpu_count()} cores, {platform.system()} "
        f"{platform.machine()}; {compiler}; {rust}. "
        f"Least processor seconds of {ROUNDS} rounds, every program in each.",
        "",
    ]
    text += ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    text += ["| " + " | ".join(row) + " |" for row in rows]
    (HERE / "results.md").write_text("\n".join(text) + "\n")
    print("\n".join(text))
    draw(rows)


# A page may be dark, and the words are black.
WHITE = '<rect width="100%" height="100%" fill="#ffffff"/>'


def draw(rows):
    """Seconds, by unit of work, as dots on one logarithmic scale with its decades."""
    import math

    rows = [row for row in rows if row[2]]
    seconds = [float(row[2]) for row in rows]
    width, left, line, top = 900, 330, 18, 28
    low, high = math.floor(math.log10(min(seconds))), math.ceil(math.log10(max(seconds)))
    at = lambda s: left + (math.log10(s) - low) / (high - low) * (width - left - 30)
    parts, y, unit = [], top - 18, None
    for row in rows:
        if row[0] != unit:
            unit, y = row[0], y + 24
            parts.append(f'<text x="8" y="{y}" font-weight="bold">{unit}</text>')
        y += line
        x = at(float(row[2]))
        colour = "#b03060" if row[1].startswith("ours") else "#607080"
        parts.append(f'<text x="{left - 10}" y="{y}" text-anchor="end">{row[1]}</text>')
        parts.append(
            f'<line x1="{left}" y1="{y - 4}" x2="{x:.1f}" y2="{y - 4}" stroke="{colour}" '
            'stroke-opacity="0.35"/>'
        )
        parts.append(f'<circle cx="{x:.1f}" cy="{y - 4}" r="4.5" fill="{colour}"/>')
        # To the left of its dot where the right is too narrow.
        side = (x - 9, "end") if x > width - 90 else (x + 9, "start")
        parts.append(f'<text x="{side[0]:.1f}" y="{y}" text-anchor="{side[1]}">{row[2]} s</text>')
    decades = []
    for k in range(low, high + 1):
        x = at(10.0 ** k)
        decades.append(
            f'<line x1="{x:.1f}" y1="{top - 8}" x2="{x:.1f}" y2="{y + 6}" stroke="#d8d8d8"/>'
        )
        decades.append(
            f'<text x="{x:.1f}" y="{top - 12}" text-anchor="middle" fill="#606060">{10.0**k:g} '
            's</text>'
        )
    decades.append(
        f'<text x="8" y="{top - 12}" fill="#606060">processor seconds; ours in red</text>'
    )
    style = 'font-family="sans-serif" font-size="12"'
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{y + 20}" {style}>'
        + WHITE
        + "\n".join(decades + parts)
        + "</svg>\n"
    )
    (HERE / "results.svg").write_text(svg)


if sys.argv[1] == "draw":
    with open(HERE / "results.csv", newline="") as file:
        draw(list(csv.reader(file))[1:])
else:
    main()
