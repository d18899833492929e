// Time-step mode with both sides in one process: turn-taking, value checks, and succession of controllers.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

struct Pair {
  explicit Pair(const std::string& what, bool hold = true, bool in_place = false) : name(unique_name(what)) {
    auto config = small_surface(name);
    config.hold_last_frame = hold;
    config.answers_in_place = in_place;
    surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  }
  void attach() { controller = std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(name)); }
  void fill_actuators(float height) {
    std::ranges::fill(controller->actuator(kHeight), height);
    std::ranges::fill(controller->actuator<std::uint8_t>(kLamp), std::uint8_t{1});
    std::ranges::fill(controller->actuator<std::uint32_t>(kValve), 12u);
  }
  // The controller disappears without detaching, as after kill -9.
  void kill_controller() {
    RawSegment raw(name);
    const auto process = raw.header().claim.controller_process;
    const auto detached = raw.header().claim.detached;
    controller.reset();
    raw.header().claim.detached = detached;
    raw.header().claim.controller_process = process - (std::uint64_t{1} << 22);
  }

  std::string name;
  std::unique_ptr<SurfaceEndpoint> surface;
  std::unique_ptr<ControllerEndpoint> controller;
};

TEST(Lockstep, OneTick) {
  Pair p("tick");
  p.attach();
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kTimeout);
  p.surface->sensor(kDistance)[3] = 2.5f;
  p.surface->sensor<std::uint8_t>(kColour)[104] = 9;
  ASSERT_EQ(p.surface->publish(10, 0.25, 77), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(10, kNoWait), Status::kTimeout);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  EXPECT_EQ(p.controller->sensor_info().tick, 10u);
  EXPECT_EQ(p.controller->sensor_info().time_s, 0.25);
  EXPECT_EQ(p.controller->sensor_info().status, 77u);
  EXPECT_EQ(p.controller->sensor(kDistance)[3], 2.5f);
  EXPECT_EQ(p.controller->sensor<std::uint8_t>(kColour)[104], 9);
  p.fill_actuators(3.5f);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(10, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->actuator(kHeight)[34], 3.5f);
  EXPECT_EQ(p.surface->actuator<std::uint32_t>(kValve)[69], 12u);
  EXPECT_EQ(p.surface->actuator_info().tick, 10u);
  EXPECT_EQ(p.surface->actuator_info().answers, 1u);
  EXPECT_EQ(p.surface->counters().clamped, 0u);
}

TEST(Lockstep, NeitherSideRunsAhead) {
  Pair p("ahead");
  p.attach();
  EXPECT_EQ(p.controller->publish(), Status::kOutOfTurn);
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOutOfTurn);
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.surface->publish(1, 0.0), Status::kOutOfTurn);
  EXPECT_EQ(p.surface->await_actuators(5, kNoWait), Status::kOutOfTurn);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kOutOfTurn);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  EXPECT_EQ(p.controller->publish(), Status::kOutOfTurn);
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kTimeout);
  EXPECT_EQ(p.surface->publish(1, 0.0), Status::kOutOfTurn);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->publish(1, 0.0), Status::kOk);
}

TEST(BadValues, ReplacedAndCounted) {
  Pair p("clamp");
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.fill_actuators(1.0f);
  auto height = p.controller->actuator(kHeight);
  height[0] = std::numeric_limits<float>::quiet_NaN();
  height[1] = INFINITY;
  height[2] = -INFINITY;
  height[3] = 4.0001f;
  height[4] = -1.0001f;
  height[5] = 4.0f;
  height[6] = -1.0f;
  height[34] = -std::numeric_limits<float>::quiet_NaN();
  auto lamp = p.controller->actuator<std::uint8_t>(kLamp);
  lamp[34] = 101;
  auto valve = p.controller->actuator<std::uint32_t>(kValve);
  valve[0] = 9;
  valve[69] = 4'000'000'000u;
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  const auto seen = p.surface->actuator(kHeight);
  const float expected[] = {0.5f, 4.0f, -1.0f, 4.0f, -1.0f, 4.0f, -1.0f, 1.0f};
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(seen[i], expected[i]) << i;
  EXPECT_EQ(seen[34], 0.5f);
  EXPECT_EQ(p.surface->actuator<std::uint8_t>(kLamp)[34], 100);
  EXPECT_EQ(p.surface->actuator<std::uint32_t>(kValve)[0], 10u);
  EXPECT_EQ(p.surface->actuator<std::uint32_t>(kValve)[69], 20u);
  EXPECT_EQ(p.surface->counters().clamped, 9u);
  EXPECT_EQ(p.controller->surface_counters().clamped, 9u);
}

