// The C interface: results, texts, invalid arguments, and one tick with all three roles.
#include <gtest/gtest.h>
#include <shm_protocol/shm_protocol.h>

#include <cstring>
#include <fstream>
#include <string>
#include <thread>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace {

using shm_protocol::exists;
using shm_protocol::file_path;
using shm_protocol::unique_name;

struct Config {
  explicit Config(std::string called, std::uint32_t mode = SSP_MODE_TIME_STEP) : name(std::move(called)) {
    channels[0].name = "distance";
    channels[0].unit = "u";
    channels[0].direction = SSP_SENSOR;
    channels[0].dtype = SSP_F32;
    channels[0].maximum = 8;
    channels[1].name = "lamp";
    channels[1].direction = SSP_ACTUATOR;
    channels[1].dtype = SSP_U8;
    channels[1].components = 2;
    channels[1].maximum = 100;
    channels[1].safe = 7;
    config.name = name.c_str();
    config.rows = 3;
    config.columns = 4;
    config.period_ns = 1'000'000;
    config.mode = mode;
    config.channels = channels;
    config.channel_count = 2;
  }
  std::string name;
  ssp_channel_spec channels[2] = {};
  ssp_surface_config config = {};
};

class CApi : public ::testing::Test {
 protected:
  void start(const std::string& what, std::uint32_t mode = SSP_MODE_TIME_STEP) {
    config = std::make_unique<Config>(unique_name(what), mode);
    ASSERT_EQ(ssp_surface_create(&config->config, &surface), SSP_OK) << ssp_last_error();
    ASSERT_EQ(ssp_controller_attach(config->config.name, 0, nullptr, &controller), SSP_OK)
        << ssp_last_error();
    ASSERT_EQ(ssp_observer_attach(config->config.name, 0, nullptr, &observer), SSP_OK) << ssp_last_error();
  }
  ~CApi() override {
    ssp_observer_destroy(observer);
    ssp_controller_destroy(controller);
    ssp_surface_destroy(surface);
  }
  std::unique_ptr<Config> config;
  ssp_surface* surface = nullptr;
  ssp_controller* controller = nullptr;
  ssp_observer* observer = nullptr;
};

TEST_F(CApi, OneTickThroughAllThreeRoles) {
  start("c-tick");
  std::size_t bytes = 0;
  auto* distance = static_cast<float*>(ssp_surface_sensor(surface, 0, &bytes));
  ASSERT_EQ(bytes, 12 * sizeof(float));
  for (int i = 0; i < 12; ++i) distance[i] = static_cast<float>(i) / 2;
  EXPECT_EQ(ssp_surface_await(surface, 0, 0, nullptr), SSP_OUT_OF_TURN);
  ASSERT_EQ(ssp_surface_publish(surface, 5, 0.25, 9), SSP_OK);
  EXPECT_EQ(ssp_surface_publish(surface, 6, 0.25, 9), SSP_OUT_OF_TURN);
  EXPECT_EQ(ssp_surface_await(surface, 5, 1'000'000, nullptr), SSP_TIMEOUT);

  EXPECT_EQ(ssp_controller_sensor(controller, 0, nullptr), nullptr);  // no frame was taken yet
  ASSERT_EQ(ssp_controller_await(controller, SSP_FOREVER, nullptr), SSP_OK);
  ssp_frame_info frame;
  ASSERT_EQ(ssp_controller_frame(controller, &frame), SSP_OK);
  EXPECT_EQ(frame.tick, 5u);
  EXPECT_EQ(frame.time_s, 0.25);
  EXPECT_EQ(frame.status, 9u);
  EXPECT_EQ(static_cast<const float*>(ssp_controller_sensor(controller, 0, nullptr))[11], 5.5f);
  auto* lamp = static_cast<std::uint8_t*>(ssp_controller_actuator(controller, 1, &bytes));
  ASSERT_EQ(bytes, 24u);
  std::memset(lamp, 50, bytes);
  lamp[3] = 200;
  ASSERT_EQ(ssp_controller_publish(controller), SSP_OK);
  EXPECT_EQ(ssp_controller_publish(controller), SSP_OUT_OF_TURN);

  ASSERT_EQ(ssp_surface_await(surface, 5, SSP_FOREVER, nullptr), SSP_OK);
  const auto* taken = static_cast<const std::uint8_t*>(ssp_surface_actuator(surface, 1, &bytes));
  EXPECT_EQ(taken[2], 50);
  EXPECT_EQ(taken[3], 100);
  ssp_counters mine, theirs;
  ASSERT_EQ(ssp_controller_counters(controller, &theirs, &mine), SSP_OK);
  EXPECT_EQ(theirs.clamped, 1u);

  ASSERT_EQ(ssp_observer_latest(observer, SSP_SENSOR), SSP_OK);
  ASSERT_EQ(ssp_observer_latest(observer, SSP_ACTUATOR), SSP_OK);
  EXPECT_EQ(ssp_observer_latest(observer, SSP_ACTUATOR), SSP_REPEATED);
  EXPECT_EQ(static_cast<const std::uint8_t*>(ssp_observer_array(observer, 1, nullptr))[3], 200);
  ASSERT_EQ(ssp_observer_frame(observer, SSP_ACTUATOR, &frame), SSP_OK);
  EXPECT_EQ(frame.answers, 1u);
  EXPECT_EQ(ssp_observer_surface_state(observer), static_cast<std::uint32_t>(SSP_STATE_RUNNING));
}

