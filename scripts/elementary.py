#!/usr/bin/env python3
"""The polynomials of crates/num/src/elementary/kernels.rs, computed with 300 bits (needs mpmath).

Each interpolates its function at Chebyshev nodes; printed with the largest error of the rounded
coefficients, relative to what the kernel adds it to, as a power of two.
"""
from mpmath import (
    atanh,
    cos,
    exp,
    floor,
    frexp,
    ldexp,
    log,
    lu_solve,
    matrix,
    mp,
    mpf,
    nstr,
    pi,
    polyval,
    sqrt,
    tanh,
)

mp.prec = 300


def fit(f, a, b, degree):
    n = degree + 1
    nodes = [(a + b) / 2 + (b - a) / 2 * cos(pi * (2 * i + 1) / (2 * n)) for i in range(n)]
    system = matrix(n, n)
    values = matrix(n, 1)
    for i, x in enumerate(nodes):
        values[i] = f(x)
        for j in range(n):
            system[i, j] = x**j
    return [mpf(float(c)) for c in lu_solve(system, values)]


def report(name, f, a, b, degree, weight):
    c = fit(f, a, b, degree)
    points = [a + (b - a) * i / 2000 for i in range(2001)]
    worst = max(abs((polyval(c[::-1], x) - f(x)) * weight(x)) for x in points)
    print(f"{name}: error 2^{nstr(log(worst, 2), 5)}")
    for v in c:
        print(f"    {float(v)!r}")


def split(name, value, bits):
    mantissa, exponent = frexp(value)
    first = ldexp(floor(ldexp(mantissa, bits)), exponent - bits)
    print(f"{name}: {float(first)!r} + {float(value - first)!r}")


def near_zero(value, function):
    return lambda x: value if abs(x) < mpf(10) ** -40 else function(x)


ln2 = log(2)
wider = mpf(1.0001)
s = ln2 / 4 * wider
report(
    "P (tanh)",
    near_zero(mpf(-1) / 3, lambda u: (tanh(sqrt(u)) - sqrt(u)) / sqrt(u) ** 3),
    mpf(0),
    s**2,
    6,
    lambda u: u,
)
r = ln2 / 2 * wider
report(
    "Q (exp)", near_zero(mpf(1) / 2, lambda x: (exp(x) - 1 - x) / x**2), -r, r, 10, lambda x: x * x
)
h = wider / 2
report("G (2^x)", near_zero(ln2, lambda x: (mpf(2) ** x - 1) / x), -h, h, 9, abs)
m = (sqrt(2) - 1) / (sqrt(2) + 1) * wider
report(
    "L (log2)",
    near_zero(2 / ln2, lambda u: 2 * atanh(sqrt(u)) / ln2 / sqrt(u)),
    mpf(0),
    m**2,
    6,
    sqrt,
)
split("ln(2)/2", ln2 / 2, 44)
split("ln 2", ln2, 41)
