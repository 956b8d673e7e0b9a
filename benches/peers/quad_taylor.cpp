// Unit of work W3 (benches/README.md) with Taylor series in __float128, the compiler's 113-bit numbers: the recurrences are written out for the
// caricature, and the steps are those of our own method (crates/integrate/src/taylor.rs), so that arithmetic is compared with arithmetic.
//
//     quad_taylor W3 B 3
//
// Prints: peer, unit, set, the least seconds of processor time of the given number of runs, steps, crossings, final state of the last run.

#include <quadmath.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>

using quad = __float128;

// 1 - ln(1e-30)/2, rounded up (Jorba & Zou 2005, sec. 3).
constexpr int P = 36;
constexpr double TOLERANCE = 1e-30;
using Series = quad[P + 1];

static quad product(const Series a, const Series b, int k) {
    quad sum = 0;
    for (int j = 0; j <= k; ++j) sum += a[j] * b[k - j];
    return sum;
}

static quad square(const Series a, int k) {
    quad sum = 0;
    for (int j = 0; 2 * j < k; ++j) sum += a[j] * a[k - j];
    sum *= 2;
    if (k % 2 == 0) sum += a[k / 2] * a[k / 2];
    return sum;
}

// How far, and how fast at most, the argument of tanh moves in the time s.
static double travel(const double* w, double s) {
    double sum = 0;
    for (int k = P - 1; k >= 1; --k) sum = (sum + std::fabs(w[k])) * s;
    return sum;
}

static double speed(const double* w, double s) {
    double sum = 0;
    for (int k = P - 1; k >= 1; --k) sum = sum * s + k * std::fabs(w[k]);
    return sum;
}

static double value(const double* w, double s) {
    double sum = 0;
    for (int k = P - 1; k >= 0; --k) sum = sum * s + w[k];
    return sum;
}

static double stride_time(const double* w, double stride, double h) {
    if (travel(w, h) <= stride) return h;
    double s = std::min(h, stride / std::fabs(w[1]));
    for (int i = 0; i < 50; ++i) {
        double excess = travel(w, s) - stride;
        if (excess <= 1e-3 * stride) break;
        s -= excess / speed(w, s);
    }
    return s;
}

static double layer_step(const double* w, double h) {
    const double edge = 0.5 * std::log(2.0 / TOLERANCE), distance = std::fabs(w[0]);
    if (distance >= edge + 1.0) {
        double fastest = speed(w, h), s = 0;
        for (int i = 0; i < 100; ++i) {
            double room = std::fabs(value(w, s)) - edge - 0.25;
            if (room < 0.5) return s;
            s += room / fastest;
            if (s >= h) return h;
        }
        return s;
    }
    double always = stride_time(w, 0.5, h);
    double r = std::min(0.5 * (P + 1), distance - 0.5);
    if (always >= h || r <= 0.5) return always;
    double q = std::min(0.5, std::exp((std::log(TOLERANCE) - 1.8449695 + 2 * (distance - r)) / (P + 1)));
    return std::max(always, q * stride_time(w, r, h / q));
}

int main(int argc, char** argv) {
    if (argc < 4 || std::strcmp(argv[1], "W3") != 0) return 2;
    const bool set_a = argv[2][0] == 'A';
    const quad alpha = set_a ? 1e-3 : 1e-1, beta = set_a ? 1e-5 : 1e-4, eps = 1e-3;
    const double t_end = 300;
    double best = std::numeric_limits<double>::infinity();
    long steps = 0;
    quad state[3];
    for (int run = 0; run < std::atoi(argv[3]); ++run) {
        std::clock_t begin = std::clock();
        state[0] = quad(0.2), state[1] = 0, state[2] = -1;
        quad t = 0;
        steps = 0;
        while (t < t_end) {
            Series x, y, z, w, u, v, phi, l, lphi, r2, ay, az, py, pz;
            x[0] = state[0], y[0] = state[1], z[0] = state[2];
            for (int k = 0; k < P; ++k) {
                w[k] = x[k] / eps;
                if (k == 0) {
                    u[0] = tanhq(w[0]);
                    v[0] = (1 - u[0]) * (1 + u[0]);
                } else {
                    quad sum = 0;
                    for (int j = 1; j <= k; ++j) sum += j * w[j] * v[k - j];
                    u[k] = sum / k;
                    v[k] = -square(u, k);
                }
                phi[k] = u[k] / 2;
                if (k == 0) phi[0] += quad(1) / 2;
                l[k] = -y[k] - z[k];
                lphi[k] = product(l, phi, k);
                r2[k] = square(x, k) + square(y, k) + square(z, k);
                ay[k] = -beta * y[k];
                az[k] = -beta * z[k];
                if (k == 0) ay[0] += alpha, az[0] += alpha;
                py[k] = product(ay, r2, k);
                pz[k] = product(az, r2, k);
                quad fx = z[k] + lphi[k], fy = quad(2.4) * phi[k] + py[k], fz = quad(-2.2) * phi[k] + pz[k];
                if (k == 0) fy += quad(-1.4), fz += 1;
                x[k + 1] = fx / (k + 1), y[k + 1] = fy / (k + 1), z[k + 1] = fz / (k + 1);
            }
            double h = std::numeric_limits<double>::infinity();
            for (int k : {P - 1, P}) {
                double size = 0;
                for (const quad* s : {x, y, z}) {
                    double scale = TOLERANCE * (1 + std::fabs(double(s[0])));
                    size = std::max(size, std::fabs(double(s[k])) / scale);
                }
                h = std::min(h, std::pow(size, -1.0 / k));
            }
            h *= std::exp(-0.7 / (P - 1));
            double rounded[P];
            for (int k = 0; k < P; ++k) rounded[k] = double(w[k]);
            h = layer_step(rounded, std::min({h, 10.0, double(quad(t_end) - t)}));
            const bool last = h * 1.0000001 >= double(quad(t_end) - t);
            const quad step = last ? quad(t_end) - t : quad(h);
            const quad* all[3] = {x, y, z};
            for (int i = 0; i < 3; ++i) {
                quad sum = 0;
                for (int k = P; k >= 0; --k) sum = sum * step + all[i][k];
                state[i] = sum;
            }
            t = last ? quad(t_end) : t + step;
            ++steps;
        }
        best = std::min(best, double(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    std::printf("quad-taylor W3 %s %.6f %ld 0 %.17g %.17g %.17g\n", argv[2], best, steps, double(state[0]), double(state[1]),
                double(state[2]));
}
