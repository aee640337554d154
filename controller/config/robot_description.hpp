#pragma once
// What robots/<robot>/ says of a robot's body: the one source of its masses, lengths, limits, joint order, feet and
// drives.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "controller/config/strict_yaml.hpp"
#include "controller/kinematics/fallen.hpp"
#include "controller/rigid_body/model.hpp"

namespace stance::config {

struct DriveDescription {
  JointVector damping = JointVector::Zero();  ///< N m s/rad, of DAMP, and without a valid command
  double command_timeout = 0.0;               ///< s without a valid command after which the drives damp
};

/// What a robot catches with. Its plane is square to the link's z, which points out of it.
struct Cup {
  std::string link;
  int body = 0;                        ///< body index
  Vector3 position = Vector3::Zero();  ///< m, the plane's centre in the link frame
  double radius = 0.0;                 ///< m, from the axis to the walls
  double depth = 0.0;                  ///< m, from the plane to the floor
};

struct RobotDescription {
  std::string name;
  std::string urdf_text;
  std::string yaml_text;
  std::vector<std::string> joint_names;  ///< the order of every joint vector
  std::vector<std::string> foot_links;   ///< left first; none where the base is fixed, in W's origin and turned as W is
  rigid_body::Model model;
  std::vector<rigid_body::Foot> feet;
  JointVector nominal_joint_position = JointVector::Zero();  ///< rad
  DriveDescription drives;
  kinematics::FallLimits fallen;  ///< of a robot with feet
  std::optional<Cup> cup;

  bool has_feet() const { return !foot_links.empty(); }
};

/// Whole text of a file. Throws ConfigError naming it where it cannot be read.
std::string read_text(const std::filesystem::path& file);

/// robots/<robot>/<robot>.yaml and the URDF that it names. Throws ConfigError.
RobotDescription load_robot(const std::filesystem::path& robots_directory, const std::string& robot);

/// The same from texts, as a log holds them. The `controller` section is left to biped_config_yaml.hpp. Throws
/// ConfigError.
RobotDescription robot_from_texts(const std::string& yaml_text, const std::string& urdf_text);

/// Where robots/ and sim/scenarios/ are: $STANCE_SHARE, else the source tree that this was built from, else the
/// installed share.
std::filesystem::path share_directory();

}  // namespace stance::config
