"""Checks the certificates in proofs/certificates with exact rational arithmetic.

Shares nothing with the program that wrote them: standard library only, fractions instead of floating point. What it verifies from a
certificate's own numbers: Krawczyk's inclusion, the stability conditions, distances, radii, and that crossings of the two kinds of
certificate and of tests/data agree. What it cannot verify is that the enclosures of the flow hold; for that, it follows the
closed orbits with an integrator of its own (plain Runge-Kutta, not rigorous) as a test against gross error.

Run by `make proofs`; exit code 1 and a line that says what failed, or a line a theorem.
"""

import csv
import json
import math
import sys
from fractions import Fraction as F
from pathlib import Path

HERE = Path(__file__).resolve().parent


class Failed(Exception):
    pass


def need(condition, what):
    if not condition:
        raise Failed(what)


class I:
    """An exact interval with rational bounds."""

    def __init__(self, low, high):
        self.low, self.high = F(low), F(high)
        need(self.low <= self.high, "bounds in order")

    def __add__(self, o):
        return I(self.low + o.low, self.high + o.high)

    def __sub__(self, o):
        return I(self.low - o.high, self.high - o.low)

    def __mul__(self, o):
        p = [a * b for a in (self.low, self.high) for b in (o.low, o.high)]
        return I(min(p), max(p))

    def inside(self, o):
        return o.low < self.low and self.high < o.high

    def within(self, o):
        return o.low <= self.low and self.high <= o.high

    def meets(self, o):
        return self.low <= o.high and o.low <= self.high

    def width(self):
        return self.high - self.low


def interval(pair):
    return I(F(pair[0]), F(pair[1]))


def point(x):
    return I(F(x), F(x))


def ball(b):
    c, r = F(b["high"]) + F(b["low"]), F(b["radius"])
    return I(c - r, c + r)


def midpoint(x):
    # The program's midpoint, which is where it evaluated the map: half the sum of the halves, rounded as f64.
    low, high = float(x.low), float(x.high)
    return F(min(max(0.5 * low + 0.5 * high, low), high))


def field(parameters):
    alpha, beta, eps, vp, vm = (float(parameters[k]) for k in ("alpha", "beta", "eps", "v_plus", "v_minus"))

    def f(s):
        x, y, z = s
        r2 = x * x + y * y + z * z
        dy, dz = (alpha - beta * y) * r2, (alpha - beta * z) * r2
        phi = 0.5 * (1.0 + math.tanh(x / eps))
        return (z + (-y - z) * phi, vm + dy + (1.0 - vm) * phi, 1.0 + dz + (vp - 1.0) * phi)

    return f, eps


def rk4(f, s, h):
    def at(k, c):
        return tuple(a + c * b for a, b in zip(s, k))

    k1 = f(s)
    k2 = f(at(k1, h / 2))
    k3 = f(at(k2, h / 2))
    k4 = f(at(k3, h))
    return tuple(a + h / 6 * (p + 2 * q + 2 * r + w) for a, p, q, r, w in zip(s, k1, k2, k3, k4))


def turn(parameters, x, z, crossings):
    """Follows the orbit from (x, 0, z) through a number of crossings of y = 0."""
    f, eps = field(parameters)
    s, t, found = (x, 0.0, z), 0.0, []
    while len(found) < crossings:
        speed = f(s)
        # Outside the layer the field is smooth; inside, a step moves x by a fiftieth of eps.
        distance = max(abs(s[0]) - 15 * eps, 0.0)
        h = min(0.002, max(0.02 * eps, 0.3 * distance) / max(abs(speed[0]), 1e-9))
        n = rk4(f, s, h)
        if t > 0.0 and (s[1] < 0.0) != (n[1] < 0.0):
            for _ in range(5):
                h -= n[1] / f(n)[1]
                n = rk4(f, s, h)
            found.append((t + h, n[0], n[2]))
            h += 1e-9
            n = rk4(f, s, h)
        s, t = n, t + h
        need(t < 100.0, "the orbit returns")
    return found


