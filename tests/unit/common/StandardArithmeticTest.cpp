#include "common/arithmetic/StandardArithmetic.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cfenv>
#include <limits>

#include "common/threads/ThreadPool.h"
#include "tests/unit/common/HostArithmetic.h"

namespace common {
namespace {

bool is_standard() {
  volatile float least = std::numeric_limits<float>::min();
  volatile float half = least / 2;
  return half * 2 == least && std::fegetround() == FE_TONEAREST;
}

TEST(StandardArithmetic, LastsWhileTheObjectLives) {
  EXPECT_TRUE(is_standard());
  {
    const HostArithmetic host;
    EXPECT_FALSE(is_standard());
    {
      const StandardArithmetic standard;
      EXPECT_TRUE(is_standard());
    }
    EXPECT_TRUE(HostArithmetic::is_set());
  }
  {
    const StandardArithmetic standard;
    std::fesetround(FE_DOWNWARD);  // as a library that is loaded meanwhile
  }
  EXPECT_TRUE(is_standard());
}

TEST(StandardArithmetic, ThreadsOfAPoolHaveIt) {
  const HostArithmetic host;
  ThreadPool pool(4, 0.0);
  std::atomic<int> standard = 0;
  pool.parallel_for_rows(8, [&](int begin, int) { standard += begin > 0 && is_standard(); });
  EXPECT_EQ(standard, 3);
}

}  // namespace
}  // namespace common
