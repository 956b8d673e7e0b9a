"""Runs the programs of this folder over a ladder of tolerances and writes results.csv, results.md
and results.svg (make bench-work-precision).

    python run.py BUILD [PROBLEM ...]
    python run.py tables

BUILD holds the programs (run.sh makes them). With problems named only those are measured anew.
`tables` makes results.md and the picture anew of results.csv.
"""

import collections
import csv
import datetime
import math
import os
import pathlib
import platform
import subprocess
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).parent
LADDER = [f"1e-{k}" for k in range(4, 14)]
DECADES = range(4, 13)
TARGET = 0.4
PROBLEMS = {
    "w1-a": "W1, set A, to t = 54",
    "w1-b": "W1, set B, to t = 13",
    "periodic": "closed orbit, five periods",
    "sliding": "sliding (Filippov)",
    "hysteresis": "relay with memory",
    "delay": "relay with delay",
}
HEAD = ["problem", "program", "tolerance", "error", "seconds", "steps"]
# An error above this is a run that went elsewhere.
ELSEWHERE = 1.0
# See draw.
DRAWN = 10.0


def references():
    with open(HERE / "reference.csv", newline="") as file:
        return {row["problem"]: [float(row[c]) for c in "xyz"] for row in csv.DictReader(file)}


def text(done):
    """What a program printed, to its end or until it was stopped."""
    said = getattr(done, "stdout", None) or ""
    return said if isinstance(said, str) else said.decode()


def measure(build, problem, exact):
    """Rows of every program, one program after the other, on one core."""
    python = [build / "python/bin/python", HERE / "python_peers.py"]
    pin = ["taskset", "-c", "1"] if os.cpu_count() > 1 and platform.system() == "Linux" else []
    rows = []
    for command in ([build / "ours"], [build / "peers"], [build / "crates-work-precision"], python):
        print(problem, command[-1].name, file=sys.stderr)
        for tolerance in LADDER:
            call = [*pin, *map(str, command), problem, tolerance]
            try:
                done = subprocess.run(call, stdout=subprocess.PIPE, text=True, timeout=120)
            except (OSError, subprocess.TimeoutExpired) as error:
                print(f"{problem}, {command[-1].name}, {tolerance}: {error}", file=sys.stderr)
                done = error
            for row in csv.reader(text(done).splitlines()):
                _, program, tol, seconds, steps, *state = row
                error = max(abs(float(s) - r) / (1 + abs(r)) for s, r in zip(state, exact))
                row = [problem, program, f"{float(tol):.0e}", f"{error:.2e}", seconds, steps]
                rows.append(row)
    return rows


def curves(rows):
    """For each problem and program its points (error, seconds), the loosest tolerance first."""
    found = collections.defaultdict(lambda: collections.defaultdict(list))
    for problem, program, tolerance, error, seconds, _ in rows:
        point = (float(tolerance), max(float(error), 1e-17), float(seconds))
        found[problem][program].append(point)
    return {
        problem: {
            name: [p[1:] for p in sorted(points, reverse=True)] for name, points in of.items()
        }
        for problem, of in found.items()
    }


def time_to_reach(points, error):
    """Seconds to an error that no tighter tolerance exceeds, log-log between two tolerances."""
    if not points or points[-1][0] > error:
        return None
    k = len(points) - 1
    while k > 0 and points[k - 1][0] <= error:
        k -= 1
    if k == 0:
        return points[0][1]
    (e0, s0), (e1, s1) = points[k - 1], points[k]
    part = math.log(error / e0) / math.log(e1 / e0)
    return math.exp(math.log(s0) + part * math.log(s1 / s0))


def best(of, error, ours, files=False):
    """The program that reaches an error soonest; of ours all, or those whose equation is a file."""
    times = [
        (seconds, name)
        for name, points in of.items()
        if name.startswith("ours") == ours
        and (not files or name.endswith("(file)") or name.startswith("ours, general"))
        and (seconds := time_to_reach(points, error)) is not None
    ]
    return min(times, default=None)


def fastest(of, error):
    """Seconds of the program that reaches an error soonest."""
    return min(found[0] for ours in (True, False) if (found := best(of, error, ours)))


def micro(seconds):
    return f"{seconds * 1e6:.3g}"


def machine():
    model = next(
        (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if "model name" in line), "?"
    )
    first = lambda *command: subprocess.run(
        command, capture_output=True, text=True
    ).stdout.splitlines()[0]
    commit = first("git", "-C", str(HERE), "rev-parse", "--short", "HEAD")
    load = f"{os.getloadavg()[2]:.1f}"
    return (
        f"`make bench-work-precision`, {datetime.date.today()}, on commit {commit}; {model}, "
        f"{os.cpu_count()} cores, one used, load {load} at the end; {first('g++', '--version')}, "
        f"-O3 -march=native; {first('rustc', '--version')}, release"
    )


def summary(found, files):
    """A table of our best time to the best peer's."""
    text = [
        "| problem | " + " | ".join(f"1e-{k}" for k in DECADES) + " | met |",
        "|---|" + "---|" * (len(DECADES) + 1),
    ]
    for problem, title in PROBLEMS.items():
        of, cells, met, asked = found.get(problem, {}), [], 0, 0
        for k in DECADES:
            us, peer = best(of, 10.0**-k, True, files), best(of, 10.0**-k, False)
            if us and peer:
                ratio = us[0] / peer[0]
                met, asked = met + (ratio <= TARGET), asked + 1
                cells.append(f"{ratio:.2f}")
            else:
                met, asked = met + bool(us), asked + bool(us)
                cells.append("only ours" if us else "only a peer" if peer else "-")
        text.append(f"| {title} | " + " | ".join(cells) + f" | {met} of {asked} |")
    return text


