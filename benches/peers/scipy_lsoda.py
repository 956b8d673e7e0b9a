"""Units of work W0 and W1 (benches/README.md) with SciPy's LSODA (ODEPACK) and a right-hand side
compiled by Numba.

    python scipy_lsoda.py W1 A 5

Crossings are not located: odeint cannot, and SciPy's interface that can takes a Python step at a
time. So this does less than the others. Prints: peer, unit, set, the least seconds of processor
time of the given number of runs, steps, crossings, final state of the last run.
"""

import math
import sys
import time

import numba
import numpy as np
from scipy.integrate import odeint


@numba.njit
def field(s, _, alpha, beta):
    x, y, z = s
    phi = 0.5 * (1.0 + math.tanh(x / 1e-3))
    r2 = x * x + y * y + z * z
    d = np.empty(3)
    d[0] = z + (-y - z) * phi
    d[1] = -1.4 + 2.4 * phi + (alpha - beta * y) * r2
    d[2] = 1.0 - 2.2 * phi + (alpha - beta * z) * r2
    return d


unit, which, repeats = sys.argv[1], sys.argv[2], int(sys.argv[3])
assert unit in ("W0", "W1"), "only W0, W1"
segments, length = (1, 10.0) if unit == "W0" else (2000, 100.0)
parameters = (1e-3, 1e-5) if which == "A" else (1e-1, 1e-4)
tolerance = 1.0536712e-8
field(np.array([0.2, 0.0, -1.0]), 0.0, *parameters)
best = math.inf
for _ in range(repeats):
    start = time.process_time()
    state, steps = np.array([0.2, 0.0, -1.0]), 0
    for _ in range(segments):
        states, info = odeint(
            field,
            state,
            [0.0, length],
            parameters,
            rtol=tolerance,
            atol=tolerance,
            hmax=10.0,
            mxstep=10**8,
            full_output=True,
        )
        state, steps = states[-1], steps + info["nst"][-1]
    best = min(best, time.process_time() - start)
print(
    f"scipy-lsoda {unit} {which} {best:.6f} {steps} 0 {state[0]:.17g} {state[1]:.17g} "
    f"{state[2]:.17g}"
)
