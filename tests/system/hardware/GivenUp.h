// Commands to a suspended bridge, whose users are told that it does not answer.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <string>

#include "shm-protocol/hardware/bridge/ControlSocket.h"
#include "tests/system/hardware/Program.h"

namespace hardware {

// Once the bridge continues, a stop is done and a release is not.
inline void check_commands_that_are_given_up(const Program& bridge, const std::string& surface) {
  const auto give_up = [&](const std::string& command) {
    bridge.suspend();
    EXPECT_THROW(ask_bridge(surface, command, std::chrono::milliseconds(20)), std::runtime_error);
    bridge.signal(SIGCONT);
    return ask_bridge(surface, "status");
  };
  EXPECT_NE(give_up("stop").find("emergency_stop by the user"), std::string::npos);
  EXPECT_NE(give_up("arm").find("emergency_stop by the user"), std::string::npos);
  EXPECT_EQ(ask_bridge(surface, "arm"), "armed\n");
  EXPECT_NE(ask_bridge(surface, "status").find("emergency_stop none"), std::string::npos);
}

}  // namespace hardware
