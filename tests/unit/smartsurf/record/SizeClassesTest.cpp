#include "smartsurf/record/SizeClasses.h"

#include <gtest/gtest.h>

#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

using Classes = std::vector<SizeClass>;
constexpr SizeClass kSmall = SizeClass::kSmall, kLarge = SizeClass::kLarge, kNone = SizeClass::kNone;

TEST(ClassifyObjects, ByLabelOrBySize) {
  EXPECT_EQ(classify_objects({sphere(4, "a"), sphere(2, "b"), sphere(4, "a")}),
            (Classes{kLarge, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(1, "b"), sphere(1, "a")}),
            (Classes{kLarge, kSmall}));  // equal means: alphabetical
  EXPECT_EQ(classify_objects({sphere(9, "a"), sphere(1, "a"), sphere(2, "b")}),
            (Classes{kLarge, kLarge, kSmall}));  // the mean size of a label decides
  EXPECT_EQ(classify_objects({sphere(4, "a"), sphere(2, "b"), sphere(9)}), (Classes{kLarge, kSmall, kNone}));
  EXPECT_EQ(classify_objects({sphere(4), sphere(2), sphere(3.1)}), (Classes{kLarge, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(1, "a"), sphere(2, "b"), sphere(9, "c")}),
            (Classes{kSmall, kSmall, kLarge}));
  EXPECT_EQ(classify_objects({sphere(3, "a"), sphere(3, "a")}), (Classes{kNone, kNone}));
  scene::ObjectSpec wall = sphere(50, "wall");
  wall.fixed = true;
  EXPECT_EQ(classify_objects({sphere(4), sphere(2), wall}), (Classes{kLarge, kSmall, kNone}));
  EXPECT_TRUE(classify_objects({}).empty());
}

}  // namespace
}  // namespace smartsurf::record
