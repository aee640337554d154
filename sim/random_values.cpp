#include "sim/random_values.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <sstream>

#include "controller/config/strict_yaml.hpp"
#include "controller/platform/hash.hpp"
#include "controller/platform/text.hpp"
#include "sim/random.hpp"

namespace stance::sim {
namespace {

class Drawing {
 public:
  Drawing(const std::string& name, std::uint64_t seed) : name_(name), seed_(seed) {}

  /// `node` with what was drawn in it.
  YAML::Node drawn(const YAML::Node& node, const std::string& path) {
    if (node.IsMap()) return is_random(node) ? random_value(node, path) : mapping(node, path);
    if (node.IsSequence()) return list(node, path);
    return node;
  }
  const std::vector<DrawnValue>& values() const { return values_; }

 private:
  static bool is_random(const YAML::Node& node) { return node["uniform"] || node["normal"] || node["choice"]; }

  [[noreturn]] void fail(const std::string& path, const std::string& problem) const {
    throw config::ConfigError(name_ + ": " + path + " " + problem);
  }

  YAML::Node mapping(const YAML::Node& node, const std::string& path) {
    YAML::Node out(YAML::NodeType::Map);
    out.SetStyle(node.Style());
    for (const auto& entry : node) {
      const std::string key = (path.empty() ? "" : path + ".") + entry.first.Scalar();
      out.force_insert(entry.first, drawn(entry.second, key));  // a key that stands twice stays for the strict parser
    }
    return out;
  }

  YAML::Node list(const YAML::Node& node, const std::string& path) {
    YAML::Node out(YAML::NodeType::Sequence);
    out.SetStyle(node.Style());
    for (std::size_t i = 0; i < node.size(); ++i) out.push_back(drawn(node[i], entry_path(path, i)));
    return out;
  }

  YAML::Node random_value(const YAML::Node& node, const std::string& path) {
    for (const auto& entry : node) {
      const std::string& key = entry.first.Scalar();
      const bool known = node["choice"]   ? key == "choice"
                         : node["normal"] ? key == "normal"
                                          : key == "uniform" || key == "step";
      if (!known) {
        fail(path, "has '" + key + "' beside its random value: give {uniform: [a, b]}, with step or without, " +
                       "{normal: [mean, sigma]}, or {choice: [...]}");
      }
    }
    const double u = keyed_uniform(platform::hash(path, platform::hash_step(platform::kHashSeed, seed_)));
    if (node["normal"]) {
      return normal(node["normal"], path, u,
                    keyed_uniform(platform::hash(path + ".angle", platform::hash_step(platform::kHashSeed, seed_))));
    }
    return node["choice"] ? choice(node["choice"], path, u) : uniform(node, path, u);
  }

  YAML::Node uniform(const YAML::Node& node, const std::string& path, double u) {
    const YAML::Node range = node["uniform"];
    if (!range.IsSequence() || range.size() != 2) fail(path + ".uniform", "must be a list of two numbers");
    const double low = number(range[0], path + ".uniform"), high = number(range[1], path + ".uniform");
    if (low > high) fail(path + ".uniform", "must have its lower end first");
    double value = low + u * (high - low);
    if (node["step"]) {
      const double step = number(node["step"], path + ".step");
      if (!(step > 0.0)) fail(path + ".step", "must be > 0");
      constexpr double rounding = 1e-9;  // of the range, so that its upper end counts
      value = low + step * std::floor(u * (std::floor((high - low) / step + rounding) + 1.0));
    }
    values_.push_back({path, platform::to_text(value)});
    return YAML::Node(values_.back().value);
  }

  /// By Box and Muller.
  YAML::Node normal(const YAML::Node& of, const std::string& path, double u, double turn) {
    if (!of.IsSequence() || of.size() != 2) fail(path + ".normal", "must be a list of a mean and a standard deviation");
    const double mean = number(of[0], path + ".normal"), sigma = number(of[1], path + ".normal");
    if (!(sigma >= 0.0)) fail(path + ".normal", "must have a standard deviation >= 0");
    const double value = mean + sigma * std::sqrt(-2.0 * std::log(1.0 - u)) * std::cos(2.0 * M_PI * turn);
    values_.push_back({path, platform::to_text(value)});
    return YAML::Node(values_.back().value);
  }

  YAML::Node choice(const YAML::Node& from, const std::string& path, double u) {
    if (!from.IsSequence() || from.size() == 0) fail(path + ".choice", "must be a list of at least one value");
    const auto index = static_cast<std::size_t>(u * static_cast<double>(from.size()));
    const std::string place = entry_path("choice", index);
    values_.push_back({path, from[index].IsScalar() ? from[index].Scalar() : place});
    return drawn(from[index], path + "." + place);
  }

  double number(const YAML::Node& node, const std::string& path) const {
    double value = 0.0;
    if (!YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
      fail(path, "has an entry that is not a finite number");
    }
    return value;
  }

  static std::string entry_path(const std::string& path, std::size_t index) {
    return path + "[" + std::to_string(index + 1) + "]";
  }

  const std::string& name_;
  std::uint64_t seed_;
  std::vector<DrawnValue> values_;
};

}  // namespace

DrawnText draw_random_values(const std::string& text, const std::string& name, std::uint64_t seed) {
  // Refuses what is no YAML mapping, and keys that stand twice in what is not drawn, too.
  static_cast<void>(config::StrictYaml::parse(text, name));
  Drawing drawing(name, seed);
  const YAML::Node drawn = drawing.drawn(YAML::Load(text), "");
  if (drawing.values().empty()) return {text, {}};
  std::ostringstream out;
  out << YAML::Dump(drawn) << "\n\n# Drawn by the seed " << seed << " from:\n";
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) out << "# " << line << "\n";
  return {out.str(), drawing.values()};
}

}  // namespace stance::sim