TEST_F(CApi, WritesWithinTheArrayOnly) {
  start("c-write");
  const float values[12] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 7, 6, 5};
  ASSERT_EQ(ssp_surface_write(surface, 0, 0, values, 16), SSP_OK);
  ASSERT_EQ(ssp_surface_write(surface, 0, 16, values + 4, 32), SSP_OK);
  EXPECT_EQ(ssp_surface_write(surface, 0, 16, values, 36), SSP_E_ARGUMENT);  // beyond the end
  EXPECT_EQ(ssp_surface_write(surface, 0, SIZE_MAX - 3, values, 8), SSP_E_ARGUMENT);
  EXPECT_EQ(ssp_surface_write(surface, 0, 2, values, 4), SSP_E_ARGUMENT);  // within an element
  EXPECT_EQ(ssp_surface_write(surface, 1, 0, values, 4), SSP_E_ARGUMENT);  // an actuator
  EXPECT_EQ(ssp_surface_write(surface, 0, 0, nullptr, 4), SSP_E_ARGUMENT);
  ASSERT_EQ(ssp_surface_publish(surface, 0, 0.0, 0), SSP_OK);
  std::size_t bytes = 1;
  EXPECT_EQ(ssp_controller_next(controller, 1, 0, nullptr, &bytes), nullptr);  // an actuator
  EXPECT_EQ(bytes, 0u);
  const void* cells = ssp_controller_next(controller, 0, 0, nullptr, &bytes);
  ASSERT_EQ(bytes, sizeof values);
  EXPECT_EQ(std::memcmp(cells, values, sizeof values), 0);
  EXPECT_EQ(ssp_controller_next(controller, 0, SSP_FOREVER, nullptr, &bytes), nullptr);  // end of the channel
  ASSERT_EQ(ssp_controller_await(controller, 0, nullptr), SSP_OK);
  EXPECT_EQ(std::memcmp(ssp_controller_sensor(controller, 0, nullptr), values, sizeof values), 0);
  const std::vector<std::uint8_t> lamp(24, 9);
  ASSERT_EQ(ssp_controller_write(controller, 1, 0, lamp.data(), lamp.size()), SSP_OK);
  ASSERT_EQ(ssp_controller_publish(controller), SSP_OK);
  cells = ssp_surface_next(surface, 1, SSP_FOREVER, nullptr, &bytes);
  ASSERT_EQ(bytes, lamp.size());
  EXPECT_EQ(static_cast<const std::uint8_t*>(cells)[23], 9);
  ASSERT_EQ(ssp_surface_await(surface, 0, SSP_FOREVER, nullptr), SSP_OK);
  EXPECT_EQ(static_cast<const std::uint8_t*>(ssp_surface_actuator(surface, 1, nullptr))[23], 9);
}