TEST(BadValues, UncheckedInPlaceAndCountedByCaller) {
  Pair p("unchecked", true, true);
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.fill_actuators(1.0f);
  p.controller->actuator(kHeight)[0] = 9.0f;
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->actuator(kHeight)[0], 9.0f);
  EXPECT_EQ(p.surface->counters().clamped, 0u);
  p.surface->count_clamped(3);
  EXPECT_EQ(p.controller->surface_counters().clamped, 3u);
}

// The current answer stays in its slot while the next one is written; after the loss of the controller the
// surface's own copy is in effect.
TEST(Lockstep, AnswersStayInPlaceUntilControllerIsLost) {
  for (const bool hold : {true, false}) {
    Pair p("in-place", hold, true);
    EXPECT_EQ(p.surface->actuator(kHeight)[0], 0.5f);  // the safe frame
    p.attach();
    for (std::uint64_t tick = 0; tick < 5; ++tick) {
      ASSERT_EQ(p.surface->publish(tick, 0.0), Status::kOk);
      ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
      const auto before = p.surface->actuator(kHeight)[34];
      p.fill_actuators(static_cast<float>(tick) / 2);
      EXPECT_EQ(p.surface->actuator(kHeight)[34], before) << tick;
      auto height = p.controller->actuator(kHeight);
      ASSERT_EQ(p.controller->publish(), Status::kOk);
      ASSERT_EQ(p.surface->await_actuators(tick, kNoWait), Status::kOk);
      EXPECT_EQ(p.surface->actuator(kHeight)[34], static_cast<float>(tick) / 2);
      height[34] = 3.75f;  // in place: a later store by the controller is visible
      EXPECT_EQ(p.surface->actuator(kHeight)[34], 3.75f);
    }
    ASSERT_EQ(p.surface->publish(5, 0.0), Status::kOk);
    p.kill_controller();
    EXPECT_EQ(p.surface->await_actuators(5), Status::kControllerDead);
    EXPECT_EQ(p.surface->actuator(kHeight)[34], hold ? 3.75f : 0.5f);
    RawSegment raw(p.name);
    for (std::uint64_t frame : {5u, 6u})
      std::memset(static_cast<void*>(&raw.actuator_slot(frame) + 1), 0xFF,
                  raw.header().geometry.actuator_slot_bytes - sizeof(ssp_slot));
    EXPECT_EQ(p.surface->actuator(kHeight)[34], hold ? 3.75f : 0.5f);
  }
}

TEST(Lockstep, TakenFrameIsImmutable) {
  Pair p("private");
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.fill_actuators(1.0f);
  auto height = p.controller->actuator(kHeight);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  height[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(p.surface->actuator(kHeight)[0], 1.0f);
}

TEST(Lockstep, SafeValuesUntilFirstFrame) {
  Pair p("safe");
  EXPECT_EQ(p.surface->actuator(kHeight)[0], 0.5f);
  EXPECT_EQ(p.surface->actuator<std::uint8_t>(kLamp)[34], 7);
  EXPECT_EQ(p.surface->actuator<std::uint32_t>(kValve)[1], 11u);
  EXPECT_EQ(p.surface->actuator_info().frame, 0u);
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kNoController);
  EXPECT_EQ(p.surface->publish(1, 0.0), Status::kOk);  // abandoned: the surface may continue alone
}

