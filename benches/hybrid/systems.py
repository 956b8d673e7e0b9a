"""The systems of the comparison: what is asked, its reference, and how a user of each program gets
it.

Every system has a file NAME.toml for `twofold run`. `ours` takes the number from the rows that it
writes. `plain` hands the discontinuous right-hand side to a solver. `by_hand` is a program with
events and modes of the user's own; `until` is one integration that ends at its first event, by
SciPy or by CVODE (compare.py): until(f, t, y, end, (g, direction), ...) gives the time, the state,
and the number of the event or None. `nosnoc` hands a Filippov system to FESD: run(x, x0, c, F, end,
steps) gives the states at the ends of the finite elements and their times. Column 1 of F[i] is
added where c[i] > 0, column 2 where c[i] < 0; `signs` of run names the sides if c[i] is a vector.
`why` says why nosnoc cannot state a system.
"""

import contextlib
import math
import re
from bisect import bisect_right

import numpy as np

with contextlib.suppress(ImportError):
    import casadi
    from casadi import horzcat, vertcat

# The systems in the order of the table.
SYSTEMS = {}


def system(cls):
    SYSTEMS[cls.name] = cls
    return cls


def last(column):
    return lambda rows: float(rows[-1][column])


@system
class BouncingBall:
    name, t_end = "bouncing-ball", 10
    asked = "time at which the impacts end, sqrt(2h/g)(1 + r)/(1 - r)"
    plain = None

    def reference():
        return math.sqrt(2 / 9.81) * (1 + 0.8) / (1 - 0.8)

    def ours(rows):
        return max(float(r["t"]) for r in rows if r["event"])

    def by_hand(until):
        f = lambda t, s: [s[1], -9.81]
        impact = (lambda t, s: s[0], -1)
        t, s, hit = until(f, 0, [1, 0], 10, impact)
        while hit is not None and s[1] < -1e-8:
            t, s, hit = until(f, t, [0, -0.8 * s[1]], 10, impact)
        return t


@system
class ImpactTrain:
    name, t_end = "impact-train", 100
    asked = "x(100) after 32 impacts, 0.99^32 |cos 100|"
    ours = last("x")
    plain = None

    def reference():
        return 0.99 ** (math.floor((100 - math.pi / 2) / math.pi) + 1) * abs(math.cos(100))

    def by_hand(until):
        f = lambda t, s: [s[1], -s[0]]
        t, s, hit = until(f, 0, [1, 0], 100, (lambda t, s: s[0], -1))
        while hit is not None:
            t, s, hit = until(f, t, [0, -0.99 * s[1]], 100, (lambda t, s: s[0], -1))
        return s[0]


@system
class GrazingImpact:
    name, t_end = "grazing-impact", 30
    asked = "time of the first impact, a relative 1e-6 below the amplitude"
    ours = last("t")
    plain = None

    def reference():
        phi = math.atan2(2 * 0.05 * 2.8, 1 - 2.8**2)
        return (phi - math.acos(1 - 1e-6)) / 2.8

    def by_hand(until):
        w, zeta = 2.8, 0.05
        a = 1 / math.sqrt((1 - w**2) ** 2 + (2 * zeta * w) ** 2)
        phi = math.atan2(2 * zeta * w, 1 - w**2)
        f = lambda t, s: [s[1], math.cos(w * t) - s[0] - 2 * zeta * s[1]]
        impact = (lambda t, s: s[0] - a * (1 - 1e-6), 1)
        t, s, hit = until(f, 0, [a * math.cos(phi), a * w * math.sin(phi)], 30, impact)
        return t

    def nosnoc(run):
        w, zeta = 2.8, 0.05
        a = 1 / math.sqrt((1 - w**2) ** 2 + (2 * zeta * w) ** 2)
        phi = math.atan2(2 * zeta * w, 1 - w**2)
        x = casadi.SX.sym("x", 3)
        f = vertcat(x[1], casadi.cos(w * x[2]) - x[0] - 2 * zeta * x[1], 1)
        wall = x[0] - a * (1 - 1e-6)
        states, times = run(x, [a * math.cos(phi), a * w * math.sin(phi), 0], [wall], [horzcat(f, f)], 30, 600)
        met = [t for s, t in zip(states, times) if s[0] - a * (1 - 1e-6) > -1e-8]
        return met[0] if met else times[-1]


