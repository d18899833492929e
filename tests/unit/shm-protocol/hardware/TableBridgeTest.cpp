// The bridge of a table, with emulated boards in another process.
#include "shm-protocol/hardware/bridge/TableBridge.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
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

// Two boards of 4×4 cells, side by side, in a process of their own.
class Boards {
 public:
  Boards() {
    spec.file = "table.toml";
    spec.name = "test-table-bridge-" + std::to_string(::getpid());
    spec.period_us = kPeriod_us;
    std::vector<std::unique_ptr<EmulatedBoard>> boards;
    for (std::uint32_t i = 0; i < 2; ++i) {
      EmulatedBoardOptions options;
      options.tcp = 0;
      options.period_us = kPeriod_us;
      boards.push_back(std::make_unique<EmulatedBoard>(options, [](EmulatedDevice::Write write) {
        return std::make_unique<ToyDevice>(std::uint16_t{4}, std::uint16_t{4}, kPeriod_us, std::move(write));
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
    for (;;) {
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
    for (std::size_t i = 0; i < tick.map.channels().size(); ++i)
      if (!tick.map.channels()[i].sensor) std::ranges::fill(tick.planes[i], height_at(tick.tick));
    return ++ticks < most ? Answer::kCommands : Answer::kEnd;
  }
  static float height_at(std::int64_t tick) { return static_cast<float>(tick % 100) * 0.02F; }
  int ticks = 0, most = 300;
  std::function<void(int, const TableTick&)> look;
};

void run(TableDriver& driver) {
  const Boards boards;
  BridgeOptions options;
  options.mode = shm_protocol::Mode::kPassive;
  options.surface.clear();
  options.silence_timeout = std::chrono::seconds(20);
  const std::atomic<bool> stop{false};
  TableBridge bridge(
      boards.spec, options, stop, [](const std::string&) {}, &driver);
  EXPECT_EQ(bridge.run(), Outcome::kDone);
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
  };
  run(waves);
  EXPECT_GT(compared, 100);
}

}  // namespace
}  // namespace hardware
