#include "smartsurf/run/Pacer.h"

#include <gtest/gtest.h>

using smartsurf::run::Pacer;
using namespace std::chrono_literals;

TEST(Pacer, UnpacedIsDueImmediately) {
  Pacer pacer(std::nullopt);
  const auto due = pacer.due_time(1000.0);
  EXPECT_LE(due, Pacer::Clock::now());
}

TEST(Pacer, ScalesSimulatedTimeByFactor) {
  Pacer pacer(2.0);
  const auto first = pacer.due_time(10.0);
  EXPECT_NEAR(std::chrono::duration<double>(pacer.due_time(14.0) - first).count(), 2.0, 1e-9);
  EXPECT_NEAR(std::chrono::duration<double>(pacer.due_time(30.0) - first).count(), 10.0, 1e-9);
}

TEST(Pacer, DoesNotCatchUpAfterRestart) {
  Pacer pacer(1.0);
  (void)pacer.due_time(0.0);
  pacer.restart();
  const auto now = Pacer::Clock::now();
  EXPECT_LT(pacer.due_time(5.0) - now, 1s);
}
