#include "controller/kinematics/arm5.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace stance::kinematics {
namespace {

/// Of T_15(2,3), and of R^T R over 1.
constexpr double kOrientation = 1e-9;
/// Of a root's argument, relative: what rounding may have left of a double root, or taken from it.
constexpr double kDoubleRoot = 1e-12;
/// rad: a limit's decimals.
constexpr double kLimit = 1e-12;

/// The turn of `angle` that is within pi of the middle of [lower, upper].
double turn(double angle, double lower, double upper) noexcept {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double from = 0.5 * (lower + upper) - std::numbers::pi;
  const double turned = angle - kTurn * std::floor((angle - from) / kTurn);
  return turned < from + kTurn ? turned : from;  // rounding up to the next turn
}

/// Where the arm's plane may stand for a position: the sine and cosine of t1, and the position's x in frame 1.
struct Side {
  double t1, sin, cos, x;
};

/// The sides of the first axis on which the tool may lie: none, one (double root) or two.
struct Sides {
  std::array<Side, 2> side;
  int count = 0;
};

Sides sides(const Arm5Geometry& arm, const Vector3& p) noexcept {
  Sides out;
  const double r2 = p.x() * p.x() + p.y() * p.y();
  double x2 = r2 - arm.d2 * arm.d2;
  const double slack = kDoubleRoot * r2;
  if (x2 < -slack) return out;
  const bool one = x2 <= slack;
  const double x = one ? 0.0 : std::sqrt(x2);
  const double bearing = std::atan2(p.y(), p.x());
  for (const double sign : {1.0, -1.0}) {
    Side& side = out.side[out.count++];
    side.x = sign * x;
    side.t1 = bearing - std::atan2(-arm.d2, side.x);
    side.sin = std::sin(side.t1);
    side.cos = std::cos(side.t1);
    if (one) break;
  }
  return out;
}

/// Collects solutions and what stood against others.
class Collector {
 public:
  Collector(const Arm5Geometry& arm, const Arm5Limits& limits) noexcept : arm_(arm), limits_(limits) {}

  /// The elbow's two ways to put the tool at (x, z) of frame 1 with the pitch's sine and cosine.
  void add_elbows(double t1, double x, double z, double sin_pitch, double cos_pitch, double pitch,
                  double roll) noexcept {
    const double k1 = x - arm_.d5 * sin_pitch - arm_.a1;
    const double k2 = z + arm_.d5 * cos_pitch;
    const double cos_elbow = (k1 * k1 + k2 * k2 - arm_.a2 * arm_.a2 - arm_.a3 * arm_.a3) / (2.0 * arm_.a2 * arm_.a3);
    if (!(std::abs(cos_elbow) <= 1.0 + kDoubleRoot)) return;
    const bool one = std::abs(cos_elbow) >= 1.0 - kDoubleRoot;
    const double elbow = one ? (cos_elbow > 0.0 ? 0.0 : std::numbers::pi) : std::acos(cos_elbow);
    const double shoulder = std::atan2(k2, k1);
    const double inner = std::atan2(arm_.a3 * std::sin(elbow), arm_.a2 + arm_.a3 * std::cos(elbow));
    add({t1, shoulder - inner, elbow, pitch - (shoulder - inner) - elbow, roll});
    if (!one) add({t1, shoulder + inner, -elbow, pitch - (shoulder + inner) + elbow, roll});
  }

  Arm5Solutions result(Arm5Status otherwise) noexcept {
    out_.status = out_.count > 0 ? Arm5Status::kOk : outside_ ? Arm5Status::kOutsideLimits : otherwise;
    return out_;
  }

 private:
  void add(const std::array<double, 5>& t) noexcept {
    Arm5Vector& solution = out_.t[out_.count];
    for (int i = 0; i < 5; ++i) {
      const double lower = limits_.lower(i), upper = limits_.upper(i);
      const double angle = turn(t[i], lower, upper);
      if (!(angle >= lower - kLimit && angle <= upper + kLimit)) {
        outside_ = true;
        return;
      }
      solution(i) = std::clamp(angle, lower, upper);
    }
    ++out_.count;
  }

  const Arm5Geometry& arm_;
  const Arm5Limits& limits_;
  Arm5Solutions out_;
  bool outside_ = false;
};

void require(bool fits, const std::string& element, const std::string& rule) {
  if (!fits) throw std::invalid_argument("5-joint arm: " + element + " " + rule);
}

}  // namespace

Arm5Geometry arm5_geometry(const rigid_body::Model& model, double d5) {
  constexpr double kAlignment = 1e-9;  // m and 1: decimals in a URDF
  require(model.num_joints == 5, "model '" + model.name + "'", "must have five joints");
  Matrix3 quarter;  // Rx(90 deg)
  quarter << 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0;
  const auto& joints = model.joints;
  const Arm5Geometry arm{joints[1].p_PJ.x(), joints[2].p_PJ.x(),  joints[3].p_PJ.x(),
                         joints[0].p_PJ.z(), -joints[1].p_PJ.y(), d5};
  const std::array<Vector3, 5> origin{Vector3(0.0, 0.0, arm.d1), Vector3(arm.a1, -arm.d2, 0.0),
                                      Vector3(arm.a2, 0.0, 0.0), Vector3(arm.a3, 0.0, 0.0), Vector3::Zero()};
  for (int i = 0; i < 5; ++i) {
    const rigid_body::Joint& joint = joints[i];
    const std::string element = "joint '" + joint.name + "'";
    const bool turned = i == 1 || i == 4;
    require(joint.parent == i, element, "must hang on the link of the joint before it");
    require((joint.axis - Vector3::UnitZ()).norm() < kAlignment, element, "must turn about z");
    require((joint.p_PJ - origin[i]).norm() < kAlignment, element, "must have its origin where the document's arm has");
    require((joint.R_PJ - (turned ? quarter : Matrix3(Matrix3::Identity()))).norm() < kAlignment, element,
            turned ? "must be turned by 90 deg about its parent's x" : "must not be turned in its parent");
  }
  require(arm.a2 > 0.0 && arm.a3 > 0.0, "the upper arm and the forearm", "must have a length, along x");
  return arm;
}

