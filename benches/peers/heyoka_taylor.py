"""Unit of work W1 (benches/README.md) with heyoka's adaptive Taylor method.

    python heyoka_taylor.py W1 A 5

Terminal events at the layer's edge, x = +-20 eps, and at x = 0, so that the layer is not jumped over unseen; every y = 0 crossing is an event.
Prints: peer, unit, set, the least seconds of processor time of the given number of runs, steps, crossings, final state of the last run.
"""

import math
import sys
import time

import heyoka as hy

unit, which, repeats = sys.argv[1], sys.argv[2], int(sys.argv[3])
assert unit == "W1", "only W1"
alpha, beta = (1e-3, 1e-5) if which == "A" else (1e-1, 1e-4)
eps = 1e-3
x, y, z = hy.make_vars("x", "y", "z")
phi = 0.5 * (1.0 + hy.tanh(x / eps))
r2 = x * x + y * y + z * z
system = [
    (x, z + (-y - z) * phi),
    (y, -1.4 + 2.4 * phi + (alpha - beta * y) * r2),
    (z, 1.0 - 2.2 * phi + (alpha - beta * z) * r2),
]
crossings = 0


def crossed(_ta, _t, _sign):
    global crossings
    crossings += 1


def go_on(_ta, _sign):
    return True


edges = [hy.t_event(x - edge, callback=go_on) for edge in (-20 * eps, 0.0, 20 * eps)]
ta = hy.taylor_adaptive(
    system, [0.2, 0.0, -1.0], tol=1.0536712e-8, t_events=edges, nt_events=[hy.nt_event(y, crossed)]
)
best = math.inf
for _ in range(repeats):
    start = time.process_time()
    ta.time, ta.state[:], steps, crossings = 0.0, [0.2, 0.0, -1.0], 0, 0
    ta.reset_cooldowns()
    for segment in range(2000):
        outcome = ta.propagate_until(100.0 * (segment + 1), max_delta_t=10.0)
        steps += outcome[3]
    best = min(best, time.process_time() - start)
s = ta.state
print(f"heyoka-taylor {unit} {which} {best:.6f} {steps} {crossings} {s[0]:.17g} {s[1]:.17g} {s[2]:.17g}")
