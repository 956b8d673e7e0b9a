// The problems of `make bench-work-precision` (README.md) by Boost.odeint, CVODE and ARKODE.
//
//     g++ -O3 -march=native -std=c++17 peers.cpp -o peers -lsundials_cvode -lsundials_arkode -lsundials_nvecserial
//     ./peers w1-a 1e-4 1e-6 1e-8
//
// Prints CSV: problem, program, tolerance, seconds, steps, final state. A run is repeated until 0.05 s of processor time have gone,
// three times; the least mean is printed. Events are written as a user writes them: one terminal event at a time, the mode by hand.
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <deque>
#include <functional>
#include <string>
#include <vector>

#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

using State = std::array<double, 3>;
namespace ode = boost::numeric::odeint;

enum Mode { Smooth, Plus, Minus, Slide, RelayPlus, RelayMinus };

struct Field {
    double alpha, beta;
    Mode mode;
    void operator()(const State &s, State &d, double) const { eval(s.data(), d.data()); }
    void eval(const double *s, double *d) const {
        const double x = s[0], y = s[1], z = s[2];
        if (mode >= RelayPlus) {
            d[0] = y - x, d[1] = z - y, d[2] = (mode == RelayPlus ? -1.0 : 1.0) - z;
            return;
        }
        const double phi = mode == Smooth ? 0.5 * (1.0 + std::tanh(x / 1e-3)) : mode == Plus ? 1.0 : mode == Minus ? 0.0 : z / (y + z);
        const double r2 = x * x + y * y + z * z;
        d[0] = mode == Slide ? 0.0 : z + (-y - z) * phi;
        d[1] = -1.4 + 2.4 * phi + (alpha - beta * y) * r2;
        d[2] = 1.0 - 2.2 * phi + (alpha - beta * z) * r2;
    }
};

// side (x - offset), or y z where a run slides; an event where it falls below zero.
struct Event {
    double side, offset;
    bool sliding;
    double operator()(const double *s) const { return sliding ? s[1] * s[2] : side * (s[0] - offset); }
};

// One integration after another, each with one terminal event or none: `until` moves t and x to the event (true) or to `end`.
struct Method {
    virtual ~Method() = default;
    virtual bool until(const Field &field, const Event *event, double &t, State &x, double end) = 0;
    // Before a run.
    virtual void begin() {}
    bool has_events = true;
    long steps = 0;
};

template <class Stepper>
struct Dense : Method {
    Stepper stepper;
    double first = 1e-3;
    explicit Dense(Stepper stepper) : stepper(stepper) {}
    void begin() override { first = 1e-3; }
    bool until(const Field &field, const Event *event, double &t, State &x, double end) override {
        stepper.initialize(x, t, std::min(first, end - t));
        while (true) {
            stepper.do_step(field);
            ++steps;
            const double t0 = stepper.previous_time(), t1 = std::min(stepper.current_time(), end);
            State at = stepper.current_state();
            if (t1 == end) stepper.calc_state(end, at);
            if (event && (*event)(at.data()) < 0.0) {
                // Regula falsi, Illinois variant, to the last bits.
                double a = t0, b = t1, ga = (*event)(stepper.previous_state().data()), gb = (*event)(at.data());
                for (int i = 0; i < 60; ++i) {
                    const double m = b - gb * (b - a) / (gb - ga);
                    stepper.calc_state(m, at);
                    const double g = (*event)(at.data());
                    const double moved = std::abs(m - b);
                    if ((g < 0.0) != (gb < 0.0)) a = b, ga = gb;
                    else ga *= 0.5;
                    b = m, gb = g;
                    if (g == 0.0 || moved <= 1e-15 * std::abs(m)) break;
                }
                first = stepper.current_time_step();
                t = b, x = at;
                return true;
            }
            if (t1 == end) {
                first = stepper.current_time_step();
                t = end, x = at;
                return false;
            }
        }
    }
};

// Without dense output, so without events: the step that ends at the end is made to.
template <class Controlled>
struct ToTheEnd : Method {
    Controlled stepper;
    explicit ToTheEnd(Controlled stepper) : stepper(stepper) { has_events = false; }
    bool until(const Field &field, const Event *, double &t, State &x, double end) override {
        double h = std::min(1e-3, end - t);
        while (t < end) {
            if (t + h > end || end - t - h < 1e-14 * end) h = end - t;
            if (stepper.try_step(field, x, t, h) == ode::success) {
                ++steps;
                if (end - t < 1e-14 * end) t = end;
            }
        }
        return false;
    }
};

