// The surface role for a table of many boards: one surface in shared memory, whose ticks the host's clock
// paces.
//
// A tick closes when every live board has sent its frame, at the latest after 40 % of the period. Cells of
// other boards keep their values, with `valid` 0 and a growing `age`. Single-threaded, except for opening TCP
// connections. Ticks allocate nothing.
#pragma once

#include <poll.h>
#include <shm_protocol/SurfaceEndpoint.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/Board.h"
#include "shm-protocol/hardware/bridge/Bridge.h"
#include "shm-protocol/hardware/bridge/Calibration.h"
#include "shm-protocol/hardware/bridge/ControlSocket.h"
#include "shm-protocol/hardware/bridge/EmergencyStop.h"
#include "shm-protocol/hardware/bridge/Quantiles.h"
#include "shm-protocol/hardware/bridge/TableMap.h"

namespace hardware {

// A tick of the table as a driver sees it.
struct TableTick {
  std::int64_t tick;
  const TableMap& map;
  const std::vector<std::unique_ptr<Board>>& boards;
  std::span<const std::uint32_t> board_age;  // 0: the board's frame came
  std::vector<std::vector<float>>& planes;   // by channel: the sensors' values, and the commands to be sent
  bool stopped;                              // an emergency stop is in effect
};

// Answers the ticks of a table within the bridge, instead of a controller.
class TableDriver {
 public:
  enum class Answer { kCommands, kNothing, kEnd };
  virtual ~TableDriver() = default;
  // True if boards get no frame, not even of safe values, before the first commands.
  virtual bool begins_at_rest() const = 0;
  // Reads the tick and writes the commands, or says that there are none yet, or that the session ends.
  virtual Answer drive(TableTick) = 0;
};

class TableBridge {
 public:
  // `options.port` and `options.silence_timeout` unless set are not used. A calibration file that the table
  // names is read here, and the surface's name reserved. Throws std::invalid_argument with one line if
  // the file cannot be read or is another table's, and as reserve_surface() does.
  TableBridge(TableSpec, BridgeOptions, const std::atomic<bool>& stop, EventLog::Print,
              TableDriver* driver = nullptr);
  ~TableBridge();

  // Like Bridge::run(). Throws std::invalid_argument with one line if the boards are not as the table says.
  Outcome run();

  // Returns whether frames were published.
  bool served() const { return counters_.frames != 0; }
  // Lines of statistics.
  std::string report() const;

 private:
  using Clock = std::chrono::steady_clock;

  std::optional<Outcome> await_boards();
  void mount_described_boards(bool pass_over);
  void refuse(std::size_t board, const std::string& why);
  void make_safe(const MountedBoard&);
  void create_surface();
  void await_recorder();
  void serve();
  void poll_lines(std::int64_t until);
  void log_events();
  bool is_complete() const;
  void close_tick();
  void skip_tick();
  void fill_planes();
  void publish_boards();
  void publish_limits(std::size_t board);
  void poll_answer();
  void poll_latest();
  void receive_commands();
  void correct_commands(const Board&, const MountedBoard&);
  void ask_driver();
  bool send_answers(std::uint64_t answered);
  bool send_commands(Board&, const MountedBoard&, std::uint64_t answered);
  void keep_boards_alive();
  void check_emergency_stop();
  void measure_spread();
  std::uint32_t status_of_boards();
  ControlAnswer answer(const std::string& command);
  void arm();
  std::string status_text() const;
  std::int64_t tick_start(std::int64_t tick) const { return epoch_ + tick * period_us_; }

  TableSpec spec_;
  BridgeOptions options_;
  const std::atomic<bool>& stop_;
  EventLog log_;
  TableDriver* driver_;
  bool driver_ended_ = false;
  std::optional<Calibration> calibration_;
  TableMap map_;
  std::vector<std::unique_ptr<Board>> boards_;
  std::shared_ptr<shm_protocol::SurfaceName> name_, boards_name_;
  std::optional<shm_protocol::SurfaceEndpoint> board_surface_, surface_;  // the first one exists longer
  std::optional<ControlSocket> control_;
  EmergencyStop emergency_;
  std::int64_t period_us_, epoch_ = 0;
  std::int64_t tick_ = 0;  // that is being collected
  bool awaiting_answer_ = false;
  std::uint64_t published_tick_ = 0;
  std::int64_t published_at_ = 0;
  std::uint32_t status_ = 0;
  // By channel of the table: the newest values of all sensors, and commands, as the boards have them.
  std::vector<std::vector<float>> planes_;
  std::vector<pollfd> lines_;
  std::vector<std::uint8_t> valid_, age_;  // by cell
  std::vector<std::uint32_t> board_age_;   // ticks
  std::vector<std::uint64_t> board_missed_;
  std::vector<std::size_t> shown_limits_;  // the table's actuators whose limits the boards' surface has
  std::vector<float> frame_;               // the actuators of one board
  double spread_us_ = 0;
  std::vector<std::uint64_t> valid_ticks_;
  bool has_begun_ = false;          // boards are started
  std::uint64_t filled_ticks_ = 0;  // also those that the controller did not get
  Quantiles close_us_, answer_us_, spread_quantiles_, phase_quantiles_;
  BridgeCounters counters_;
};

}  // namespace hardware
