#include "features/feature_whitening.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

namespace relocd {
namespace {

using RowMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstRows = Eigen::Map<const RowMatrix>;

/// Variances below this part of the largest are noise.
constexpr double kVarianceFloor = 1e-4;

}  // namespace

std::vector<float> FeatureWhitening::Offset() const {
  const ConstRows basis_rows(basis.data(), inputs, outputs);
  const Eigen::Map<const Eigen::RowVectorXf> mean_row(mean.data(), inputs);
  const Eigen::RowVectorXf offset = -(mean_row * basis_rows);
  return {offset.data(), offset.data() + outputs};
}

void FeatureWhitening::Apply(std::span<const float> features, std::span<float> whitened) const {
  const auto count = static_cast<Eigen::Index>(features.size()) / inputs;
  const Eigen::Map<const Eigen::RowVectorXf> mean_row(mean.data(), inputs);
  Eigen::Map<RowMatrix>(whitened.data(), count, outputs).noalias() =
      (ConstRows(features.data(), count, inputs).rowwise() - mean_row) *
      ConstRows(basis.data(), inputs, outputs);
}

Result<FeatureWhitening> FitWhitening(std::span<const float> features, int inputs, int outputs) {
  const auto count = static_cast<Eigen::Index>(features.size()) / inputs;
  if (count < inputs || outputs < 1 || outputs > inputs) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("whitening {} features of {} dimensions to {}: needs at least as many "
                             "features as dimensions, and no more outputs than inputs",
                             count,
                             inputs,
                             outputs)};
  }
  const ConstRows rows(features.data(), count, inputs);
  if (!rows.allFinite()) {
    return Error{ErrorKind::kInvalidInput, "whitening features: one is not finite"};
  }
  const Eigen::RowVectorXf mean = rows.cast<double>().colwise().mean().cast<float>();
  const RowMatrix centred = rows.rowwise() - mean;
  Eigen::MatrixXd covariance = (centred.transpose() * centred).cast<double>();
  covariance /= static_cast<double>(count);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  const double floor = kVarianceFloor * solver.eigenvalues()(inputs - 1);

  FeatureWhitening whitening;
  whitening.inputs = inputs;
  whitening.outputs = outputs;
  whitening.mean.assign(mean.data(), mean.data() + inputs);
  whitening.basis.resize(static_cast<std::size_t>(inputs) * static_cast<std::size_t>(outputs));
  Eigen::Map<RowMatrix> basis(whitening.basis.data(), inputs, outputs);
  for (int output = 0; output < outputs; ++output) {
    const Eigen::Index component = inputs - 1 - output;  // eigenvalues come in increasing order
    const double variance = std::max(solver.eigenvalues()(component), 0.0) + floor;
    basis.col(output) = (solver.eigenvectors().col(component) / std::sqrt(variance)).cast<float>();
  }
  return whitening;
}

}  // namespace relocd