def check_cycle(c, name):
    box = [interval(b) for b in c["candidate"]]
    centre = [midpoint(b) for b in box]
    value = [interval(v) for v in c["value_at_midpoint"]]
    slope = [[interval(v) for v in row] for row in c["derivative_on_candidate"]]
    y = [[point(v) for v in row] for row in c["preconditioner"]]
    need(y[0][0].low * y[1][1].low != y[0][1].low * y[1][0].low, f"{name}: the preconditioner is regular")
    unit = [[point(1), point(0)], [point(0), point(1)]]
    at = [value[i] - point(centre[i]) for i in range(2)]
    df = [[slope[i][j] - unit[i][j] for j in range(2)] for i in range(2)]
    for i in range(2):
        k = point(centre[i]) - (y[i][0] * at[0] + y[i][1] * at[1])
        for j in range(2):
            k = k + (unit[i][j] - (y[i][0] * df[0][j] + y[i][1] * df[1][j])) * (box[j] - point(centre[j]))
        need(k.inside(box[i]), f"{name}: Krawczyk's inclusion")
        image, p = interval(c["image"][i]), interval(c["point"][i])
        need(k.within(image) and p.within(image) and image.inside(box[i]), f"{name}: the boxes are nested")
    d = [[interval(v) for v in row] for row in c["derivative_at_point"]]
    for i in range(2):
        for j in range(2):
            need(d[i][j].meets(slope[i][j]), f"{name}: derivatives agree")
    trace, det = d[0][0] + d[1][1], d[0][0] * d[1][1] - d[0][1] * d[1][0]
    need(trace.within(interval(c["trace"])) and det.within(interval(c["determinant"])), f"{name}: trace, determinant")
    need(det.high < 1, f"{name}: det < 1")
    need(1 + det.low + trace.low > 0 and 1 + det.low - trace.high > 0, f"{name}: |trace| < 1 + det")
    crossings = c["crossings"]
    last = crossings[-1]
    need(last["upward"] and interval(last["time"]).within(interval(c["period"])), f"{name}: the last crossing closes it")
    found = turn(c["equation"], *(float(F(a + b) / 2) for a, b in ((F(p[0]), F(p[1])) for p in c["point"])), len(crossings))
    worst = 0.0
    for got, want in zip(found, crossings):
        for g, w in zip(got, [want["time"], *want["point"]]):
            worst = max(worst, abs(g - 0.5 * (w[0] + w[1])))
    need(worst < 1e-5, f"{name}: a plain integrator finds the same crossings ({worst:.1e} off)")
    return f"inclusion, stability; a plain integrator agrees to {worst:.0e}"


def check_printed_cycle(data):
    for b in data["candidate"]:
        need(interval(b).width() < F(1, 10**8), "the candidate is narrower than 1e-8")
    need(interval(data["period"]).width() < F(1, 10**9), "the period has ten digits")
    return check_cycle(data, "printed cycle")


def check_coexistence(data):
    one, three = data["period one"], data["period three"]
    need(one["equation"] == three["equation"], "one equation")
    said = [check_cycle(one, "period one"), check_cycle(three, "period three")]
    upward = [[c["point"] for c in o["crossings"] if c["upward"]] for o in (one, three)]
    need([len(u) for u in upward] == [1, 3], "one and three returns")
    points = upward[0] + upward[1]
    for i, a in enumerate(points):
        for b in points[i + 1 :]:
            need(not all(interval(p).meets(interval(q)) for p, q in zip(a, b)), "the crossings are different")
    return "; ".join(said)


def check_sensitivity(data):
    xs = [F(x) for x in data["states"]["x"]]
    need(abs(xs[0] - xs[1]) < F(1, 10**12), "the states are less than 1e-12 apart")
    second = data["crossings"][1]
    a, b = second["orbits"]
    dx, dz = ball(a["x"]) - ball(b["x"]), ball(a["z"]) - ball(b["z"])

    def least(d):
        return 0 if d.low <= 0 <= d.high else min(abs(d.low), abs(d.high))

    squared = least(dx) ** 2 + least(dz) ** 2
    need(squared > F(3, 10) ** 2, "the second crossings are more than 0.3 apart")
    return f"{float(abs(xs[0] - xs[1])):.1e} becomes {math.sqrt(squared):.4f}"


def check_crossings(data):
    said = []
    for name, count in (("printed", 24), ("reconstructed", 61)):
        text = (HERE.parent / "tests" / "data" / f"crossings-{name}.csv").read_text()
        table = list(csv.DictReader(l for l in text.splitlines() if not l.startswith("#")))
        rows = data[name]["crossings"]
        need(len(rows) == len(table) == count, f"{name}: {count} rows")
        widest, before = F(0), F(0)
        for n, (row, want) in enumerate(zip(rows, table), 1):
            slack = F(want["uncertainty"])
            for key, column in (("time", "t"), ("x", "x"), ("z", "z")):
                b, w = ball(row[key]), F(want[column])
                # The table has 16 or 17 digits.
                room = slack + abs(w) / 10**15
                need(b.low - room <= w <= b.high + room, f"{name}, row {n}: {column}")
                widest = max(widest, b.width())
            need(row["upward"] == (want["direction"] == "up"), f"{name}, row {n}: direction")
            need(ball(row["time"]).low > before, f"{name}, row {n}: times grow")
            before = ball(row["time"]).high
        said.append(f"{name}: {count} rows, widest {float(widest):.1e}")
    return "; ".join(said)


CHECKS = {
    "printed-cycle": check_printed_cycle,
    "coexistence": check_coexistence,
    "sensitivity": check_sensitivity,
    "crossings": check_crossings,
}


def main():
    failed = False
    for name, check in CHECKS.items():
        try:
            certificate = json.loads((HERE / "certificates" / f"{name}.json").read_text())
            need(certificate["theorem"] == name, "the certificate is this theorem's")
            print(f"{name}: checked ({check(certificate['data'])})")
        except (Failed, KeyError, ValueError, OSError) as e:
            failed = True
            print(f"{name}: FAILED: {e}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