TEST(Lockstep, HoldsLastFrameOrSafeValuesAfterControllerDeath) {
  for (const bool hold : {true, false}) {
    Pair p("death", hold);
    p.attach();
    ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
    ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
    p.fill_actuators(3.0f);
    ASSERT_EQ(p.controller->publish(), Status::kOk);
    ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
    ASSERT_EQ(p.surface->publish(1, 0.0), Status::kOk);
    p.kill_controller();
    EXPECT_EQ(p.surface->await_actuators(1), Status::kControllerDead);  // no deadline: death ends the wait
    EXPECT_EQ(p.surface->actuator(kHeight)[0], hold ? 3.0f : 0.5f);
    EXPECT_EQ(p.surface->actuator<std::uint8_t>(kLamp)[34], hold ? 1 : 7);
    EXPECT_EQ(p.surface->await_actuators(1), Status::kNoController);
    EXPECT_FALSE(p.surface->has_controller());
  }
}

TEST(Lockstep, DistinguishesDetachFromDeath) {
  Pair p("leave", false);
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kTimeout);
  p.controller.reset();
  EXPECT_EQ(p.surface->await_actuators(0), Status::kControllerClosed);
  EXPECT_EQ(p.surface->await_actuators(0), Status::kNoController);
  EXPECT_EQ(p.surface->await_controller({.timeout = 10ms}), Status::kTimeout);
  p.attach();
  EXPECT_EQ(p.surface->await_controller(), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait),
            Status::kOk);  // the frame that the predecessor left unanswered
  p.fill_actuators(2.0f);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->actuator(kHeight)[0], 2.0f);
}

// The answer is present at the first poll, so the surface has not examined the claim.
TEST(Lockstep, ReportsDetachOfImmediatelyAnsweringController) {
  for (const bool before_the_look : {false, true}) {
    Pair p("quick", false);
    for (std::uint64_t tick = 0; tick < 4; tick += 2) {  // and of the next one too
      p.attach();
      ASSERT_EQ(p.surface->publish(tick, 0.0), Status::kOk);
      ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
      p.fill_actuators(3.0f);
      ASSERT_EQ(p.controller->publish(), Status::kOk);
      if (before_the_look) p.controller.reset();
      ASSERT_EQ(p.surface->await_actuators(tick, kNoWait), Status::kOk);
      EXPECT_EQ(p.surface->actuator(kHeight)[0], 3.0f);
      ASSERT_EQ(p.surface->publish(tick + 1, 0.0), Status::kOk);
      p.controller.reset();
      EXPECT_EQ(p.surface->await_actuators(tick + 1, kNoWait), Status::kControllerClosed);
      EXPECT_EQ(p.surface->actuator(kHeight)[0], 0.5f);  // the safe value
      EXPECT_EQ(p.surface->await_actuators(tick + 1, kNoWait), Status::kNoController);
    }
  }
}

TEST(Lockstep, SuccessorDoesNotAnswerTwice) {
  Pair p("twice");
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  p.controller.reset();
  p.attach();
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kTimeout);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  ASSERT_EQ(p.surface->publish(1, 0.0), Status::kOk);
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
}

TEST(Lockstep, SuccessorIgnoresPartialPublication) {
  Pair p("half");
  p.attach();
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  // Killed after writing the publication line except the word.
  p.kill_controller();
  {
    RawSegment raw(p.name);
    raw.header().actuators.frame = 1;
    raw.header().actuators.answers = 1;
    raw.actuator_slot(1).sequence = 2;
    raw.actuator_slot(1).answers = 1;
  }
  p.attach();
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);  // otherwise both would wait forever
  p.fill_actuators(1.5f);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kOk);
  EXPECT_EQ(p.surface->actuator(kHeight)[0], 1.5f);
}