TEST_F(CApi, DescribesTheSurfaceToEveryRole) {
  start("c-describe");
  ssp_description of[3];
  ASSERT_EQ(ssp_surface_describe(surface, &of[0]), SSP_OK);
  ASSERT_EQ(ssp_controller_describe(controller, &of[1]), SSP_OK);
  ASSERT_EQ(ssp_observer_describe(observer, &of[2]), SSP_OK);
  for (const auto& d : of) {
    EXPECT_EQ(d.name, config->name);
    EXPECT_EQ(d.rows, 3u);
    EXPECT_EQ(d.columns, 4u);
    EXPECT_EQ(d.pitch, 1.0);  // the default
    EXPECT_EQ(d.channel_count, 2u);
    EXPECT_EQ(d.session, of[0].session);
    EXPECT_EQ(d.version_major << 16 | d.version_minor, ssp_protocol_version());
    EXPECT_EQ(d.positions, nullptr);
  }
  ssp_channel_info channel;
  ASSERT_EQ(ssp_controller_channel(controller, 1, &channel), SSP_OK);
  EXPECT_STREQ(channel.name, "lamp");
  EXPECT_EQ(channel.components, 2u);
  EXPECT_EQ(channel.bytes, 24u);
  EXPECT_EQ(channel.safe, 7.0);
  EXPECT_EQ(ssp_controller_find(controller, SSP_ACTUATOR, "lamp"), 1);
  EXPECT_EQ(ssp_controller_find(controller, SSP_SENSOR, "lamp"), -1);
  EXPECT_EQ(ssp_observer_find(observer, SSP_SENSOR, "distance"), 0);
  EXPECT_STREQ(ssp_direction_text(channel.direction), "actuator");
  EXPECT_STREQ(ssp_dtype_text(channel.dtype), "u8");
  EXPECT_STREQ(ssp_mode_text(of[0].mode), "time-step");
  EXPECT_STREQ(ssp_mode_text(77), "unknown");
}

TEST_F(CApi, PassiveModeCounts) {
  start("c-passive", SSP_MODE_PASSIVE);
  EXPECT_EQ(ssp_controller_latest(controller), SSP_REPEATED);
  for (std::uint64_t tick = 0; tick < 3; ++tick) {
    ASSERT_EQ(ssp_surface_publish(surface, tick, 0.0, 0), SSP_OK);
    if (tick == 0) {
      ASSERT_EQ(ssp_controller_latest(controller), SSP_OK);
    }
  }
  ASSERT_EQ(ssp_controller_latest(controller), SSP_OK);
  ASSERT_EQ(ssp_controller_publish(controller), SSP_OK);
  EXPECT_EQ(ssp_surface_latest(surface), SSP_OK);
  ASSERT_EQ(ssp_surface_miss_deadline(surface), SSP_OK);
  ssp_counters of_surface, of_controller;
  ASSERT_EQ(ssp_observer_counters(observer, &of_surface, &of_controller), SSP_OK);
  EXPECT_EQ(of_controller.skipped, 1u);
  EXPECT_EQ(of_controller.repeated, 1u);
  EXPECT_EQ(of_surface.deadline_misses, 1u);
}

TEST_F(CApi, ErrorsReportTextAndProcess) {
  start("c-errors");
  ssp_controller* second = controller;
  EXPECT_EQ(ssp_controller_attach(config->config.name, 0, nullptr, &second), SSP_E_CONTROLLER_LIVES);
  EXPECT_EQ(second, nullptr);
  EXPECT_EQ(ssp_last_error_pid(), static_cast<std::uint32_t>(::getpid()));
  EXPECT_NE(std::string(ssp_last_error()).find("already has a controller"), std::string::npos);
  ssp_surface* again = nullptr;
  EXPECT_EQ(ssp_surface_create(&config->config, &again), SSP_E_SURFACE_LIVES);
  EXPECT_EQ(ssp_controller_attach("no-such-surface", 0, nullptr, &second), SSP_E_NOT_FOUND);
  EXPECT_EQ(ssp_last_error_pid(), 0u);
  ssp_observer* onlooker = observer;
  EXPECT_EQ(ssp_observer_attach("not/a/name", 0, nullptr, &onlooker), SSP_E_BAD_CONFIG);
  EXPECT_EQ(onlooker, nullptr);
  ASSERT_EQ(ssp_observer_attach(config->config.name, 0, nullptr, &onlooker), SSP_OK);
  ssp_observer_destroy(onlooker);
  Config bad(unique_name("c-bad"));
  bad.channels[0].maximum = -1;
  EXPECT_EQ(ssp_surface_create(&bad.config, &again), SSP_E_BAD_CONFIG);
  EXPECT_NE(std::string(ssp_last_error()).find("distance"), std::string::npos) << ssp_last_error();
  bad.config.channel_count = 4'000'000'000;
  EXPECT_EQ(ssp_surface_create(&bad.config, &again), SSP_E_BAD_CONFIG);
  std::string other;
  std::thread([&] { other = ssp_last_error(); }).join();
  EXPECT_EQ(other, "");  // per-thread
}

