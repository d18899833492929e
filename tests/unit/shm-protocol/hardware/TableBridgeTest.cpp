// The bridge of a table, with emulated boards in another process.
#include "shm-protocol/hardware/bridge/TableBridge.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <shm_protocol/ObserverEndpoint.h>
#include <signal.h>
#include <sys/inotify.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "shm-protocol/hardware/fake/EmulatedBoard.h"
#include "shm-protocol/hardware/fake/ToyDevice.h"
#include "tests/unit/common/AllocationCounter.h"

namespace hardware {
namespace {

constexpr std::uint32_t kPeriod_us = 4000;

volatile sig_atomic_t changes = 0, hangs = 0;

constexpr std::size_t kPinChannel = 1;
constexpr float kFirstSafe = 0.75F;

// Writes the packets of the first device: the safe value of its pin_height is another one than that of the
// second, and while it hangs, its sensor frames keep their tick.
EmulatedDevice::Write changed(EmulatedDevice::Write write) {
  return [write = std::move(write), tick = std::uint32_t{0}](const std::uint8_t* bytes,
                                                             std::size_t count) mutable {
    ssw_receiver receiver;
    ssw_receiver_init(&receiver);
    ssw_packet packet;
    std::array<std::uint8_t, SSW_MAX_PAYLOAD> payload;
    for (std::size_t i = 0; i < count; ++i) {
      if (!ssw_receive(&receiver, bytes[i], &packet)) continue;
      if (packet.type == SSW_CHANNEL2 && packet.payload[0] == kPinChannel) {
        std::copy_n(packet.payload, packet.payload_bytes, payload.begin());
        ssw_put_f32(payload.data() + 12, kFirstSafe);
        packet.payload = payload.data();
      } else if (packet.type == SSW_SENSOR_DATA || packet.type == SSW_SENSOR_END) {
        if (hangs == 0) tick = packet.tick;
        packet.tick = tick;
      } else {
        continue;
      }
      std::array<std::uint8_t, SSW_MAX_ENCODED + 2> changed;
      return write(changed.data(), ssw_write(&packet, changed.data()));
    }
    return write(bytes, count);
  };
}

// Two boards of 4×4 cells, side by side, in a process of their own.
class Boards {
 public:
  Boards() {
    spec.file = "table.toml";
    changes = 0;
    hangs = 0;
    spec.name = "test-table-bridge-" + std::to_string(::getpid());
    spec.period_us = kPeriod_us;
    std::vector<std::unique_ptr<EmulatedBoard>> boards;
    for (std::uint32_t i = 0; i < 2; ++i) {
      EmulatedBoardOptions options;
      options.tcp = 0;
      options.period_us = kPeriod_us;
      boards.push_back(std::make_unique<EmulatedBoard>(options, [i](EmulatedDevice::Write write) {
        return std::make_unique<ToyDevice>(std::uint16_t{4}, std::uint16_t{4}, kPeriod_us,
                                           i == 0 ? changed(std::move(write)) : std::move(write));
      }));
      EmulatedBoard* const at = boards.back().get();
      at->device().become({"b" + std::to_string(i), {}, [at] { return at->micros(); }, {}, {}});
      TableBoard board;
      board.id = "b" + std::to_string(i);
      board.port = PortAddress::parse(at->line().name(), 115200);
      board.column = 4 * i;
      spec.boards.push_back(board);
    }
    pid_ = ::fork();
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::signal(SIGUSR1, [](int) { changes = 1; });
    ::signal(SIGUSR2, [](int) { hangs = 1 - hangs; });
    bool is_other = false;
    for (;;) {
      if (std::exchange(changes, 0)) {
        EmulatedBoard* const at = boards[0].get();
        is_other = !is_other;
        at->set_faults(50, 5, false);
        at->cut_line();
        at->device().become({is_other ? "b1" : "b0", {}, [at] { return at->micros(); }, {}, {}});
      }
      std::vector<pollfd> lines;
      for (const auto& board : boards) lines.push_back({board->line().descriptor(), POLLIN, 0});
      ::poll(lines.data(), lines.size(), 1);
      for (const auto& board : boards) board->step();
    }
  }
  ~Boards() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Boards(const Boards&) = delete;
  Boards& operator=(const Boards&) = delete;

  // Cuts the line of the first board, which comes back as another one, and the next time as itself.
  void exchange_first() const { ::kill(pid_, SIGUSR1); }
  // The first board hangs, and the next time goes on.
  void hang_first() const { ::kill(pid_, SIGUSR2); }

  TableSpec spec;

