// One board of a table: its line, which may be cut and opened again, its description, frames and clock.
//
// Never blocks, except while a TCP connection is opened (a thread does that). One thread at a time. Frames
// and clocks allocate nothing once the board is described; events do.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <future>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/ClockSync.h"
#include "shm-protocol/hardware/bridge/DeviceLine.h"
#include "shm-protocol/hardware/bridge/EmergencyStop.h"
#include "shm-protocol/hardware/bridge/FrameSequence.h"
#include "shm-protocol/hardware/bridge/TableFile.h"

namespace hardware {

struct BoardCounters {
  std::uint64_t frames = 0;         // complete sensor frames
  std::uint64_t lost = 0;           // that did not arrive completely
  std::uint64_t late = 0;           // ticks of the table without a frame of this board
  std::uint64_t missed = 0;         // deadlines that the board counted
  std::uint64_t unsent = 0;         // actuator frames dropped because the line is too slow
  std::uint64_t silences = 0;       // times that it fell silent
  std::uint64_t reconnections = 0;  // times that its line was cut and restored
  std::uint64_t restarts = 0;
};

class Board {
 public:
  using Clock = std::chrono::steady_clock;

  struct Frame {
    std::uint32_t tick = 0;
    std::uint32_t in_force = SSW_NONE;  // the board's tick whose answer is in force from this frame on
    std::vector<float> values;
  };

  Board(const TableBoard&, std::uint32_t period_us, std::chrono::microseconds silence);

  static std::int64_t now();  // µs of the steady clock

  // Opens the line if it is not open, every `reopen_us` at most; sends what is due: handshakes, SSW_SYNC,
  // pending bytes.
  void maintain(std::int64_t epoch, bool session, std::int64_t reopen_us);
  // Reads what has arrived.
  void receive(std::int64_t epoch);
  int descriptor() const { return line_.descriptor(); }
  bool wants_to_write() const { return line_.pending_bytes() != 0; }

  const std::string& title() const { return title_; }
  // Set after each complete description; the table clears it when it has accepted or refused the board.
  bool newly_described = false;
  // Why a description is invalid; the table clears it when it has refused the board.
  std::string invalid_description;
  // The table has accepted the description. Boards that it has not accepted get no frames.
  void accept();
  void refuse(std::string why);
  bool accepted() const { return accepted_; }
  const std::string& refusal() const { return refusal_; }
  const DeviceDescription& description() const { return *description_; }
  bool described() const { return description_.has_value(); }
  bool connected() const { return line_.is_open(); }
  bool silent() const { return silent_; }
  std::string reason() const;  // why the board is not there

  // The frame for the table's tick, or null: the newest of a board in phase; of others, the oldest that
  // waits.
  const Frame* take(std::int64_t tick, std::int64_t epoch);
  bool has_frame(std::int64_t tick, std::int64_t epoch) const;
  // The table has published the last frame taken as that of its tick `tick`.
  void mark_published(std::int64_t tick);
  // The board's tick in the last frame taken.
  std::uint32_t frame_tick() const { return taken_.tick; }
  // The table's tick whose answer is in force since the last frame taken; nothing: safe values are, it is
  // long ago, or the frame that it answers had two answers, which the board does not distinguish.
  std::optional<std::int64_t> tick_in_force() const;
  // The same since a period of the board, of the last 64, whose frame came, whether it was taken or not;
  // kSafeValues: safe values. Of two answers to a frame, the newer.
  static constexpr std::int64_t kSafeValues = -1;
  std::optional<std::int64_t> in_force_since(std::uint32_t board_tick) const;
  // Flags of the newest frame.
  std::uint32_t flags() const { return flags_; }

  // Sends an actuator frame that answers the table's tick `tick`, the last one published or an earlier one.
  // Returns false if the board gets none, as until a tick is published after a silence.
  bool send(std::span<const float> values, std::int64_t tick);
  void send_safe();
  void discard_pending() { line_.discard_pending(); }
  void send_heartbeat();
  void send_reason(std::uint8_t type, std::uint32_t reason);
  void send_stop();
  // Returns whether nothing is left to send, or the line is lost.
  bool send_pending();
  std::size_t actuator_elements() const { return line_.link().actuator_elements(); }

  const ClockSync& clock() const { return sync_; }
  const ssw_status& status() const { return status_; }
  BoardCounters counters() const {
    BoardCounters counters = counters_;
    counters.unsent = line_.unsent();
    return counters;
  }
  std::uint64_t damaged_packets() const { return line_.link().damaged_packets(); }
  std::uint64_t lost_packets() const { return line_.link().lost_packets(); }
  std::int64_t stop_sent_tick = -1;  // of the table, when the last SSW_STOP_NOW or SSW_ARM was sent
  EmergencyStop::Release release;    // of the emergency stop
  bool is_driven = true;             // false: handshakes do not send safe values
  bool is_back = false;              // set with the first frame after a silence or a cut; the table clears it
  // Lines for the log, and what the board reports; the table takes them.
  std::vector<std::string> events, reports;

 private:
  void open_line(std::int64_t reopen_us);
  void on_line_lost();
  void handshake(bool session);
  void on_event(DeviceLink::Event, std::int64_t epoch);
  void on_description();
  void on_frame();
  void enter_silence();
  void restart();
  void drop_oldest();

  TableBoard spec_;
  std::string title_;
  std::uint32_t period_us_;
  std::int64_t silence_us_;
  DeviceLine line_;
  std::future<std::pair<std::optional<Port>, std::string>> opening_;
  std::string why_ = "its line is not open";
  std::optional<DeviceDescription> description_;
  bool accepted_ = false, silent_ = true, ever_connected_ = false;
  std::string refusal_;
  std::array<Frame, 2> waiting_;  // oldest first
  std::size_t waiting_count_ = 0;
  Frame taken_;
  struct Published {
    std::uint32_t tick;  // of the board
    std::int64_t table_tick;
  };
  std::optional<Published> published_;
  struct Answer {
    std::uint32_t tick = SSW_NONE;  // of the board
    std::int64_t table_tick = 0;
    bool is_second = false;  // to the same frame, because the next one was late
  };
  std::optional<std::int64_t> table_tick_of(std::uint32_t answered) const;
  std::array<Answer, 64> answers_;  // the last ones, by the board's tick
  struct Heard {
    std::uint32_t tick = SSW_NONE, in_force = SSW_NONE;
  };
  std::array<Heard, 64> heard_;  // of the last frames, by their tick
  FrameSequence sequence_;
  std::uint32_t flags_ = 0, boot_ = 0;
  unsigned handshakes_ = 0;
  std::int64_t last_frame_ = 0, last_handshake_ = 0, last_open_ = 0;
  ClockSync sync_;
  ssw_status status_{};
  BoardCounters counters_;
};

}  // namespace hardware