TEST(Lockstep, RejectsAnswerToAbandonedFrame) {
  Pair p("late");
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kNoController);
  p.attach();
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  ASSERT_EQ(p.surface->publish(1, 0.0), Status::kOk);  // published before the controller attached
  EXPECT_EQ(p.controller->publish(), Status::kTorn);
  ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  EXPECT_EQ(p.controller->sensor_info().tick, 1u);
  ASSERT_EQ(p.controller->publish(), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(1, kNoWait), Status::kOk);
}

// A controller that the surface did not know of has answered a frame that was given up; while it announces
// the answer to the next one, the line already says `answers` of that, the word still means the first.
TEST(Lockstep, DistinguishesConsecutiveAnswers) {
  // What may be seen of the line while it is written: frame first, or, by one who does not keep to the order,
  // answers.
  const std::pair<std::uint64_t, Status> cases[] = {{2, Status::kTimeout}, {1, Status::kTorn}};
  for (const auto& [line_frame, expected] : cases) {
    Pair p("first-second");
    ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
    ASSERT_EQ(p.surface->await_actuators(0, kNoWait), Status::kNoController);
    p.attach();
    ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
    p.fill_actuators(1);
    ASSERT_EQ(p.controller->publish(), Status::kOk);
    ASSERT_EQ(p.surface->publish(1, 0.0), Status::kOk);
    RawSegment raw(p.name);
    raw.header().actuators.frame = line_frame;
    raw.header().actuators.answers = 2;
    EXPECT_EQ(p.surface->await_actuators(1, kNoWait), expected) << line_frame;
    ASSERT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
    p.fill_actuators(2);
    ASSERT_EQ(p.controller->publish(), Status::kOk);
    ASSERT_EQ(p.surface->await_actuators(1, kNoWait), Status::kOk);
    EXPECT_EQ(p.surface->actuator(kHeight)[0], 2.0f);
  }
}

TEST(Lockstep, ControllerAdoptedWhileDetachingIsNotDead) {
  Pair p("leaver");
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  p.attach();
  RawSegment raw(p.name);
  const auto process = raw.header().claim.controller_process;
  p.controller.reset();
  raw.header().claim.controller_process = process;  // the detach is not complete yet
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kTimeout);
  raw.header().claim.controller_process = 0;
  EXPECT_EQ(p.surface->await_actuators(0, kNoWait), Status::kControllerClosed);
}

TEST(Lockstep, StatesAreVisibleToThePeer) {
  Pair p("states");
  p.attach();
  EXPECT_EQ(p.controller->surface_state(), State::kReady);
  EXPECT_EQ(p.surface->controller_state(), State::kReady);
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.controller->surface_state(), State::kRunning);
  p.surface->set_state(State::kPaused);
  EXPECT_EQ(p.controller->surface_state(), State::kPaused);
  EXPECT_EQ(p.controller->await_sensors(kNoWait), Status::kOk);
  p.controller->set_state(State::kPaused);
  EXPECT_EQ(p.surface->controller_state(), State::kPaused);
  EXPECT_EQ(p.surface->await_actuators(0, {.timeout = 120ms}), Status::kTimeout);  // alive, however long
  p.surface.reset();
  EXPECT_EQ(p.controller->publish(), Status::kOk);
  EXPECT_EQ(p.controller->await_sensors(), Status::kSurfaceClosed);
}

TEST(Lockstep, StopFlagEndsEveryWait) {
  Pair p("stop");
  const std::atomic<bool> stop{true};
  EXPECT_EQ(p.surface->await_controller({.stop = &stop}), Status::kInterrupted);
  p.attach();
  EXPECT_EQ(p.controller->await_sensors({.stop = &stop}), Status::kInterrupted);
  ASSERT_EQ(p.surface->publish(0, 0.0), Status::kOk);
  EXPECT_EQ(p.surface->await_actuators(0, {.stop = &stop}), Status::kInterrupted);
}

}  // namespace
}  // namespace shm_protocol
