#include <array>
#include <catch2/catch_message.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "controller/config/biped_config_yaml.hpp"
#include "tests/loop/biped_rig.hpp"

namespace stance::config {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::Message;
using Catch::Matchers::MessageMatches;
using test::biped;
using test::biped_with;
using test::biped_yaml_with;

/// One mapping of the controller's section, and the steps that lead there.
struct Mapping {
  std::string path;  ///< "controller." or "controller.safety."
  std::vector<std::string> steps;
  std::vector<std::string> keys;
};

void find_mappings(const YAML::Node& node, const Mapping& here, std::vector<Mapping>& found) {
  Mapping mapping = here;
  for (const auto& entry : node) {
    const auto key = entry.first.as<std::string>();
    mapping.keys.push_back(key);
    if (!entry.second.IsMap()) continue;
    Mapping below{here.path + key + ".", here.steps, {}};
    below.steps.push_back(key);
    find_mappings(entry.second, below, found);
  }
  found.push_back(mapping);
}

std::vector<Mapping> controller_mappings() {
  std::vector<Mapping> found;
  find_mappings(YAML::Load(biped().yaml_text)["controller"], {"controller.", {"controller"}, {}}, found);
  return found;
}

/// The biped's YAML with one of its mappings changed.
behaviours::BipedConfig biped_config_of(const std::string& yaml_text) {
  RobotDescription robot = biped();
  robot.yaml_text = yaml_text;
  return biped_config(robot);
}

std::string edited(const std::vector<std::string>& steps, const std::function<void(YAML::Node&)>& edit) {
  YAML::Node root = YAML::Load(biped().yaml_text);
  std::vector<YAML::Node> way{root};
  for (const std::string& step : steps) way.push_back(way.back()[step]);
  edit(way.back());
  return YAML::Dump(root);
}

}  // namespace

TEST_CASE("TheBipedsOwnConfigurationIsRead") {
  const behaviours::BipedConfig c = biped_config(biped());
  const YAML::Node yaml = YAML::Load(biped().yaml_text)["controller"];
  CHECK(c.last_link_pitch == yaml["last_link_pitch"].as<double>());
  CHECK(c.intake.user_command_timeout == yaml["user_command_timeout"].as<double>());
  CHECK(c.estimator.initial_accelerometer_bias_sigma ==
        yaml["estimator"]["initial_accelerometer_bias_sigma"].as<double>());
  CHECK(c.com_offset_observer.bandwidth == yaml["com_offset_observer"]["bandwidth"].as<double>());
  CHECK(c.com_offset_quiet_momentum == yaml["com_offset_observer"]["quiet_momentum"].as<double>());
  CHECK(c.force_qp.engine == QpEngine::kStructured);
  CHECK(c.force_qp.max_iterations == yaml["force_qp"]["max_iterations"].as<int>());
  CHECK(c.force_limits.normal_force_max == yaml["force_qp"]["normal_force_max"].as<double>());
  CHECK(c.stand.stages == yaml["stand"]["stages"].as<int>());
  for (int i = 0; i < 12; ++i) CHECK(c.stand.state_weights[i] == yaml["stand"]["state_weights"][i].as<double>());
  CHECK(c.torque_map.lead == yaml["torque_map"]["lead"].as<double>());
  CHECK(c.fault_ladder.hold_time == yaml["safety"]["hold_time"].as<double>());
  CHECK(c.fault_ladder.damp_time == yaml["safety"]["damp_time"].as<double>());
  const YAML::Node damping = YAML::Load(biped().yaml_text)["drives"]["damping"];
  for (int i = 0; i < kMaxJoints; ++i) CHECK(c.damping[i] == damping[i].as<double>());
  const YAML::Node fallen = YAML::Load(biped().yaml_text)["fallen"];
  CHECK(c.fallen.min_upright == fallen["min_upright"].as<double>());
  CHECK(c.fallen.min_height == fallen["min_height"].as<double>());
  CHECK(c.intake.validation.joint_velocity_factor == yaml["safety"]["joint_velocity_factor"].as<double>());
}

TEST_CASE("AnyKeyOfTheControllersSectionThatIsMissingIsNamed") {
  int removed = 0;
  for (const Mapping& mapping : controller_mappings()) {
    for (const std::string& key : mapping.keys) {
      const std::string text = edited(mapping.steps, [&](YAML::Node& node) { node.remove(key); });
      CAPTURE(mapping.path, key);
      CHECK_THROWS_MATCHES(biped_config_of(text), ConfigError,
                           Message("biped.yaml: " + mapping.path + key + " is missing"));
      ++removed;
    }
  }
  CHECK(removed > 50);
  YAML::Node root = YAML::Load(biped().yaml_text);
  root.remove("controller");
  CHECK_THROWS_MATCHES(biped_config_of(YAML::Dump(root)), ConfigError, Message("biped.yaml: controller is missing"));
}

