#!/usr/bin/env python3
"""Makes papers/jeffrey-2013/code/workprecision/odepack:
ODEPACK's LSODA, as SciPy carries it, on the test problems.

Frozen: run by hand, committed with the versions used, never run by the tests.

    pip install scipy==1.14.1 && python3 scripts/odepack_reference.py

SciPy 1.14 is among the last that compile ODEPACK's own Fortran (SciPy 1.17's translation to C gives
the same counts in 60 of the 62 runs, and in all those that rounding does not decide). Every run is
made with analytic Jacobians and one step at a time (solve_ivp's LSODA class: ITASK = 5, the end of
the run is a wall), so that steps, evaluations, orders and switches are ODEPACK's own counters
(IWORK, RWORK), not a wrapper's.

The reference solutions are Radau's at its tightest; the distance from LSODA's at its tightest is
recorded as the uncertainty.

Step control magnifies rounding: the same code started 1e-12 away makes other decisions sooner or
later. So each run is also made from four starts with the first component shifted by that much
("shifted"). Where these agree with each other on every count, a faithful implementation must agree
too; elsewhere their spread is the yardstick.
"""

import csv
import json
import pathlib
import platform

import numpy as np
import scipy
from scipy.integrate import LSODA, solve_ivp

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parent / "papers/jeffrey-2013/code/workprecision/odepack"


def robertson(x):
    a, b, c = x
    return [-0.04 * a + 1e4 * b * c, 0.04 * a - 1e4 * b * c - 3e7 * b * b, 3e7 * b * b]


def robertson_jac(x):
    a, b, c = x
    return [[-0.04, 1e4 * c, 1e4 * b], [0.04, -1e4 * c - 6e7 * b, -1e4 * b], [0.0, 6e7 * b, 0.0]]


def van_der_pol(mu):
    return (
        lambda x: [x[1], mu * (1 - x[0] * x[0]) * x[1] - x[0]],
        lambda x: [[0.0, 1.0], [-2 * mu * x[0] * x[1] - 1, mu * (1 - x[0] * x[0])]],
    )


def oregonator(x):
    a, b, c = x
    return [77.27 * (b + a * (1 - 8.375e-6 * a - b)), (c - (1 + a) * b) / 77.27, 0.161 * (a - c)]


def oregonator_jac(x):
    a, b, c = x
    return [
        [77.27 * (1 - 2 * 8.375e-6 * a - b), 77.27 * (1 - a), 0.0],
        [-b / 77.27, -(1 + a) / 77.27, 1 / 77.27],
        [0.161, 0.0, -0.161],
    ]


def hires(y):
    r = 280.0 * y[5] * y[7]
    return [
        -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
        1.71 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
        8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
        -r + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
        r - 1.81 * y[6],
        -r + 1.81 * y[6],
    ]


def hires_jac(y):
    j = np.zeros((8, 8))
    j[0, :3] = [-1.71, 0.43, 8.32]
    j[1, :2] = [1.71, -8.75]
    j[2, 2:5] = [-10.03, 0.43, 0.035]
    j[3, 1:4] = [8.32, 1.71, -1.12]
    j[4, 4:7] = [-1.745, 0.43, 0.43]
    u, v = 280.0 * y[7], 280.0 * y[5]
    j[5, 3:8] = [0.69, 1.71, -0.43 - u, 0.69, -v]
    j[6, 5:8] = [u, -1.81, v]
    j[7, 5:8] = [-u, 1.81, -v]
    return j


def lorenz(x):
    return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]


def lorenz_jac(x):
    return [[-10, 10, 0], [28 - x[2], -1, -x[0]], [x[1], x[0], -8 / 3]]


V_PLUS, V_MINUS, EPS, BETA = -1.2, -1.4, 1e-3, 1e-5