Arm5Limits arm5_limits(const rigid_body::Model& model) noexcept {
  Arm5Limits limits;
  for (int i = 0; i < 5; ++i) {
    limits.lower(i) = model.joints[i].lower;
    limits.upper(i) = model.joints[i].upper;
  }
  return limits;
}

RigidTransform arm5_forward(const Arm5Geometry& arm, const Arm5Vector& t) noexcept {
  const double s1 = std::sin(t(0)), c1 = std::cos(t(0)), s2 = std::sin(t(1)), c2 = std::cos(t(1));
  const double s23 = std::sin(t(1) + t(2)), c23 = std::cos(t(1) + t(2));
  const double s234 = std::sin(t(1) + t(2) + t(3)), c234 = std::cos(t(1) + t(2) + t(3));
  const double s5 = std::sin(t(4)), c5 = std::cos(t(4));
  const double x = arm.d5 * s234 + arm.a3 * c23 + arm.a2 * c2 + arm.a1;
  const double z = arm.a3 * s23 - arm.d5 * c234 + arm.a2 * s2;
  RigidTransform T;
  T.R << c1 * c234 * c5 + s1 * s5, -c1 * c234 * s5 + s1 * c5, c1 * s234,  //
      s1 * c234 * c5 - c1 * s5, -s1 * c234 * s5 - c1 * c5, s1 * s234,     //
      s234 * c5, -s234 * s5, -c234;
  T.p << c1 * x + s1 * arm.d2, s1 * x - c1 * arm.d2, z + arm.d1;
  return T;
}

Eigen::Matrix<double, 3, 5> arm5_position_jacobian(const Arm5Geometry& arm, const Arm5Vector& t) noexcept {
  const double s1 = std::sin(t(0)), c1 = std::cos(t(0));
  // The tool as seen from joints 4, 3 and 2, whose axes are the arm's plane's normal: x outward, z up.
  const double x4 = arm.d5 * std::sin(t(1) + t(2) + t(3)), z4 = -arm.d5 * std::cos(t(1) + t(2) + t(3));
  const double x3 = x4 + arm.a3 * std::cos(t(1) + t(2)), z3 = z4 + arm.a3 * std::sin(t(1) + t(2));
  const double x2 = x3 + arm.a2 * std::cos(t(1)), z2 = z3 + arm.a2 * std::sin(t(1));
  const double x = x2 + arm.a1;
  Eigen::Matrix<double, 3, 5> J;
  J << -s1 * x + c1 * arm.d2, -c1 * z2, -c1 * z3, -c1 * z4, 0.0,  //
      c1 * x + s1 * arm.d2, -s1 * z2, -s1 * z3, -s1 * z4, 0.0,    //
      0.0, x2, x3, x4, 0.0;
  return J;
}

Arm5Solutions arm5_ik(const Arm5Geometry& arm, const RigidTransform& T_A5, const Arm5Limits& limits) noexcept {
  const Matrix3& R = T_A5.R;
  const Vector3& p = T_A5.p;
  const bool is_rotation =
      (R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff() <= kOrientation && R.determinant() > 0.0;
  if (!p.allFinite() || !is_rotation) return {};
  Collector found(arm, limits);
  const Sides at = sides(arm, p);
  bool in_plane = false;
  for (int k = 0; k < at.count; ++k) {
    const Side& side = at.side[k];
    // The second row of T_15 = T_01^-1 T_A5: components along frame 1's y.
    const auto across = [&](int column) { return side.cos * R(1, column) - side.sin * R(0, column); };
    if (std::abs(across(2)) > kOrientation) continue;
    in_plane = true;
    const double sin_pitch = side.cos * R(0, 2) + side.sin * R(1, 2), cos_pitch = -R(2, 2);
    found.add_elbows(side.t1, side.x, p.z() - arm.d1, sin_pitch, cos_pitch, std::atan2(sin_pitch, cos_pitch),
                     std::atan2(-across(0), -across(1)));
  }
  return found.result(at.count > 0 && !in_plane ? Arm5Status::kOrientation : Arm5Status::kUnreachable);
}

Arm5Solutions arm5_ik(const Arm5Geometry& arm, const Vector3& p_A, double pitch, double roll,
                      const Arm5Limits& limits) noexcept {
  if (!p_A.allFinite() || !std::isfinite(pitch) || !std::isfinite(roll)) return {};
  Collector found(arm, limits);
  const Sides at = sides(arm, p_A);
  for (int k = 0; k < at.count; ++k) {
    found.add_elbows(at.side[k].t1, at.side[k].x, p_A.z() - arm.d1, std::sin(pitch), std::cos(pitch), pitch, roll);
  }
  return found.result(Arm5Status::kUnreachable);
}

}  // namespace stance::kinematics