TEST_CASE("AnUnknownKeyInAnyMappingOfTheControllersSectionIsNamed") {
  const std::vector<Mapping> mappings = controller_mappings();
  CHECK(mappings.size() == 15);
  for (const Mapping& mapping : mappings) {
    const std::string text = edited(mapping.steps, [](YAML::Node& node) { node["surprise"] = 1; });
    CAPTURE(mapping.path);
    CHECK_THROWS_MATCHES(
        biped_config_of(text), ConfigError,
        MessageMatches(ContainsSubstring("biped.yaml: " + mapping.path + "surprise is not a known key")));
  }
}

TEST_CASE("AnyValueOfTheControllersSectionThatIsAWordOrNotFiniteIsRefusedByItsPath") {
  for (const Mapping& mapping : controller_mappings()) {
    for (const std::string& key : mapping.keys) {
      for (const char* value : {"surprise", ".nan", ".inf"}) {
        const std::string text = edited(mapping.steps, [&](YAML::Node& node) { node[key] = YAML::Load(value); });
        CAPTURE(mapping.path, key, value);
        CHECK_THROWS_MATCHES(biped_config_of(text), ConfigError,
                             MessageMatches(ContainsSubstring("biped.yaml: " + mapping.path + key + " ")));
      }
    }
  }
}

TEST_CASE("AValueOutOfRangeIsRefusedByItsName") {
  struct Case {
    const char* path;
    const char* value;
    const char* named;
  };
  const std::array cases{
      Case{"last_link_pitch", "1.6", "last_link_pitch"},
      Case{"last_link_pitch", "-1.6", "last_link_pitch"},
      Case{"user_command_timeout", "0", "user_command_timeout"},
      Case{"estimator.gyro_noise", "-1e-6", "gyro_noise"},
      Case{"estimator.accelerometer_noise", "0", "accelerometer_noise"},
      Case{"estimator.swing_foot_noise", "0", "swing_foot_noise"},
      Case{"estimator.foot_velocity_sigma", "0", "foot_velocity_sigma"},
      Case{"estimator.foot_position_sigma", "0", "foot_position_sigma"},
      Case{"estimator.contact_ramp", "0", "contact_ramp"},
      Case{"estimator.slip_gate", "1", "slip_gate"},
      Case{"estimator.slip_inflation", "0.5", "slip_inflation"},
      Case{"estimator.initial_tilt_sigma", "-1", "initial_tilt_sigma"},
      Case{"com_offset_observer.bandwidth", "-1", "bandwidth"},
      Case{"com_offset_observer.bandwidth", "21", "bandwidth"},
      Case{"com_offset_observer.limit", "0.3", "limit"},
      Case{"com_offset_observer.quiet_momentum", "0", "quiet_momentum"},
      Case{"force_qp.friction", "0", "friction"},
      Case{"force_qp.normal_force_min", "-1", "normal_force_min"},
      Case{"force_qp.normal_force_max", "5.0", "normal_force_max"},
      Case{"force_qp.tolerance", "0.1", "tolerance"},
      Case{"force_qp.tolerance", "0", "tolerance"},
      Case{"force_qp.max_iterations", "0", "max_iterations"},
      Case{"force_qp.max_primal_residual", "0", "max_primal_residual"},
      Case{"force_qp.max_dual_residual", "0", "max_dual_residual"},
      Case{"stand.stages", "0", "stages"},
      Case{"stand.stages", "101", "stages"},
      Case{"height.offset_rate", "0", "height.offset_rate"},
      Case{"height.offset_range", "[0.1, 0.2]", "height.offset_range"},
      Case{"height.offset_range", "[-0.2, -0.1]", "height.offset_range"},
      Case{"stand.state_weights", "[1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1]", "state_weights"},
      Case{"stand.force_weight", "0", "force_weight"},
      Case{"height.integral_gain", "-1", "height.integral_gain"},
      Case{"height.integral_limit", "-1", "height.integral_limit"},
      Case{"walk.horizon.num_fine", "0", "num_fine"},
      Case{"walk.horizon.num_coarse", "91", "horizon"},
      Case{"walk.horizon.coarse_periods", "11", "coarse_periods"},
      Case{"walk.friction", "0", "friction"},
      Case{"walk.force_weight", "0", "force_weight"},
      Case{"walk.velocity.max", "[-0.1, 0.5]", "velocity.max"},
      Case{"walk.velocity.acceleration", "0", "acceleration"},
      Case{"walk.gait.freeze", "-0.01", "freeze"},
      Case{"walk.gait.touchdown_phase", "1", "touchdown_phase"},
      Case{"walk.gait.touchdown_speed", "0", "touchdown_speed"},
      Case{"walk.recovery_crouch", "-0.1", "recovery_crouch"},
      Case{"walk.crouch_rate", "0", "crouch_rate"},
      Case{"torque_map.max_posture_error", "0", "max_posture_error"},
      Case{"walk.gait.footholds.swing_time", "0", "swing_time"},
      Case{"walk.gait.footholds.max_second_time", "0.5", "max_second_time"},
      Case{"walk.gait.footholds.crossing_forward", "0.8", "crossing_forward"},
      Case{"walk.gait.swing.apex", "1", "apex"},
      Case{"walk.gait.swing.late_depth", "0", "late_depth"},
      Case{"stepping.min_steps", "0", "min_steps"},
      Case{"stepping.settled", "[0, 0.05]", "settled"},
      Case{"torque_map.swing_kp", "-1", "swing_kp"},
      Case{"torque_map.swing_lead", "0.05", "swing_lead"},
      Case{"torque_map.max_ankle", "0", "max_ankle"},
      Case{"torque_map.max_reach", "0.4", "max_reach"},
      Case{"torque_map.limit_margin", "0.1", "limit_margin"},
      Case{"torque_map.null_space_kp", "-1", "null_space_kp"},
      Case{"torque_map.null_space_kd", "-1", "null_space_kd"},
      Case{"torque_map.lead", "0.05", "lead"},
      Case{"torque_map.lead", "-0.001", "lead"},
      Case{"safety.hold_time", "0.21", "hold_time"},
      Case{"safety.hold_time", "-0.01", "hold_time"},
      Case{"safety.damp_time", "0", "damp_time"},
      Case{"safety.max_angular_velocity", "0", "max_angular_velocity"},
      Case{"safety.max_acceleration", "-200", "max_acceleration"},
      Case{"safety.joint_position_margin", "0", "joint_position_margin"},
      Case{"safety.joint_velocity_factor", "0", "joint_velocity_factor"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.path, c.value);
    CHECK_THROWS_MATCHES(biped_config_of(biped_yaml_with(std::string("controller.") + c.path, c.value)), ConfigError,
                         MessageMatches(ContainsSubstring("biped.yaml: controller: ") && ContainsSubstring(c.named)));
  }
}

