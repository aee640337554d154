#pragma once
// YAML in which every key is asked for and no other key may stand: a typing error is an error, not a default.
#include <yaml-cpp/yaml.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace stance::config {

/// What is wrong with a configuration: names the file, the key, its value and the remedy.
class ConfigError : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// One mapping of a YAML document. Every key that is read is required, but for a list of mappings; `finish()` refuses
/// the keys that nobody read.
class StrictYaml {
 public:
  /// Parses `text`; `name` stands in messages (a file's name). Throws ConfigError where it is no YAML mapping, or a key
  /// stands twice in one mapping.
  static StrictYaml parse(const std::string& text, const std::string& name);

  /// Does the key stand there?
  bool has(const std::string& key) const;
  /// Does a number or a word stand there, and neither nothing nor a list nor a mapping?
  bool is_scalar(const std::string& key) const;

  double number(const std::string& key);
  int integer(const std::string& key);
  std::string text(const std::string& key);
  /// A list of numbers, exactly `size` of them where size > 0.
  std::vector<double> numbers(const std::string& key, int size = 0);
  std::vector<std::string> texts(const std::string& key);
  /// A mapping below this one. The caller finishes it too.
  StrictYaml mapping(const std::string& key);
  /// A list of mappings; empty where the key is missing.
  std::vector<StrictYaml> mappings(const std::string& key);
  /// Marks a key as read without reading it: another reader takes that section.
  void leave(const std::string& key);

  /// Throws ConfigError naming the first key that nobody asked for.
  void finish() const;
  /// Throws ConfigError: "<file>: <path>.<key> <problem>".
  [[noreturn]] void fail(const std::string& key, const std::string& problem) const;

 private:
  StrictYaml(const YAML::Node& node, std::string file, std::string path);
  YAML::Node require(const std::string& key);
  /// Refuses, here and below, a key that stands twice (yaml-cpp keeps the first and says nothing) or is no name.
  void check_keys() const;
  std::string entry_path(const std::string& key, std::size_t index) const;

  YAML::Node node_;
  std::string file_;
  std::string path_;  ///< of this mapping within the file, as "controller.safety."
  std::vector<std::string> read_;
};

}  // namespace stance::config
