// A second opinion on proofs/printed_cycle.rs: the same theorem, proved with CAPD::DynSys (Kapela, Mrozek, Wilczak, Zgliczynski 2021,
// https://github.com/CAPDGroup/CAPD): its intervals, its Taylor series, its C1 sets, its section map. No line of this project's library takes part.
//
// Theorem. For alpha = 1e-3, beta = 1e-5, eps = 1e-3, v+ = -1.2, v- = -1.4 and the tanh transition, the smoothed caricature (eqs. 5, 8, 9 of Jeffrey 2013)
// has exactly one closed orbit that crosses y = 0 upwards in the box below and returns to it at its first upward crossing. It attracts.
//
// The transition. CAPD has no tanh. (1 + tanh(x/eps))/2 is written in two ways, as the same function exactly: 1/(1 + e) with e = exp(-2x/eps), which cannot overflow
// where x > 0, and e/(1 + e) with e = exp(2x/eps), where x < 0. Both are good to |x| = 0.3 on the other side; a step uses the one of the side that it begins
// on. tanh is not carried as a state: T' = (1 - T^2) x'/eps is unstable by exp(2 |x|/eps) where the orbit comes in from far outside the layer.
//
// Usage: printed_cycle [ORDER [TOLERANCE]] ; printed_cycle crossings FILE ALPHA ROWS [ORDER [TOLERANCE]]

#include <ctime>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "capd/capdlib.h"

using namespace capd;
using capd::autodiff::Node;

// Parameters: alpha, beta, v+, v-, 2/eps.
static const int ALPHA = 0, BETA = 1, V_PLUS = 2, V_MINUS = 3, SHARPNESS = 4, PARAMETERS = 5;

static void field(Node in[], Node out[], Node par[], Node phi, Node other) {
  Node x = in[0], y = in[1], z = in[2];
  Node r = sqr(x) + sqr(y) + sqr(z);
  out[0] = z * other - y * phi;
  out[1] = phi + par[V_MINUS] * other + (par[ALPHA] - par[BETA] * y) * r;
  out[2] = par[V_PLUS] * phi + other + (par[ALPHA] - par[BETA] * z) * r;
}

static void from_right(Node, Node in[], int, Node out[], int, Node par[], int) {
  Node e = exp(-(par[SHARPNESS] * in[0]));
  Node phi = 1 / (1 + e);
  field(in, out, par, phi, e * phi);
}

static void from_left(Node, Node in[], int, Node out[], int, Node par[], int) {
  Node e = exp(par[SHARPNESS] * in[0]);
  Node other = 1 / (1 + e);
  field(in, out, par, e * other, other);
}

struct Crossing {
  interval time;
  IVector point;
  IMatrix derivative;
  bool upward;
};

static interval ratio(double a, double b) { return interval(a) / interval(b); }

// The flow of the smoothed caricature.
class Flow {
public:
  Flow(interval alpha, int order, double tolerance)
      : fields{IMap(from_left, 3, 3, PARAMETERS), IMap(from_right, 3, 3, PARAMETERS)}, solvers{IOdeSolver(fields[0], order), IOdeSolver(fields[1], order)}, section(3, 1) {
    for (int side = 0; side < 2; ++side) {
      fields[side].setParameter(ALPHA, alpha);
      fields[side].setParameter(BETA, ratio(1, 100000));
      fields[side].setParameter(V_PLUS, ratio(-12, 10));
      fields[side].setParameter(V_MINUS, ratio(-14, 10));
      fields[side].setParameter(SHARPNESS, interval(2000)); // 2/eps, eps = 1e-3
      solvers[side].setAbsoluteTolerance(tolerance);
      solvers[side].setRelativeTolerance(tolerance);
    }
  }

  // The next `count` crossings of y = 0 by all orbits from a set that lies on it. None is missed: while a step's enclosure meets y = 0, y' has one sign on
  // all of it.
  template <class SetType> std::vector<Crossing> crossings(SetType set, size_t count) {
    std::vector<Crossing> found;
    int sign = 0; // of y, before the step; 0 while the set is on the section
    SetType before = set;
    int side_before = 1;
    while (found.size() < count) {
      const int side = IVector(set)[0].mid().leftBound() >= 0.;
      // The last set that is known to lie on one side of the section, and whose formula reaches it.
      if (sign != 0 && !IVector(set)[1].contains(0.)) {
        before = set;
        side_before = side;
      }
      limit_step(IVector(set), side);
      solvers[side](set);
      ++steps;
      const IVector all = set.getLastEnclosure();
      if (all[1].contains(0.)) {
        const interval speed = fields[side](all)[1];
        if (speed.contains(0.)) throw std::runtime_error("the flow is not transversal to y = 0 on a step's enclosure");
      }
      const interval y = IVector(set)[1];
      if (y.contains(0.)) continue;
      const int now = y.leftBound() > 0. ? 1 : -1;
      if (sign != 0 && now != sign) found.push_back(cross(before, side_before));
      sign = now;
    }
    return found;
  }