@system
class RimlessWheel:
    name, t_end = "rimless-wheel", 30
    asked = "speed just after an impact on the cycle (McGeer 1990)"
    plain = None

    def reference():
        c = math.cos(math.pi / 4)
        return c * math.sqrt(4 * 9.81 * math.sin(math.pi / 8) * math.sin(0.08) / (1 - c * c))

    def ours(rows):
        return float([r for r in rows if r["event"]][-1]["w"])

    def by_hand(until):
        f = lambda t, s: [s[1], 9.81 * math.sin(s[0])]
        step = (lambda t, s: s[0] - 0.08 - math.pi / 8, 1)
        t, s, hit = until(f, 0, [0.08 - math.pi / 8, 1.5], 30, step)
        while hit is not None:
            w = math.cos(math.pi / 4) * s[1]
            t, s, hit = until(f, t, [s[0] - math.pi / 4, w], 30, step)
        return w


@system
class Thermostat:
    name, t_end = "thermostat", 100
    asked = "T(100), from the period 20 ln 1.5 of the relay with hysteresis"
    ours = last("T")

    def reference():
        half = 10 * math.log(1.5)
        phase = 100 % (2 * half)
        return 30 - 12 * math.exp(-0.1 * phase) if phase < half else 10 + 12 * math.exp(-0.1 * (phase - half))

    def plain(solve):
        on = True
        def f(t, s):
            nonlocal on
            on = s[0] < 18 or on and s[0] < 22
            return [0.1 * ((30 if on else 10) - s[0])]
        return solve(f, [18], 100)[0]

    def by_hand(until):
        modes = [(30, 22, 1), (10, 18, -1)]
        t, s, hit, n = 0, [18], 0, 0
        while hit is not None:
            target, edge, direction = modes[n % 2]
            f = lambda t, s: [0.1 * (target - s[0])]
            t, s, hit = until(f, t, s, 100, (lambda t, s: s[0] - edge, direction))
            n += 1
        return s[0]


@system
class StickSlip:
    name, t_end = "stick-slip", 100
    asked = "x(100), from the period 2d/b + pi + 2 atan(b/d) of stick and slip"
    ours = last("x")

    def reference():
        belt, static, kinetic = 0.2, 1, 0.5
        d = static - kinetic
        slip = math.pi + 2 * math.atan(belt / d)
        phase = (100 - static / belt) % (2 * d / belt + slip)
        if phase < slip:
            return kinetic + math.hypot(d, belt) * math.cos(phase - math.atan2(belt, d))
        return 2 * kinetic - static + belt * (phase - slip)

    def plain(solve):
        def f(t, s):
            x, v = s
            if abs(v - 0.2) < 1e-6 and abs(x) < 1:
                return [0.2, 0]
            return [v, -x + (0.5 if v < 0.2 else -0.5)]
        return solve(f, [0, 0.2], 100)[0]

    def by_hand(until):
        stick = (lambda t, s: [0.2, 0], (lambda t, s: s[0] - 1, 1))
        slip = (lambda t, s: [s[1], 0.5 - s[0]], (lambda t, s: s[1] - 0.2, 1))
        t, s, hit, n = 0, [0, 0.2], 0, 0
        while hit is not None:
            f, event = [stick, slip][n % 2]
            t, s, hit = until(f, t, s, 100, event)
            if hit is not None:
                s = [s[0], 0.2]
            n += 1
        return s[0]


