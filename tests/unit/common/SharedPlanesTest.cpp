#include "common/process/SharedPlanes.h"

#include <gtest/gtest.h>

using common::SharedPlanes;

namespace {

std::optional<common::PlaneNames> names_after(const std::vector<std::string>& names) {
  const SharedPlanes planes;
  EXPECT_TRUE(SharedPlanes::describe(planes.descriptor(), {names, 2, 3}));
  return planes.names(2, 3);
}

TEST(SharedPlanes, ReturnsTheChildsNamesAndValues) {
  const SharedPlanes planes;
  EXPECT_FALSE(planes.names(2, 3));
  ASSERT_TRUE(SharedPlanes::describe(planes.descriptor(), {{"SIZE", "ch[0]"}, 2, 3}));
  const auto shown = planes.names(2, 3);
  ASSERT_TRUE(shown);
  EXPECT_EQ(shown->names, (std::vector<std::string>{"SIZE", "ch[0]"}));
  EXPECT_FALSE(planes.names(3, 2));
  std::vector<float> values(12);
  EXPECT_FALSE(planes.read(values));
  ASSERT_TRUE(SharedPlanes::write(planes.descriptor(), 0, std::vector<float>(12, 4.0F)));
  EXPECT_TRUE(planes.read(values));
  EXPECT_EQ(values[11], 4.0F);
}

TEST(SharedPlanes, RefusesNamesThatAreNoDatasets) {
  for (const char* name : {"", ".", "..", "a/b", "a b", "a\nb", "\x1b[2J", "\xff"})
    EXPECT_FALSE(names_after({"SIZE", name})) << name;
  EXPECT_FALSE(names_after({"SIZE", "SIZE"}));
  EXPECT_TRUE(names_after({"SIZE", "size", "f.x"}));
}

}  // namespace
