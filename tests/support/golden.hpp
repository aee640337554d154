#pragma once
// Reading the reference vectors of tests/golden (JSON, which is YAML: one parser serves both).
#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace stance::test {

/// Where the reference vectors are: $STANCE_GOLDEN_DIR, else the source tree's tests/golden.
inline std::filesystem::path golden_directory() {
  const char* directory = std::getenv("STANCE_GOLDEN_DIR");
  return directory != nullptr ? std::filesystem::path(directory)
                              : std::filesystem::path(STANCE_SOURCE_DIR "/tests/golden");
}

/// A whole file, as "leg000.json". Throws std::runtime_error naming the path where it cannot be read or parsed.
inline YAML::Node load_golden(const std::string& file) {
  const std::filesystem::path path = golden_directory() / file;
  try {
    return YAML::LoadFile(path.string());
  } catch (const YAML::Exception& error) {
    throw std::runtime_error("golden file " + path.string() + ": " + error.what());
  }
}

/// The cases of a file: at least one, lest a test pass on none.
inline YAML::Node golden_cases(const YAML::Node& file) {
  const YAML::Node cases = file["cases"];
  if (!cases || cases.size() == 0) throw std::runtime_error("a golden file has no cases");
  return cases;
}

/// A whole file as text, as "arm5.urdf". Throws std::runtime_error naming the path where it cannot be read.
inline std::string golden_text(const std::string& file) {
  const std::filesystem::path path = golden_directory() / file;
  std::ifstream stream(path);
  if (!stream) throw std::runtime_error("golden file " + path.string() + ": cannot be read");
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// A list of numbers. Rows may be Eigen::Dynamic; a fixed size must fit exactly, else std::runtime_error.
template <int Rows = Eigen::Dynamic>
Eigen::Matrix<double, Rows, 1> as_vector(const YAML::Node& list) {
  const auto rows = static_cast<Eigen::Index>(list.size());
  if (!list.IsSequence() || (Rows != Eigen::Dynamic && rows != Rows)) {
    throw std::runtime_error("a list of " + std::to_string(rows) + " numbers does not fit " + std::to_string(Rows));
  }
  Eigen::Matrix<double, Rows, 1> out(rows);
  for (Eigen::Index i = 0; i < rows; ++i) out(i) = list[static_cast<std::size_t>(i)].as<double>();
  return out;
}

/// A list of rows of numbers (row-major). Sizes as in as_vector.
template <int Rows = Eigen::Dynamic, int Cols = Eigen::Dynamic>
Eigen::Matrix<double, Rows, Cols> as_matrix(const YAML::Node& rows) {
  const auto num_rows = static_cast<Eigen::Index>(rows.size());
  const auto num_cols = num_rows > 0 && rows.IsSequence() ? static_cast<Eigen::Index>(rows[0].size()) : 0;
  if (num_cols == 0 || (Rows != Eigen::Dynamic && num_rows != Rows) || (Cols != Eigen::Dynamic && num_cols != Cols)) {
    throw std::runtime_error("a " + std::to_string(num_rows) + " x " + std::to_string(num_cols) +
                             " matrix does not fit " + std::to_string(Rows) + " x " + std::to_string(Cols));
  }
  Eigen::Matrix<double, Rows, Cols> out(num_rows, num_cols);
  for (Eigen::Index r = 0; r < num_rows; ++r) {
    out.row(r) = as_vector<Cols>(rows[static_cast<std::size_t>(r)]).transpose();
  }
  return out;
}

/// node[key] as a number, a vector, a matrix. They throw std::exception with a message that names a missing key.
inline double golden_number(const YAML::Node& node, const std::string& key) { return node[key].as<double>(); }

template <int Rows = Eigen::Dynamic>
Eigen::Matrix<double, Rows, 1> golden_vector(const YAML::Node& node, const std::string& key) {
  return as_vector<Rows>(node[key]);
}

template <int Rows = Eigen::Dynamic, int Cols = Eigen::Dynamic>
Eigen::Matrix<double, Rows, Cols> golden_matrix(const YAML::Node& node, const std::string& key) {
  return as_matrix<Rows, Cols>(node[key]);
}

/// The largest |a - b| over the entries: what a test compares with its tolerance.
template <typename A, typename B>
double max_difference(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return (a - b).cwiseAbs().maxCoeff();
}

}  // namespace stance::test
