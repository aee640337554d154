#include "controller/config/strict_yaml.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stance::config {
namespace {

/// Converts a scalar, or fails naming what was expected.
template <typename T>
T convert(const StrictYaml& where, const std::string& key, const YAML::Node& node, const char* expected) {
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    const std::string value = node.IsScalar() ? "'" + node.Scalar() + "'" : "a list or a mapping";
    where.fail(key, "is " + value + ", but must be " + expected);
  }
}

double finite(const StrictYaml& where, const std::string& key, const YAML::Node& node) {
  const auto value = convert<double>(where, key, node, "a number");
  if (!std::isfinite(value)) where.fail(key, "is not finite");
  return value;
}

}  // namespace

StrictYaml::StrictYaml(const YAML::Node& node, std::string file, std::string path)
    : node_(node), file_(std::move(file)), path_(std::move(path)) {}

StrictYaml StrictYaml::parse(const std::string& text, const std::string& name) {
  YAML::Node node;
  try {
    node = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw ConfigError(name + ": not YAML: " + error.what());
  }
  if (!node.IsMap()) throw ConfigError(name + ": must be a mapping of keys to values");
  StrictYaml root(node, name, "");
  root.check_keys();
  return root;
}

void StrictYaml::check_keys() const {
  std::vector<std::string> keys;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) fail("a key", "is a list or a mapping, but must be a name");
    const std::string& key = entry.first.Scalar();
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) fail(key, "stands twice");
    keys.push_back(key);
    if (entry.second.IsMap()) StrictYaml(entry.second, file_, path_ + key + ".").check_keys();
    if (!entry.second.IsSequence()) continue;
    for (std::size_t i = 0; i < entry.second.size(); ++i) {
      if (entry.second[i].IsMap()) StrictYaml(entry.second[i], file_, entry_path(key, i)).check_keys();
    }
  }
}

std::string StrictYaml::entry_path(const std::string& key, std::size_t index) const {
  return path_ + key + "[" + std::to_string(index + 1) + "].";
}

bool StrictYaml::has(const std::string& key) const { return static_cast<bool>(node_[key]); }

bool StrictYaml::is_scalar(const std::string& key) const {
  const YAML::Node value = node_[key];
  return value && value.IsScalar();
}

YAML::Node StrictYaml::require(const std::string& key) {
  read_.push_back(key);
  const YAML::Node value = node_[key];
  if (!value || value.IsNull()) fail(key, "is missing");
  return value;
}

double StrictYaml::number(const std::string& key) { return finite(*this, key, require(key)); }
int StrictYaml::integer(const std::string& key) { return convert<int>(*this, key, require(key), "a whole number"); }

std::string StrictYaml::text(const std::string& key) {
  return convert<std::string>(*this, key, require(key), "a text");
}

std::vector<double> StrictYaml::numbers(const std::string& key, int size) {
  const YAML::Node list = require(key);
  if (!list.IsSequence()) fail(key, "must be a list of numbers");
  if (size > 0 && list.size() != static_cast<std::size_t>(size)) {
    fail(key, "has " + std::to_string(list.size()) + " entries, but must have " + std::to_string(size));
  }
  std::vector<double> values;
  for (const auto& entry : list) values.push_back(finite(*this, key, entry));
  return values;
}

std::vector<std::string> StrictYaml::texts(const std::string& key) {
  const YAML::Node list = require(key);
  if (!list.IsSequence()) fail(key, "must be a list of names");
  std::vector<std::string> values;
  for (const auto& entry : list) values.push_back(convert<std::string>(*this, key, entry, "a name"));
  return values;
}

StrictYaml StrictYaml::mapping(const std::string& key) {
  const YAML::Node value = require(key);
  if (!value.IsMap()) fail(key, "must be a mapping of keys to values");
  return {value, file_, path_ + key + "."};
}

std::vector<StrictYaml> StrictYaml::mappings(const std::string& key) {
  std::vector<StrictYaml> entries;
  if (!has(key)) return entries;
  const YAML::Node list = require(key);
  if (!list.IsSequence()) fail(key, "must be a list");
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!list[i].IsMap()) fail(key, "entry " + std::to_string(i + 1) + " must be a mapping of keys to values");
    entries.push_back(StrictYaml(list[i], file_, entry_path(key, i)));
  }
  return entries;
}

void StrictYaml::leave(const std::string& key) { read_.push_back(key); }

void StrictYaml::finish() const {
  for (const auto& entry : node_) {
    const auto key = entry.first.as<std::string>();
    if (std::find(read_.begin(), read_.end(), key) == read_.end()) {
      fail(key, "is not a known key: correct its spelling or remove it");
    }
  }
}

void StrictYaml::fail(const std::string& key, const std::string& problem) const {
  throw ConfigError(file_ + ": " + path_ + key + " " + problem);
}

}  // namespace stance::config
