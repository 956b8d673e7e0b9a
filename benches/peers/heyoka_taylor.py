"""Units of work W0 and W1 (benches/README.md) with heyoka's adaptive Taylor method.

    python heyoka_taylor.py [resolved] W1 A 5

Terminal events at the layer's edge, x = +-20 eps, and at x = 0 end the steps there; every y = 0
crossing is an event. That is not enough for the layer to be seen: far from its middle tanh's series
has no terms large enough for the step control to notice, and a step goes from the edge to the
middle as if tanh were constant. With `resolved`, events in between make the error what was asked
for; W0 says how large it is either way. Prints: peer, unit, set, the least seconds of processor
time of the given number of runs, steps, crossings, final state of the last run.
"""

import math
import sys
import time

import heyoka as hy

TOLERANCE = 1.0536712e-8
EPS = 1e-3
EDGES = (-20, 0, 20)
RESOLVED = (-11, -5.5, -2.5, 0, 2.5, 5.5, 11)

x, y, z = hy.make_vars("x", "y", "z")
crossings = 0


def crossed(_ta, _t, _sign):
    global crossings
    crossings += 1


def go_on(_ta, _sign):
    return True


def integrator(which, edges):
    alpha, beta = (1e-3, 1e-5) if which == "A" else (1e-1, 1e-4)
    phi = 0.5 * (1.0 + hy.tanh(x / EPS))
    r2 = x * x + y * y + z * z
    system = [
        (x, z + (-y - z) * phi),
        (y, -1.4 + 2.4 * phi + (alpha - beta * y) * r2),
        (z, 1.0 - 2.2 * phi + (alpha - beta * z) * r2),
    ]
    events = [hy.t_event(x - edge * EPS, callback=go_on) for edge in edges]
    return hy.taylor_adaptive(
        system,
        [0.2, 0.0, -1.0],
        tol=TOLERANCE,
        t_events=events,
        nt_events=[hy.nt_event(y, crossed)],
    )


def main():
    global crossings
    unit, which, repeats = sys.argv[-3], sys.argv[-2], int(sys.argv[-1])
    assert unit in ("W0", "W1"), "only W0, W1"
    segments, length = (1, 10.0) if unit == "W0" else (2000, 100.0)
    resolved = "resolved" in sys.argv
    ta = integrator(which, RESOLVED if resolved else EDGES)
    best = math.inf
    for _ in range(repeats):
        start = time.process_time()
        ta.time, ta.state[:], steps, crossings = 0.0, [0.2, 0.0, -1.0], 0, 0
        ta.reset_cooldowns()
        for segment in range(segments):
            outcome = ta.propagate_until(length * (segment + 1), max_delta_t=10.0)
            steps += outcome[3]
        best = min(best, time.process_time() - start)
    s = ta.state
    print(
        f"heyoka-taylor {unit} {which} {best:.6f} {steps} {crossings} {s[0]:.17g} {s[1]:.17g} "
        f"{s[2]:.17g}"
    )


main()
