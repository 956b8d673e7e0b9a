"""The problems of `make bench-work-precision` (README.md) by SciPy and heyoka.

    python python_peers.py w1-a 1e-4 1e-6 1e-8

Prints CSV: problem, program, tolerance, seconds, steps, final state. A run is repeated until 0.05 s
of processor time have gone, three times; the least mean is printed. Start-up, imports and
compilation at run time (Numba, heyoka) are not counted. Events are written as a user writes them:
one terminal event at a time, the mode by hand.
"""

import math
import sys
import time

import heyoka as hy
import numba
import numpy as np
from scipy.integrate import odeint, solve_ivp

LONG_ENOUGH, ROUNDS = 0.05, 3
A, B = (1e-3, 1e-5), (1e-1, 1e-4)
EPS = 1e-3
EDGES = (-20, 0, 20)
# With these the layer is seen (benches/peers/heyoka_taylor.py).
RESOLVED = (-11, -5.5, -2.5, 0, 2.5, 5.5, 11)
START = [0.2, 0.0, -1.0]
PERIODIC = [17.057344142481766, 0.0, -0.015417177803876677]
SMOOTH = {
    "w1-a": (A, START, 54.0),
    "w1-b": (B, START, 13.0),
    "periodic": (A, PERIODIC, 101.23977502156168),
}


def caricature(phi, alpha, beta, x, y, z, slides=False):
    r2 = x * x + y * y + z * z
    return [
        0.0 * x if slides else z + (-y - z) * phi,
        -1.4 + 2.4 * phi + (alpha - beta * y) * r2,
        1.0 - 2.2 * phi + (alpha - beta * z) * r2,
    ]


# -------------------------------------------------------------------------------- SciPy


@numba.njit
def smooth_field(t, s, alpha, beta):
    x, y, z = s
    phi = 0.5 * (1.0 + math.tanh(x / 1e-3))
    r2 = x * x + y * y + z * z
    d = np.empty(3)
    d[0] = z + (-y - z) * phi
    d[1] = -1.4 + 2.4 * phi + (alpha - beta * y) * r2
    d[2] = 1.0 - 2.2 * phi + (alpha - beta * z) * r2
    return d


def compiled_mode(mode):
    """The field of a mode, compiled."""

    @numba.njit
    def field(t, s):
        x, y, z = s
        phi = 1.0 if mode == 0 else 0.0 if mode == 1 else z / (y + z)
        r2 = x * x + y * y + z * z
        d = np.empty(3)
        d[0] = 0.0 if mode == 2 else z + (-y - z) * phi
        d[1] = -1.4 + 2.4 * phi + (1e-1 - 1e-4 * y) * r2
        d[2] = 1.0 - 2.2 * phi + (1e-1 - 1e-4 * z) * r2
        return d

    return field


def compiled_relay(u):
    @numba.njit
    def field(t, s):
        d = np.empty(3)
        d[0] = s[1] - s[0]
        d[1] = s[2] - s[1]
        d[2] = u - s[2]
        return d

    return field


class SciPy:
    """`until`: from t, s to the terminal event or to `end`; was there one?"""

    def __init__(self, method, tolerance):
        self.method, self.tolerance, self.steps = method, tolerance, 0

    fields = {
        "plus": compiled_mode(0),
        "minus": compiled_mode(1),
        "slide": compiled_mode(2),
        "relay-plus": compiled_relay(-1.0),
        "relay-minus": compiled_relay(1.0),
    }

    def until(self, mode, event, t, s, end):
        side, offset = event
        if side == 0:
            g = lambda t, s: s[1] * s[2]
        else:
            g = lambda t, s: side * (s[0] - offset)
        g.terminal, g.direction = True, -1
        done = solve_ivp(
            self.fields[mode],
            (t, end),
            s,
            method=self.method,
            events=g,
            rtol=max(self.tolerance, 2.3e-14),
            atol=self.tolerance,
        )
        if done.status < 0:
            raise RuntimeError(done.message)
        self.steps += len(done.t) - 1
        hit = done.status == 1
        return hit, done.t[-1], done.y[:, -1]

    def smooth(self, problem):
        parameters, start, end = SMOOTH[problem]
        done = solve_ivp(
            smooth_field,
            (0.0, end),
            start,
            method=self.method,
            args=parameters,
            max_step=10.0,
            rtol=max(self.tolerance, 2.3e-14),
            atol=self.tolerance,
        )
        if done.status < 0:
            raise RuntimeError(done.message)
        self.steps += len(done.t) - 1
        return done.y[:, -1]


class Odeint:
    """ODEPACK's LSODA, whose steps are not Python's."""

    def __init__(self, tolerance):
        self.tolerance, self.steps = tolerance, 0

    def smooth(self, problem):
        parameters, start, end = SMOOTH[problem]
        states, info = odeint(
            smooth_field,
            start,
            [0.0, end],
            parameters,
            rtol=self.tolerance,
            atol=self.tolerance,
            hmax=10.0,
            mxstep=10**8,
            full_output=True,
            tfirst=True,
        )
        self.steps += int(info["nst"][-1])
        return states[-1]


# -------------------------------------------------------------------------------- heyoka

