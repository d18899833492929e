// The bytes of a new segment at the offsets that PROTOCOL.md specifies.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>

#include "tests/unit/shm-protocol/RawSegment.h"

extern "C" size_t layout_sizes_from_c(size_t which);

namespace shm_protocol {
namespace {

template <class T>
T at(RawSegment& raw, std::size_t offset) {
  T value;
  std::memcpy(&value, raw.data() + offset, sizeof value);
  return value;
}

TEST(Layout, MatchesBetweenCAndCxx) {
  EXPECT_EQ(layout_sizes_from_c(0), sizeof(ssp_header));
  EXPECT_EQ(layout_sizes_from_c(1), sizeof(ssp_channel));
  EXPECT_EQ(layout_sizes_from_c(2), sizeof(ssp_slot));
  EXPECT_EQ(layout_sizes_from_c(3), offsetof(ssp_header, sensors));
}

TEST(Layout, IdentityAndGeometryOffsets) {
  const auto config = small_surface(unique_name("layout"), Mode::kPassive);
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  EXPECT_EQ(std::memcmp(raw.data(), "SMRTSURF", 8), 0);
  EXPECT_EQ(at<std::uint32_t>(raw, 8), 0x00020000u);
  EXPECT_EQ(at<std::uint32_t>(raw, 12), 4096u);
  EXPECT_EQ(at<std::uint64_t>(raw, 16), raw.size());
  EXPECT_EQ(at<std::uint64_t>(raw, 24) & 0x3FFFFF, static_cast<std::uint64_t>(::getpid()));
  EXPECT_NE(at<std::uint64_t>(raw, 32), 0u);
  EXPECT_EQ(at<std::uint64_t>(raw, 48), 16'666'667u);
  EXPECT_EQ(at<std::uint32_t>(raw, 56), 2u);
  EXPECT_STREQ(reinterpret_cast<const char*>(raw.data()) + 64, config.name.c_str());
  EXPECT_EQ(at<std::uint32_t>(raw, 128), 5u);
  EXPECT_EQ(at<std::uint32_t>(raw, 132), 7u);
  EXPECT_EQ(at<double>(raw, 136), 1.5);
  EXPECT_EQ(at<std::uint32_t>(raw, 144), 6u);
  EXPECT_EQ(at<std::uint32_t>(raw, 256), std::uint32_t{SSP_STATE_READY});
}

TEST(Layout, DirectoryDescribesEachChannel) {
  const auto config = small_surface(unique_name("directory"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  const auto* channels = reinterpret_cast<const ssp_channel*>(raw.data() + 4096);
  EXPECT_STREQ(channels[kColour].name, "colour");
  EXPECT_EQ(channels[kColour].bytes, 5u * 7 * 3);
  EXPECT_EQ(channels[kDistance].offset, 128u);
  EXPECT_EQ(channels[kColour].offset, 128u + 192);  // 140 bytes of distances, rounded up to 64
  EXPECT_EQ(channels[kHeight].offset, 128u);        // first in the actuator slot
  EXPECT_EQ(channels[kValve].bytes, 5u * 7 * 2 * 4);
  EXPECT_EQ(channels[kHeight].safe, 0.5);
  for (int c = 0; c < 6; ++c) EXPECT_EQ(channels[c].offset % 64, 0u);
}

TEST(Layout, ArraysAreAlignedAndWrittenInPlace) {
  const auto config = small_surface(unique_name("place"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  auto distance = surface.sensor(kDistance);
  ASSERT_EQ(distance.size(), 35u);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(distance.data()) % 64, 0u);
  EXPECT_EQ(surface.sensor<std::uint8_t>(kColour).size(), 105u);
  distance[34] = 3.25f;
  ASSERT_EQ(surface.publish(41, 0.5), Status::kOk);
  const auto& slot = raw.sensor_slot(1);
  EXPECT_EQ(slot.sequence, 2u);
  EXPECT_EQ(slot.tick, 41u);
  EXPECT_EQ(slot.time_s, 0.5);
  EXPECT_EQ(reinterpret_cast<const float*>(&slot + 1)[34], 3.25f);
  EXPECT_EQ(raw.header().sensors.word, 1u);
  EXPECT_EQ(raw.sensor_slot(2).sequence, 3u);  // the next frame is being written
}

// Time-step mode alternates between two slots of each ring; passive mode uses all.
TEST(Layout, TimeStepUsesTwoSlotsOfEachRing) {
  for (const Mode mode : {Mode::kTimeStep, Mode::kPassive}) {
    const auto config = small_surface(unique_name("slots"), mode);
    auto surface = SurfaceEndpoint::create(config);
    auto controller = ControllerEndpoint::attach(config.name);
    for (std::uint64_t tick = 0; tick < 9; ++tick) {
      ASSERT_EQ(surface.publish(tick, 0.0), Status::kOk);
      ASSERT_EQ(controller.await_sensors(), Status::kOk);
      ASSERT_EQ(controller.publish(), Status::kOk);
      if (mode == Mode::kTimeStep) {
        ASSERT_EQ(surface.await_actuators(tick), Status::kOk);
      }
    }
    RawSegment raw(config.name);
    const auto& g = raw.header().geometry;
    EXPECT_EQ(g.sensor_slots, 4u);
    for (const auto& [ring, bytes] : {std::pair{g.sensor_ring_offset, g.sensor_slot_bytes},
                                      {g.actuator_ring_offset, g.actuator_slot_bytes}})
      for (std::uint64_t slot = 0; slot < 4; ++slot) {
        const auto sequence = reinterpret_cast<const ssp_slot*>(raw.data() + ring + slot * bytes)->sequence;
        // Frame 9 is complete, frame 10 is being written.
        const std::uint64_t two[] = {19, 18, 0, 0}, four[] = {16, 18, 19, 14};
        EXPECT_EQ(sequence, (mode == Mode::kTimeStep ? two : four)[slot]) << slot;
      }
  }
}

TEST(Layout, HashDependsOnLayoutOnly) {
  auto config = small_surface(unique_name("hash"));
  const auto hash = [](const SurfaceConfig& c) {
    return SurfaceEndpoint::create(c).description().layout_hash;
  };
  const auto before = hash(config);
  EXPECT_EQ(hash(config), before);
  config.mode = Mode::kPassive;
  EXPECT_EQ(hash(config), before);
  config.channels[0].maximum = 9;
  EXPECT_NE(hash(config), before);
  config = small_surface(config.name);
  config.rows = 6;
  EXPECT_NE(hash(config), before);
}

TEST(Layout, EveryLineSpansTwoCacheLines) {
  for (const std::size_t offset :
       {offsetof(ssp_header, surface), offsetof(ssp_header, controller), offsetof(ssp_header, claim),
        offsetof(ssp_header, sensors), offsetof(ssp_header, actuators),
        offsetof(ssp_header, controller_waiting), offsetof(ssp_header, surface_waiting)})
    EXPECT_EQ(offset % 128, 0u);
}

}  // namespace
}  // namespace shm_protocol
