#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "common/confine/Confinement.h"
#include "tests/unit/common/TemporaryFolder.h"

namespace {

TEST(GraphicsDevices, AreThoseOfDriversAlone) {
  const TemporaryFolder folder;
  for (const char* const name :
       {"nvidiactl", "nvidia0", "mali0", "dxg", "nvme0n1", "null", "sda", "mem", "kmsg", "nvram"})
    std::ofstream(folder.path() / name);
  std::filesystem::create_directory(folder.path() / "dri");
  EXPECT_EQ(common::graphics_devices(folder.path()),
            (std::vector<std::filesystem::path>{folder.path() / "dxg", folder.path() / "mali0",
                                                folder.path() / "nvidia0", folder.path() / "nvidiactl"}));
  EXPECT_TRUE(common::graphics_devices(folder.path() / "nowhere").empty());
}

}  // namespace
