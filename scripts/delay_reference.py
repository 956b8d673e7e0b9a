#!/usr/bin/env python3
"""Makes tests/data/delay-smooth.csv: the caricature with a smooth delayed switch, by a method of
steps of SciPy's.

Frozen: run by hand, committed with the version used, never run by the tests.

    pip install scipy==1.17.1 && python3 scripts/delay_reference.py

Each interval between two multiples of the delay is an ordinary differential equation, whose
right-hand side asks for the orbit one delay earlier: the dense output (order 7) of DOP853 on the
interval before. Nothing is shared with this project but the equation. Tolerances are 1e-13; a run
with intervals of half the length shows how far the numbers are good.
"""

import pathlib

import numpy as np
import scipy
from scipy.integrate import solve_ivp

ALPHA, BETA, V_PLUS, V_MINUS = 1e-1, 1e-5, -1.2, -1.4
START = np.array([0.2, 0.0, -1.0])
CASES = [(0.02, 0.01), (0.06, 0.01)]
T_END = 12.0
OUT = pathlib.Path(__file__).resolve().parent.parent / "tests" / "data" / "delay-smooth.csv"


def fields(v):
    x, y, z = v
    r2 = x * x + y * y + z * z
    push = np.array([0.0, (ALPHA - BETA * y) * r2, (ALPHA - BETA * z) * r2])
    return np.array([-y, 1.0, V_PLUS]) + push, np.array([z, V_MINUS, 1.0]) + push


def orbit(delay, eps, parts):
    """The states at t = 1, 2, ...; each delay in so many intervals."""
    pieces, states, t, v = [], [], 0.0, START
    step = delay / parts
    count = int(round(T_END / step))
    for k in range(count):
        t0, t1 = k * step, (k + 1) * step
        past = pieces[k - parts] if k >= parts else (lambda _: START)

        def right(s, w):
            plus, minus = fields(w)
            phi = 0.5 * (1.0 + np.tanh(past(s - delay)[0] / eps))
            return minus + (plus - minus) * phi

        marks = [m for m in range(1, int(T_END) + 1) if t0 < m <= t1 + 1e-12]
        found = solve_ivp(right, (t0, t1), v, "DOP853", dense_output=True, rtol=1e-13, atol=1e-14)
        states += [found.sol(min(m, t1)) for m in marks]
        pieces.append(found.sol)
        v = found.y[:, -1]
    return np.array(states)


rows = []
for delay, eps in CASES:
    one, two = orbit(delay, eps, 1), orbit(delay, eps, 2)
    for t, (a, b) in enumerate(zip(one, two), 1):
        rows.append([delay, eps, t, *map(float, a), float(f"{np.abs(a - b).max():.1e}")])
with OUT.open("w") as out:
    print(
        f"# scripts/delay_reference.py with SciPy {scipy.__version__}: caricature, alpha 0.1, beta "
        "1e-5, tanh, from (0.2, 0, -1)",
        file=out,
    )
    print("delay,eps,t,x,y,z,uncertainty", file=out)
    for row in rows:
        print(",".join(map(repr, row)), file=out)
