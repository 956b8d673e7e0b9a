"""End states of the problems in closed form or by Taylor series of 50 digits: reference.csv.

    python reference.py PROGRAM

PROGRAM is our program, whose method `taylor-extended` gives the end states of the problems that are
smooth or switch late. The hysteresis is computed a second time here, from its linear flows, and the
sliding motion, which that method does not follow, by Taylor series of 50 digits and hand-written
events.
"""

import csv
import pathlib
import subprocess
import sys

from mpmath import exp, findroot, mp, mpf

mp.dps = 50
HERE = pathlib.Path(__file__).parent


def series(field, s, degree):
    """Taylor coefficients of a solution, one list a state."""
    parts = [[c] for c in s]
    for k in range(degree):
        for part, slope in zip(parts, field(parts, k)):
            part.append(slope / (k + 1))
    return parts


def product(a, b, k):
    return sum((a[i] * b[k - i] for i in range(k + 1)), mpf(0))


def caricature(mode):
    alpha, beta = mpf("0.1"), mpf("0.0001")
    squares, phis = [], []

    def field(s, k):
        if k == 0:
            squares.clear()
            phis.clear()
        x, y, z = s
        squares.append(product(x, x, k) + product(y, y, k) + product(z, z, k))
        if mode == "slide":
            # phi (y + z) = z, coefficient by coefficient.
            whole = [a + b for a, b in zip(y, z)]
            known = sum((phis[i] * whole[k - i] for i in range(k)), mpf(0))
            phis.append((z[k] - known) / whole[0])
        else:
            phis.append(mpf(mode == "plus" and k == 0))
        constant = 1 if k == 0 else 0
        phi = phis[k]
        dx = {"plus": -y[k], "minus": z[k], "slide": mpf(0)}[mode]
        dy = mpf("-1.4") * constant + mpf("2.4") * phi
        dz = constant - mpf("2.2") * phi
        dy += alpha * squares[k] - beta * product(y, squares, k)
        dz += alpha * squares[k] - beta * product(z, squares, k)
        return dx, dy, dz

    return field


def sliding(step=mpf(1) / 50, degree=36):
    t, s, mode, end = mpf(0), [mpf("0.2"), mpf(0), mpf(-1)], "plus", mpf(13)
    at = lambda parts, h: [sum(c * h**i for i, c in enumerate(p)) for p in parts]
    while t < end:
        h = min(step, end - t)
        parts = series(caricature(mode), s, degree)
        to = at(parts, h)
        if mode != "slide" and (to[0] < 0) == (mode == "plus"):
            low, high = mpf(0), h
            for _ in range(170):
                middle = (low + high) / 2
                outside = (at(parts, middle)[0] < 0) == (mode == "plus")
                low, high = (low, middle) if outside else (middle, high)
            h, to = high, at(parts, high)
            to[0] = mpf(0)
            mode = "slide" if to[1] > 0 and to[2] > 0 else "minus" if to[1] > 0 else "plus"
        t, s = t + h, to
    return s


def hysteresis():
    """p' = q - p, q' = r - q, r' = u - r: (u + a) etc. times exp(-t)."""
    t, s, u = mpf(0), [mpf("0.3"), mpf(0), mpf(0)], mpf(-1)
    end, band = mpf(60), mpf("0.1")

    def flow(h):
        p, q, r = (c - u for c in s)
        e = exp(-h)
        return [u + e * (p + h * q + h * h / 2 * r), u + e * (q + h * r), u + e * r]

    while True:
        h = mpf(0)
        # The first place where p comes to the far edge of the band.
        while u * (flow(h)[0] - u * band) < 0 and t + h < end:
            h += mpf(1) / 200
        if t + h >= end and u * (flow(end - t)[0] - u * band) < 0:
            return flow(end - t)
        h = findroot(lambda h: flow(h)[0] - u * band, (h - mpf(1) / 200, h), solver="anderson")
        t, s, u = t + h, flow(h), -u


def main():
    printed = subprocess.run([sys.argv[1], "reference"], capture_output=True, text=True, check=True)
    rows = {row[0]: row[5:] for row in csv.reader(printed.stdout.splitlines())}
    linear = hysteresis()
    assert all(abs(mpf(a) - b) < 1e-15 for a, b in zip(rows["hysteresis"], linear)), linear
    rows["sliding"] = [repr(float(c)) for c in sliding()]
    with open(HERE / "reference.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["problem", "x", "y", "z"])
        out.writerows([name, *state] for name, state in rows.items())


main()