@system
class DryFriction:
    name, t_end = "dry-friction", 30
    asked = "where it rests: the amplitude 5.3 loses 2F = 1 a half turn"
    ours = last("x")

    def reference():
        return -0.3

    def plain(solve):
        return solve(lambda t, s: [s[1], -s[0] - 0.5 * np.sign(s[1])], [5.3, 0], 30)[0]

    def by_hand(until):
        t, s, hit = 0, [5.3, 0], 0
        while hit is not None and abs(s[0]) > 0.5:
            sign = -math.copysign(1, s[0])
            f = lambda t, s: [s[1], -s[0] - 0.5 * sign]
            t, s, hit = until(f, t, [s[0], 0], 30, (lambda t, s: s[1], -sign))
        return s[0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)
        F = horzcat(vertcat(x[1], -x[0] - 0.5), vertcat(x[1], -x[0] + 0.5))
        return run(x, [5.3, 0], [x[1]], [F], 30, 150)[0][-1][0]


@system
class SlidingMode:
    name, t_end = "sliding-mode", 5
    asked = "x(5) = x(t1) exp(t1 - 5), t1 where sliding begins"
    ours = last("x")

    def reference():
        x = lambda t: 1 - t * t + t / 6 - math.sin(3 * t) / 18
        v = lambda t: -2 * t + (1 - math.cos(3 * t)) / 6
        low, high = 0, 1
        while low < (middle := (low + high) / 2) < high:
            low, high = (middle, high) if x(middle) + v(middle) > 0 else (low, middle)
        return x(low) * math.exp(low - 5)

    def plain(solve):
        f = lambda t, s: [s[1], 0.5 * math.sin(3 * t) - 2 * np.sign(s[1] + s[0])]
        return solve(f, [1, 0], 5)[0]

    def by_hand(until):
        reach = lambda t, s: [s[1], 0.5 * math.sin(3 * t) - 2]
        t, s, hit = until(reach, 0, [1, 0], 5, (lambda t, s: s[0] + s[1], -1))
        slide = lambda t, s: [-s[0], s[0]]  # the control 0.5 sin(3t) + v, by hand
        return until(slide, t, [s[0], -s[0]], 5)[1][0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 3)  # the last is time
        f = vertcat(x[1], 0.5 * casadi.sin(3 * x[2]), 1)
        F = horzcat(f - vertcat(0, 2, 0), f + vertcat(0, 2, 0))
        return run(x, [1, 0, 0], [x[0] + x[1]], [F], 5, 100)[0][-1][0]


@system
class ThreeRelays:
    name, t_end = "three-relays", 3
    asked = "integral of 1 + x + y + z to t = 3; all three slide from t = 1"
    ours = last("sum")

    def reference():
        return 3 + 3 * 0.7 / 2

    def plain(solve):
        def f(t, s):
            x, y, z = np.sign(s[:3])
            return [-x + 0.3 * y, -y + 0.3 * z, -z + 0.3 * x, 1 + s[0] + s[1] + s[2]]
        return solve(f, [0.7, 0.7, 0.7, 0], 3)[3]

    def by_hand(until):
        def f(t, s):
            x, y, z = signs
            return [-x + 0.3 * y, -y + 0.3 * z, -z + 0.3 * x, 1 + s[0] + s[1] + s[2]]
        signs = [1, 1, 1]
        zero = [(lambda t, s, i=i: s[i], -1) for i in range(3)]
        t, s, hit = until(f, 0, [0.7, 0.7, 0.7, 0], 3, *zero)
        # That all three may slide is decided by hand.
        signs = [0 if abs(x) < 1e-8 else 1 for x in s[:3]]
        return until(f, t, s, 3)[1][3]

    def nosnoc(run):
        x = casadi.SX.sym("x", 4)
        f = vertcat(0, 0, 0, 1 + x[0] + x[1] + x[2])
        A, B, C = vertcat(-1, 0, 0.3, 0), vertcat(0.3, -1, 0, 0), vertcat(0, 0.3, -1, 0)
        F = [horzcat(f + A, f - A), horzcat(B, -B), horzcat(C, -C)]
        return run(x, [0.7, 0.7, 0.7, 0], [x[0], x[1], x[2]], F, 3, 60)[0][-1][3]


