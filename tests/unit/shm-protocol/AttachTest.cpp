// Attaching a controller: the description it reads and the cases in which it is rejected.
#include <gtest/gtest.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/Segments.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <memory>
#include <thread>

#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

using namespace std::chrono_literals;

TEST(Attach, ReadsTheSurfaceDescription) {
  auto config = small_surface(unique_name("discover"));
  config.positions.resize(35);
  config.positions[34] = {1.0f, 2.0f, 3.0f};
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  const auto& d = controller.description();
  EXPECT_EQ(d.name, config.name);
  EXPECT_EQ(d.rows, 5u);
  EXPECT_EQ(d.columns, 7u);
  EXPECT_EQ(d.pitch, 1.5);
  EXPECT_EQ(d.period_ns, config.period_ns);
  EXPECT_EQ(d.mode, Mode::kTimeStep);
  EXPECT_EQ(d.surface_pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_EQ(d.session, surface.description().session);
  ASSERT_EQ(d.channels.size(), config.channels.size());
  for (std::size_t i = 0; i < d.channels.size(); ++i) {
    EXPECT_EQ(d.channels[i].name, config.channels[i].name);
    EXPECT_EQ(d.channels[i].direction, config.channels[i].direction);
    EXPECT_EQ(d.channels[i].dtype, config.channels[i].dtype);
    EXPECT_EQ(d.channels[i].components, config.channels[i].components);
    EXPECT_EQ(d.channels[i].unit, config.channels[i].unit);
    EXPECT_EQ(d.channels[i].minimum, config.channels[i].minimum);
    EXPECT_EQ(d.channels[i].maximum, config.channels[i].maximum);
    EXPECT_EQ(d.channels[i].safe, config.channels[i].safe);
  }
  ASSERT_EQ(d.positions.size(), 35u);
  EXPECT_EQ(d.positions[34], (std::array{1.0f, 2.0f, 3.0f}));
  EXPECT_EQ(d.channel(Direction::kActuator, "lamp"), kLamp);
  EXPECT_EQ(d.channel(Direction::kSensor, "lamp"), -1);
}

TEST(Attach, AcceptsThirtyTwoChannels) {
  auto config = small_surface(unique_name("many"));
  config.channels.clear();
  for (int i = 0; i < 32; ++i)
    config.channels.push_back({"c" + std::to_string(i), i % 2 ? Direction::kSensor : Direction::kActuator,
                               static_cast<DType>(1 + i % 3), 1u + static_cast<std::uint32_t>(i), "u", 0,
                               200.0 + i, static_cast<double>(i)});
  auto surface = SurfaceEndpoint::create(config);
  const auto controller = ControllerEndpoint::attach(config.name);
  ASSERT_EQ(controller.description().channels.size(), 32u);
  for (int i = 0; i < 32; ++i) {
    const auto& c = controller.description().channels[static_cast<std::size_t>(i)];
    EXPECT_EQ(c.name, "c" + std::to_string(i));
    EXPECT_EQ(c.components, 1u + static_cast<std::uint32_t>(i));
    EXPECT_EQ(c.maximum, 200.0 + i);
  }
  config.name += "-more";
  config.channels.push_back(config.channels[0]);
  config.channels.back().name = "one too many";
  EXPECT_EQ(error_of([&] { SurfaceEndpoint::create(config); }), ErrorCode::kBadConfig);
}

TEST(Attach, MissingSurfaceIsNotFound) {
  std::string message;
  const std::string name = unique_name("nothing");
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(name); }, &message), ErrorCode::kNotFound);
  EXPECT_NE(message.find(name), std::string::npos) << message;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach("no/slash"); }), ErrorCode::kBadConfig);
}

TEST(Attach, WaitsForTheSurfaceToAppear) {
  const auto config = small_surface(unique_name("late"));
  std::thread later([&] {
    std::this_thread::sleep_for(50ms);
    auto surface = SurfaceEndpoint::create(config);
    EXPECT_EQ(surface.await_controller({.timeout = 20s}), Status::kOk);
  });
  auto controller = ControllerEndpoint::attach(config.name, {.timeout = 20s});
  later.join();
  EXPECT_EQ(controller.surface_status(), Status::kSurfaceClosed);
}

TEST(Attach, StopFlagEndsTheWait) {
  const std::atomic<bool> stop{true};
  EXPECT_EQ(
      error_of([&] { ControllerEndpoint::attach(unique_name("stop"), {.timeout = 20s, .stop = &stop}); }),
      ErrorCode::kInterrupted);
}

TEST(Attach, RejectsSecondControllerAndReportsPid) {
  const auto config = small_surface(unique_name("second"));
  auto surface = SurfaceEndpoint::create(config);
  {
    auto first = ControllerEndpoint::attach(config.name);
    EXPECT_EQ(surface.controller_pid(), static_cast<std::uint32_t>(::getpid()));
    std::string message;
    std::uint32_t pid = 0;
    EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(config.name, {.timeout = 1s}); }, &message, &pid),
              ErrorCode::kControllerLives);
    EXPECT_EQ(pid, static_cast<std::uint32_t>(::getpid()));
    EXPECT_NE(message.find(std::to_string(::getpid())), std::string::npos) << message;
  }
  EXPECT_FALSE(surface.has_controller());
  EXPECT_NO_THROW(ControllerEndpoint::attach(config.name));
  EXPECT_EQ(surface.controllers_seen(), 2u);
}

