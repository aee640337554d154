#include "tests/bench/force_qp/sequence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <random>
#include <stdexcept>

#include "controller/force_qp/tick_file.hpp"
#include "controller/math/so3.hpp"

namespace stance::bench {
namespace {

using namespace force_qp;

constexpr int kTicks = 240;
constexpr int kTicksPerStep = 30;          // of walking
constexpr double kMass = 12.0;             // kg
constexpr double kHeight = 0.55;           // m
constexpr double kSpeed = 0.3;             // m/s, of walking
constexpr double kMaxNormalForce = 250.0;  // N
constexpr double kForceWeight = 1e-5;
constexpr int kPushTicks = 6;
constexpr int kLoopStages = 30;  // of the QP that closes the loop
const StateVector kStateWeights = (StateVector() << 200, 200, 100, 100, 100, 500, 1, 1, 1, 10, 10, 10).finished();
const Matrix3 kInertia = Vector3(0.25, 0.22, 0.08).asDiagonal();  // kg m^2, in B
const double kPendulum = std::sqrt(kGravity / kHeight);           // 1/s

double side(int step) { return step % 2 == 0 ? 0.08 : -0.08; }

StateVector reference(Motion motion, int tick) {
  StateVector x = StateVector::Zero();
  x(5) = kHeight;
  if (motion != Motion::kWalk) return x;
  const double period = kTicksPerStep * kControlPeriod;
  const int step = tick / kTicksPerStep;
  const double phase = kPendulum * (tick % kTicksPerStep * kControlPeriod - period / 2);
  const double half = kPendulum * period / 2;
  const double stride = kSpeed * period;
  x(3) = stride * (step + 0.5) + stride / 2 * std::sinh(phase) / std::sinh(half);
  x(9) = stride / 2 * kPendulum * std::cosh(phase) / std::sinh(half);
  x(4) = side(step) * (1.0 - std::cosh(phase) / std::cosh(half));
  x(10) = -side(step) * kPendulum * std::sinh(phase) / std::cosh(half);
  const double time = tick * kControlPeriod;
  x(2) = 0.2 * std::sin(0.8 * time);
  x(8) = 0.16 * std::cos(0.8 * time);
  return x;
}

Vector3 nominal_foothold(int step) { return {kSpeed * kTicksPerStep * kControlPeriod * (step + 0.5), side(step), 0.0}; }

std::vector<Vector3> standing_feet(Motion motion) {
  if (motion == Motion::kStand) return {{0.0, 0.08, 0.0}, {0.0, -0.08, 0.0}};
  return {{0.2, 0.12, 0.0}, {0.2, -0.12, 0.0}, {-0.2, 0.12, 0.0}, {-0.2, -0.12, 0.0}};
}

/// Where the walker will step: footholds follow the divergent component of motion.
class Footholds {
 public:
  Vector3 decided(int step) const { return decided_.at(step); }
  void decide(int step, const StateVector& x, int tick) {
    if (!decided_.contains(step)) decided_[step] = aimed(step, x, tick);
  }
  Vector3 aimed(int step, const StateVector& x, int tick) const {
    if (decided_.contains(step)) return decided_.at(step);
    Vector3 foothold = nominal_foothold(step);
    if (step == 0 || step > tick / kTicksPerStep + 1) return foothold;
    const StateVector from = x - reference(Motion::kWalk, tick);
    for (int i = 0; i < 2; ++i) foothold(i) += std::clamp(from(3 + i) + from(9 + i) / kPendulum, -0.12, 0.12);
    return foothold;
  }

