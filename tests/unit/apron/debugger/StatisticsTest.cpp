#include "apron/debugger/Statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

namespace apron::debugger {
namespace {

TEST(Statistics, ExtremesMeanAndCounts) {
  const Statistics s = compute_statistics({0.0F, 1.0F, 2.0F, 5.0F, NAN, INFINITY, -3.0F});
  EXPECT_EQ(s.min, -3.0F);
  EXPECT_EQ(s.max, 5.0F);
  EXPECT_DOUBLE_EQ(s.mean, 1.0);
  EXPECT_EQ(s.finite, 5U);
  EXPECT_EQ(s.non_finite, 2U);
  EXPECT_EQ(s.non_zero, 6U);
}

TEST(Statistics, HistogramCountsEachFiniteCellOnce) {
  std::vector<float> cells(1000);
  std::iota(cells.begin(), cells.end(), 0.0F);
  const Statistics s = compute_statistics(cells);
  EXPECT_EQ(std::accumulate(s.histogram.begin(), s.histogram.end(), 0U), 1000U);
  // 999 / 64 = 15.6, so every bin has 15 or 16 whole numbers.
  for (const std::uint32_t count : s.histogram) EXPECT_TRUE(count == 15 || count == 16) << count;
}

TEST(Statistics, SingleValueNoneAndExtremeRange) {
  const Statistics same = compute_statistics(std::vector<float>(12, 7.0F));
  EXPECT_EQ(same.histogram[0], 12U);
  const Statistics none = compute_statistics({NAN, NAN});
  EXPECT_EQ(none.finite, 0U);
  EXPECT_EQ(none.min, 0.0F);
  const float most = std::numeric_limits<float>::max();
  const Statistics far = compute_statistics({-most, most, 0.0F});
  EXPECT_EQ(far.histogram.front(), 1U);
  EXPECT_EQ(far.histogram.back(), 1U);
  EXPECT_EQ(far.histogram[kHistogramBins / 2], 1U);
}

TEST(Statistics, AutomaticRangeContainsZeroAndIsNeverEmpty) {
  const auto expect = [](const std::vector<float>& cells, float low, float high) {
    EXPECT_EQ(automatic_range(cells).low, low);
    EXPECT_EQ(automatic_range(cells).high, high);
  };
  expect({2.0F, 5.0F}, 0.0F, 5.0F);
  expect({-2.0F, 5.0F}, -2.0F, 5.0F);
  expect({-4.0F, -2.0F}, -4.0F, 0.0F);
  expect({0.0F, 0.0F}, 0.0F, 1.0F);
  expect({1.0F, 1.0F, NAN}, 0.0F, 1.0F);
}

}  // namespace
}  // namespace apron::debugger
