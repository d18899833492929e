#include "common/text/Suggestion.h"

#include <gtest/gtest.h>

#include "common/text/Words.h"

namespace common {
namespace {

TEST(Suggestion, NearestName) {
  const std::vector<std::string> known{"radius", "position", "size", "colour", "mass"};
  EXPECT_EQ(nearest_name("raduis", known), "radius");
  EXPECT_EQ(nearest_name("psition", known), "position");
  EXPECT_EQ(nearest_name("color", known), "colour");
  EXPECT_EQ(nearest_name("szie", known), "size");
  EXPECT_EQ(nearest_name("sise", known), "size");
  EXPECT_EQ(nearest_name("cuont", {"amount", "count", "c"}), "count");
  EXPECT_EQ(nearest_name("sqrt", {"math.sqrt", "sort"}), "math.sqrt");
  EXPECT_EQ(nearest_name("math.abs", {"math.acos", "abs"}), "abs");
  EXPECT_EQ(nearest_name("core.sin", {"core.min", "math.sin"}), "math.sin");
  EXPECT_EQ(nearest_name("sihft.north", {"north", "shift.north", "shift.south"}), "shift.north");
  EXPECT_EQ(nearest_name("IMAGE", {"Image", "IMAGO"}), "Image");
  EXPECT_EQ(nearest_name("ba", {"ca", "aa"}), "aa");
  EXPECT_EQ(nearest_name("xyz", {"abc", "Image"}), "");
  EXPECT_EQ(nearest_name("a", {"b"}), "");
  EXPECT_EQ(nearest_name("", {}), "");
  EXPECT_EQ(did_you_mean("shift.nroth", {"shift.north", "shift.south"}), "; did you mean 'shift.north'?");
}

TEST(Words, CapitalUnlessAFileBegins) {
  EXPECT_EQ(with_capital("the ball fell"), "The ball fell");
  EXPECT_EQ(with_capital("done: 3.5 s"), "Done: 3.5 s");
  EXPECT_EQ(with_capital("sort.lua:12: no such pin"), "sort.lua:12: no such pin");
  EXPECT_EQ(with_capital("out/run: cannot be written"), "out/run: cannot be written");
  EXPECT_EQ(with_capital(""), "");
}

}  // namespace
}  // namespace common
