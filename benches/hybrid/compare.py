"""Hybrid systems by `twofold run`, SciPy, CVODE and nosnoc beside each other (make bench-hybrid):
results.json, and the tables in README.md.

    python compare.py               TWOFOLD names the program [target/release/twofold]
    python compare.py --no-times    values and lines only; seconds are marked as not measured
    python compare.py --page        README.md anew from results.json
    python compare.py NAME METHOD   one cell, as JSON

Every cell of SciPy, CVODE and nosnoc is a process of its own, ended after LIMIT seconds.
"""

import contextlib
import csv
import datetime
import importlib.metadata
import inspect
import json
import os
import pathlib
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time

import systems

HERE = pathlib.Path(__file__).resolve().parent
TWOFOLD = pathlib.Path(os.environ.get("TWOFOLD") or HERE / "../../target/release/twofold")
RTOL, ATOL = 1e-10, 1e-12
# A value is right if its error is at most this, relative to the larger of 1 and the reference.
RIGHT = 1e-6
REPEATS, LIMIT = 5, 60
# A run longer than this is timed once.
LONG = 2.0
METHODS = {
    "twofold": "`twofold run`",
    "plain": "SciPy, right-hand side as it is",
    "scipy": "SciPy, events and modes by hand",
    "cvode": "CVODE, the same by its root finding",
    "nosnoc": "nosnoc (FESD)",
}
# Steps that nosnoc itself says it did not solve, of one run.
UNSOLVED = []


def solve(f, y, end):
    """SciPy's answer at the end from a right-hand side as it is."""
    from scipy.integrate import solve_ivp

    answer = solve_ivp(f, (0, end), y, rtol=RTOL, atol=ATOL)
    if not answer.success:
        raise RuntimeError(answer.message)
    return answer.y[:, -1].tolist()


def by_scipy(f, t, y, end, *events):
    """To the first event or the end, by SciPy."""
    from scipy.integrate import solve_ivp

    def function(g, direction):
        event = lambda t, y: g(t, y)
        event.terminal, event.direction = True, direction
        return event

    if t >= end:
        return t, list(y), None
    answer = solve_ivp(f, (t, end), y, rtol=RTOL, atol=ATOL, events=[function(*e) for e in events] or None)
    if not answer.success:
        raise RuntimeError(answer.message)
    hit = next((i for i, times in enumerate(answer.t_events or []) if len(times)), None) if answer.status == 1 else None
    return float(answer.t[-1]), answer.y[:, -1].tolist(), hit


def by_cvode(f, t, y, end, *events):
    """To the first event or the end, by CVODE's Adams formulas."""
    import numpy
    from sksundae.cvode import CVODE

    def rhs(t, y, out):
        out[:] = f(t, y)

    def roots(t, y, out):
        out[:] = [g(t, y) for g, _ in events]

    if t >= end:
        return t, list(y), None
    roots.terminal, roots.direction = [True] * len(events), [int(d) for _, d in events]
    watch = {"eventsfn": roots, "num_events": len(events)} if events else {}
    solver = CVODE(rhs, method="Adams", rtol=RTOL, atol=ATOL, max_num_steps=10**6, **watch)
    answer = solver.solve(numpy.array([t, end], float), numpy.array(y, float))
    if not answer.success:
        raise RuntimeError(answer.message)
    hit = next((i for i, sign in enumerate(answer.i_events[0]) if sign), None) if answer.status == 2 else None
    return float(answer.t[-1]), answer.y[-1].tolist(), hit


