// The unchanged case-study program, through the bridge, over a bad line, to the firmware.
#include <gtest/gtest.h>

#include "tests/system/hardware/Program.h"

namespace hardware {
namespace {

TEST(Chain, RunsUnchangedCaseStudyOverBadLine) {
  const std::string name = surface_name("chain");
  Device device({"--pty", line_path("chain"), "--size", "24x24", "--period-ms", "5", "--drop", "0.0001",
                 "--corrupt", "0.0001", "--delay-ms", "7", "--seed", "3"});
  Program bridge({SURFACE_BRIDGE, device.name, "--shm", name, "--silence", "20"});
  bridge.await_output("controllers attach");
  Program apron({APRON, "run", CASE_STUDY, "--shm", name, "--ticks", "300"});
  EXPECT_EQ(apron.wait(), 0) << apron.output();
  bridge.signal(SIGINT);
  EXPECT_EQ(bridge.wait(), 130) << bridge.output();
  // The very first answer may be to a frame that the bridge had given up, because it looked just before apron
  // attached.
  EXPECT_GE(bridge.figure("answers"), 299u);
  EXPECT_GT(bridge.figure("missed"), 0u);
  EXPECT_GT(bridge.figure("damaged_packets"), 0u);
  EXPECT_FALSE(segment_exists(name));
}

}  // namespace
}  // namespace hardware