def caricature(x, phi, alpha):
    """The caricature (eq. 5) blended by phi (eq. 8); also d/dx at fixed phi and d/dphi."""
    r2 = x[0] ** 2 + x[1] ** 2 + x[2] ** 2
    dy, dz = (alpha - BETA * x[1]) * r2, (alpha - BETA * x[2]) * r2
    plus = np.array([-x[1], 1 + dy, V_PLUS + dz])
    minus = np.array([x[2], V_MINUS + dy, 1 + dz])
    f = minus + (plus - minus) * phi
    j = np.zeros((3, 3))
    j[0] = [0, -phi, 1 - phi]
    for row, value in ((1, x[1]), (2, x[2])):
        j[row] = 2 * (alpha - BETA * value) * np.asarray(x[:3])
        j[row, row] -= BETA * r2
    return f, j, plus - minus


def smoothed(alpha):
    def f(x):
        return caricature(x, (1 + np.tanh(x[0] / EPS)) / 2, alpha)[0]

    def jac(x):
        t = np.tanh(x[0] / EPS)
        _, j, jump = caricature(x, (1 + t) / 2, alpha)
        j[:, 0] += jump * (1 - t * t) / (2 * EPS)
        return j

    return f, jac


def hysteretic(alpha):
    prime = 10 * EPS
    width = prime * prime

    def argument(x):
        return (x[0] + (2 * x[3] - 1) * EPS) / width

    def f(x):
        return np.append(
            caricature(x, x[3], alpha)[0], ((1 + np.tanh(argument(x))) / 2 - x[3]) / prime
        )

    def jac(x):
        t = np.tanh(argument(x))
        _, j3, jump = caricature(x, x[3], alpha)
        j = np.zeros((4, 4))
        j[:3, :3] = j3
        j[:3, 3] = jump
        slope = (1 - t * t) / (2 * width)
        j[3, 0] = slope / prime
        j[3, 3] = (slope * 2 * EPS - 1) / prime
        return j

    return f, jac


HIRES_0 = [1, 0, 0, 0, 0, 0, 0, 0.0057]
# Tolerances of the test problems, and those about NDSolve's default of the paper's system.
DECADES = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10]
ABOUT_DEFAULT = [1e-6, 1e-7, 10**-7.97727, 1e-9, 1e-10]
START = [0.2, 0, -1]
# name, (f, jacobian), start, end, step cap, tolerances, atol over rtol
PROBLEMS = [
    ("robertson", (robertson, robertson_jac), [1, 0, 0], 4e5, np.inf, DECADES, 1e-4),
    ("van-der-pol-1", van_der_pol(1), [2, 0], 20, np.inf, DECADES, 1),
    ("van-der-pol-1000", van_der_pol(1000), [2, 0], 2000, np.inf, DECADES, 1),
    ("oregonator", (oregonator, oregonator_jac), [1, 2, 3], 360, np.inf, DECADES, 1),
    ("hires", (hires, hires_jac), HIRES_0, 321.8122, np.inf, DECADES, 1e-2),
    ("lorenz", (lorenz, lorenz_jac), [1, 1, 1], 10, np.inf, DECADES, 1),
    ("smoothed-printed", smoothed(1e-3), START, 10, 0.25, ABOUT_DEFAULT, 1),
    ("smoothed-reconstructed", smoothed(1e-1), START, 10, 0.25, ABOUT_DEFAULT, 1),
    ("hysteretic-printed", hysteretic(1e-3), [*START, 1], 10, 0.25, ABOUT_DEFAULT, 1),
    ("hysteretic-reconstructed", hysteretic(1e-1), [*START, 1], 10, 0.25, ABOUT_DEFAULT, 1),
]


SHIFTS = [1e-12, -1e-12, 2e-12, -2e-12]