def by_nosnoc(x, x0, c, F, end, steps, stages=3, elements=2, signs=None, p=None, values=None, **inclusion):
    """States and times at the ends of the finite elements, by FESD with Radau IIA."""
    import nosnoc
    import numpy

    opts = nosnoc.NosnocOpts()
    opts.n_s, opts.N_finite_elements, opts.comp_tol, opts.sigma_N = stages, elements, 1e-9, 1e-9
    opts.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    opts.terminal_time = end / steps
    if F is None:
        opts.pss_mode = nosnoc.PssMode.STEP
    else:
        inclusion |= {"F": F, "S": signs or [numpy.array([[1], [-1]])] * len(c)}
    if p is not None:
        inclusion |= {"p_global": p, "p_global_val": values[0]}
    model = nosnoc.NosnocModel(x=x, x0=numpy.array(x0, float), c=c, **inclusion)
    looper = nosnoc.NosnocSimLooper(nosnoc.NosnocSolver(opts, model), model.x0, steps, p_values=values)
    looper.run()
    answer = looper.get_results()
    UNSOLVED[:] = [i for i, status in enumerate(answer["status"]) if status != nosnoc.Status.SUCCESS]
    return answer["X_sim"].tolist(), answer["t_grid"].tolist()


def timed(work):
    """A value and the median of its seconds."""
    seconds = []
    while not seconds or len(seconds) < REPEATS and seconds[0] < LONG:
        begin = time.perf_counter()
        value = work()
        seconds.append(time.perf_counter() - begin)
    return {"value": value, "seconds": statistics.median(seconds), "runs": len(seconds)}


def one(name, method):
    """A cell by SciPy, CVODE or nosnoc, in this process."""
    system = systems.SYSTEMS[name]
    # Imports are not timed.
    import scipy.integrate  # noqa: F401

    if method == "cvode":
        import sksundae.cvode  # noqa: F401
    if method == "nosnoc":
        import nosnoc  # noqa: F401
    work = {
        "plain": lambda: system.plain(solve),
        "scipy": lambda: system.by_hand(by_scipy),
        "cvode": lambda: system.by_hand(by_cvode),
        "nosnoc": lambda: system.nosnoc(by_nosnoc),
    }
    try:
        return timed(work[method]) | ({"unsolved": len(UNSOLVED)} if UNSOLVED else {})
    except Exception as error:  # what a user would see of it is the cell's answer
        return {"failed": f"{type(error).__name__}: {error}"}


def written(name, method):
    """What the user writes for SciPy, CVODE or nosnoc, or None."""
    by = {"plain": "plain", "nosnoc": "nosnoc"}.get(method, "by_hand")
    return getattr(systems.SYSTEMS[name], by, None)


def peer(name, method):
    """A cell by SciPy, CVODE or nosnoc, in a process of its own."""
    if written(name, method) is None:
        return {"none": getattr(systems.SYSTEMS[name], "why", "no resets, no modes")}
    try:
        done = subprocess.run(
            [sys.executable, __file__, name, method], capture_output=True, text=True, timeout=LIMIT
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"not done in {LIMIT} s"}
    if done.returncode != 0:
        return {"failed": (done.stderr.strip().splitlines() or ["no reason given"])[-1]}
    return json.loads(done.stdout.splitlines()[-1])


def ours(name):
    """A cell by `twofold run`: the whole process, its file of rows included."""
    system = systems.SYSTEMS[name]
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "run.csv"
        command = [
            TWOFOLD,
            "run",
            "--system",
            HERE / f"{name}.toml",
            "--t-end",
            str(system.t_end),
            "--out",
            out,
            "--quiet",
        ]
        last = []

        def run():
            last[:] = [subprocess.run(command, capture_output=True, text=True)]

        cell = timed(run)
        if last[0].returncode == 3:
            said = last[0].stderr.strip().replace(f"{folder}/", "")
            value = system.refused(said) if hasattr(system, "refused") else None
            return cell | ({"refused": said} if value is None else {"value": value})
        if last[0].returncode != 0:
            return {"failed": last[0].stderr.strip()}
        with open(out, newline="") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return cell | {"value": system.ours(rows)}


def lines(name, method):
    """Lines that the user writes, without blank ones, comments, names and titles."""
    if method == "twofold":
        text, skipped = (HERE / f"{name}.toml").read_text(), r"#|name =|title ="
        # The name of an event is one of its lines.
        text = re.sub(r"\[\[event\]\]\nname", "[[event]]\nevent name", text)
    else:
        function = written(name, method)
        if function is None:
            return None
        # The line `def plain(solve)` belongs to the comparison.
        text, skipped = inspect.getsource(function).split("\n", 1)[1], "#"
    return sum(
        1 for line in text.splitlines() if line.strip() and not re.match(skipped, line.strip())
    )