TEST_F(CApi, RejectsNullsAndInvalidChannels) {
  start("c-null");
  EXPECT_EQ(ssp_surface_create(nullptr, nullptr), SSP_E_ARGUMENT);
  ssp_controller* refused = controller;
  EXPECT_EQ(ssp_controller_attach(nullptr, 0, nullptr, &refused), SSP_E_ARGUMENT);
  ASSERT_EQ(refused, nullptr);
  EXPECT_EQ(ssp_controller_publish(nullptr), SSP_E_ARGUMENT);
  EXPECT_EQ(ssp_controller_find(nullptr, SSP_SENSOR, "x"), -1);
  std::size_t bytes = 5;
  EXPECT_EQ(ssp_surface_sensor(surface, 1, &bytes), nullptr);  // an actuator
  EXPECT_EQ(bytes, 0u);
  EXPECT_EQ(ssp_surface_sensor(surface, -1, nullptr), nullptr);
  EXPECT_EQ(ssp_surface_sensor(surface, 2, nullptr), nullptr);
  EXPECT_EQ(ssp_surface_actuator(surface, 0, nullptr), nullptr);
  EXPECT_EQ(ssp_observer_array(observer, 2, nullptr), nullptr);
  EXPECT_EQ(ssp_observer_latest(observer, 3), SSP_E_ARGUMENT);
  ssp_channel_info channel;
  EXPECT_EQ(ssp_surface_channel(surface, 2, &channel), SSP_E_ARGUMENT);
  EXPECT_EQ(ssp_surface_set_state(surface, SSP_STATE_DEAD), SSP_E_ARGUMENT);
  ssp_controller_destroy(nullptr);
  ssp_controller_close(nullptr);
  ssp_surface_close(nullptr);
  ssp_surface_destroy(nullptr);
  ssp_observer_destroy(nullptr);
  ssp_stop_destroy(nullptr);
}

TEST_F(CApi, EveryResultHasAText) {
  for (int i = SSP_E_INTERNAL; i <= SSP_SURFACE_CLOSED; ++i) {
    EXPECT_STRNE(ssp_text(static_cast<ssp_result>(i)), "unknown") << i;
    for (int k = SSP_E_INTERNAL; k < i; ++k)
      EXPECT_STRNE(ssp_text(static_cast<ssp_result>(i)), ssp_text(static_cast<ssp_result>(k)))
          << i << ' ' << k;
  }
  EXPECT_STREQ(ssp_text(static_cast<ssp_result>(99)), "unknown");
}

