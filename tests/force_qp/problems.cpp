#include "tests/force_qp/problems.hpp"

#include <cmath>

namespace stance::force_qp::test {

centroidal::Parameters body() {
  centroidal::Parameters parameters;
  parameters.mass = kMass;
  parameters.inertia_body = Vector3(0.31, 0.286, 0.36).asDiagonal();
  return parameters;
}

StateVector stand_weights() { return (StateVector() << 100, 100, 100, 40, 40, 300, 1, 1, 1, 2, 2, 5).finished(); }
StateVector walk_weights() { return (StateVector() << 150, 150, 60, 0, 0, 300, 1, 1, 1, 3, 3, 8).finished(); }

centroidal::Linearisation stand_linearisation(int num_contacts, bool coupling) {
  centroidal::Linearisation at;
  at.num_contacts = num_contacts;
  at.coupling = coupling;
  at.force_ref = Vector3(0.0, 0.0, kWeight);
  at.p_ref = Vector3(0.0, 0.0, kHeight);
  for (int i = 0; i < num_contacts; ++i) {
    const double angle = M_PI * (0.5 + 2.0 * i / num_contacts);
    const double radius = num_contacts == 1 ? 0.0 : kHalfWidth;
    at.r[static_cast<std::size_t>(i)] = Vector3(radius * std::cos(angle), radius * std::sin(angle), -kHeight);
  }
  return at;
}

Problem standing(int num_stages, int num_contacts, double friction) {
  Problem problem({num_stages, num_contacts});
  problem.friction = friction;
  problem.x0(5) = kHeight;
  for (StageData& stage : problem.stages) {
    centroidal::dynamics(body(), stand_linearisation(num_contacts, true), stage.dynamics);
    stage.x_ref = problem.x0;
    stage.Q = stand_weights();
    stage.R.setConstant(0.1);
    for (int c = 0; c < num_contacts; ++c) {
      stage.f_ref.segment<3>(3 * c) = Vector3(0.0, 0.0, kWeight / num_contacts);
      stage.fz_min[static_cast<std::size_t>(c)] = 5.0;
      stage.fz_max[static_cast<std::size_t>(c)] = 350.0;
    }
  }
  if (num_contacts > 1) {
    problem.has_terminal_cost = true;
    problem.terminal_cost =
        centroidal::riccati_terminal_cost(problem.stages[0].dynamics, problem.stages[0].Q, problem.stages[0].R);
  }
  return problem;
}

Problem walking(int num_stages, int tick, double friction) {
  constexpr int kSwing = 26;
  constexpr int kStep = 32;
  constexpr double kStride = 0.1;  // m
  constexpr double kSpeed = kStride / (kStep * kControlPeriod);
  const auto foothold = [](int step) {  // where the foot lands that ends step `step`; even: left
    return Vector3(kStride * (step + 0.5), step % 2 == 0 ? kHalfWidth : -kHalfWidth, 0.0);
  };
  const auto reference = [](int at) {
    const double phase = M_PI * at / kStep;
    StateVector x = StateVector::Zero();
    x(3) = kSpeed * at * kControlPeriod;
    x(4) = -0.02 * std::sin(phase);
    x(5) = kHeight;
    x(9) = kSpeed;
    x(10) = -0.02 * std::cos(phase) * M_PI / (kStep * kControlPeriod);
    return x;
  };
  Problem problem({num_stages, 2});
  problem.friction = friction;
  problem.x0 = reference(tick);
  for (int k = 0; k < num_stages; ++k) {
    StageData& stage = problem.stages[static_cast<std::size_t>(k)];
    const int step = (tick + k) / kStep;
    const bool swings = (tick + k) % kStep < kSwing;
    const std::size_t swing = step % 2 == 0 ? 0 : 1;
    const std::size_t support = 1 - swing;
    const StateVector x = reference(tick + k);
    centroidal::Linearisation at;
    at.num_contacts = 2;
    at.yaw = x(2);
    at.r[swing] = foothold(step) - x.segment<3>(3);
    at.r[support] = foothold(step - 1) - x.segment<3>(3);
    at.coupling = true;
    at.force_ref = Vector3(0.0, 0.0, kWeight);
    at.p_ref = x.segment<3>(3);
    centroidal::dynamics(body(), at, stage.dynamics);
    stage.x_ref = reference(tick + k + 1);
    stage.Q = walk_weights();
    stage.R.setConstant(0.01);
    for (std::size_t c : {swing, support}) {
      const bool stands = c == support || !swings;
      stage.fz_min[c] = stands ? 5.0 : 0.0;
      stage.fz_max[c] = stands ? 350.0 : 0.0;
      stage.f_ref(static_cast<Eigen::Index>(3 * c + 2)) = stands ? kWeight / (swings ? 1.0 : 2.0) : 0.0;
    }
  }
  return problem;
}

Problem any_problem(Sizes sizes, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto matrix = [&](auto block, double scale) {
    for (Eigen::Index i = 0; i < block.size(); ++i) block(i) = scale * normal(random);
  };
  Problem problem(sizes);
  problem.friction = 0.05 + 1.45 * uniform(random);
  matrix(problem.x0.head(12), 0.2);
  for (StageData& stage : problem.stages) {
    const double dt = uniform(random) < 0.5 ? 0.01 : 0.03;
    Dynamics& dynamics = stage.dynamics;
    dynamics.A.setIdentity();
    Matrix3 block;
    const auto any = [&](double scale) -> const Matrix3& {
      matrix(block.reshaped(), scale);
      return block;
    };
    dynamics.A.block<3, 3>(0, 6) = dt * (Matrix3::Identity() + any(0.3));
    dynamics.A.block<3, 3>(3, 9) = dt * (Matrix3::Identity() + any(0.3));
    if (uniform(random) < 0.7) dynamics.A.block<3, 3>(6, 3) = dt * any(100.0);
    for (int c = 0; c < sizes.num_contacts; ++c) {
      const auto contact = static_cast<std::size_t>(c);
      dynamics.B.block<3, 3>(6, 3 * c) = dt * any(0.5);
      dynamics.B.block<3, 3>(9, 3 * c) = dt / kMass * (Matrix3::Identity() + any(0.1));
      const bool stands = uniform(random) < 0.7 || (c == 0 && &stage == &problem.stages.front());
      stage.fz_max[contact] = stands ? 20.0 + 200.0 * uniform(random) : 0.0;
      stage.fz_min[contact] = stands && uniform(random) < 0.5 ? 0.9 * uniform(random) * stage.fz_max[contact] : 0.0;
    }
    matrix(dynamics.g.head(12), 0.01);
    dynamics.g(11) -= dt * kGravity;
    matrix(stage.x_ref.head(12), 0.1);
    matrix(stage.f_ref.head(3 * sizes.num_contacts), 30.0);
    for (int i = 0; i < 12; ++i) stage.Q(i) = uniform(random) < 0.2 ? 0.0 : std::pow(10.0, 3.0 * uniform(random));
    for (int i = 0; i < 3 * sizes.num_contacts; ++i) stage.R(i) = std::pow(10.0, -3.0 * uniform(random));
  }
  if (uniform(random) < 0.5) {
    StateMatrix root;
    matrix(root.reshaped(), 10.0);
    problem.has_terminal_cost = true;
    problem.terminal_cost = root * root.transpose();
  }
  return problem;
}

void disturb(Problem& problem, double severity, std::mt19937_64& random) {
  const StateVector scale =
      (StateVector() << 0.01, 0.01, 0.01, 0.004, 0.004, 0.004, 0.05, 0.05, 0.05, 0.02, 0.02, 0.02).finished();
  std::normal_distribution<double> normal;
  for (int i = 0; i < 12; ++i) problem.x0(i) += severity * scale(i) * normal(random);
}

}  // namespace stance::force_qp::test
