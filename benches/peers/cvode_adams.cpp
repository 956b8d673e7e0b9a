// Units of work W0 and W1 (benches/README.md) with SUNDIALS' CVODE: Adams with functional iteration, y = 0 as its root function.
//
//     g++ -O3 -march=native -std=c++17 cvode_adams.cpp -o cvode_adams -lsundials_cvode -lsundials_nvecserial -lsundials_sunnonlinsolfixedpoint && ./cvode_adams W1 A 5
//
// Prints: peer, unit, set, the least seconds of processor time of the given number of runs, steps, crossings, final state of the last run.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

struct Caricature {
    double alpha, beta;
};

static int field(double, N_Vector s, N_Vector d, void *data) {
    const auto *c = static_cast<const Caricature *>(data);
    const double *v = N_VGetArrayPointer(s);
    double *out = N_VGetArrayPointer(d);
    const double phi = 0.5 * (1.0 + std::tanh(v[0] / 1e-3));
    const double r2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    out[0] = v[2] + (-v[1] - v[2]) * phi;
    out[1] = -1.4 + (1.0 + 1.4) * phi + (c->alpha - c->beta * v[1]) * r2;
    out[2] = 1.0 + (-1.2 - 1.0) * phi + (c->alpha - c->beta * v[2]) * r2;
    return 0;
}

static int section(double, N_Vector s, double *g, void *) {
    g[0] = N_VGetArrayPointer(s)[1];
    return 0;
}

int main(int argc, char **argv) {
    if (argc != 4 || (std::strcmp(argv[1], "W0") != 0 && std::strcmp(argv[1], "W1") != 0)) {
        std::fprintf(stderr, "usage: cvode_adams W1 A|B REPEATS\n");
        return 2;
    }
    const bool a = std::strcmp(argv[2], "A") == 0;
    Caricature c{a ? 1e-3 : 1e-1, a ? 1e-5 : 1e-4};
    SUNContext context;
    SUNContext_Create(nullptr, &context);
    N_Vector x = N_VNew_Serial(3, context);
    double *v = N_VGetArrayPointer(x);
    double best = 1e300;
    long steps = 0, crossings = 0;
    for (int i = 0; i < std::atoi(argv[3]); ++i) {
        const std::clock_t start = std::clock();
        steps = crossings = 0;
        v[0] = 0.2, v[1] = 0.0, v[2] = -1.0;
        void *cvode = CVodeCreate(CV_ADAMS, context);
        CVodeInit(cvode, field, 0.0, x);
        CVodeSStolerances(cvode, 1.0536712e-8, 1.0536712e-8);
        SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(x, 0, context);
        CVodeSetNonlinearSolver(cvode, solver);
        CVodeSetUserData(cvode, &c);
        CVodeSetMaxStep(cvode, 10.0);
        CVodeSetMaxNumSteps(cvode, 100000000);
        CVodeRootInit(cvode, 1, section);
        CVodeSetNoInactiveRootWarn(cvode);
        // W0 ends at t = 10.
        const bool short_run = std::strcmp(argv[1], "W0") == 0;
        for (int segment = 0; segment < (short_run ? 1 : 2000); ++segment) {
            double t = 100.0 * segment;
            const double end = short_run ? 10.0 : t + 100.0;
            if (segment > 0) CVodeReInit(cvode, t, x);
            CVodeSetStopTime(cvode, end);
            while (t < end) {
                const int flag = CVode(cvode, end, x, &t, CV_NORMAL);
                if (flag < 0) return 1;
                if (flag == CV_ROOT_RETURN) ++crossings;
            }
            long taken;
            CVodeGetNumSteps(cvode, &taken);
            steps += taken;
        }
        CVodeFree(&cvode);
        SUNNonlinSolFree(solver);
        best = std::min(best, double(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::printf("cvode-adams %s %s %.6f %ld %ld %.17g %.17g %.17g\n", argv[1], argv[2], best, steps, crossings, v[0], v[1], v[2]);
}
