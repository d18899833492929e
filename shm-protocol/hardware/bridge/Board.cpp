#include "shm-protocol/hardware/bridge/Board.h"

#include <poll.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <system_error>
#include <thread>
#include <utility>

namespace hardware {
namespace {

constexpr std::int64_t kHandshake_us = 200'000;
constexpr int kMaxOpenings = 64;
std::atomic<int> openings{0};

// A line that a thread of this process opens.
struct Opening {
  Opening() { ++openings; }
  ~Opening() { --openings; }
  Opening(const Opening&) = delete;
  Opening& operator=(const Opening&) = delete;
};

}  // namespace

Board::Board(const TableBoard& spec, std::uint32_t period_us, std::chrono::microseconds silence)
    : spec_(spec),
      title_(spec.title()),
      period_us_(period_us),
      silence_us_(silence.count()),
      sync_(period_us) {}

std::int64_t Board::now() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch()).count();
}

// ---- line

void Board::open_line(std::int64_t reopen_us) {
  using namespace std::chrono_literals;
  if (opening_.valid()) {
    if (opening_.wait_for(0s) != std::future_status::ready) return;
    auto [port, why] = opening_.get();
    if (!port) {
      why_ = why;
      return;
    }
    spec_.port.local_port = port->local_port();
    line_.open(std::move(*port));
    if (ever_connected_) ++counters_.reconnections;
    ever_connected_ = true;
    handshakes_ = 0;
    last_handshake_ = 0;
    last_frame_ = now();
    why_.clear();
    return;
  }
  if (now() - last_open_ < reopen_us || openings >= kMaxOpenings) return;
  last_open_ = now();
  try {
    opening_ = std::async(std::launch::async, [address = spec_.port, opening = std::make_unique<Opening>()] {
      std::string why;
      auto port = Port::open(address, why);
      return std::pair{std::move(port), std::move(why)};
    });
  } catch (const std::system_error& error) {  // no thread
    why_ = error.what();
  }
}

void Board::on_line_lost() {
  line_.close();
  sequence_.restart();
  why_ = "its line is cut";
  enter_silence();
  if (accepted_) events.push_back("board '" + title_ + "': the line is cut; its cells are not valid");
  accepted_ = false;
}

void Board::enter_silence() {
  silent_ = true;
  published_.reset();
  waiting_count_ = 0;
  sync_.reset();
}

// The board has restarted: its ticks are not those that were answered.
void Board::restart() {
  answers_.fill({});
  heard_.fill({});
  enter_silence();
}

// Version 2 is asked for twice, then both versions in turn; a board with an id is hardly ever asked for
// version 1, whose error message it would get on a bad line, and a board that has described itself stays with
// its version.
void Board::handshake(bool session) {
  if (now() - last_handshake_ < kHandshake_us || line_.pending_bytes() > DeviceLine::kMaxPendingBytes) return;
  last_handshake_ = now();
  const bool known = description_.has_value();
  const bool second = known              ? description_->version == 2
                      : spec_.id.empty() ? handshakes_ < 2 || handshakes_ % 2 == 0
                                         : handshakes_ % 16 != 15;
  ++handshakes_;
  line_.write(second ? SSW_DESCRIBE2 : SSW_DESCRIBE, sequence_.tick());
  if (!session || !accepted_ || !line_.link().described()) return;
  line_.write(SSW_START, sequence_.tick());
  if (is_driven) send_safe();
}

void Board::maintain(std::int64_t epoch, bool session, std::int64_t reopen_us) {
  if (!line_.is_open()) open_line(reopen_us);
  if (!line_.is_open()) return;
  const std::int64_t t = now();
  if (!line_.link().described() || silent_) handshake(session);
  if (!silent_ && t - last_frame_ > silence_us_) {
    enter_silence();
    ++counters_.silences;
    events.push_back("board '" + title_ + "' is silent; its cells are not valid");
  }
  if (session && accepted_ && !silent_ && description_->can_sync() && t >= sync_.due())
    line_.write_sync(sync_.next(t, epoch), sequence_.tick());
  if (!line_.flush()) on_line_lost();
}

void Board::receive(std::int64_t epoch) {
  if (!line_.is_open()) return;
  const bool connected =
      line_.receive([] { return true; }, [&](DeviceLink::Event event) { on_event(event, epoch); });
  if (!connected || !line_.flush()) on_line_lost();
}

// ---- what the board says

void Board::on_event(DeviceLink::Event event, std::int64_t epoch) {
  switch (event) {
    case DeviceLink::Event::kNothing:
    case DeviceLink::Event::kAlive:
      return;
    case DeviceLink::Event::kDescribed:
      return on_description();
    case DeviceLink::Event::kRejected:
      invalid_description = line_.link().message();
      why_ = "its description is not valid: " + invalid_description;
      return;
    case DeviceLink::Event::kFault:
      reports.push_back("board '" + title_ + "' reports: " + line_.link().message());
      return;
    case DeviceLink::Event::kClock:
      return sync_.receive(line_.link().clock(), now(), epoch);
    case DeviceLink::Event::kStatus:
      status_ = line_.link().status();
      return;
    case DeviceLink::Event::kFrame:
      return on_frame();
  }
}