TEST(Attach, ReplacesDeadController) {
  const auto config = small_surface(unique_name("heir"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  raw.header().claim.controller_process = raw.header().identity.surface_process - (std::uint64_t{1} << 22);
  auto controller = ControllerEndpoint::attach(config.name);
  EXPECT_EQ(raw.header().claim.controller_process, raw.header().identity.surface_process);
}

TEST(Attach, ReplacesControllerWithRecycledPid) {
  const auto config = small_surface(unique_name("recycled"));
  auto surface = SurfaceEndpoint::create(config);
  // This process's pid with a different start time.
  RawSegment(config.name).header().claim.controller_process =
      (std::uint64_t{12345} << SSP_PID_BITS) | static_cast<std::uint32_t>(::getpid());
  auto controller = ControllerEndpoint::attach(config.name);
  EXPECT_EQ(surface.controller_pid(), static_cast<std::uint32_t>(::getpid()));
}

TEST(Attach, DetectsControllerWithRecycledPidAsDead) {
  const auto config = small_surface(unique_name("recycled-dead"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment(config.name).header().claim.controller_process =
      (std::uint64_t{12345} << SSP_PID_BITS) | static_cast<std::uint32_t>(::getpid());
  ASSERT_EQ(surface.publish(0, 0.0), Status::kOk);
  EXPECT_EQ(surface.await_actuators(0, {.timeout = std::chrono::seconds(60)}), Status::kControllerDead);
}

TEST(Attach, RejectsOtherMajorVersionAndReportsBoth) {
  const auto config = small_surface(unique_name("major"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment(config.name).header().identity.version = (7u << 16) | 3u;
  std::string message;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(config.name); }, &message), ErrorCode::kWrongVersion);
  EXPECT_NE(message.find("7.3"), std::string::npos) << message;
  EXPECT_NE(message.find("program 2.0"), std::string::npos) << message;
}

TEST(Attach, NewerMinorVersionIsAccepted) {
  const auto config = small_surface(unique_name("minor"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  raw.header().identity.version = SSP_VERSION + 9;
  raw.header().reserved[100] = 1;  // a field added by a newer minor version
  auto controller = ControllerEndpoint::attach(config.name);
  EXPECT_EQ(controller.description().version_minor, SSP_VERSION_MINOR + 9);
  ASSERT_EQ(surface.publish(3, 0.0), Status::kOk);
  EXPECT_EQ(controller.await_sensors(), Status::kOk);
  EXPECT_EQ(controller.sensor_info().tick, 3u);
}

TEST(Attach, WaitsForTheVersionWord) {
  const auto config = small_surface(unique_name("unready"));
  auto surface = SurfaceEndpoint::create(config);
  RawSegment raw(config.name);
  raw.header().identity.version = 0;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(config.name, {.timeout = 30ms}); }),
            ErrorCode::kNotFound);
  raw.header().identity.version = SSP_VERSION;
  EXPECT_NO_THROW(ControllerEndpoint::attach(config.name));
}

TEST(Attach, DeadSurfaceIsNotFoundWithReason) {
  const auto config = small_surface(unique_name("dead"));
  auto surface = SurfaceEndpoint::create(config);
  const std::string copy = config.name + "-copy";  // which nobody holds a lock of
  std::filesystem::copy_file(file_path(config.name), file_path(copy));
  RawSegment raw(copy);
  raw.header().identity.surface_process -= std::uint64_t{1} << 22;
  std::string message;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(copy); }, &message), ErrorCode::kNotFound);
  EXPECT_NE(message.find("dead"), std::string::npos) << message;
  EXPECT_EQ(remove_orphans(copy).size(), 1U);
}

// Like a peer in another pid namespace, where the process word means nothing.
TEST(Attach, LocksTellLivingFromDeadWithoutProcessWords) {
  const auto config = small_surface(unique_name("locked"));
  auto surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  RawSegment raw(config.name);
  raw.header().identity.surface_process -= std::uint64_t{1} << 22;
  EXPECT_TRUE(remove_orphans(config.name).empty());
  auto controller = std::make_unique<ControllerEndpoint>(ControllerEndpoint::attach(config.name));
  raw.header().claim.controller_process -= std::uint64_t{1} << 22;
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(config.name); }), ErrorCode::kControllerLives);
  // A forked child does not keep the locks of its parent.
  int started[2];
  ASSERT_EQ(::pipe(started), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(started[1]);
    ::pause();
    ::_exit(0);
  }
  ::close(started[1]);
  char none = 0;
  EXPECT_EQ(::read(started[0], &none, 1), 0);  // the child runs
  ::close(started[0]);
  const auto process = raw.header().claim.controller_process;
  controller.reset();
  raw.header().claim.controller_process = process;
  EXPECT_NO_THROW(ControllerEndpoint::attach(config.name));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

TEST(Attach, ReconnectRequiresTheSameLayout) {
  auto config = small_surface(unique_name("again"));
  auto surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  auto controller = ControllerEndpoint::attach(config.name);
  const auto first = controller.description().session;
  surface.reset();
  EXPECT_EQ(controller.await_sensors(), Status::kSurfaceClosed);
  EXPECT_EQ(error_of([&] { controller.reconnect({.timeout = 20ms}); }), ErrorCode::kNotFound);
  surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  controller.reconnect({.timeout = 5s});
  EXPECT_NE(controller.description().session, first);
  EXPECT_TRUE(surface->has_controller());
  surface.reset();
  config.rows = 6;
  surface = std::make_unique<SurfaceEndpoint>(SurfaceEndpoint::create(config));
  EXPECT_EQ(error_of([&] { controller.reconnect({.timeout = 5s}); }), ErrorCode::kLayoutChanged);
  EXPECT_FALSE(surface->has_controller());
}

}  // namespace
}  // namespace shm_protocol