  // A step moves x by eps/5 in the layer, and by a quarter of the way to it outside: filib ends the program where exp overflows, so that an enclosure that is tried on the way
  // may not reach |x| = 0.35 on a formula's other side.
  void limit_step(const IVector& at, int side) {
    const double x = std::abs(at[0].mid().leftBound()), speed = std::abs(fields[side](at)[0].mid().leftBound());
double longest = (2e-4 + 0.25 * std::max(x - 0.015, 0.)) / (speed + 1e-3);
    // The speed may be small only for a while.
    if (x < 1) longest = std::min(longest, 0.02);
    // Sliding orbits contract across the layer at a rate of (y + z)/(2 eps).
    if (x < 0.02) longest = std::min(longest, 5e-4 / (1e-3 + std::abs(at[1].mid().leftBound()) + std::abs(at[2].mid().leftBound())));
    solvers[side].setMaxStep(interval(longest));
  }

  // The crossing of y = 0 that a step from `set` or the next makes, and the derivative of the map on the section.
  Crossing cross(C1Rect2Set set, int side) {
    limit_step(IVector(set), side);
    IPoincareMap map(solvers[side], section);
    Crossing c;
    const bool below = IVector(set)[1].rightBound() < 0.;
    IMatrix flow(3, 3);
    c.point = map(set, flow, c.time);
    c.derivative = map.computeDP(c.point, flow, c.time);
    c.upward = below;
    return c;
  }

  Crossing cross(C0HOTripletonSet set, int side) {
    limit_step(IVector(set), side);
    IPoincareMap map(solvers[side], section);
    Crossing c;
    const bool below = IVector(set)[1].rightBound() < 0.;
    c.point = map(set, c.time);
    c.upward = below;
    return c;
  }

  IMap fields[2];
  IOdeSolver solvers[2];
  ICoordinateSection section;
  long steps = 0;
};

static void print(const char* name, interval x) {
  std::cout << "  " << name << " [" << x.leftBound() << ", " << x.rightBound() << "]  width " << std::scientific << width(x) << std::defaultfloat << "\n";
}

// Of the processor.
static double seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

static int prove_cycle(int order, double tolerance) {
  const double started = seconds();
  Flow flow(ratio(1, 1000), order, tolerance);
  // As in proofs/printed_cycle.rs.
  const double at[2] = {17.057344142481766, -0.015417177803876677}, radius = 4e-9;
  IVector candidate(2), point(2);
  for (int i = 0; i < 2; ++i) candidate[i] = at[i] + radius * interval(-1, 1);
  point = candidate;
  bool proved = false;
  for (int pass = 0; pass < 4; ++pass) {
    IVector centre = midVector(point);
    const Crossing value = flow.crossings(C0HOTripletonSet(IVector{centre[0], interval(0.), centre[1]}), 2)[1];
    const std::vector<Crossing> turn = flow.crossings(C1Rect2Set(IVector{point[0], interval(0.), point[1]}), 2);
    if (turn[0].upward || !turn[1].upward || !value.upward) throw std::runtime_error("the crossings do not alternate");
    const IMatrix& d = turn[1].derivative;
    IMatrix slope(2, 2);
    slope[0][0] = d[0][0] - 1.;
    slope[0][1] = d[0][2];
    slope[1][0] = d[2][0];
    slope[1][1] = d[2][2] - 1.;
    IVector off(2);
    off[0] = value.point[0] - centre[0];
    off[1] = value.point[2] - centre[1];
    const IVector newton = centre - capd::matrixAlgorithms::gauss(slope, off);
    if (pass == 0) {
      proved = subsetInterior(newton, candidate);
      std::cout << "candidate\n";
      print("x            ", candidate[0]);
      print("z            ", candidate[1]);
      std::cout << "interval Newton operator: " << (proved ? "inside the candidate" : "NOT inside the candidate") << "\n";
      print("x            ", newton[0]);
      print("z            ", newton[1]);
      if (!proved) return 1;
    }
    if (!intersection(newton, point, point)) throw std::runtime_error("empty intersection");
    if (pass < 3) continue;
    const interval trace = d[0][0] + d[2][2], determinant = d[0][0] * d[2][2] - d[0][2] * d[2][0];
    std::cout << "the orbit\n";
    print("x            ", point[0]);
    print("z            ", point[1]);
    print("period       ", turn[1].time);
    print("trace        ", trace);
    print("determinant  ", determinant);
    print("1 - det      ", 1. - determinant);
    print("1 + det + tr ", 1. + determinant + trace);
    print("1 + det - tr ", 1. + determinant - trace);
    print("down at t    ", turn[0].time);
    print("down at x    ", turn[0].point[0]);
    print("down at z    ", turn[0].point[2]);
    proved = determinant < 1. && 1. + determinant + trace > 0. && 1. + determinant - trace > 0.;
  }
  std::cout << "order " << order << ", tolerance " << tolerance << ", steps " << flow.steps << ", seconds " << seconds() - started << "\n";
  std::cout << (proved ? "PROVED by CAPD: it exists, is unique there, and attracts.\n" : "NOT PROVED: the stability test does not hold\n");
  return proved ? 0 : 1;
}