def wrapper(function):
    text = inspect.getsource(function)
    return sum(1 for line in text.splitlines() if line.strip() and '"""' not in line)


def judge(name, cell):
    """Error and verdict of a cell."""
    reference = systems.SYSTEMS[name].reference()
    if "refused" in cell:
        decided = reference is not None or "not decided" not in cell["refused"]
        return cell | {"verdict": "wrong" if decided else "right"}
    if "value" not in cell:
        return cell | {"verdict": "none" if "none" in cell else "wrong"}
    if reference is None:
        return cell | {"verdict": "wrong"}
    error = abs(cell["value"] - reference)
    return cell | {
        "error": error,
        "verdict": "right" if error <= RIGHT * max(1, abs(reference)) else "wrong",
    }


def answer_of(cell):
    """A cell's answer in the table."""
    if cell["verdict"] == "none":
        return f"— ({cell['none']})"
    if "failed" in cell:
        return f"**{cell['failed'].splitlines()[0][:60]}**"
    if "refused" in cell:
        return (
            "refused, with the reason"
            if cell["verdict"] == "right"
            else "**stops, with the reason**"
        )
    if "error" not in cell:
        return f"**does not say: {cell['value']:.2g}**"
    said = f"{cell['error']:.1e}" + (
        f" ({cell['unsolved']} steps not solved)" if "unsolved" in cell else ""
    )
    return said if cell["verdict"] == "right" else f"**wrong: {said}**"


def cost_of(cell):
    """Milliseconds and lines in the table."""
    if cell["verdict"] == "none":
        return "—"
    if "failed" in cell:
        spent = "—"
    elif cell.get("seconds") is None:
        spent = "not measured"
    else:
        spent = f"{1e3 * cell['seconds']:.3g}" + ("" if cell["runs"] == REPEATS else " (once)")
    return f"{spent} / {cell['lines']}"


def cpu():
    with contextlib.suppress(OSError):
        found = re.search(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.M)
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def version(module):
    try:
        return __import__(module).__version__
    except ImportError as error:
        return f"not installed ({error})"


def sundials():
    with contextlib.suppress(ImportError, AttributeError):
        import sksundae

        return sksundae.SUNDIALS_VERSION
    return "unknown"


def table(results, columns, cell_of, first=lambda name: f"`{name}`"):
    head = "| system | " + " | ".join(columns.values()) + " |"
    body = [
        f"| {first(name)} | " + " | ".join(cell_of(cells, m) for m in columns) + " |"
        for name, cells in results.items()
    ]
    return [head, "|---" * (len(columns) + 1) + "|", *body]