@system
class Staircase:
    name, t_end = "staircase", 30
    why = "no floor"
    asked = "integral of floor(10 t) to t = 30"
    ours = last("y")

    def reference():
        return sum(range(300)) / 10

    def plain(solve):
        return solve(lambda t, s: [math.floor(10 * t)], [0], 30)[0]

    def by_hand(until):
        s = [0]
        for k in range(300):
            t, s, hit = until(lambda t, s: [k], k / 10, s, (k + 1) / 10)
        return s[0]


@system
class PulseWidth:
    name, t_end = "pulse-width", 100
    asked = "v(100) behind pulses of 0.05 every 1, by the exponentials"
    ours = last("v")

    def reference():
        v = 0
        for _ in range(100):
            v = (1 + (v - 1) * math.exp(-0.05 / 5)) * math.exp(-0.95 / 5)
        return v

    def plain(solve):
        return solve(lambda t, s: [((1 if t % 1 < 0.05 else 0) - s[0]) / 5], [0], 100)[0]

    def by_hand(until):
        s = [0]
        for k in range(100):
            t, s, hit = until(lambda t, s: [(1 - s[0]) / 5], k, s, k + 0.05)
            t, s, hit = until(lambda t, s: [-s[0] / 5], k + 0.05, s, k + 1)
        return s[0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)  # the last is time; mod(t, 1) < 0.05 by a cosine
        pulse = casadi.cos(2 * math.pi * (x[1] - 0.025)) - math.cos(0.05 * math.pi)
        F = horzcat(vertcat((1 - x[0]) / 5, 1), vertcat(-x[0] / 5, 1))
        return run(x, [0, 0], [pulse], [F], 100, 500, elements=3)[0][-1][0]


@system
class ThinPulse:
    name, t_end = "thin-pulse", 30
    asked = "sum of ten pulses of width 2e-6 in x, by the arc sine"
    ours = last("y")

    def reference():
        return 10 * 1e6 * (math.asin(0.3 + 1e-6) - math.asin(0.3 - 1e-6))

    def plain(solve):
        f = lambda t, s: [s[1], -s[0], 1e6 if abs(s[0] - 0.3) < 1e-6 else 0]
        return solve(f, [0, 1, 0], 30)[2]

    def by_hand(until):
        t, s, hit, inside = 0, [0, 1, 0], 0, False
        while hit is not None:
            if inside:
                side = direction = math.copysign(1, s[1])
            else:
                side = math.copysign(1, s[0] - 0.3)
                direction = -side
            f = lambda t, s: [s[1], -s[0], 1e6 * inside]
            edge = lambda t, s: s[0] - 0.3 - 1e-6 * side
            t, s, hit = until(f, t, s, 30, (edge, direction))
            inside = not inside
        return s[2]

    def nosnoc(run):
        x = casadi.SX.sym("x", 3)
        f, pulse = vertcat(x[1], -x[0], 0), vertcat(0, 0, 1e6)
        c = vertcat(x[0] - 0.3 + 1e-6, 0.3 + 1e-6 - x[0])
        signs = np.array([[1, 1], [1, -1], [-1, 1]])
        return run(x, [0, 1, 0], [c], [horzcat(f + pulse, f, f)], 30, 600, signs=[signs])[0][-1][2]