void Board::on_description() {
  const DeviceDescription& d = line_.link().description();
  if (description_ && d.boot != boot_) {
    ++counters_.restarts;
    sequence_.restart();
    restart();
    last_handshake_ = 0;
    events.push_back("board '" + title_ + "' was restarted");
  }
  boot_ = d.boot;
  if (description_ && accepted_ && d.is_compatible_with(*description_)) return;
  description_ = d;
  accepted_ = false;
  newly_described = true;
  waiting_count_ = 0;  // its frames are not as now described
}

void Board::accept() {
  accepted_ = true;
  refusal_.clear();
  last_handshake_ = 0;
}

std::string Board::reason() const { return why_.empty() ? line_.why_undescribed() : why_; }

void Board::refuse(std::string why) {
  accepted_ = false;
  if (why != refusal_) events.push_back(why);
  refusal_ = std::move(why);
}

void Board::on_frame() {
  if (!accepted_) return;
  const SensorFrame& frame = line_.link().frame();
  const auto step = sequence_.next(frame, now(), silence_us_);
  if (!step) return;
  last_frame_ = now();
  if (step->restarted) restart();
  if (!silent_) {  // a silence counts as one, not as so many losses
    if (step->ticks < 1u << 20) counters_.lost += step->ticks - 1;
    counters_.missed += step->missed;
  } else {
    is_back = true;
  }
  silent_ = false;
  flags_ = frame.flags;
  ++counters_.frames;
  heard_[frame.tick % heard_.size()] = {frame.tick, frame.active_tick};
  if (waiting_count_ == waiting_.size()) drop_oldest();
  Frame& next = waiting_[waiting_count_++];
  next.tick = frame.tick;
  next.in_force = frame.active_tick;
  next.values.assign(frame.values.begin(), frame.values.end());
}

void Board::drop_oldest() {
  std::rotate(waiting_.begin(), waiting_.begin() + 1, waiting_.end());  // swaps: no allocation
  --waiting_count_;
}

// ---- ticks of the table

bool Board::has_frame(std::int64_t tick, std::int64_t epoch) const {
  if (waiting_count_ == 0) return false;
  const auto at = sync_.table_tick(waiting_[waiting_count_ - 1].tick, epoch);
  return !at || *at >= tick;
}

const Board::Frame* Board::take(std::int64_t tick, std::int64_t epoch) {
  if (waiting_count_ == 0) {
    ++counters_.late;
    return nullptr;
  }
  // A board in phase may be early for the next tick; its older frames are out of date.
  if (sync_.phase_us()) {
    while (waiting_count_ > 1 && sync_.table_tick(waiting_[1].tick, epoch).value_or(tick) <= tick)
      drop_oldest();
  }
  std::swap(taken_, waiting_[0]);
  drop_oldest();
  return &taken_;
}

void Board::mark_published(std::int64_t tick) {
  if (!silent_) published_ = Published{taken_.tick, tick};
}

std::optional<std::int64_t> Board::table_tick_of(std::uint32_t answered) const {
  const Answer& answer = answers_[answered % answers_.size()];
  if (answered == SSW_NONE || answer.tick != answered) return std::nullopt;
  return answer.table_tick;
}

std::optional<std::int64_t> Board::tick_in_force() const {
  const auto tick = table_tick_of(taken_.in_force);
  return tick == kSafeValues || (tick && answers_[taken_.in_force % answers_.size()].is_second) ? std::nullopt
                                                                                                : tick;
}

std::optional<std::int64_t> Board::in_force_since(std::uint32_t board_tick) const {
  const Heard& frame = heard_[board_tick % heard_.size()];
  if (frame.tick != board_tick) return std::nullopt;
  return frame.in_force == SSW_NONE ? kSafeValues : table_tick_of(frame.in_force);
}

// ---- to the board

bool Board::send(std::span<const float> values, std::int64_t tick) {
  if (!accepted_ || silent_ || !published_ || !line_.link().described()) return false;
  // Both count periods of the same length.
  const std::uint32_t answered = published_->tick - (static_cast<std::uint32_t>(published_->table_tick) -
                                                     static_cast<std::uint32_t>(tick));
  if (!line_.write_frame(answered, values, true)) return false;
  Answer& answer = answers_[answered % answers_.size()];
  answer = {answered, tick, answer.tick == answered};
  line_.flush();
  return true;
}

void Board::send_safe() {
  if (!accepted_ || !line_.link().described() || line_.pending_bytes() > DeviceLine::kMaxPendingBytes) return;
  const std::uint32_t tick = sequence_.tick();
  line_.write_safe_frame(tick);
  answers_[tick % answers_.size()] = {tick, kSafeValues, false};
  line_.flush();
}

void Board::send_heartbeat() {
  if (!line_.is_open() || line_.pending_bytes() > DeviceLine::kMaxPendingBytes) return;
  line_.write(SSW_HEARTBEAT, sequence_.tick());
  line_.flush();
}

void Board::send_reason(std::uint8_t type, std::uint32_t reason) {
  if (!line_.is_open()) return;
  if (type == SSW_STOP_NOW) line_.discard_pending();
  line_.write_reason(type, reason);
  line_.flush();
}

void Board::send_stop() {
  if (!line_.is_open()) return;
  line_.discard_pending();
  line_.write(SSW_STOP, sequence_.tick());
  line_.flush();
}

bool Board::send_pending() { return !line_.flush() || line_.pending_bytes() == 0; }

}  // namespace hardware