TEST_F(CApi, StopFlagEndsWaits) {
  start("c-stop");
  ssp_stop* stop = ssp_stop_create();
  std::thread raiser([&] {
    ::usleep(20'000);
    ssp_stop_raise(stop);
  });
  EXPECT_EQ(ssp_controller_await(controller, SSP_FOREVER, stop), SSP_INTERRUPTED);
  raiser.join();
  EXPECT_EQ(ssp_observer_await(observer, SSP_SENSOR, SSP_FOREVER, stop), SSP_INTERRUPTED);
  ssp_controller* never = nullptr;
  EXPECT_EQ(ssp_controller_attach("no-such-surface", SSP_FOREVER, stop, &never), SSP_E_INTERRUPTED);
  ssp_stop_lower(stop);
  EXPECT_EQ(ssp_controller_await(controller, 0, stop), SSP_TIMEOUT);
  ssp_stop_destroy(stop);
}

TEST_F(CApi, CloseEndsTheRoleAndKeepsTheMapping) {
  start("c-close");
  ASSERT_EQ(ssp_surface_await_controller(surface, 0, nullptr), SSP_OK);
  ASSERT_EQ(ssp_surface_publish(surface, 0, 0.0, 0), SSP_OK);
  ASSERT_EQ(ssp_controller_await(controller, 0, nullptr), SSP_OK);
  const void* sensor = ssp_controller_sensor(controller, 0, nullptr);
  ssp_controller_close(controller);
  EXPECT_EQ(ssp_controller_publish(controller), SSP_OUT_OF_TURN);
  EXPECT_EQ(ssp_surface_await(surface, 0, SSP_FOREVER, nullptr), SSP_CONTROLLER_CLOSED);
  ssp_surface_close(surface);
  EXPECT_FALSE(exists(file_path(config->name)));
  EXPECT_EQ(ssp_surface_publish(surface, 1, 0.0, 0), SSP_OUT_OF_TURN);
  EXPECT_EQ(static_cast<const float*>(sensor)[0], 0.0f);
  EXPECT_EQ(ssp_controller_surface_status(controller), SSP_SURFACE_CLOSED);
}

// The mappings of the segment in this process.
int count_mappings(const std::string& name) {
  std::ifstream maps("/proc/self/maps");
  int count = 0;
  for (std::string line; std::getline(maps, line);) count += line.find(file_path(name)) != line.npos ? 1 : 0;
  return count;
}

TEST_F(CApi, DestroyUnmapsItsHandle) {
  start("c-unmap");
  const int all = count_mappings(config->name);
  ASSERT_EQ(all % 3, 0);
  ssp_observer_destroy(std::exchange(observer, nullptr));
  EXPECT_EQ(count_mappings(config->name), all / 3 * 2);
  ssp_controller_destroy(std::exchange(controller, nullptr));
  EXPECT_EQ(count_mappings(config->name), all / 3);
  ssp_surface_destroy(std::exchange(surface, nullptr));
  EXPECT_EQ(count_mappings(config->name), 0);
}

TEST_F(CApi, DestroyClosesWhatIsStillOpen) {
  start("c-destroy");
  ASSERT_EQ(ssp_surface_await_controller(surface, 0, nullptr), SSP_OK);
  ssp_controller_destroy(std::exchange(controller, nullptr));
  EXPECT_EQ(ssp_surface_publish(surface, 0, 0.0, 0), SSP_OK);
  EXPECT_EQ(ssp_surface_await(surface, 0, SSP_FOREVER, nullptr), SSP_CONTROLLER_CLOSED);
  ssp_surface_destroy(std::exchange(surface, nullptr));
  EXPECT_FALSE(exists(file_path(config->name)));
  EXPECT_EQ(ssp_observer_latest(observer, SSP_SENSOR), SSP_OK);  // the mapping of another handle stays
  EXPECT_EQ(ssp_observer_latest(observer, SSP_SENSOR), SSP_SURFACE_CLOSED);
}

TEST_F(CApi, ReconnectsToTheNextSurface) {
  start("c-again");
  ssp_surface_destroy(surface);
  surface = nullptr;
  EXPECT_EQ(ssp_controller_await(controller, SSP_FOREVER, nullptr), SSP_SURFACE_CLOSED);
  EXPECT_EQ(ssp_controller_reconnect(controller, 0, nullptr), SSP_E_NOT_FOUND);
  ASSERT_EQ(ssp_surface_create(&config->config, &surface), SSP_OK);
  ASSERT_EQ(ssp_controller_reconnect(controller, 0, nullptr), SSP_OK) << ssp_last_error();
  ASSERT_EQ(ssp_surface_publish(surface, 0, 0.0, 0), SSP_OK);
  EXPECT_EQ(ssp_controller_await(controller, 0, nullptr), SSP_OK);
}

TEST_F(CApi, ListsAndCleans) {
  start("c-list");
  std::size_t count = 0;
  ASSERT_EQ(ssp_list(nullptr, 0, &count), SSP_OK);
  std::vector<ssp_segment_info> found(count + 8);
  ASSERT_EQ(ssp_list(found.data(), found.size(), &count), SSP_OK);
  bool seen = false;
  for (std::size_t i = 0; i < count; ++i) {
    if (found[i].name != config->name) continue;
    seen = true;
    EXPECT_EQ(found[i].ownership, static_cast<std::uint32_t>(SSP_LIVING));
    EXPECT_EQ(found[i].controller_pid, static_cast<std::uint32_t>(::getpid()));
  }
  EXPECT_TRUE(seen);
  ASSERT_EQ(ssp_clean(config->name.c_str(), nullptr, 0, &count), SSP_OK);
  EXPECT_EQ(count, 0u);  // the surface is alive
  EXPECT_TRUE(exists(file_path(config->name)));
}

}  // namespace