@system
class Tank:
    name, t_end = "tank", 50
    asked = "height at t = 50 by a table's inflow, by the exponentials"
    ours = last("h")

    def reference():
        h = 0.5
        for q, left in ((0.2, 10), (0.9, 10), (0.1, 20), (0.5, 10)):
            while left > 0:
                # At the rim the side is that into which the inflow leads.
                over = h > 3 or h == 3 and q > 0.3
                rest, rate = ((q + 6) / 2.1, 2.1) if over else (q / 0.1, 0.1)
                meets = (3 - rest) / (h - rest) if h != 3 else 0
                time = -math.log(meets) / rate if 0 < meets < 1 else math.inf
                h = 3 if time < left else rest + (h - rest) * math.exp(-rate * left)
                left -= min(time, left)
        return h

    def plain(solve):
        times, rates = [0, 10, 20, 40], [0.2, 0.9, 0.1, 0.5]
        def f(t, s):
            inflow = rates[bisect_right(times, t) - 1]
            return [inflow - 0.1 * s[0] - (2 * (s[0] - 3) if s[0] > 3 else 0)]
        return solve(f, [0.5], 50)[0]

    def by_hand(until):
        times, rates = [0, 10, 20, 40, 50], [0.2, 0.9, 0.1, 0.5]
        s, over = [0.5], False
        for inflow, t, end in zip(rates, times, times[1:]):
            hit = 0
            while hit is not None:
                f = lambda t, s: [inflow - 0.1 * s[0] - (2 * (s[0] - 3) if over else 0)]
                t, s, hit = until(f, t, s, end, (lambda t, s: s[0] - 3, -1 if over else 1))
                over ^= hit is not None
        return s[0]

    def nosnoc(run):
        h, inflow = casadi.SX.sym("h"), casadi.SX.sym("inflow")
        F = horzcat(inflow - 0.1 * h - 2 * (h - 3), inflow - 0.1 * h)
        rates = np.repeat([0.2, 0.9, 0.1, 0.5], [20, 20, 40, 20])[:, None]  # one a step
        return run(h, [0.5], [h - 3], [F], 50, 100, p=inflow, values=rates)[0][-1][0]


@system
class Rotation:
    name, t_end = "rotation", 1.5
    asked = "x(1.5), nosnoc's example: exp(0.5) cos(3 pi)"
    ours = last("x")

    def reference():
        return -math.exp(0.5)

    def plain(solve):
        def f(t, s):
            turn = 2 * math.pi if s[0] ** 2 + s[1] ** 2 < 1 else -2 * math.pi
            return [s[0] + turn * s[1], s[1] - turn * s[0]]
        return solve(f, [math.exp(-1), 0], 1.5)[0]

    def by_hand(until):
        turn = 2 * math.pi
        f = lambda t, s: [s[0] + turn * s[1], s[1] - turn * s[0]]
        t, s, hit = until(f, 0, [math.exp(-1), 0], 1.5, (lambda t, s: s[0] ** 2 + s[1] ** 2 - 1, 1))
        turn = -2 * math.pi
        return until(f, t, s, 1.5)[1][0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)
        out = vertcat(x[0] - 2 * math.pi * x[1], x[1] + 2 * math.pi * x[0])
        inside = vertcat(x[0] + 2 * math.pi * x[1], x[1] - 2 * math.pi * x[0])
        F = horzcat(out, inside)
        return run(x, [math.exp(-1), 0], [x[0] ** 2 + x[1] ** 2 - 1], [F], 1.5, 29)[0][-1][0]


@system
class Spiral:
    name, t_end = "spiral", 2
    asked = "integral of |x| + |y|; crossings accumulate at the corner at t = 1"
    ours = last("sum")

    def reference():
        return 1

    def plain(solve):
        def f(t, s):
            x, y = np.sign(s[:2])
            return [2 * y - x, -2 * x - y, abs(s[0]) + abs(s[1])]
        return solve(f, [-1, 1, 0], 2)[2]

    def by_hand(until):
        t, s, hit = 0, [-1, 1, 0], 0
        x, y = -1, 1
        while hit is not None and abs(s[0]) + abs(s[1]) > 1e-8:  # less is taken for rest
            f = lambda t, s: [2 * y - x, -2 * x - y, x * s[0] + y * s[1]]
            axis = 0 if x * y < 0 else 1
            side = (x, y)[axis]
            t, s, hit = until(f, t, s, 2, (lambda t, s: s[axis], -side))
            s[axis] = 0
            x, y = (-x, y) if axis == 0 else (x, -y)
        return s[2]

    def nosnoc(run):
        x = casadi.SX.sym("x", 3)
        A, B = vertcat(-1, -2, x[0]), vertcat(2, -1, x[1])
        F = [horzcat(A, -A), horzcat(B, -B)]
        return run(x, [-1, 1, 0], [x[0], x[1]], F, 2, 40)[0][-1][2]


