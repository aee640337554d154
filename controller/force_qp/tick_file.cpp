#include "controller/force_qp/tick_file.hpp"

#include <bit>
#include <stdexcept>

namespace stance::force_qp {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename T>
void put(std::ostream& out, T value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
}
template <typename Matrix>
void put_matrix(std::ostream& out, const Matrix& matrix) {
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) put<double>(out, matrix(i, j));
  }
}

}  // namespace

void TickWriter::write_header() {
  out_.write(kTickFileMagic, sizeof kTickFileMagic - 1);
  put<std::int32_t>(out_, sizes_.num_contacts);
  put<std::int32_t>(out_, ticks_);
  put<std::int32_t>(out_, sizes_.num_stages);
  put<std::int32_t>(out_, has_terminal_cost_);
  put<double>(out_, friction_);
  put<double>(out_, typical_force_);
}

void TickWriter::write(const Problem& problem) {
  if (ticks_ == 0) {
    sizes_ = problem.sizes;
    friction_ = problem.friction;
    has_terminal_cost_ = problem.has_terminal_cost;
    write_header();
  } else if (problem.sizes.num_stages != sizes_.num_stages || problem.sizes.num_contacts != sizes_.num_contacts ||
             problem.friction != friction_ || problem.has_terminal_cost != has_terminal_cost_) {
    throw std::invalid_argument("force QP " + std::to_string(ticks_ + 1) +
                                " has other sizes, friction or terminal cost than the first of its file");
  }
  put_matrix(out_, problem.x0);
  for (const StageData& stage : problem.stages) {
    put_matrix(out_, stage.dynamics.A);
    put_matrix(out_, stage.dynamics.B);
    put_matrix(out_, stage.dynamics.g);
    put_matrix(out_, stage.x_ref);
    put_matrix(out_, stage.Q);
    put_matrix(out_, stage.f_ref);
    put_matrix(out_, stage.R);
    for (const auto& bounds : {stage.fz_min, stage.fz_max}) {
      for (int c = 0; c < sizes_.num_contacts; ++c) put<double>(out_, bounds[static_cast<std::size_t>(c)]);
    }
  }
  if (has_terminal_cost_) put_matrix(out_, problem.terminal_cost);
  ++ticks_;
}

bool TickWriter::finish() {
  if (ticks_ > 0) {
    out_.seekp(0);
    write_header();
  }
  return static_cast<bool>(out_.flush());
}

}  // namespace stance::force_qp
