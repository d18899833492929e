#include "common/files/ProgramOnPath.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "tests/unit/common/TemporaryFolder.h"

namespace {

namespace fs = std::filesystem;

// PATH during a test.
class Path {
 public:
  explicit Path(const std::string& folders) : old_(std::getenv("PATH")) {
    ::setenv("PATH", folders.c_str(), 1);
  }
  ~Path() { ::setenv("PATH", old_.c_str(), 1); }
  Path(const Path&) = delete;
  Path& operator=(const Path&) = delete;

 private:
  std::string old_;
};

TEST(ProgramOnPath, IsTheFirstExecutableFile) {
  const TemporaryFolder folder;
  for (const char* name : {"folder", "data", "first", "second"}) fs::create_directory(folder.path() / name);
  fs::create_directory(folder.path() / "folder/tool");
  std::ofstream(folder.path() / "data/tool") << "no program\n";
  for (const char* name : {"first/tool", "second/tool"}) {
    std::ofstream(folder.path() / name) << "#!/bin/sh\n";
    fs::permissions(folder.path() / name, fs::perms::owner_all);
  }
  const std::string root = folder.path().string();
  const Path path(root + "/absent:" + root + "/folder:" + root + "/data:" + root + "/first:" + root +
                  "/second");
  EXPECT_EQ(common::program_on_path("tool"), folder.path() / "first/tool");
  EXPECT_EQ(common::program_on_path("other"), "");
}

TEST(ProgramOnPath, AnEmptyEntryIsTheCurrentFolder) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "tool") << "#!/bin/sh\n";
  fs::permissions(folder.path() / "tool", fs::perms::owner_all);
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  for (const char* folders : {"", ":/absent", "/absent:", "/absent::/none"}) {
    const Path path(folders);
    EXPECT_EQ(common::program_on_path("tool"), "./tool") << folders;
  }
  fs::current_path(before);
}

}  // namespace