@system
class WaterTanks:
    name, t_end = "water-tanks", 3
    asked = "time at which switching accumulates, (1 + 1)/(2 1.5 - 2)"
    plain = None

    def reference():
        return 2

    def ours(rows):
        # A run that comes here went on.
        return float(rows[-1]["t"])

    def refused(said):
        found = re.search(r"accumulate at t = (\S+) ", said)
        return found and float(found[1])

    def by_hand(until):
        t, s, hit, low, old = 0, [1, 1], 0, 1, -1
        while hit is not None and t - old > 1e-9:  # shorter ones are taken for the end
            old, f = t, lambda t, s: [0.5 if i != low else -1.5 for i in (0, 1)]
            t, s, hit = until(f, t, s, 3, (lambda t, s: s[low], -1))
            s[low] = 0
            low = 1 - low
        return t


@system
class TwoContacts:
    name, t_end = "two-contacts", 30
    asked = "height of the first ball, that rests since t = 4.24, at t = 30"
    ours = last("x")
    plain = None

    def reference():
        return 0

    def by_hand(until):
        t, s, hit, rest = 0, [1, 0, 2, 0], 0, [False, False]
        while hit is not None:
            f = lambda t, s: [0 if rest[0] else s[1], -1 + rest[0], 0 if rest[1] else s[3], -1 + rest[1]]
            free = [i for i in (0, 1) if not rest[i]]
            t, s, hit = until(f, t, s, 30, *[(lambda t, s, i=i: s[2 * i], -1) for i in free])
            if hit is not None:
                i = free[hit]
                rest[i] = abs(s[2 * i + 1]) < 1e-7
                s[2 * i] = 0
                s[2 * i + 1] *= 0 if rest[i] else (-0.5, -0.7)[i]
        return s[0]


@system
class PulseTrain:
    name, t_end = "pulse-train", 10.5
    asked = "sum of pulses in time, by the arc sine"
    ours = last("y")

    def reference():
        return 21 / math.pi * math.asin(1e-3) * 1000

    def plain(solve):
        return solve(lambda t, s: [1000 if math.sin(math.pi * t) ** 2 < 1e-6 else 0], [0], 10.5)[0]

    def by_hand(until):
        half = math.asin(1e-3) / math.pi
        t, s = 0, [0]
        for k in range(11):
            t, s, hit = until(lambda t, s: [0], t, s, k - half)
            t, s, hit = until(lambda t, s: [1000], max(t, k - half), s, k + half)
        return s[0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)  # the last is time
        sine = casadi.sin(math.pi * x[1])
        c = vertcat(1e-3 - sine, 1e-3 + sine)
        F = horzcat(vertcat(1000, 1), vertcat(0, 1), vertcat(0, 1))
        signs = np.array([[1, 1], [1, -1], [-1, 1]])
        return run(x, [0, 0], [c], [F], 10.5, 210, signs=[signs])[0][-1][0]


@system
class Undecided:
    name, t_end = "undecided", 3
    asked = "whether it says that from t = 1 the motion is not determined"
    ours = last("x")

    def reference():
        return None

    def plain(solve):
        return solve(lambda t, s: [(t - 1) * np.sign(s[0])], [0.1], 3)[0]

    def by_hand(until):
        f = lambda t, s: [(t - 1) * sign]
        sign = 1
        t, s, hit = until(f, 0, [0.1], 3, (lambda t, s: s[0], -1))
        sign = 0  # that it slides, and how long, is decided by hand
        return until(f, t, [0], 3)[1][0]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)  # the last is time
        F = horzcat(vertcat(x[1] - 1, 1), vertcat(1 - x[1], 1))
        return run(x, [0.1, 0], [x[0]], [F], 3, 60)[0][-1][0]