struct Asked {
    Field field;
    const Event *event;
};
static int rhs(double, N_Vector s, N_Vector d, void *data) {
    static_cast<const Asked *>(data)->field.eval(N_VGetArrayPointer(s), N_VGetArrayPointer(d));
    return 0;
}
static int root(double, N_Vector s, double *g, void *data) {
    g[0] = (*static_cast<const Asked *>(data)->event)(N_VGetArrayPointer(s));
    return 0;
}

struct Sundials : Method {
    SUNContext context;
    N_Vector v;
    Asked asked{};
    int roots = 0;
    Sundials() {
        SUNContext_Create(nullptr, &context);
        v = N_VNew_Serial(3, context);
    }
    virtual void restart(double t) = 0;
    virtual int evolve(double end, double *t) = 0;
    virtual long taken() = 0;
    virtual void watch(int number) = 0;
    bool until(const Field &field, const Event *event, double &t, State &x, double end) override {
        asked = {field, event};
        std::copy(x.begin(), x.end(), N_VGetArrayPointer(v));
        restart(t);
        if (roots != (event ? 1 : 0)) watch(roots = event ? 1 : 0);
        bool hit = false;
        while (t < end && !hit) {
            const int flag = evolve(end, &t);
            if (flag < 0) throw std::string("gives up: ") + std::to_string(flag);
            hit = flag == 2;
        }
        std::copy_n(N_VGetArrayPointer(v), 3, x.begin());
        steps += taken();
        return hit;
    }
};

struct Cvode : Sundials {
    void *memory;
    Cvode(bool adams, double tolerance) {
        memory = CVodeCreate(adams ? CV_ADAMS : CV_BDF, context);
        CVodeInit(memory, rhs, 0.0, v);
        CVodeSStolerances(memory, tolerance, tolerance);
        if (adams) {
            CVodeSetNonlinearSolver(memory, SUNNonlinSol_FixedPoint(v, 0, context));
        } else {
            SUNMatrix matrix = SUNDenseMatrix(3, 3, context);
            CVodeSetLinearSolver(memory, SUNLinSol_Dense(v, matrix, context), matrix);
        }
        CVodeSetUserData(memory, &asked);
        CVodeSetMaxStep(memory, 10.0);
        CVodeSetMaxNumSteps(memory, 100000000);
        CVodeSetNoInactiveRootWarn(memory);
    }
    ~Cvode() override { CVodeFree(&memory); }
    void restart(double t) override { CVodeReInit(memory, t, v); }
    int evolve(double end, double *t) override {
        CVodeSetStopTime(memory, end);
        return CVode(memory, end, v, t, CV_NORMAL);
    }
    long taken() override {
        long n;
        CVodeGetNumSteps(memory, &n);
        return n;
    }
    void watch(int number) override {
        CVodeRootInit(memory, number, root);
        int down = -1;
        if (number) CVodeSetRootDirection(memory, &down);
    }
};

struct Erk : Sundials {
    void *memory;
    explicit Erk(double tolerance) {
        memory = ERKStepCreate(rhs, 0.0, v, context);
        ERKStepSStolerances(memory, tolerance, tolerance);
        ERKStepSetTableNum(memory, ARKODE_FEHLBERG_13_7_8);
        ERKStepSetUserData(memory, &asked);
        ERKStepSetMaxStep(memory, 10.0);
        ERKStepSetMaxNumSteps(memory, 100000000);
        ERKStepSetMaxErrTestFails(memory, 100);
    }
    ~Erk() override { ERKStepFree(&memory); }
    void restart(double t) override { ERKStepReInit(memory, rhs, t, v); }
    int evolve(double end, double *t) override {
        ERKStepSetStopTime(memory, end);
        return ERKStepEvolve(memory, end, v, t, ARK_NORMAL);
    }
    long taken() override {
        long n;
        ERKStepGetNumSteps(memory, &n);
        return n;
    }
    void watch(int number) override {
        ERKStepRootInit(memory, number, root);
        int down = -1;
        if (number) ERKStepSetRootDirection(memory, &down);
    }
};

static State smooth(Method &m, double alpha, double beta, State x, double end) {
    double t = 0.0;
    m.until({alpha, beta, Smooth}, nullptr, t, x, end);
    return x;
}

static State sliding(Method &m, double end) {
    State x{0.2, 0.0, -1.0};
    double t = 0.0;
    Mode mode = Plus;
    while (true) {
        const Event event{mode == Minus ? -1.0 : 1.0, 0.0, mode == Slide};
        if (!m.until({1e-1, 1e-4, mode}, &event, t, x, end)) return x;
        x[0] = 0.0;
        // f+ leads down where y > 0, f- leads up where z > 0; this orbit does not stop sliding.
        mode = x[1] > 0.0 && x[2] > 0.0 ? Slide : x[1] > 0.0 ? Minus : Plus;
    }
}

