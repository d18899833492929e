#include "smartsurf/world/solver/BlockCholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

namespace smartsurf::world {
namespace {

constexpr int kSize = BlockCholesky::kSize;

// A random matrix of springs between bodies, in both forms.
template <class Sparse>
struct Springs {
  int rows;
  Sparse sparse;
  Eigen::MatrixXd dense;

  Springs(int n, double density, std::mt19937& random) : rows(n), dense(kSize * n, kSize * n) {
    std::uniform_real_distribution<double> u(0.0, 1.0);
    sparse.reset(n);
    std::vector<std::pair<int, int>> links;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        if (i != j && u(random) < density) {
          links.emplace_back(i, j);
          sparse.connect(i, j);
        }
    sparse.analyse();
    dense.setZero();
    for (int i = 0; i < kSize * n; ++i) {
      const double mass = 0.1 + u(random);
      sparse.add_to_diagonal(i / kSize, i % kSize, i % kSize, mass);
      dense(i, i) += mass;
    }
    for (const auto& [i, j] : links) {
      typename Sparse::Rows a, b;
      for (auto* rows_of : {&a, &b})
        for (auto& row : *rows_of)
          for (double& x : row) x = 2.0 * u(random) - 1.0;
      const double weight[3] = {1e3 * u(random), u(random), 0.0};
      sparse.add(i, i, weight, a, a), sparse.add(j, j, weight, b, b), sparse.add(i, j, weight, a, b);
      for (int k = 0; k < 3; ++k) {
        const Eigen::Map<const Eigen::Matrix<double, 1, kSize>> on_i(a[k]), on_j(b[k]);
        for (const auto& [row, left] : {std::pair(i, on_i), std::pair(j, on_j)})
          for (const auto& [column, right] : {std::pair(i, on_i), std::pair(j, on_j)})
            dense.block<kSize, kSize>(kSize * row, kSize * column) += weight[k] * left.transpose() * right;
      }
    }
  }
};

template <class Sparse>
void expect_solutions(std::initializer_list<int> rows) {
  std::mt19937 random(5);
  for (const int n : rows)
    for (const double density : {0.0, 0.05, 0.2, 1.0}) {
      Springs<Sparse> m(n, density, random);
      const Eigen::VectorXd right_side = Eigen::VectorXd::Random(kSize * n);
      for (int time = 0; time < 2; ++time) {  // the matrix stays as it is
        Eigen::VectorXd solution = right_side;
        ASSERT_TRUE(m.sparse.factor());
        m.sparse.solve(solution.data());
        Eigen::VectorXd at_once = right_side;
        ASSERT_TRUE(m.sparse.factor_and_solve(at_once.data()));
        ASSERT_EQ(at_once, solution);
        ASSERT_LT((m.dense * solution - right_side).norm(), 1e-8 * right_side.norm())
            << n << " rows, density " << density;
      }
    }
}

TEST(BlockCholesky, SolvesSystemsOfSprings) {
  expect_solutions<BlockCholesky>({1, 2, 3, 5, 8, 13, 21, BlockCholesky::kMaxRows});
  expect_solutions<LargeBlockCholesky>({1, 5, 33, 64, 65, LargeBlockCholesky::kMaxRows});
}

TEST(BlockCholesky, RefusesWhatIsNotPositiveDefinite) {
  BlockCholesky m;
  m.reset(1);
  m.analyse();
  for (int i = 0; i < kSize; ++i) m.add_to_diagonal(0, i, i, i == 4 ? -1.0 : 1.0);
  EXPECT_FALSE(m.factor());
}

}  // namespace
}  // namespace smartsurf::world