def tables(rows, head):
    found = curves(rows)
    text = [
        head,
        "",
        "Microseconds of processor time of one run, the least of three means over at least 0.05 s; "
        "errors and interpolation as in README.md. `-`: no program reaches that error.",
        "",
        "Our best time to the best peer's, by error (aim: at most 0.4):",
        "",
        *summary(found, files=False),
        "",
        "The same by methods of ours whose equation is a file:",
        "",
        *summary(found, files=True),
    ]
    for problem, title in PROBLEMS.items():
        of = found.get(problem, {})
        text += ["", f"## {title}", ""]
        text += ["| error | ours | µs | best peer | µs | ratio | 0.4 |", "|" + "---|" * 7]
        for k in DECADES:
            us, peer = best(of, 10.0**-k, True), best(of, 10.0**-k, False)
            cells = [f"1e-{k}"]
            cells += [us[1].removeprefix("ours, "), micro(us[0])] if us else ["-", ""]
            cells += [peer[1], micro(peer[0])] if peer else ["-", ""]
            if us and peer:
                ratio = us[0] / peer[0]
                cells += [f"{ratio:.2f}", "met" if ratio <= TARGET else "missed"]
            else:
                cells += ["", "only ours" if us else ""]
            text.append("| " + " | ".join(cells) + " |")
    (HERE / "results.md").write_text("\n".join(text) + "\n")
    print("\n".join(text))
    draw(found)


def draw(found):
    """Error against time, a panel a problem: ours solid and warm, peers dotted and cold.

    In a panel only programs that come within `DRAWN` times the fastest at one of its errors, and
    our fastest ones.
    """
    plt.rcParams |= {
        "svg.fonttype": "none",
        "svg.hashsalt": "work-precision",
        "font.size": 8,
        "font.family": "sans-serif",
    }
    figure, axes = plt.subplots(2, 3, figsize=(13, 9.6))
    names = {name for of in found.values() for name in of}
    warm = ["#b2182b", "#ef8a62", "#762a83", "#e7298a", "#d95f02", "#7f3b08", "#c51b7d"]
    cold = ["#2166ac", "#1b9e77", "#4d4d4d", "#35978f", "#5aae61", "#8c96c6", "#999999"]
    marks = "osD^v<>PX*hp"
    looks = {}
    for ours in (True, False):
        colours = warm if ours else cold
        for i, name in enumerate(sorted(n for n in names if n.startswith("ours") == ours)):
            looks[name] = {
                "color": colours[i % len(colours)],
                "marker": marks[i % len(marks)],
                "linestyle": "-" if ours else ":",
                "markersize": 4,
                "linewidth": 1.4 if ours else 1,
            }
    drawn = {}
    for axis, (problem, title) in zip(axes.flat, PROBLEMS.items()):
        of = found.get(problem, {})
        best_of_ours = {won[1] for k in DECADES if (won := best(of, 10.0**-k, True))}
        for name, points in sorted(of.items()):
            # The compiled equation and the file's would cover each other.
            if name.endswith(" (file)") and name.removesuffix(" (file)") in of:
                continue
            shown = [(e, s) for e, s in points if e < ELSEWHERE]
            is_best = {name, f"{name} (file)"} & best_of_ours
            if not is_best and not any(s <= DRAWN * fastest(of, e) for e, s in shown):
                continue
            (line,) = axis.plot(*zip(*shown), **looks[name]) if shown else (None,)
            drawn |= {name: line} if shown else {}
        axis.set(xscale="log", yscale="log", title=title, xlim=(1e-1, 1e-15))
        axis.grid(alpha=0.3)
    for axis in axes[1]:
        axis.set_xlabel("error at the end")
    for axis in axes[:, 0]:
        axis.set_ylabel("processor seconds of a run")
    order = sorted(drawn, key=lambda name: (not name.startswith("ours"), name))
    figure.legend([drawn[n] for n in order], order, ncol=5, loc="lower center", frameon=False)
    figure.tight_layout(rect=(0, 0.13, 1, 1))
    figure.savefig(HERE / "results.svg", metadata={"Date": None, "Creator": None})


def main():
    path = HERE / "results.csv"
    if sys.argv[1] == "tables":
        with open(path, newline="") as file:
            rows = list(csv.reader(file))[1:]
        head = (HERE / "results.md").read_text().splitlines()[0]
        return tables(rows, head)
    build, exact = pathlib.Path(sys.argv[1]).resolve(), references()
    wanted = sys.argv[2:] or list(PROBLEMS)
    rows = []
    if path.exists() and len(wanted) < len(PROBLEMS):
        with open(path, newline="") as file:
            rows = [row for row in list(csv.reader(file))[1:] if row[0] not in wanted]
    for problem in wanted:
        rows += measure(build, problem, exact[problem])
    rows.sort(key=lambda row: list(PROBLEMS).index(row[0]))
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])
    tables(rows, machine())


main()