@system
class SimplestSwitch:
    name, t_end = "simplest-switch", 2
    asked = "x(2) = 3 (2 - sqrt(2)), nosnoc's example of a crossing"
    ours = last("x")

    def reference():
        return 3 * (2 - math.sqrt(2))

    def plain(solve):
        return solve(lambda t, s: [1 if s[0] < 0 else 3], [-math.sqrt(2)], 2)[0]

    def by_hand(until):
        t, s, hit = until(lambda t, s: [1], 0, [-math.sqrt(2)], 2, (lambda t, s: s[0], 1))
        return until(lambda t, s: [3], t, s, 2)[1][0]

    def nosnoc(run):
        x = casadi.SX.sym("x")
        return run(x, [-math.sqrt(2)], [x], [horzcat(3, 1)], 2, 3, stages=2, elements=3)[0][-1][0]


@system
class SimplestSliding:
    name, t_end = "simplest-sliding", 2
    asked = "integral of x, -1/3, nosnoc's example of sliding, from sqrt(2)/3 on"
    ours = last("sum")

    def reference():
        return -1 / 3

    def plain(solve):
        return solve(lambda t, s: [3 if s[0] < 0 else -1, s[0]], [-math.sqrt(2), 0], 2)[1]

    def by_hand(until):
        reach = lambda t, s: [3, s[0]]
        t, s, hit = until(reach, 0, [-math.sqrt(2), 0], 2, (lambda t, s: s[0], 1))
        return until(lambda t, s: [0, 0], t, [0, s[1]], 2)[1][1]

    def nosnoc(run):
        x = casadi.SX.sym("x", 2)
        F = horzcat(vertcat(-1, x[0]), vertcat(3, x[0]))
        return run(x, [-math.sqrt(2), 0], [x[0]], [F], 2, 7, stages=2)[0][-1][1]


@system
class TwoGene:
    name, t_end = "two-gene", 1
    asked = "integral of x + y, nosnoc's example (Acary et al. 2014), by the exponentials"
    ours = last("sum")

    def reference():
        to = lambda t, x, rest, rate: rest + (x - rest) * math.exp(-rate * t)
        when = lambda x, end, rest, rate: math.log((x - rest) / (end - rest)) / rate
        area = lambda t, x, rest, rate: rest * t + (x - rest) * (1 - math.exp(-rate * t)) / rate
        # y grows to 8, where it slides; x falls until y = 4, grows from then on to 8, where it
        # slides.
        grown, four = when(3, 8, 80 / 3, 1.5), when(3, 4, 80 / 3, 1.5)
        low = to(four, 9, 0, 4.5)
        back = when(low, 8, 80 / 9, 4.5)
        x = area(four, 9, 0, 4.5) + area(back, low, 80 / 9, 4.5) + 8 * (1 - four - back)
        return x + area(grown, 3, 80 / 3, 1.5) + 8 * (1 - grown)

    def plain(solve):
        def f(t, s):
            x, y = s[:2]
            return [40 * (x < 8 and y > 4) - 4.5 * x, 40 * (x > 4 and y < 8) - 1.5 * y, x + y]
        return solve(f, [9, 3, 0], 1)[2]

    def by_hand(until):
        a, b = 0, 1  # on or off; None while it slides
        def f(t, s):
            x, y = s[:2]
            return [0 if a is None else 40 * a - 4.5 * x, 0 if b is None else 40 * b - 1.5 * y, x + y]
        t, s, hit = until(f, 0, [9, 3, 0], 1, (lambda t, s: s[1] - 4, 1))
        a = 1
        t, s, hit = until(f, t, s, 1, (lambda t, s: s[0] - 8, 1))
        a = None
        t, s, hit = until(f, t, s, 1, (lambda t, s: s[1] - 8, 1))
        b = None  # the order of these events is found by hand
        return until(f, t, s, 1)[1][2]

    def nosnoc(run):
        x, alpha = casadi.SX.sym("x", 3), casadi.SX.sym("alpha", 4)
        a, b = (1 - alpha[1]) * alpha[2], alpha[0] * (1 - alpha[3])
        f = vertcat(40 * a - 4.5 * x[0], 40 * b - 1.5 * x[1], x[0] + x[1])
        c = vertcat(x[0] - 4, x[0] - 8, x[1] - 4, x[1] - 8)
        return run(x, [9, 3, 0], [c], None, 1, 20, elements=3, alpha=[alpha], f_x=[f])[0][-1][2]