static State hysteresis(Method &m, double end) {
    State x{0.3, 0.0, 0.0};
    double t = 0.0;
    bool plus = true;
    while (true) {
        const Event event = plus ? Event{1.0, -0.1, false} : Event{-1.0, 0.1, false};
        if (!m.until({0.0, 0.0, plus ? RelayPlus : RelayMinus}, &event, t, x, end)) return x;
        x[0] = event.offset;
        plus = !plus;
    }
}

static State late(Method &m, double end) {
    State x{0.2, 0.0, -1.0};
    double t = 0.0, side = 1.0;
    bool plus = true;
    std::deque<double> coming;
    while (t < end) {
        const double next = coming.empty() ? end : std::min(coming.front(), end);
        const Event event{side, 0.0, false};
        if (m.until({1e-1, 1e-4, plus ? Plus : Minus}, &event, t, x, next)) {
            x[0] = 0.0;
            side = -side;
            coming.push_back(t + 1e-2);
        } else if (!coming.empty() && next == coming.front()) {
            coming.pop_front();
            plus = !plus;
        }
    }
    return x;
}

static double seconds() {
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

static void measure(const std::string &problem, const char *program, double tolerance, Method &m) {
    const bool events = problem == "sliding" || problem == "hysteresis" || problem == "delay";
    if (events && !m.has_events) return;
    const auto run = [&]() -> State {
        m.begin();
        m.steps = 0;
        if (problem == "w1-a") return smooth(m, 1e-3, 1e-5, {0.2, 0.0, -1.0}, 54.0);
        if (problem == "w1-b") return smooth(m, 1e-1, 1e-4, {0.2, 0.0, -1.0}, 13.0);
        if (problem == "periodic")
            return smooth(m, 1e-3, 1e-5, {17.057344142481766, 0.0, -0.015417177803876677}, 101.23977502156168);
        if (problem == "sliding") return sliding(m, 13.0);
        if (problem == "hysteresis") return hysteresis(m, 60.0);
        if (problem == "delay") return late(m, 13.0);
        throw std::string("no such problem");
    };
    try {
        const State end = run();
        const long steps = m.steps;
        double best = 1e300;
        long count = 1;
        for (int round = 0; round < 3;) {
            const double start = seconds();
            for (long i = 0; i < count; ++i) run();
            const double took = seconds() - start;
            if (took >= 0.05) {
                best = std::min(best, took / double(count));
                ++round;
            } else {
                count = std::clamp(long(0.065 / std::max(took / double(count), 1e-9)), count + 1, 10 * count);
            }
        }
        std::printf("%s,\"%s\",%g,%.4e,%ld,%.17g,%.17g,%.17g\n", problem.c_str(), program, tolerance, best, steps, end[0], end[1], end[2]);
        std::fflush(stdout);
    } catch (const std::string &why) {
        std::fprintf(stderr, "%s,%s,%g: %s\n", problem.c_str(), program, tolerance, why.c_str());
    } catch (const std::exception &why) {
        std::fprintf(stderr, "%s,%s,%g: %s\n", problem.c_str(), program, tolerance, why.what());
    }
}

int main(int argc, char **argv) {
    const std::string problem = argc > 1 ? argv[1] : "";
    for (int i = 2; i < argc; ++i) {
        const double tol = std::atof(argv[i]);
        {
            auto stepper = ode::make_dense_output(tol, tol, 10.0, ode::runge_kutta_dopri5<State>());
            Dense<decltype(stepper)> m(stepper);
            measure(problem, "Boost dopri5", tol, m);
        }
        {
            auto stepper = ode::make_controlled(tol, tol, ode::runge_kutta_fehlberg78<State>());
            ToTheEnd<decltype(stepper)> m(stepper);
            measure(problem, "Boost fehlberg78", tol, m);
        }
        {
            ode::bulirsch_stoer_dense_out<State> stepper(tol, tol, 1.0, 1.0);
            Dense<decltype(stepper)> m(stepper);
            measure(problem, "Boost Bulirsch-Stoer", tol, m);
        }
        {
            Cvode m(true, tol);
            measure(problem, "CVODE Adams", tol, m);
        }
        {
            Cvode m(false, tol);
            measure(problem, "CVODE BDF", tol, m);
        }
        {
            Erk m(tol);
            measure(problem, "ARKODE ERK 8(7)", tol, m);
        }
    }
}