def page(record):
    """The part of README.md that is made."""
    results = record["systems"]
    made = record["made"]
    asked = {name: cells["asked"] for name, cells in results.items()}
    stated = {m: sum(r[m]["verdict"] != "none" for r in results.values()) for m in METHODS}
    counts = ["| right | " + " | ".join(
        f"{sum(r[m]['verdict'] == 'right' for r in results.values())} of {len(results)}"
        + (f" ({stated[m]} stated)" if stated[m] < len(results) else "") for m in METHODS) + " |"]
    total = [
        "| lines in all | "
        + " | ".join(str(sum(r[m]["lines"] or 0 for r in results.values())) for m in METHODS)
        + " |"
    ]
    both = [
        n
        for n, r in results.items()
        if all(r[m].get("seconds") and r[m]["verdict"] == "right" for m in ("twofold", "scipy"))
    ]
    slower = [n for n in both if results[n]["twofold"]["seconds"] > results[n]["scipy"]["seconds"]]
    equal = [
        n for n, r in results.items() if r["scipy"]["verdict"] == r["twofold"]["verdict"] == "right"
    ]
    closer = [
        n
        for n in equal
        if results[n]["scipy"].get("error", 0) < results[n]["twofold"].get("error", 0)
    ]
    names = lambda some: ", ".join(f"`{n}`" for n in some) or "none"
    if record["times"]:
        speed = (f"Of the {len(both)} that both do, `twofold` is slower than SciPy by hand in "
                 f"{len(slower)}: {names(slower)}.")
    else:
        speed = "Seconds are not measured in this run: `make bench-hybrid` fills them in."
    return "\n".join(
        [
            f"{made['date']}, {made['machine']}; {made['twofold']}, SciPy {made['scipy']}, "
            f"SUNDIALS {made['sundials']} (scikit-sundae",
            f"{made['scikit-sundae']}), nosnoc {made['nosnoc']} (CasADi {made['casadi']}), NumPy "
            f"{made['numpy']}, Python {made['python']};",
            f"`{made['command']}`.",
            "",
            "Error of each program; what is not right is bold.",
            "",
            *table(
                results,
                METHODS,
                lambda cells, m: answer_of(cells[m]),
                lambda n: f"`{n}`: {asked[n]}".replace("|", "\\|"),
            ),
            *counts,
            "",
            "`twofold run` is not right in "
            f"{len(results) - sum(r['twofold']['verdict'] == 'right' for r in results.values())}:",
            f"{names([n for n, r in results.items() if r['twofold']['verdict'] != 'right'])}.",
            f"SciPy by hand is as right as `twofold` in {len(equal)} systems:",
            f"{names(equal)}.",
            f"Of these it has the smaller error in {len(closer)}: {names(closer)}.",
            "",
            "Milliseconds / lines that the user writes; of SciPy and CVODE by hand without the "
            "wrapper of one integration,",
            f"`by_scipy` ({wrapper(by_scipy)} lines) or `by_cvode` ({wrapper(by_cvode)}), and of "
            "nosnoc without its options and loop,",
            f"`by_nosnoc` ({wrapper(by_nosnoc)}).",
            "",
            *table(results, METHODS, lambda cells, m: cost_of(cells[m])),
            *total,
            "",
            speed,
        ]
    )


def main(times):
    results = {}
    for name, system in systems.SYSTEMS.items():
        cells = {m: judge(name, ours(name) if m == "twofold" else peer(name, m)) for m in METHODS}
        for m, cell in cells.items():
            cell["lines"] = lines(name, m)
            if not times:
                cell["seconds"] = None
        results[name] = {
            "asked": system.asked,
            "reference": system.reference(),
            "t_end": system.t_end,
        } | cells
        print(
            name,
            *(
                answer_of(c) + (f" [{1e3 * c['seconds']:.3g} ms]" if c.get("seconds") else "")
                for c in cells.values()
            ),
            sep=" | ",
            flush=True,
        )
    said = subprocess.run(
        [TWOFOLD, "--version"], capture_output=True, text=True, check=True
    ).stdout.split("\n")[0]
    made = {
        "date": datetime.date.today().isoformat(),
        "machine": f"{cpu()}, {os.cpu_count()} processors, {platform.system()}",
        "command": "make bench-hybrid" if times else "python compare.py --no-times",
        "twofold": said,
        "scipy": version("scipy"),
        "scikit-sundae": version("sksundae"),
        "sundials": sundials(),
        "nosnoc": importlib.metadata.version("nosnoc"),
        "casadi": version("casadi"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
    }
    record = {
        "made": made,
        "times": times,
        "rtol": RTOL,
        "atol": ATOL,
        "right": RIGHT,
        "systems": results,
    }
    (HERE / "results.json").write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    write(record)


def write(record):
    """The made part of README.md."""
    readme = HERE / "README.md"
    text = readme.read_text()
    begin, rest = text.split("do not edit -->\n", 1)
    end = rest[rest.index("<!-- end of what is made"):]
    readme.write_text(f"{begin}do not edit -->\n\n{page(record)}\n\n{end}")


if __name__ == "__main__":
    if sys.argv[1:] in ([], ["--no-times"]):
        main(times=not sys.argv[1:])
    elif sys.argv[1:] == ["--page"]:
        write(json.loads((HERE / "results.json").read_text()))
    else:
        print(json.dumps(one(*sys.argv[1:3])))
