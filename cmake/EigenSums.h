// For WebAssembly, where Eigen has no vectors: a sum of four floats in the order of its vectors on x86-64.
#pragma once

#include <Eigen/Core>

namespace Eigen::internal {

template <class Evaluator>
struct redux_impl<scalar_sum_op<float, float>, Evaluator, DefaultTraversal, CompleteUnrolling> {
  using Sum = scalar_sum_op<float, float>;
  using Scalar = float;
  template <class Expression>
  static float run(const Evaluator& evaluator, const Sum& sum, const Expression&) {
    constexpr int kSize = Evaluator::SizeAtCompileTime, kInner = Evaluator::InnerSizeAtCompileTime;
    if constexpr (kSize == 4) {
      const auto at = [&](int i) { return evaluator.coeffByOuterInner(i / kInner, i % kInner); };
      return (at(0) + at(2)) + (at(1) + at(3));
    } else {
      return redux_novec_unroller<Sum, Evaluator, 0, kSize>::run(evaluator, sum);
    }
  }
};

}  // namespace Eigen::internal
