#include "apron/syntax/Suggestion.h"

#include <gtest/gtest.h>

namespace apron::syntax {
namespace {

TEST(Suggestion, NearestName) {
  EXPECT_EQ(nearest("cuont", {"amount", "count", "c"}), "count");
  EXPECT_EQ(nearest("sqrt", {"math.sqrt", "sort"}), "math.sqrt");
  EXPECT_EQ(nearest("math.abs", {"math.acos", "abs"}), "abs");
  EXPECT_EQ(nearest("core.sin", {"core.min", "math.sin"}), "math.sin");
  EXPECT_EQ(nearest("sihft.north", {"north", "shift.north", "shift.south"}), "shift.north");
  EXPECT_EQ(nearest("IMAGE", {"Image", "IMAGO"}), "Image");
  EXPECT_EQ(nearest("ba", {"ca", "aa"}), "aa");
  EXPECT_EQ(nearest("xyz", {"abc", "Image"}), "");
  EXPECT_EQ(nearest("a", {"b"}), "");
  EXPECT_EQ(nearest("", {"b"}), "");
  EXPECT_EQ(did_you_mean("shift.nroth", {"shift.north", "shift.south"}), "; did you mean 'shift.north'?");
}

}  // namespace
}  // namespace apron::syntax