 private:
  std::map<int, Vector3> decided_;
};

StateMatrix dense_terminal_cost() {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  StateMatrix root;
  for (Eigen::Index i = 0; i < root.size(); ++i) root(i) = uniform(random);
  StateMatrix P = 20.0 * root * root.transpose();
  P.diagonal() += kStateWeights + StateVector::Constant(50.0);
  return P;
}

Problem tick_of(const Recipe& recipe, int tick, int num_stages, const StateVector& x, const Footholds& footholds) {
  const bool walks = recipe.motion == Motion::kWalk;
  const std::vector<Vector3> standing = standing_feet(recipe.motion);
  const int contacts = walks ? 1 : static_cast<int>(standing.size());
  const Vector3 weight(0.0, 0.0, kMass * kGravity);
  centroidal::Parameters body;
  body.mass = kMass;
  body.inertia_body = kInertia;
  Problem problem({num_stages, contacts});
  problem.friction = recipe.friction;
  problem.x0 = x;
  const Vector3 off = x.segment<3>(3) - reference(recipe.motion, tick).segment<3>(3);
  for (int k = 0; k < num_stages; ++k) {
    StageData& stage = problem.stages[static_cast<std::size_t>(k)];
    const StateVector here = reference(recipe.motion, tick + k);
    centroidal::Linearisation at;
    at.yaw = here(2);
    at.num_contacts = contacts;
    at.p_ref = here.segment<3>(3);
    if (walks) at.p_ref += off * std::max(0.0, 1.0 - k / 40.0);
    for (int c = 0; c < contacts; ++c) {
      const Vector3 foot =
          walks ? footholds.aimed((tick + k) / kTicksPerStep, x, tick) : standing[static_cast<std::size_t>(c)];
      at.r[static_cast<std::size_t>(c)] = foot - at.p_ref;
      stage.fz_max[static_cast<std::size_t>(c)] = kMaxNormalForce;
    }
    at.coupling = recipe.coupled;
    at.force_ref = weight;
    centroidal::dynamics(body, at, stage.dynamics);
    stage.x_ref = reference(recipe.motion, tick + k + 1);
    stage.Q = kStateWeights;
    stage.R.setConstant(kForceWeight);
    stage.f_ref.setZero();
  }
  if (recipe.coupled) {
    problem.has_terminal_cost = true;
    problem.terminal_cost = dense_terminal_cost();
  }
  return problem;
}

/// One period of the rigid body, the gyroscopic term included.
StateVector moved(const StateVector& x, const Vector3& force, const Vector3& torque) {
  const Matrix3 R = math::rotation_from_rpy(x.head<3>());
  const Matrix3 inertia = R * kInertia * R.transpose();
  const Vector3 omega = x.segment<3>(6);
  StateVector next = x;
  next.segment<3>(6) += kControlPeriod * (inertia.inverse() * (torque - omega.cross(inertia * omega)));
  next.segment<3>(9) += kControlPeriod * (force / kMass - Vector3(0.0, 0.0, kGravity));
  next.head<3>() += kControlPeriod * (math::rotation_z(x(2)).transpose() * next.segment<3>(6));
  next.segment<3>(3) += kControlPeriod * next.segment<3>(9);
  return next;
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : file_(file), stream_(file, std::ios::binary) {
    if (!stream_) fail("cannot be read");
  }
  template <typename T>
  T value() {
    T read{};
    bytes(&read, sizeof read);
    return read;
  }
  /// Row by row into a column-major matrix.
  template <typename M>
  void matrix(M&& out) {
    for (Eigen::Index i = 0; i < out.rows(); ++i) {
      for (Eigen::Index j = 0; j < out.cols(); ++j) out(i, j) = value<double>();
    }
  }
  std::vector<double> numbers(std::size_t count) {
    std::vector<double> read(count);
    bytes(read.data(), count * sizeof(double));
    return read;
  }
  void rewind() { stream_.seekg(0); }
  [[noreturn]] void fail(const std::string& what) const { throw std::runtime_error(file_.string() + ": " + what); }

 private:
  void bytes(void* to, std::size_t count) {
    if (!stream_.read(static_cast<char*>(to), static_cast<std::streamsize>(count))) fail("ends too early");
  }
  std::filesystem::path file_;
  std::ifstream stream_;
};

Sequence read_first_version(Reader& in) {
  const auto ticks = static_cast<std::size_t>(in.value<std::int32_t>());
  const auto stages = static_cast<std::size_t>(in.value<std::int32_t>());
  if (ticks < 1 || ticks > 100000 || stages < 1 || stages > 200) in.fail("is no file of ticks");
  const auto x0 = in.numbers(12 * ticks);
  const auto yaw = in.numbers(ticks * stages);
  const auto B = in.numbers(ticks * stages * 72);
  const auto x_ref = in.numbers(ticks * stages * 12);
  const auto contact = in.numbers(ticks * stages * 2);
  Sequence sequence;
  sequence.typical_force = kMass * kGravity;
  for (std::size_t t = 0; t < ticks; ++t) {
    Problem problem({static_cast<int>(stages), 2});
    problem.friction = 0.6;
    problem.x0 = Eigen::Map<const StateVector>(&x0[12 * t]);
    for (std::size_t k = 0; k < stages; ++k) {
      const std::size_t at = t * stages + k;
      StageData& stage = problem.stages[k];
      stage.dynamics.A.setIdentity();
      stage.dynamics.A.block<3, 3>(0, 6) = kControlPeriod * math::rotation_z(yaw[at]).transpose();
      stage.dynamics.A.block<3, 3>(3, 9) = kControlPeriod * Matrix3::Identity();
      stage.dynamics.B = Eigen::Map<const Eigen::Matrix<double, 12, 6, Eigen::RowMajor>>(&B[72 * at]);
      stage.dynamics.g(11) = -kControlPeriod * kGravity;
      stage.x_ref = Eigen::Map<const StateVector>(&x_ref[12 * at]);
      stage.Q = kStateWeights;
      stage.R.setConstant(kForceWeight);
      for (std::size_t c = 0; c < 2; ++c) stage.fz_max[c] = contact[2 * at + c] > 0.0 ? kMaxNormalForce : 0.0;
    }
    sequence.ticks.push_back(std::move(problem));
  }
  return sequence;
}

Sequence read_second_version(Reader& in) {
  const auto contacts = in.value<std::int32_t>();
  const auto ticks = in.value<std::int32_t>();
  const auto stages = in.value<std::int32_t>();
  const auto terminal = in.value<std::int32_t>();
  if (contacts < 1 || contacts > kMaxContacts || ticks < 1 || stages < 1 || stages > 200 || terminal < 0 ||
      terminal > 1) {
    in.fail("has a header out of range");
  }
  Sequence sequence;
  const auto friction = in.value<double>();
  sequence.typical_force = in.value<double>();
  for (int t = 0; t < ticks; ++t) {
    Problem problem({stages, contacts});
    problem.friction = friction;
    problem.has_terminal_cost = terminal == 1;
    in.matrix(problem.x0);
    for (StageData& stage : problem.stages) {
      in.matrix(stage.dynamics.A);
      in.matrix(stage.dynamics.B);
      in.matrix(stage.dynamics.g);
      in.matrix(stage.x_ref);
      in.matrix(stage.Q);
      in.matrix(stage.f_ref);
      in.matrix(stage.R);
      for (int c = 0; c < contacts; ++c) stage.fz_min[static_cast<std::size_t>(c)] = in.value<double>();
      for (int c = 0; c < contacts; ++c) stage.fz_max[static_cast<std::size_t>(c)] = in.value<double>();
    }
    if (terminal == 1) in.matrix(problem.terminal_cost);
    sequence.ticks.push_back(std::move(problem));
  }
  return sequence;
}

}  // namespace

void Sequence::cut(std::size_t tick, int num_stages, Problem& out) const {
  const Problem& from = ticks[tick];
  out.x0 = from.x0;
  out.friction = from.friction;
  out.has_terminal_cost = from.has_terminal_cost;
  out.terminal_cost = from.terminal_cost;
  std::copy_n(from.stages.begin(), num_stages, out.stages.begin());
}

Sequence record(const Recipe& recipe, int max_stages) {
  static constexpr std::array kNames = {"stand", "walk", "four feet"};
  Sequence sequence;
  sequence.name = kNames[static_cast<std::size_t>(recipe.motion)];
  sequence.typical_force = kMass * kGravity;
  sequence.time_invariant = recipe.motion != Motion::kWalk;
  std::mt19937_64 random(10 * recipe.seed + static_cast<unsigned>(recipe.motion));
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto any = [&](const Vector3& size) -> Vector3 {
    Vector3 v;
    for (int i = 0; i < 3; ++i) v(i) = size(i) * uniform(random);
    return v;
  };

  Settings settings;
  settings.engine = QpEngine::kStructured;
  StateVector x = reference(recipe.motion, 0);
  Footholds footholds;
  const Problem first = tick_of(recipe, 0, kLoopStages, x, footholds);
  auto engine = make_force_qp(settings, first.sizes, sequence.typical_force);
  Solution solution(first.sizes);
  Vector3 push_force = Vector3::Zero();
  Vector3 push_torque = Vector3::Zero();
  for (int tick = 0; tick < kTicks; ++tick) {
    const int step = tick / kTicksPerStep;
    if (recipe.motion == Motion::kWalk) footholds.decide(step, x, tick);
    StateVector seen = x;
    for (int i = 0; i < 12; ++i) {
      static constexpr std::array kNoise = {0.002, 0.0005, 0.02, 0.005};  // rad, m, rad/s, m/s
      seen(i) += kNoise[static_cast<std::size_t>(i / 3)] * normal(random);
    }
    sequence.ticks.push_back(tick_of(recipe, tick, max_stages, seen, footholds));
    if (engine->solve(tick_of(recipe, tick, kLoopStages, seen, footholds), solution) != QpStatus::kSolved) {
      throw std::runtime_error("tick " + std::to_string(tick) + " of the recorded loop is not solved");
    }

    const ForceVector& f = solution.forces.front();
    Vector3 force = Vector3::Zero();
    Vector3 torque = Vector3::Zero();
    for (int c = 0; 3 * c < f.size(); ++c) {
      const Vector3 foot = recipe.motion == Motion::kWalk ? footholds.decided(step)
                                                          : standing_feet(recipe.motion)[static_cast<std::size_t>(c)];
      force += f.segment<3>(3 * c);
      torque += (foot - x.segment<3>(3)).cross(f.segment<3>(3 * c));
    }
    const int since_push = recipe.often ? (tick + 30) % 50 : tick - kTicks / 2;
    if (since_push == 0) {
      push_force = recipe.push * any({50.0, 50.0, 40.0});
      push_torque = recipe.push * any({1.5, 1.5, 0.5});
    }
    if (since_push >= 0 && since_push < kPushTicks && tick < kTicks - 50) {
      force += push_force;
      torque += push_torque;
    }
    x = moved(x, force, torque);
    // Two point feet without coupling cannot hold their pitch: a stand that is lost begins again.
    const StateVector off = x - reference(recipe.motion, tick);
    if (recipe.motion != Motion::kWalk &&
        (off.segment<3>(3).cwiseAbs().maxCoeff() > 0.2 || x.head<3>().cwiseAbs().maxCoeff() > 0.3)) {
      x = reference(recipe.motion, tick);
      x.tail<3>() += any(Vector3::Constant(0.3));
      x.segment<3>(6) += any(Vector3::Constant(0.5));
    }
  }
  return sequence;
}

Sequence read_sequence(const std::filesystem::path& file) {
  Reader in(file);
  char magic[sizeof kTickFileMagic - 1];
  for (char& c : magic) c = in.value<char>();
  Sequence sequence;
  if (std::memcmp(magic, kTickFileMagic, sizeof magic) == 0) {
    sequence = read_second_version(in);
  } else {
    in.rewind();
    sequence = read_first_version(in);
  }
  sequence.name = file.stem().string();
  const auto same_model = [](const Problem& a, const Problem& b) {
    for (std::size_t k = 0; k < a.stages.size(); ++k) {
      const StageData& s = a.stages[k];
      const StageData& t = b.stages[k];
      if (s.dynamics.A != t.dynamics.A || s.dynamics.B != t.dynamics.B || s.Q != t.Q || s.R != t.R ||
          s.fz_min != t.fz_min || s.fz_max != t.fz_max) {
        return false;
      }
    }
    return a.terminal_cost == b.terminal_cost;
  };
  sequence.time_invariant = std::all_of(sequence.ticks.begin(), sequence.ticks.end(),
                                        [&](const Problem& p) { return same_model(p, sequence.ticks.front()); });
  return sequence;
}

void write_sequence(const Sequence& sequence, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  TickWriter writer(out, sequence.typical_force);
  for (const Problem& problem : sequence.ticks) writer.write(problem);
  if (!writer.finish()) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace stance::bench