 private:
  pid_t pid_ = 0;
};

// Sends each tick another height, and calls `look` with the tick and what the table says.
class Waves final : public TableDriver {
 public:
  bool begins_at_rest() const override { return false; }
  Answer drive(TableTick tick) override {
    if (look) look(ticks, tick);
    if (is_over) return Answer::kEnd;
    for (std::size_t i = 0; i < tick.map.channels().size(); ++i)
      if (!tick.map.channels()[i].sensor) std::ranges::fill(tick.planes[i], height_at(tick.tick));
    return ++ticks < most ? Answer::kCommands : Answer::kEnd;
  }
  static float height_at(std::int64_t tick) { return static_cast<float>(tick % 100) * 0.02F; }
  int ticks = 0, most = 300;
  bool is_over = false;
  std::function<void(int, const TableTick&)> look;
};

void run(const Boards& boards, TableDriver& driver, const EventLog::Print& log,
         std::chrono::milliseconds silence = std::chrono::seconds(20)) {
  BridgeOptions options;
  options.mode = shm_protocol::Mode::kPassive;
  options.surface.clear();
  options.silence_timeout = silence;
  const std::atomic<bool> stop{false};
  TableBridge bridge(boards.spec, options, stop, log, &driver);
  EXPECT_EQ(bridge.run(), Outcome::kDone);
}

void run(TableDriver& driver) {
  run(Boards(), driver, [](const std::string&) {});
}

#ifdef COUNTS_ALLOCATIONS
TEST(TableBridge, TicksAllocateNothing) {
  Waves waves;
  std::size_t before = 0, after = 0;
  waves.look = [&](int ticks, const TableTick&) {
    if (ticks == 100) before = allocations;
    if (ticks == 299) after = allocations;
  };
  run(waves);
  EXPECT_GT(before, 0u);
  EXPECT_EQ(after, before);
}
#endif

// The echo of the active frame is what was sent in answer to the tick that the board names.
TEST(TableBridge, KnowsWhatIsInForceOnEachBoard) {
  Waves waves;
  waves.most = 10'000;
  int compared = 0;
  std::vector<std::optional<std::int64_t>> last(2);
  std::vector<std::uint32_t> last_tick(2);
  waves.look = [&](int, const TableTick& tick) {
    const auto& channels = tick.map.channels();
    const auto echo = std::ranges::find(channels, "target_echo", &TableChannel::name) - channels.begin();
    for (std::size_t i = 0; i < 2; ++i) {
      if (tick.board_age[i] != 0) continue;
      const Board& board = *tick.boards[i];
      // The echo was taken before the new frame took effect.
      if (last[i] && board.frame_tick() == last_tick[i] + 1) {
        EXPECT_EQ(tick.planes[static_cast<std::size_t>(echo)][4 * i],
                  std::round(Waves::height_at(*last[i]) / 0.02F));
        ++compared;
      }
      last[i] = board.tick_in_force();
      last_tick[i] = board.frame_tick();
    }
    waves.is_over = compared > 100;
  };
  run(waves);
  EXPECT_GT(compared, 100);
}

// Whoever finds the table's surface finds that of its boards, which recordings read.
TEST(TableBridge, SurfaceOfTheBoardsIsThereBeforeTheTablesAndAfterIt) {
  const int watch = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  ASSERT_GE(::inotify_add_watch(watch, "/dev/shm", IN_MOVED_TO | IN_DELETE), 0);
  const Boards boards;
  Waves waves;
  waves.most = 1;
  run(boards, waves, [](const std::string&) {});
  const std::string table = "smartsurf." + boards.spec.name;
  std::string order;
  alignas(inotify_event) std::array<char, 65'536> events;
  for (ssize_t bytes; (bytes = ::read(watch, events.data(), events.size())) > 0;)
    for (ssize_t at = 0; at < bytes;) {
      const auto* event = reinterpret_cast<const inotify_event*>(&events[static_cast<std::size_t>(at)]);
      const char* const what = event->mask & IN_DELETE ? "-" : "+";
      if (event->name == table) order += what + std::string("table ");
      if (event->name == table + ".boards") order += what + std::string("boards ");
      at += static_cast<ssize_t>(sizeof *event + event->len);
    }
  ::close(watch);
  EXPECT_EQ(order, "+boards +table -table -boards ");
}

// Even with the id of another board of the table.
TEST(TableBridge, CellsOfAnotherBoardAreNotValidUntilTheFirstOneIsBack) {
  Boards boards;
  std::ranges::reverse(boards.spec.boards);  // the channels' safe values are those of the other one
  for (TableBoard& board : boards.spec.boards) board.id.clear();
  Waves waves;
  waves.most = 10'000;
  enum { kBefore, kExchanged, kRefused, kReturning, kBack } phase = kBefore;
  std::uint32_t age = 0;
  int refused_ticks = 0;
  waves.look = [&](int ticks, const TableTick& tick) {
    if (phase == kBefore && ticks > 50 && tick.board_age[1] == 0) {
      boards.exchange_first();
      phase = kExchanged;
    } else if (phase == kRefused) {
      EXPECT_GT(tick.board_age[1], age);
      age = tick.board_age[1];
      const auto& channels = tick.map.channels();
      for (std::size_t i = 0; i < channels.size(); ++i)
        for (const std::uint32_t cell : tick.map.boards()[1].cells)
          EXPECT_TRUE(!channels[i].sensor ||
                      tick.planes[i][cell] ==
                          (channels[i].name == "pin_height" ? kFirstSafe : channels[i].safe))
              << channels[i].name;
      if (++refused_ticks < 200) return;
      boards.exchange_first();
      phase = kReturning;
    } else if (phase == kReturning && tick.board_age[1] == 0) {
      phase = kBack;
      waves.is_over = true;
    }
  };
  std::vector<std::string> said;
  run(boards, waves, [&](const std::string& line) {
    said.push_back(line);
    if (line.find("it has changed since it first came: id from 'b0' to 'b1'; it is not used") !=
        std::string::npos)
      phase = kRefused;
  });
  EXPECT_EQ(phase, kBack) << testing::PrintToString(said);
  EXPECT_EQ(std::ranges::count_if(said, [](const auto& l) { return l.find("not used") != l.npos; }), 1);
}

// A calibration corrects readings: not the safe values of a board that is missing, and of one that is
// refused.
TEST(TableBridge, CalibrationLeavesCellsWithoutAReadingAlone) {
  Boards boards;
  TableSpec& spec = boards.spec;
  spec.boards.push_back(spec.boards[1]);
  spec.boards[2].id = "b2";
  spec.boards[2].port = PortAddress::parse("/nonexistent", 115200);
  spec.boards[2].column = 8;
  for (TableBoard& board : spec.boards) board.size = {4, 4};
  Calibration calibration;
  calibration.table = "t";
  calibration.actuator = "height";
  calibration.sensor = "pin_height";
  calibration.unit = "u";
  calibration.rows = 4;
  calibration.columns = 12;
  calibration.period_us = kPeriod_us;
  for (const TableBoard& b : spec.boards) calibration.boards.push_back({b.id, b.row, b.column});
  calibration.fits.resize(calibration.cells());
  for (CellFit& fit : calibration.fits) {
    fit.value[CellFit::kSlope] = 1;
    fit.value[CellFit::kSensorZero] = 0.25;
  }
  spec.calibration = testing::TempDir() + spec.name + ".toml";
  std::ofstream(*spec.calibration) << calibration.text();

  std::atomic<bool> stop{false};
  bool is_exchanged = false, is_refused = false;
  int frames = 0, valid_frames = 0, refused_frames = 0;
  std::optional<shm_protocol::ObserverEndpoint> observer;
  BridgeOptions options;
  options.mode = shm_protocol::Mode::kPassive;
  options.surface.clear();
  options.connect_timeout = std::chrono::milliseconds(100);
  options.is_recorder_ready = [&] {
    if (!observer) observer = shm_protocol::ObserverEndpoint::attach(spec.name);
    constexpr auto kSensor = shm_protocol::Direction::kSensor;
    if (observer->latest(kSensor) != shm_protocol::Status::kOk) return true;
    const auto& d = observer->description();
    const auto pin = observer->array<float>(d.channel(kSensor, "pin_height"));
    const auto valid = observer->array<std::uint8_t>(d.channel(kSensor, "valid"));
    EXPECT_TRUE(!valid[0] || pin[0] == -0.25F) << pin[0];
    EXPECT_TRUE(!valid[4] || pin[4] == -0.25F) << pin[4];
    EXPECT_TRUE(!is_refused || pin[0] == kFirstSafe) << pin[0];
    EXPECT_EQ(pin[8], kFirstSafe);
    valid_frames += valid[0] && valid[4];
    if (valid_frames == 5 && !std::exchange(is_exchanged, true)) boards.exchange_first();
    refused_frames += is_refused;
    stop = refused_frames == 5 || ++frames == 10'000;
    return true;
  };
  TableBridge bridge(spec, options, stop, [&](const std::string& line) {
    is_refused = is_refused || line.find("it is not used") != line.npos;
  });
  EXPECT_EQ(bridge.run(), Outcome::kStopped);
  EXPECT_GE(valid_frames, 5);
  EXPECT_EQ(refused_frames, 5);
  std::filesystem::remove(*spec.calibration);
}

void expect_that_repeated_frames_are_not_valid(std::chrono::milliseconds silence) {
  const Boards boards;
  Waves waves;
  waves.most = 10'000;
  enum { kBefore, kHangs, kGoesOn, kBack } phase = kBefore;
  std::uint32_t most = 0;
  waves.look = [&](int ticks, const TableTick& tick) {
    EXPECT_TRUE(phase != kHangs || most < 30 || tick.board_age[0] > most) << "valid again";
    most = std::max(most, tick.board_age[0]);
    if (phase == kBefore && ticks > 50) {
      boards.hang_first();
      phase = kHangs;
      most = 0;  // not from before the first frame
    } else if (phase == kHangs && (most > 200 || ticks > 2000)) {
      boards.hang_first();
      phase = kGoesOn;
    } else if (phase == kGoesOn && tick.board_age[0] == 0) {
      phase = kBack;
      waves.is_over = true;
    }
  };
  run(
      boards, waves, [](const std::string&) {}, silence);
  EXPECT_GT(most, 200U);
  EXPECT_EQ(phase, kBack);
}

TEST(TableBridge, RepeatedFramesAreNotValid) {
  expect_that_repeated_frames_are_not_valid(std::chrono::seconds(20));
}

TEST(TableBridge, RepeatedFramesAreNotValidAfterASilence) {
  expect_that_repeated_frames_are_not_valid(std::chrono::milliseconds(200));
}

}  // namespace
}  // namespace hardware
