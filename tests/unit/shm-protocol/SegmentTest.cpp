// Creation, rejection, reclaiming and removal of segments, and the listing of orphans.
#include <gtest/gtest.h>
#include <sched.h>
#include <shm_protocol/ControllerEndpoint.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <shm_protocol/Segments.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <vector>

#include "shm-protocol/src/segment/Ownership.h"
#include "tests/unit/shm-protocol/RawSegment.h"

namespace shm_protocol {
namespace {

// A surface whose process is killed, leaving its segment; reaped or still a zombie.
pid_t leave_orphan(const SurfaceConfig& config, bool reap) {
  int ready[2];
  EXPECT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    auto surface = SurfaceEndpoint::create(config);
    if (::write(ready[1], "x", 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char byte;
  EXPECT_EQ(::read(ready[0], &byte, 1), 1);
  ::close(ready[0]);
  ::close(ready[1]);
  ::kill(child, SIGKILL);
  siginfo_t info;
  ::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | (reap ? 0 : WNOWAIT));
  return child;
}

const SegmentInfo* find(const std::vector<SegmentInfo>& list, const std::string& name) {
  const auto it = std::find_if(list.begin(), list.end(), [&](const auto& s) { return s.name == name; });
  return it == list.end() ? nullptr : &*it;
}

TEST(Segment, HasMode0600AndIsRemovedWithItsSurface) {
  const auto config = small_surface(unique_name("mode"));
  {
    auto surface = SurfaceEndpoint::create(config);
    struct stat status {};
    ASSERT_EQ(::stat(file_path(config.name).c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, 0600u);
  }
  EXPECT_FALSE(exists(file_path(config.name)));
  for (const auto& s : list_segments()) EXPECT_EQ(s.name.find(config.name), std::string::npos) << s.name;
}

TEST(Segment, RejectsNameOfLivingSurfaceAndReportsPid) {
  const auto config = small_surface(unique_name("lives"));
  auto surface = SurfaceEndpoint::create(config);
  std::string message;
  std::uint32_t pid = 0;
  EXPECT_EQ(error_of([&] { SurfaceEndpoint::create(config); }, &message, &pid), ErrorCode::kSurfaceLives);
  EXPECT_EQ(pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_NE(message.find(std::to_string(::getpid())), std::string::npos) << message;
  EXPECT_EQ(surface.publish(0, 0.0), Status::kOk);
  EXPECT_TRUE(exists(file_path(config.name)));
}

TEST(Segment, ReclaimsSegmentOfKilledSurface) {
  for (const bool reap : {true, false}) {
    const auto config = small_surface(unique_name("stale"));
    const pid_t dead = leave_orphan(config, reap);
    ASSERT_TRUE(exists(file_path(config.name)));
    {
      auto surface = SurfaceEndpoint::create(config);
      EXPECT_EQ(surface.description().surface_pid, static_cast<std::uint32_t>(::getpid()));
    }
    if (!reap) ::waitpid(dead, nullptr, 0);
  }
}

TEST(Segment, ReclaimsSegmentOfRecycledPid) {
  const auto config = small_surface(unique_name("recycled"));
  std::vector<std::uint8_t> bytes;
  {
    auto surface = SurfaceEndpoint::create(config);
    RawSegment raw(config.name);
    raw.header().identity.surface_process -= std::uint64_t{1}
                                             << 22;  // our pid, started one clock tick earlier
    bytes = raw.copy();
  }
  ForgedSegment forged(config.name, bytes);
  EXPECT_EQ(find(list_segments(), config.name)->ownership, Ownership::kOrphan);
  EXPECT_NO_THROW(SurfaceEndpoint::create(config));
}

TEST(Segment, RejectsAndKeepsForeignFile) {
  const std::string name = unique_name("foreign");
  ForgedSegment forged(name, std::vector<std::uint8_t>(8192, 0x5A));
  EXPECT_EQ(error_of([&] { SurfaceEndpoint::create(small_surface(name)); }), ErrorCode::kForeign);
  EXPECT_EQ(error_of([&] { ControllerEndpoint::attach(name); }), ErrorCode::kForeign);
  EXPECT_TRUE(remove_orphans(name).empty());
  EXPECT_TRUE(exists(file_path(name)));
}

// Runs `action` in a child; false unless it returns true within a second.
template <class Action>
bool succeeds_within_a_second(Action&& action) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(2);  // twice the time, for a busy machine
    ::_exit(action() ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

template <class Action>
bool is_refused(ErrorCode code, Action&& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.code() == code && std::string(e.what()).find('\n') == std::string::npos;
  }
  return false;
}

bool every_role_is_refused(const std::string& name, ErrorCode code) {
  return is_refused(code, [&] { SurfaceEndpoint::create(small_surface(name)); }) &&
         is_refused(code, [&] { ControllerEndpoint::attach(name); }) &&
         is_refused(code, [&] { ObserverEndpoint::attach(name); }) && remove_orphans(name).empty();
}

TEST(Segment, FifoSocketFolderAndLinkAreRefusedAtOnce) {
  const std::string name = unique_name("obstacle"), path = file_path(name);
  const auto refused = [&] {
    return succeeds_within_a_second([&] { return every_role_is_refused(name, ErrorCode::kForeign); });
  };
  ASSERT_EQ(::mkfifo(path.c_str(), 0666), 0);
  EXPECT_TRUE(refused()) << "FIFO";
  EXPECT_EQ(find(list_segments(), name)->ownership, Ownership::kForeign);
  ::unlink(path.c_str());

  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  struct sockaddr_un address {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<struct sockaddr*>(&address), sizeof address), 0);
  EXPECT_TRUE(refused()) << "socket";
  ::close(socket);
  ::unlink(path.c_str());

  ASSERT_EQ(::mkdir(path.c_str(), 0777), 0);
  EXPECT_TRUE(refused()) << "folder";
  ::rmdir(path.c_str());

  ASSERT_EQ(::symlink("/dev/zero", path.c_str()), 0);
  EXPECT_TRUE(refused()) << "link";
  ::unlink(path.c_str());
}

// Whatever bytes a caller passes on, the message is one line without control sequences.
TEST(Segment, RefusedNamesAreQuotedWithoutControlCharacters) {
  std::mt19937 random(5);
  for (int i = 0; i < 1000; ++i) {
    std::string name(1 + random() % 60, '\0');
    for (char& c : name) c = static_cast<char>(random() % 2 != 0 ? 'a' + random() % 26 : random() % 256);
    name[random() % name.size()] = '\033';
    std::string shown = name;
    std::ranges::replace_if(
        shown, [](char c) { return c < ' ' || c > '~'; }, '?');
    SurfaceConfig named = small_surface(name), channel = small_surface("x"), unit = channel;
    channel.channels[0].name = name;
    unit.channels[0].unit = name + std::string(16, 'u');
    for (const SurfaceConfig& config : {named, channel, unit}) try {
        SurfaceEndpoint::create(config);
        ADD_FAILURE() << shown;
      } catch (const Error& e) {
        const std::string said = e.what();
        EXPECT_EQ(e.code(), ErrorCode::kBadConfig);
        EXPECT_NE(said.find('"' + shown), std::string::npos) << said;
        EXPECT_TRUE(std::ranges::all_of(said, [](char c) { return c >= ' ' && c <= '~'; })) << said;
      }
  }
}

TEST(Segment, SegmentOfAnotherUserIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become another user";
  const std::string name = unique_name("other-user");
  auto surface = SurfaceEndpoint::create(small_surface(name));
  ASSERT_EQ(::chown(file_path(name).c_str(), 65534, 65534), 0);
  EXPECT_TRUE(is_refused(ErrorCode::kForeign, [&] { ControllerEndpoint::attach(name); }));
  EXPECT_TRUE(is_refused(ErrorCode::kForeign, [&] { ObserverEndpoint::attach(name); }));
  // The same file, seen by another user than its owner.
  ASSERT_EQ(::chown(file_path(name).c_str(), 0, 0), 0);
  ASSERT_EQ(::chmod(file_path(name).c_str(), 0666), 0);
  EXPECT_TRUE(succeeds_within_a_second([&] {
    return ::setuid(65534) == 0 &&
           is_refused(ErrorCode::kForeign, [&] { ControllerEndpoint::attach(name); }) &&
           inspect_segment("smartsurf." + name).ownership == Ownership::kForeign;
  }));
  // As surfaces make it, that user cannot even open it.
  ASSERT_EQ(::chmod(file_path(name).c_str(), 0600), 0);
  EXPECT_TRUE(succeeds_within_a_second([&] {
    const auto message = [&](auto&& action) {
      try {
        action();
      } catch (const Error& e) {
        return std::string(e.what());
      }
      return std::string();
    };
    const std::string other =
        file_path(name) + " belongs to another user (0), who alone may map it; choose another name";
    return ::setuid(65534) == 0 && every_role_is_refused(name, ErrorCode::kForeign) &&
           message([&] { SurfaceEndpoint::create(small_surface(name)); }) == other &&
           message([&] { ControllerEndpoint::attach(name); }) == other &&
           message([&] { ObserverEndpoint::attach(name); }) == other;
  }));
}

TEST(Segment, HeldLockDelaysNeitherStartNorEnd) {
  const auto config = small_surface(unique_name("locked"));
  leave_orphan(config, true);
  const int file = ::open(file_path(config.name).c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(::flock(file, LOCK_EX), 0);
  EXPECT_TRUE(succeeds_within_a_second(
      [&] { return is_refused(ErrorCode::kForeign, [&] { SurfaceEndpoint::create(config); }); }));
  EXPECT_TRUE(succeeds_within_a_second([&] { return remove_orphans(config.name).empty(); }));
  ::close(file);

  EXPECT_TRUE(succeeds_within_a_second([&] {
    std::optional<SurfaceEndpoint> surface(SurfaceEndpoint::create(config));
    const int other = ::open(file_path(config.name).c_str(), O_RDONLY | O_CLOEXEC);
    const bool locked = ::flock(other, LOCK_EX) == 0;
    surface.reset();
    return locked && !exists(file_path(config.name));
  }));
  EXPECT_FALSE(exists(file_path(config.name)));
}

TEST(Segment, ForkedChildRemovesNothing) {
  const auto config = small_surface(unique_name("fork"));
  auto surface = SurfaceEndpoint::create(config);
  auto controller = ControllerEndpoint::attach(config.name);
  const pid_t child = ::fork();
  if (child == 0) {
    {
      auto mine = std::move(surface);
      auto also = std::move(controller);
    }
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_TRUE(exists(file_path(config.name)));
  EXPECT_TRUE(surface.has_controller());
  EXPECT_EQ(controller.surface_status(), Status::kOk);
}

TEST(Segment, ListsAndRemovesOnlyOrphans) {
  const auto living = small_surface(unique_name("clean") + "-living");
  const auto orphan = small_surface(unique_name("clean") + "-orphan");
  auto surface = SurfaceEndpoint::create(living);
  auto controller = ControllerEndpoint::attach(living.name);
  const pid_t dead = leave_orphan(orphan, true);
  // The file left by a builder killed before renaming its segment into place.
  ForgedSegment unfinished(unique_name("clean") + "~" + std::to_string(dead) + ".0",
                           std::vector<std::uint8_t>(100));

  auto list = list_segments();
  ASSERT_NE(find(list, living.name), nullptr);
  EXPECT_EQ(find(list, living.name)->ownership, Ownership::kLiving);
  EXPECT_EQ(find(list, living.name)->surface_pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_EQ(find(list, living.name)->controller_pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_EQ(find(list, living.name)->version_major, SSP_VERSION_MAJOR);
  ASSERT_NE(find(list, orphan.name), nullptr);
  EXPECT_EQ(find(list, orphan.name)->ownership, Ownership::kOrphan);
  EXPECT_EQ(find(list, orphan.name)->surface_pid, static_cast<std::uint32_t>(dead));
  EXPECT_EQ(find(list, unfinished.name())->ownership, Ownership::kOrphan);

  EXPECT_TRUE(remove_orphans(unique_name("clean") + "-living").empty());
  const auto removed = remove_orphans(unique_name("clean"));
  EXPECT_NE(find(removed, orphan.name), nullptr);
  EXPECT_EQ(find(removed, living.name), nullptr);
  EXPECT_FALSE(exists(file_path(orphan.name)));
  EXPECT_FALSE(exists(file_path(unfinished.name())));
  EXPECT_TRUE(exists(file_path(living.name)));
}

// Makes all mounts private. The root of a chroot is no mount point, so that the root above it is changed,
// from a working directory outside.
bool make_mounts_private() {
  if (::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0) return true;
  const int root = ::open("/", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (root < 0 || ::chroot("/proc") != 0 || ::fchdir(root) != 0) return false;
  for (int i = 0; i < 100; ++i)
    if (::chdir("..") != 0) return false;
  const bool done = ::mount("none", ".", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
  return ::fchdir(root) == 0 && ::chroot(".") == 0 && done;
}

// Mounts a private /dev/shm of the given size; false if that is not permitted. Root needs no user namespace,
// which a chroot refuses.
bool mount_own_shm(std::size_t bytes) {
  const std::string size = "size=" + std::to_string(bytes);
  const std::string user = "0 " + std::to_string(::getuid()) + " 1",
                    group = "0 " + std::to_string(::getgid()) + " 1";
  if (::unshare(CLONE_NEWNS) != 0) {
    if (::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << user;
    std::ofstream("/proc/self/gid_map") << group;
  }
  return make_mounts_private() && ::mount("tmpfs", "/dev/shm", "tmpfs", 0, size.c_str()) == 0;
}

// Runs `body` in a child with such a /dev/shm; false if that is not permitted.
template <class Body>
bool with_own_shm(std::size_t bytes, Body&& body, int& status) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(mount_own_shm(bytes) ? body() : 77);
  ::waitpid(child, &status, 0);
  return !(WIFEXITED(status) && WEXITSTATUS(status) == 77);
}

// 0: rejected with a one-line error and nothing left behind; otherwise the failed check.
int refused_for_lack_of_space(std::size_t files_before) {
  auto config = small_surface("no-space");
  config.rows = config.columns = 64;
  try {
    SurfaceEndpoint::create(config);
    return 1;
  } catch (const Error& e) {
    const std::string what = e.what();
    if (e.code() != ErrorCode::kSystem) return 2;
    if (what.find("bytes in /dev/shm") == std::string::npos ||
        what.find("No space left") == std::string::npos)
      return 3;
  }
  const auto left = std::distance(std::filesystem::directory_iterator("/dev/shm"), {});
  return static_cast<std::size_t>(left) == files_before ? 0 : 4;
}

TEST(Segment, TooSmallShmIsAnErrorNotASigbus) {
  int status = 0;
  if (!with_own_shm(
          64 * 1024, [] { return refused_for_lack_of_space(0); }, status))
    GTEST_SKIP() << "private mounts are not permitted";
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(Segment, FullShmIsAnErrorAndFreedSpaceIsUsed) {
  int status = 0;
  const auto body = [] {
    const std::vector<char> much(8 * 1024 * 1024 - 200 * 1024, 1);
    std::ofstream("/dev/shm/other", std::ios::binary)
        .write(much.data(), static_cast<std::streamsize>(much.size()));
    if (const int wrong = refused_for_lack_of_space(1)) return wrong;
    std::filesystem::remove("/dev/shm/other");
    auto config = small_surface("no-space");
    config.rows = config.columns = 64;
    auto surface = SurfaceEndpoint::create(config);
    for (std::uint64_t tick = 0; tick < 8; ++tick) {
      std::ranges::fill(surface.sensor(kDistance), 1.0f);
      if (surface.publish(tick, 0.0) != Status::kOk) return 5;
      if (surface.await_actuators(tick) != Status::kNoController) return 6;
    }
    return 0;
  };
  if (!with_own_shm(8 * 1024 * 1024, body, status)) GTEST_SKIP() << "private mounts are not permitted";
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(Segment, LargerThanAllMemoryIsAnErrorNotACrash) {
  auto config = small_surface(unique_name("huge"));
  config.rows = config.columns = 65536;
  config.channels[kColour].components = 64;
  EXPECT_EQ(error_of([&] { SurfaceEndpoint::create(config); }), ErrorCode::kSystem);
  for (const auto& s : list_segments()) EXPECT_EQ(s.name.find(config.name), std::string::npos) << s.name;
}

TEST(Segment, InvalidConfigurationNamesTheField) {
  const auto expect = [](const std::string& word, auto change) {
    auto config = small_surface(unique_name("bad"));
    change(config);
    std::string message;
    EXPECT_EQ(error_of([&] { SurfaceEndpoint::create(config); }, &message), ErrorCode::kBadConfig);
    EXPECT_NE(message.find(word), std::string::npos) << message;
  };
  expect("name", [](auto& c) { c.name = "../x"; });
  expect("name", [](auto& c) { c.name = ""; });
  expect("rows", [](auto& c) { c.rows = 0; });
  expect("columns", [](auto& c) { c.columns = 65537; });
  expect("pitch", [](auto& c) { c.pitch = std::nan(""); });
  expect("period_ns", [](auto& c) { c.period_ns = 0; });
  expect("slots", [](auto& c) { c.slots = 6; });
  expect("channels", [](auto& c) { c.channels.clear(); });
  expect("positions", [](auto& c) { c.positions.resize(3); });
  expect("named twice", [](auto& c) { c.channels[1].name = "distance"; });
  expect("range", [](auto& c) { c.channels[kHeight].maximum = INFINITY; });
  expect("range", [](auto& c) { c.channels[kHeight].minimum = NAN; });
  expect("range", [](auto& c) { c.channels[kLamp].maximum = 256; });
  expect("safe", [](auto& c) { c.channels[kHeight].safe = 4.5; });
  expect("components", [](auto& c) { c.channels[kHeight].components = 0; });
  expect("unit", [](auto& c) { c.channels[kHeight].unit = "sixteen letters!"; });
}

}  // namespace
}  // namespace shm_protocol
