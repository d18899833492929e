#include "smartsurf/surface/WorkerPool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

using smartsurf::surface::WorkerPool;

TEST(WorkerPool, CoversEveryRowOnce) {
  for (const int threads : {1, 2, 3, 8})
    for (const int rows : {0, 1, 2, 5, 16, 101}) {
      WorkerPool pool(threads);
      EXPECT_EQ(pool.threads(), threads);
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(rows));
      for (int round = 0; round < 50; ++round)
        pool.for_rows(rows, [&](int begin, int end) {
          for (int r = begin; r < end; ++r) ++visits[static_cast<std::size_t>(r)];
        });
      for (const auto& v : visits) EXPECT_EQ(v, 50);
    }
}