TEST_CASE("DrivesAndTheLimitsOfAFallAreReadStrictlyToo") {
  struct Case {
    const char* path;
    const char* value;
    const char* message;
  };
  const std::array cases{
      Case{"drives.damping", "[1, 1, 1, 1, 1, 1, 1, -1]", "drives.damping has an entry that is not >= 0"},
      Case{"drives.command_timeout", "0.001", "drives.command_timeout is shorter than a control period"},
      Case{"drives.comand_timeout", "0.04", "drives.comand_timeout is not a known key"},
      Case{"fallen.min_upright", "0", "fallen.min_upright must be in 0..1"},
      Case{"fallen.min_upright", "1", "fallen.min_upright must be in 0..1"},
      Case{"fallen.min_height", "0", "fallen.min_height must be > 0 m"},
      Case{"fallen.surprise", "1", "fallen.surprise is not a known key"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.path, c.value);
    CHECK_THROWS_MATCHES(biped_with(c.path, c.value), ConfigError, MessageMatches(ContainsSubstring(c.message)));
  }
}

TEST_CASE("AnUnknownEngineAndAWrongNumberOfWeightsAreRefusedByPath") {
  CHECK_THROWS_MATCHES(biped_config_of(biped_yaml_with("controller.force_qp.engine", "qpoases")), ConfigError,
                       Message("biped.yaml: controller.force_qp.engine is 'qpoases', but must be structured, "
                               "osqp-condensed or osqp-sparse"));
  CHECK_THROWS_MATCHES(biped_config_of(biped_yaml_with("controller.stand.state_weights", "[1, 2]")), ConfigError,
                       Message("biped.yaml: controller.stand.state_weights has 2 entries, but must have 12"));
}

