// Units of work W0, W1 and W2 (benches/README.md) with Boost.odeint's Dormand-Prince 5(4) and its dense output.
//
//     g++ -O3 -march=native -std=c++17 boost_dopri5.cpp -o boost_dopri5 && ./boost_dopri5 W1 A 5
//
// Prints: peer, unit, set, the least seconds of processor time of the given number of runs, steps, crossings, final state of the last run.
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

using State = std::array<double, 3>;
namespace ode = boost::numeric::odeint;

struct Caricature {
    double alpha, beta, eps = 1e-3, v_plus = -1.2, v_minus = -1.4;
    void operator()(const State &s, State &d, double) const {
        const auto [x, y, z] = s;
        const double phi = 0.5 * (1.0 + std::tanh(x / eps));
        const double r2 = x * x + y * y + z * z;
        d[0] = z + (-y - z) * phi;
        d[1] = v_minus + (1.0 - v_minus) * phi + (alpha - beta * y) * r2;
        d[2] = 1.0 + (v_plus - 1.0) * phi + (alpha - beta * z) * r2;
    }
};

constexpr double tolerance = 1.0536712e-8;

struct Result {
    std::uint64_t steps = 0, crossings = 0;
    State end{};
    double sum = 0.0;
};

template <bool section>
void run(const Caricature &field, State x, double t_end, double every, double cap, Result &result) {
    auto stepper = ode::make_dense_output(tolerance, tolerance, cap, ode::runge_kutta_dopri5<State>());
    double t = 0.0;
    while (t < t_end) {
        const double end = std::min(t + every, t_end);
        stepper.initialize(x, t, 1e-3);
        do {
            stepper.do_step(field);
            ++result.steps;
            if (section) {
                const double t0 = stepper.previous_time(), t1 = std::min(stepper.current_time(), end);
                double ya = stepper.previous_state()[1], yb = stepper.current_state()[1];
                State at;
                if (t1 == end) {
                    stepper.calc_state(end, at);
                    yb = at[1];
                }
                if ((ya < 0.0) != (yb < 0.0)) {
                    // Regula falsi, Illinois variant, to the last bits.
                    double a = t0, b = t1;
                    for (int i = 0; i < 60; ++i) {
                        const double m = b - yb * (b - a) / (yb - ya);
                        stepper.calc_state(m, at);
                        if (at[1] == 0.0 || std::abs(m - b) <= 1e-15 * std::abs(b)) break;
                        if ((at[1] < 0.0) != (yb < 0.0)) {
                            a = b;
                            ya = yb;
                        } else {
                            ya *= 0.5;
                        }
                        b = m;
                        yb = at[1];
                    }
                    ++result.crossings;
                    result.sum += at[0] + at[2];
                }
            }
        } while (stepper.current_time() < end);
        stepper.calc_state(end, x);
        t = end;
    }
    result.end = x;
}

int main(int argc, char **argv) {
    if (argc != 4) {
        std::fprintf(stderr, "usage: boost_dopri5 W0|W1|W2 A|B REPEATS\n");
        return 2;
    }
    const bool a = std::strcmp(argv[2], "A") == 0;
    const Caricature field{a ? 1e-3 : 1e-1, a ? 1e-5 : 1e-4};
    double best = 1e300;
    Result result;
    for (int i = 0; i < std::atoi(argv[3]); ++i) {
        const std::clock_t start = std::clock();
        result = {};
        if (std::strcmp(argv[1], "W1") == 0) {
            run<true>(field, {0.2, 0.0, -1.0}, 2e5, 100.0, 10.0, result);
        } else if (std::strcmp(argv[1], "W0") == 0) {
            run<false>(field, {0.2, 0.0, -1.0}, 10.0, 10.0, 10.0, result);
        } else {
            for (int k = 0; k < 1000; ++k) {
                run<false>(field, {0.1 + 0.2 * (k + 0.5) / 1000.0, 0.0, -1.0}, 2000.0, 2000.0, 10.0, result);
                result.sum += result.end[0];
            }
        }
        best = std::min(best, double(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::printf("boost-dopri5 %s %s %.6f %llu %llu %.17g %.17g %.17g\n", argv[1], argv[2], best,
                (unsigned long long)result.steps, (unsigned long long)result.crossings, result.end[0], result.end[1],
                result.end[2]);
}
