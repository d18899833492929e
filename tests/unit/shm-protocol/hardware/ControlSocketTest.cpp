#include "shm-protocol/hardware/bridge/ControlSocket.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>

namespace hardware {
namespace {

using std::chrono::microseconds, std::chrono::milliseconds;

// The bridge looks at random times, about when those who ask give up. Whoever is told that a command was
// done was obeyed, and nobody else.
TEST(ControlSocket, CommandIsObeyedIfAndOnlyIfItsAnswerArrives) {
  const std::string surface = "test-control-" + std::to_string(::getpid());
  ControlSocket bridge(surface);
  std::atomic<int> obeyed = 0;
  std::atomic<bool> over = false;
  std::thread serving([&] {
    std::mt19937 random(1);
    while (!over) {
      std::this_thread::sleep_for(microseconds(random() % 2000));
      bridge.serve([&](const std::string& command) -> ControlAnswer {
        return {"did " + command, [&] { ++obeyed; }};
      });
    }
  });
  int answered = 0, given_up = 0;
  for (int i = 0; i < 1000; ++i) try {
      EXPECT_EQ(ask_bridge(surface, std::to_string(i), milliseconds(1)), "did " + std::to_string(i));
      ++answered;
    } catch (const std::runtime_error& e) {
      EXPECT_EQ(std::string(e.what()), "the bridge of surface '" + surface + "' does not answer");
      ++given_up;
    }
  over = true;
  serving.join();
  EXPECT_EQ(obeyed, answered);
  EXPECT_GT(answered, 0);
  EXPECT_GT(given_up, 0);
}

}  // namespace
}  // namespace hardware