X, Y, Z = hy.make_vars("x", "y", "z")


def system(right):
    return list(zip((X, Y, Z), right))


class Heyoka:
    def __init__(self, tolerance, edges=EDGES):
        self.tolerance, self.edges, self.steps = tolerance, edges, 0
        self.made = {}

    def smooth(self, problem):
        parameters, start, end = SMOOTH[problem]
        if problem not in self.made:
            phi = 0.5 * (1.0 + hy.tanh(X / EPS))
            events = [
                hy.t_event(X - edge * EPS, callback=lambda _ta, _sign: True) for edge in self.edges
            ]
            self.made[problem] = hy.taylor_adaptive(
                system(caricature(phi, *parameters, X, Y, Z)),
                start,
                tol=self.tolerance,
                t_events=events,
            )
        ta = self.made[problem]
        ta.time, ta.state[:] = 0.0, start
        ta.reset_cooldowns()
        outcome = ta.propagate_until(end, max_delta_t=10.0)
        self.steps += outcome[3]
        return np.array(ta.state)

    def until(self, mode, event, t, s, end):
        side, offset = event
        if (mode, event) not in self.made:
            right = {
                "plus": lambda: caricature(1.0, *B, X, Y, Z),
                "minus": lambda: caricature(0.0, *B, X, Y, Z),
                "slide": lambda: caricature(Z / (Y + Z), *B, X, Y, Z, slides=True),
                "relay-plus": lambda: [Y - X, Z - Y, -1.0 - Z],
                "relay-minus": lambda: [Y - X, Z - Y, 1.0 - Z],
            }[mode]()
            g = Y * Z if side == 0 else side * (X - offset)
            stop = hy.t_event(g, direction=hy.event_direction.negative)
            self.made[mode, event] = hy.taylor_adaptive(
                system(right), list(s), tol=self.tolerance, t_events=[stop]
            )
        ta = self.made[mode, event]
        ta.time, ta.state[:] = t, s
        ta.reset_cooldowns()
        outcome = ta.propagate_until(end)
        self.steps += outcome[3]
        hit = outcome[0] != hy.taylor_outcome.time_limit
        return hit, ta.time, np.array(ta.state)


# -------------------------------------------------------------------------------- problems


def sliding(m):
    t, s, mode = 0.0, np.array(START), "plus"
    while True:
        event = {"plus": (1, 0.0), "minus": (-1, 0.0), "slide": (0, 0.0)}[mode]
        hit, t, s = m.until(mode, event, t, s, 13.0)
        if not hit:
            return s
        s[0] = 0.0
        mode = "slide" if s[1] > 0 and s[2] > 0 else "minus" if s[1] > 0 else "plus"


def hysteresis(m):
    t, s, plus = 0.0, np.array([0.3, 0.0, 0.0]), True
    while True:
        event = (1, -0.1) if plus else (-1, 0.1)
        hit, t, s = m.until("relay-plus" if plus else "relay-minus", event, t, s, 60.0)
        if not hit:
            return s
        s[0] = event[1]
        plus = not plus


def delay(m):
    t, s, side, plus, coming = 0.0, np.array(START), 1, True, []
    while t < 13.0:
        until = min([*coming[:1], 13.0])
        hit, t, s = m.until("plus" if plus else "minus", (side, 0.0), t, s, until)
        if hit:
            s[0], side = 0.0, -side
            coming.append(t + 1e-2)
        elif coming and until == coming[0]:
            coming.pop(0)
            plus = not plus
    return s


def measure(problem, program, tolerance, method):
    def run():
        method.steps = 0
        if problem in SMOOTH:
            return method.smooth(problem)
        return {"sliding": sliding, "hysteresis": hysteresis, "delay": delay}[problem](method)

    try:
        end = run()
        steps, best, count, done = method.steps, math.inf, 1, 0
        while done < ROUNDS:
            start = time.process_time()
            for _ in range(count):
                run()
            took = time.process_time() - start
            if took >= LONG_ENOUGH:
                best, done = min(best, took / count), done + 1
            else:
                wanted = int(1.3 * LONG_ENOUGH / max(took / count, 1e-9))
                count = max(count + 1, min(10 * count, wanted))
    except Exception as error:
        print(f"{problem},{program},{tolerance:g}: {error}", file=sys.stderr)
        return
    x, y, z = (float(c) for c in end)
    print(f'{problem},"{program}",{tolerance:g},{best:.4e},{steps},{x!r},{y!r},{z!r}', flush=True)


def main():
    problem, *ladder = sys.argv[1:]
    for tolerance in map(float, ladder):
        for method in ("RK45", "DOP853", "LSODA", "Radau"):
            measure(problem, f"SciPy {method}", tolerance, SciPy(method, tolerance))
        if problem in SMOOTH:
            measure(problem, "SciPy odeint", tolerance, Odeint(tolerance))
            measure(problem, "heyoka, layer's edge", tolerance, Heyoka(tolerance))
            measure(problem, "heyoka, layer resolved", tolerance, Heyoka(tolerance, RESOLVED))
        else:
            measure(problem, "heyoka", tolerance, Heyoka(tolerance))


main()
