#include "common/text/Unit.h"

#include <gtest/gtest.h>

namespace common {
namespace {

TEST(Unit, IsTypeset) {
  EXPECT_EQ(typeset_unit("mass*u/s^2"), "mass·u/s²");
  EXPECT_EQ(typeset_unit("u^3/s"), "u³/s");
  EXPECT_EQ(typeset_unit("a^4^"), "a^4^");
  EXPECT_EQ(with_unit("pressure", "mass*u/s^2"), "pressure [mass·u/s²]");
  EXPECT_EQ(with_unit("hit", ""), "hit");
}

}  // namespace
}  // namespace common