@system
class RelayFeedback:
    name, t_end = "relay-feedback", 10
    asked = "z(10), nosnoc's example (Piiroinen & Kuznetsov 2008, eq. 32), by matrix exponentials"
    ours = last("z")

    def reference():
        from scipy.linalg import expm

        A, b = np.array([[-3.5, 1, 0], [-627.5, 0, 1], [-625, 0, 0]]), np.array([1, -2, 1])
        slide = np.array([[0, 0, 0], [0, 2, 1], [0, -1, 0]])
        t, s, step = 0, np.array([0, -0.001, -0.02]), 1e-3
        while True:
            side = 0 if abs(s[1]) < 1 else math.copysign(1, s[1])
            matrix, rest = (A, np.linalg.solve(A, b * side)) if side else (slide, np.zeros(3))
            to = lambda time: rest + expm(matrix * time) @ (s - rest)
            gone = lambda s: s[0] * side < 0 if side else abs(s[1]) > 1
            low, high, whole, state = 0, step, expm(matrix * step), to(step)
            while not gone(state) and t + high < 10:
                low, high, state = high, high + step, rest + whole @ (state - rest)
            if t + high >= 10 and not gone(to(10 - t)):
                return to(10 - t)[2]
            while low < (middle := (low + high) / 2) < high:
                low, high = (low, middle) if gone(to(middle)) else (middle, high)
            t, s = t + high, to(high)
            # On the surface, and where sliding ends, exactly.
            s = np.array([0, s[1] if side else math.copysign(1, s[1]), s[2]])

    def plain(solve):
        w, xi = 25, 0.05
        def f(t, s):
            (x, y, z), u = s, np.sign(s[0])
            return [-(2 * xi * w + 1) * x + y - u, -(2 * xi * w + w**2) * x + z + 2 * u, -(w**2) * x - u]
        return solve(f, [0, -0.001, -0.02], 10)[2]

    def by_hand(until):
        w, xi = 25, 0.05
        t, s, hit = 0, [0, -0.001, -0.02], 0
        def f(t, s):
            x, y, z = s
            return [-(2 * xi * w + 1) * x + y - u, -(2 * xi * w + w**2) * x + z + 2 * u, -(w**2) * x - u]
        while hit is not None:
            if abs(s[1]) < 1:  # slides
                slide = lambda t, s: [0, 2 * s[1] + s[2], -s[1]]
                t, s, hit = until(slide, t, s, 10, (lambda t, s: s[1] - 1, 1), (lambda t, s: s[1] + 1, -1))
                s = [0, s[1] if hit is None else (1, -1)[hit], s[2]]
            else:
                u = math.copysign(1, s[1])
                t, s, hit = until(f, t, s, 10, (lambda t, s: s[0], -u))
                s = [s[0] if hit is None else 0, s[1], s[2]]
        return s[2]

    def nosnoc(run):
        w, xi = 25, 0.05
        x, b = casadi.SX.sym("x", 3), vertcat(1, -2, 1)
        A = np.array([[-(2 * xi * w + 1), 1, 0], [-(2 * xi * w + w**2), 0, 1], [-(w**2), 0, 0]])
        F = horzcat(A @ x - b, A @ x + b)
        return run(x, [0, -0.001, -0.02], [x[0]], [F], 10, 200)[0][-1][2]


@system
class Spontaneous:
    name, t_end = "spontaneous", 2
    asked = "whether it says that x' = sign(x) from x = 0 is not determined (nosnoc's example)"
    ours = last("x")

    def reference():
        return None

    def plain(solve):
        return solve(lambda t, s: [np.sign(s[0])], [0], 2)[0]

    def by_hand(until):
        return until(lambda t, s: [0], 0, [0], 2)[1][0]  # that it stays is decided by hand

    def nosnoc(run):
        x = casadi.SX.sym("x")
        return run(x, [0], [x], [horzcat(1, -1)], 2, 3, stages=2, elements=3)[0][-1][0]
