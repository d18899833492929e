#include "common/files/UserFile.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/unit/common/TemporaryFolder.h"

namespace {

TEST(UserFile, IsKeptInTheFolderOfTheUserOrNowhere) {
  const TemporaryFolder folder;
  ASSERT_EQ(setenv("XDG_CONFIG_HOME", folder.path().c_str(), 1), 0);
  EXPECT_EQ(common::read_user_file("a"), "");
  common::write_user_file("a", "one\n");
  EXPECT_EQ(common::read_user_file("a"), "one\n");
  EXPECT_EQ(common::user_file("a"), folder.path() / "smartsurf" / "a");
  common::remove_user_file("a");
  EXPECT_EQ(common::read_user_file("a"), "");
  for (const char* const nowhere : {"/proc/nowhere", "relative"}) {
    ASSERT_EQ(setenv("XDG_CONFIG_HOME", nowhere, 1), 0);
    ASSERT_EQ(setenv("HOME", "/proc/nowhere", 1), 0);
    common::write_user_file("a", "lost");
    EXPECT_EQ(common::read_user_file("a"), "");
  }
  unsetenv("XDG_CONFIG_HOME");
}

}  // namespace