TEST_CASE("WithEngineChangesTheEngineAndNothingElse") {
  const std::string text = biped().yaml_text;
  const std::string condensed = with_engine(text, "osqp-condensed");
  CHECK(biped_config_of(condensed).force_qp.engine == QpEngine::kOsqpCondensed);
  YAML::Node before = YAML::Load(text), after = YAML::Load(condensed);
  before["controller"]["force_qp"].remove("engine");
  after["controller"]["force_qp"].remove("engine");
  CHECK(YAML::Dump(before) == YAML::Dump(after));
  CHECK_NOTHROW(compose(robot_from_texts(condensed, biped().urdf_text)));
  CHECK_THROWS_MATCHES(compose(robot_from_texts(with_engine(text, "none"), biped().urdf_text)), ConfigError,
                       MessageMatches(ContainsSubstring("controller.force_qp.engine is 'none'")));
}

TEST_CASE("ARobotWithoutAControllerIsRefusedByName") {
  CHECK_THROWS_MATCHES(
      compose(test::biped_with("robot", "centipede")), ConfigError,
      MessageMatches(ContainsSubstring("centipede") && ContainsSubstring("there is one for biped, arm3")));
}

TEST_CASE("AnEngineForARobotWithoutAForceQpIsRefused") {
  CHECK_THROWS_MATCHES(with_engine("{robot: arm, controller: {gain: 1}}", "structured"), ConfigError,
                       MessageMatches(ContainsSubstring("--solver") && ContainsSubstring("arm has none")));
}

TEST_CASE("TheBipedFromItsTextsIsTheBiped") {
  const RobotDescription robot = robot_from_texts(biped().yaml_text, biped().urdf_text);
  CHECK(robot.name == "biped");
  CHECK(robot.model.num_joints == 8);
  CHECK(robot.feet.size() == 2);
  CHECK(robot.model.joints[0].name == robot.joint_names[0]);
  CHECK(robot.model.total_mass > 0.0);
}

TEST_CASE("AnErrorInARobotsTextsIsNamed") {
  struct Case {
    const char* path;
    const char* value;
    const char* message;
  };
  const std::array cases{
      Case{"surprise", "1", "biped.yaml: surprise is not a known key"},
      Case{"joints", "[q0_l, q1_l, q2_l, q3_l, q0_r, q1_r, q2_r, q3_r, q4_r]",
           "biped.yaml: joints has more than 8 entries"},
      Case{"joints", "q0_l", "biped.yaml: joints must be a list of names"},
      Case{"joints", "[q0_l, q1_l, q2_l, q3_l, q0_r, q1_r, q2_r, knee]", "biped URDF: "},
      Case{"feet", "[tarsus_l, paw]", "paw"},
      Case{"feet", "[tarsus_l, tarsus_r, a, b, c]", "biped.yaml: feet has more than 4 entries"},
      Case{"nominal_joint_position", "[0, 0, 0]", "biped.yaml: nominal_joint_position has 3 entries, but must have 8"},
      Case{"nominal_joint_position", "[0, -0.59, 9.0, -1.1, 0, -0.59, 1.44, -1.1]",
           "biped.yaml: nominal_joint_position puts joint q2_l outside its limits"},
      Case{"nominal_joint_position", "[0, -0.59, .nan, -1.1, 0, -0.59, 1.44, -1.1]",
           "biped.yaml: nominal_joint_position is not finite"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.path, c.value);
    CHECK_THROWS_MATCHES(robot_from_texts(biped_yaml_with(c.path, c.value), biped().urdf_text), ConfigError,
                         MessageMatches(ContainsSubstring(c.message)));
  }
  for (const char* key : {"robot", "urdf", "joints", "feet", "nominal_joint_position"}) {
    CAPTURE(key);
    YAML::Node root = YAML::Load(biped().yaml_text);
    root.remove(key);
    CHECK_THROWS_MATCHES(robot_from_texts(YAML::Dump(root), biped().urdf_text), ConfigError,
                         MessageMatches(ContainsSubstring(std::string(key) + " is missing")));
  }
  CHECK_THROWS_MATCHES(robot_from_texts(biped().yaml_text, "<robot"), ConfigError,
                       MessageMatches(ContainsSubstring("biped URDF: ")));
}

TEST_CASE("ARobotThatIsNotThereIsRefusedByItsFile") {
  CHECK_THROWS_MATCHES(
      load_robot(share_directory() / "robots", "centipede"), ConfigError,
      MessageMatches(ContainsSubstring("no robot 'centipede'") && ContainsSubstring("centipede.yaml")));
}

}  // namespace stance::config