def lsoda(f, jac, x0, t_end, cap, rtol, atol):
    evaluations = [0]

    def counted(t, x):
        evaluations[0] += 1
        return np.asarray(f(x), dtype=float)

    solver = LSODA(
        counted,
        0.0,
        np.array(x0, dtype=float),
        t_end,
        max_step=cap,
        rtol=rtol,
        atol=atol,
        jac=lambda t, x: np.asarray(jac(x), dtype=float),
    )
    work = solver._lsoda_solver._integrator
    method, switches, orders, stiff = 1, [], {1: [0] * 13, 2: [0] * 6}, 0
    before = 0.0
    while solver.status == "running":
        solver.step()
        assert solver.status != "failed"
        used, order = int(work.iwork[18]), int(work.iwork[13])
        if used != method:
            # The step just made is the first of the new family: the switch is at its start.
            switches.append([before, "bdf" if used == 2 else "adams"])
            method = used
        orders[used][order] += 1
        stiff += used == 2
        before = float(solver.t)
    steps, evals, jacobians = (int(work.iwork[k]) for k in (10, 11, 12))
    return {
        "rtol": rtol,
        "atol": atol,
        "x": [float(v) for v in solver.y],
        "steps": steps,
        "evaluations": evals,
        "jacobians": jacobians,
        "stiff_steps": stiff,
        "adams_orders": orders[1][1:],
        "bdf_orders": orders[2][1:],
        "switches": switches,
    }


def reference(f, jac, x0, t_end, factor, cap):
    """Two independent methods at their tightest; the first is the reference, their distance its
    uncertainty."""
    fun = lambda t, x: np.asarray(f(x), dtype=float)
    jacobian = lambda t, x: np.asarray(jac(x), dtype=float)
    cap = min(cap, 0.02) if np.isfinite(cap) else cap
    radau = solve_ivp(
        fun,
        (0, t_end),
        x0,
        method="Radau",
        jac=jacobian,
        rtol=3e-14,
        atol=3e-14 * factor,
        max_step=cap,
    )
    other = lsoda(f, jac, x0, t_end, cap, 2e-13, 2e-13 * factor)
    assert radau.success
    a, b = radau.y[:, -1], np.array(other["x"])
    return [float(v) for v in a], [float(v) for v in np.abs(a - b)]


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    document = {
        "made_by": "scripts/odepack_reference.py",
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "problems": [],
    }
    rows = []
    for name, (f, jac), x0, t_end, cap, tolerances, factor in PROBLEMS:
        x, uncertainty = reference(f, jac, x0, t_end, factor, cap)
        runs = []

        def distance(state):
            return max(abs(a - b) / (abs(b) + factor) for a, b in zip(state, x))

        for rtol in tolerances:
            run = lsoda(f, jac, x0, t_end, cap, rtol, rtol * factor)
            error = distance(run["x"])
            run["shifted"] = []
            for shift in SHIFTS:
                moved = lsoda(
                    f,
                    jac,
                    np.array([x0[0] * (1 + shift), *x0[1:]], dtype=float),
                    t_end,
                    cap,
                    rtol,
                    rtol * factor,
                )
                run["shifted"].append(
                    {
                        key: moved[key]
                        for key in ("steps", "evaluations", "jacobians", "stiff_steps", "switches")
                    }
                    | {"error": distance(moved["x"])}
                )
            runs.append(run)
            rows.append(
                [
                    name,
                    "odepack-lsoda",
                    rtol,
                    error,
                    run["evaluations"],
                    run["jacobians"],
                    run["steps"],
                ]
            )
            print(
                name,
                rtol,
                f"{error:.2e}",
                run["steps"],
                run["evaluations"],
                run["jacobians"],
                len(run["switches"]),
            )
        print("   uncertainty", uncertainty)
        document["problems"].append(
            {
                "name": name,
                "start": [float(v) for v in x0],
                "t_end": t_end,
                "max_step": cap if np.isfinite(cap) else None,
                "atol_over_rtol": factor,
                "reference": x,
                "uncertainty": uncertainty,
                "runs": runs,
            }
        )
    (OUT / "reference.json").write_text(json.dumps(document, indent=1) + "\n")
    with open(OUT / "work_precision.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["problem", "method", "tolerance", "error", "evaluations", "jacobians", "steps"]
        )
        writer.writerows(rows)


if __name__ == "__main__":
    main()