// The first crossings of y = 0 by the orbit from (0.2, 0, -1), beside a table's rows t,x,z,direction,uncertainty.
static int enclose_crossings(const std::string& file, interval alpha, size_t rows, int order, double tolerance) {
  std::ifstream table(file);
  if (!table) throw std::runtime_error("cannot read " + file);
  Flow flow(alpha, order, tolerance);
  const double started = seconds();
  const std::vector<Crossing> found = flow.crossings(C0HOTripletonSet(IVector{ratio(2, 10), interval(0.), interval(-1.)}), rows);
  std::string line;
  size_t n = 0;
  bool all = true;
  while (n < rows && std::getline(table, line)) {
    if (line.empty() || line[0] == '#' || line[0] == 't') continue;
    std::istringstream fields(line);
    std::string t, x, z, direction, uncertainty;
    std::getline(fields, t, ',');
    std::getline(fields, x, ',');
    std::getline(fields, z, ',');
    std::getline(fields, direction, ',');
    std::getline(fields, uncertainty, ',');
    const Crossing& c = found[n++];
    double widest = 0;
    bool holds = c.upward == (direction == "up");
    const std::pair<interval, std::string> columns[] = {{c.time, t}, {c.point[0], x}, {c.point[2], z}};
    for (const auto& [got, text] : columns) {
      const double want = std::stod(text);
      const interval slack = (std::stod(uncertainty) + 4.5e-16 * std::abs(want)) * interval(-1, 1);
      holds = holds && (got + slack).contains(want);
      widest = std::max(widest, width(got));
    }
    all = all && holds;
    std::cout << "row " << n << ": x in " << c.point[0] << ", z in " << c.point[2] << ", widest " << widest << ": " << (holds ? "holds the table's row" : "DOES NOT HOLD the table's row") << "\n";
  }
  std::cout << "order " << order << ", tolerance " << tolerance << ", steps " << flow.steps << ", seconds " << seconds() - started << "\n";
  return all && n == rows ? 0 : 1;
}

int main(int argc, char** argv) {
  std::cout.precision(17);
  try {
    const std::vector<std::string> arg(argv + 1, argv + argc);
    const bool table = !arg.empty() && arg[0] == "crossings";
    const size_t options = table ? 4 : 0;
    const int order = arg.size() > options ? std::stoi(arg[options]) : 22;
    const double tolerance = arg.size() > options + 1 ? std::stod(arg[options + 1]) : 1e-17;
    if (!table) return prove_cycle(order, tolerance);
    if (arg.size() < 4) throw std::runtime_error("usage: printed_cycle crossings FILE ALPHA ROWS, with ALPHA one of 1e-3 and 0.1");
    const interval alpha = arg[2] == "1e-3" ? ratio(1, 1000) : arg[2] == "0.1" ? ratio(1, 10) : throw std::runtime_error("ALPHA is 1e-3 or 0.1");
    return enclose_crossings(arg[1], alpha, std::stoul(arg[3]), order, tolerance);
  } catch (const std::exception& e) {
    std::cerr << "NOT PROVED: " << e.what() << "\n";
    return 1;
  }
}
