#include "shm-protocol/hardware/bridge/TableBridge.h"

#include <shm_protocol/layout.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <thread>
#include <utility>

namespace hardware {

using shm_protocol::Direction;
using shm_protocol::DType;
using shm_protocol::Mode;
using shm_protocol::State;
using shm_protocol::Status;
using std::chrono::milliseconds;

namespace {

constexpr std::uint32_t kPatience = 16;  // periods without a packet until a board applies its safe values
constexpr std::uint32_t kExpected = 3;   // periods that a missing board is waited for
constexpr double kLatestClosing = 0.4;   // of the period
// What each board says of itself; after these come the limits of its actuators.
enum OwnChannel { kTick, kDeviceTime, kOffset, kAge, kValid, kInForce, kFlags, kHeldBack, kOwnChannels };
constexpr const char* kBoardChannels[kOwnChannels] = {"tick",  "device_us", "offset_us", "age",
                                                      "valid", "in_force",  "flags",     "limited"};
constexpr const char* kBoards = ".boards";   // follows the table's name in that of the boards' surface
constexpr std::size_t kMaxName = 41;         // so that both are names of surfaces
constexpr std::size_t kMaxLimitedName = 18;  // so that "acceleration." and a name are the name of a channel
constexpr const char* kLimits[] = {"slew", "acceleration", "soft_start", "most_moving"};

double cpu_seconds() {
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const auto s = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return s(used.ru_utime) + s(used.ru_stime);
}

}  // namespace

TableBridge::TableBridge(TableSpec spec, BridgeOptions options, const std::atomic<bool>& stop,
                         EventLog::Print log, TableDriver* driver)
    : spec_(std::move(spec)),
      options_(std::move(options)),
      stop_(stop),
      log_(std::move(log)),
      driver_(driver),
      map_(spec_),
      period_us_(spec_.period_us) {
  if (spec_.calibration && !driver_) {
    calibration_ = Calibration::read(*spec_.calibration);
    calibration_->require_table(spec_);
    spec_.calibrated_channels = {calibration_->sensor, calibration_->actuator};
  }
  const bool named = !options_.surface.empty();
  const std::string where = named ? "--shm: " : spec_.file + ":" + std::to_string(spec_.name_line) + ": ";
  const std::string name = named ? options_.surface : spec_.name;
  if (name.size() > kMaxName)
    throw std::invalid_argument(where + "name \"" + name + "\": must be 1 to " + std::to_string(kMaxName) +
                                " characters; the surface of the boards is NAME" + kBoards);
  name_ = reserve_surface(name, where);
  boards_name_ = reserve_surface(name + kBoards, where);
  for (const TableBoard& board : spec_.boards) {
    boards_.push_back(std::make_unique<Board>(board, spec_.period_us, silence_of(options_, spec_.period_us)));
    boards_.back()->is_driven = !driver_ || !driver_->begins_at_rest();
  }
  lines_.reserve(boards_.size() + 1);
  board_age_.assign(boards_.size(), std::numeric_limits<std::uint32_t>::max());
  board_missed_.assign(boards_.size(), 0);
  valid_ticks_.assign(boards_.size(), 0);
}

TableBridge::~TableBridge() = default;

Outcome TableBridge::run() {
  if (const auto end = await_boards()) return *end;
  map_.freeze();
  if (calibration_) calibration_->require_map(map_);
  create_surface();
  await_recorder();
  has_begun_ = true;
  epoch_ = Board::now();
  tick_ = 1;
  while (!stop_.load() && !driver_ended_ &&
         !(options_.ticks && counters_.frames >= *options_.ticks && !awaiting_answer_))
    serve();
  const bool stopped = stop_.load();
  for (const auto& board : boards_) board->send_stop();
  for (int attempt = 0;
       attempt < 50 && !std::ranges::all_of(boards_, [](const auto& board) { return board->send_pending(); });
       ++attempt)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  for (const auto& board : boards_) {
    counters_.damaged_packets += board->damaged_packets();
    counters_.lost_packets += board->lost_packets();
  }
  surface_.reset();
  board_surface_.reset();
  return stopped ? Outcome::kStopped : Outcome::kDone;
}

// Waits until all boards have described themselves, or those are missing whose size the file has.
std::optional<Outcome> TableBridge::await_boards() {
  const auto until = Clock::now() + options_.connect_timeout;
  for (;;) {
    if (stop_.load()) return Outcome::kStopped;
    poll_lines(Board::now() + 5000);
    const bool is_late = Clock::now() >= until;
    mount_described_boards(is_late);
    // A board that has described itself may be unplugged again: it comes back in the session.
    if (std::ranges::all_of(map_.boards(), [](const MountedBoard& b) { return b.rows != 0; }))
      return std::nullopt;
    if (!is_late) continue;
    for (std::size_t i = 0; i < boards_.size(); ++i) {
      if (map_.boards()[i].rows != 0) continue;
      const std::string line =
          spec_.place(spec_.boards[i]) + "the device does not come: " + boards_[i]->reason();
      log_.add((spec_.boards[i].size ? "" : "error: ") + line);
      if (!spec_.boards[i].size) return Outcome::kDeviceLost;
    }
    return std::nullopt;
  }
}

// Before the session, a board that does not fit ends the bridge, and boards are mounted in the order of the
// file, whichever comes first, so that channels and errors depend on the file alone; a missing one is passed
// over with `pass_over`. Later, a board that does not fit stays without frames.
void TableBridge::mount_described_boards(bool pass_over) {
  for (std::size_t i = 0; i < boards_.size(); ++i)
    if (const std::string why = std::exchange(boards_[i]->invalid_description, {}); !why.empty())
      refuse(i, spec_.place(spec_.boards[i]) + why);
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    Board& board = *boards_[i];
    if (!pass_over && !board.newly_described && map_.boards()[i].rows == 0) return;
    if (!std::exchange(board.newly_described, false)) continue;
    const bool is_new = !map_.boards()[i].device;
    try {
      map_.mount(i, board.description());
      board.accept();
      if (surface_ && is_new) make_safe(map_.boards()[i]);
      if (surface_) log_.add("board '" + board.title() + "' is back");
    } catch (const std::invalid_argument& e) {
      if (!surface_) throw;
      refuse(i, e.what());
    }
  }
}

void TableBridge::refuse(std::size_t board, const std::string& why) {
  boards_[board]->refuse(why + "; it is not used");
  if (surface_) make_safe(map_.boards()[board]);
}

// Readings of a missing board are stale: its cells read the board's safe values.
void TableBridge::make_safe(const MountedBoard& board) {
  const std::size_t cells = valid_.size();
  for (const BoardChannel& c : board.channels) {
    const DeviceChannel& channel = board.device->channels[c.device_channel];
    if (!channel.sensor) continue;
    for (std::uint32_t k = 0; k < channel.components; ++k)
      for (const std::uint32_t cell : board.cells) planes_[c.table_channel][k * cells + cell] = channel.safe;
  }
}

void TableBridge::create_surface() {
  shm_protocol::SurfaceConfig config;
  config.name = name_->name();
  config.reserved = name_;
  config.rows = map_.rows();
  config.columns = map_.columns();
  config.pitch = map_.pitch() > 0 ? map_.pitch() : 1.0;
  config.period_ns = static_cast<std::uint64_t>(period_us_) * 1000;
  config.mode = options_.mode;
  config.hold_last_frame = options_.hold_last_frame;
  config.slots = 64;
  config.positions = map_.positions();
  for (const TableChannel& c : map_.channels())
    config.channels.push_back({c.name, c.sensor ? Direction::kSensor : Direction::kActuator,
                               c.plain_u8 ? DType::kU8 : DType::kF32, c.components, c.unit,
                               static_cast<double>(c.minimum), static_cast<double>(c.maximum),
                               static_cast<double>(c.safe)});
  config.channels.push_back({"valid", Direction::kSensor, DType::kU8, 1, "", 0, 1, 0});
  config.channels.push_back({"age", Direction::kSensor, DType::kU8, 1, "ticks", 0, 255, 255});

  shm_protocol::SurfaceConfig of_boards;
  of_boards.name = boards_name_->name();
  of_boards.reserved = boards_name_;
  of_boards.rows = 1;
  of_boards.columns = static_cast<std::uint32_t>(boards_.size());
  of_boards.period_ns = config.period_ns;
  of_boards.mode = Mode::kPassive;
  of_boards.slots = 64;
  for (const char* name : kBoardChannels) {
    const bool real = std::string_view(name) == "offset_us";
    of_boards.channels.push_back({name, Direction::kSensor, real ? DType::kF32 : DType::kU32, 1, "",
                                  real ? -1e9 : 0.0, real ? 1e9 : 4294967295.0, 0});
  }
  for (std::size_t i = 0; i < map_.channels().size(); ++i) {
    const TableChannel& c = map_.channels()[i];
    if (c.sensor || c.name.size() > kMaxLimitedName ||
        of_boards.channels.size() + std::size(kLimits) > SSP_MAX_CHANNELS)
      continue;
    shown_limits_.push_back(i);
    for (const char* limit : kLimits)
      of_boards.channels.push_back(
          {std::string(limit) + "." + c.name, Direction::kSensor, DType::kF32, 1, "", 0, 1e9, 0});
  }
  // Who finds the table's surface finds that of its boards.
  board_surface_.emplace(shm_protocol::SurfaceEndpoint::create(of_boards));
  surface_.emplace(create_described_surface(config, "the boards of table '" + spec_.name + "'"));
  control_.emplace(config.name);

  const std::size_t cells = std::size_t{map_.rows()} * map_.columns();
  for (const TableChannel& c : map_.channels()) planes_.emplace_back(cells * c.components, c.safe);
  for (const MountedBoard& board : map_.boards()) make_safe(board);
  valid_.assign(cells, 0);
  age_.assign(cells, 255);
  log_.add("table '" + spec_.name + "', " + std::to_string(boards_.size()) + " boards, " +
           std::to_string(map_.rows()) + " rows of " + std::to_string(map_.columns()) + " cells, every " +
           std::to_string(period_us_) + " us; controllers attach to '" + config.name + "'");
}

void TableBridge::await_recorder() {
  if (!options_.is_recorder_ready) return;
  const auto until = Clock::now() + kRecorderPatience;
  while (!options_.is_recorder_ready() && !stop_.load()) {
    if (Clock::now() >= until) return log_.add("the recorder is late; the first frames are not recorded");
    poll_lines(Board::now() + 5000);
  }
}

// ---- lines

void TableBridge::poll_lines(std::int64_t until) {
  // A thousand attempts a second in all, so that a table without its boards costs little.
  constexpr std::int64_t kReopen_us = 100'000, kReopenEach_us = 1000;
  const auto absent = std::ranges::count_if(boards_, [](const auto& board) { return !board->connected(); });
  const std::int64_t reopen_us = std::max(kReopen_us, absent * kReopenEach_us);
  lines_.clear();
  for (const auto& board : boards_) {
    board->maintain(epoch_, has_begun_, reopen_us);
    lines_.push_back(
        {board->descriptor(), static_cast<short>(POLLIN | (board->wants_to_write() ? POLLOUT : 0)), 0});
  }
  if (control_) lines_.push_back({control_->descriptor(), POLLIN, 0});
  const std::int64_t left = std::max<std::int64_t>(until - Board::now(), 0);
  const timespec time{static_cast<time_t>(left / 1'000'000), static_cast<long>(left % 1'000'000 * 1000)};
  if (::ppoll(lines_.data(), lines_.size(), &time, nullptr) > 0)
    for (std::size_t i = 0; i < boards_.size(); ++i)
      if (lines_[i].revents != 0) boards_[i]->receive(epoch_);
  if (control_) control_->serve([this](const std::string& command) { return answer(command); });
  log_events();
}

void TableBridge::log_events() {
  for (const auto& board : boards_) {
    for (const std::string& line : board->events) log_.add(line);
    board->events.clear();
    for (const std::string& line : board->reports) log_.add_report(line);
    board->reports.clear();
  }
  log_.print_due();
}

// ---- ticks

void TableBridge::serve() {
  const std::int64_t latest =
      tick_start(tick_) + static_cast<std::int64_t>(kLatestClosing * static_cast<double>(period_us_));
  // Wakes for the controller's answer at least every millisecond.
  poll_lines(awaiting_answer_
                 ? Board::now()
                 : std::min(latest, Board::now() + (options_.mode == Mode::kPassive ? 1000 : 20'000)));
  mount_described_boards(true);
  check_emergency_stop();
  if (awaiting_answer_) poll_answer();
  if (options_.mode == Mode::kPassive && counters_.frames != 0) poll_latest();
  const std::int64_t now = Board::now();
  if (now < tick_start(tick_) || (now < latest && !is_complete())) return;
  if (awaiting_answer_)
    skip_tick();
  else
    close_tick();
  ++tick_;
  // A host that was suspended does not catch up.
  if (const std::int64_t due = (Board::now() - epoch_) / period_us_; due > tick_ + 1) {
    counters_.skipped += static_cast<std::uint64_t>(due - tick_);
    status_ |= kFramesLost;
    tick_ = due;
  }
}

bool TableBridge::is_complete() const {
  for (std::size_t i = 0; i < boards_.size(); ++i)
    if (!boards_[i]->silent() && board_age_[i] < kExpected && !boards_[i]->has_frame(tick_, epoch_))
      return false;
  return true;
}

void TableBridge::fill_planes() {
  const std::size_t cells = valid_.size();
  bool invalid = false;
  ++filled_ticks_;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    Board& board = *boards_[i];
    const MountedBoard& mounted = map_.boards()[i];
    const Board::Frame* frame = board.accepted() ? board.take(tick_, epoch_) : nullptr;
    if (frame) {
      board_age_[i] = 0;
      ++valid_ticks_[i];
      for (const BoardChannel& c : mounted.channels) {
        const DeviceChannel& device = board.description().channels[c.device_channel];
        if (!device.sensor) continue;
        std::vector<float>& plane = planes_[c.table_channel];
        copy_to_table(mounted, c, device.components, frame->values.data() + device.first_element,
                      plane.data(), cells);
        if (calibration_ && device.name == calibration_->sensor)
          calibration_->correct_readings(mounted, plane);
      }
    } else {
      if (board_age_[i] != std::numeric_limits<std::uint32_t>::max()) ++board_age_[i];
      invalid = true;
    }
    const auto age = static_cast<std::uint8_t>(std::min<std::uint32_t>(board_age_[i], 255));
    for (std::size_t cell = 0; cell < mounted.cells.size(); ++cell) {
      if (!mounted.exists[cell]) continue;
      valid_[mounted.cells[cell]] = age == 0;
      age_[mounted.cells[cell]] = age;
    }
  }
  if (invalid) status_ |= kBoardNotValid;
}

std::uint32_t TableBridge::status_of_boards() {
  std::uint32_t status = 0;
  std::uint64_t missed = 0;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    Board& board = *boards_[i];
    missed = std::max(missed, board.counters().missed - board_missed_[i]);
    board_missed_[i] = board.counters().missed;
    if (!board.accepted() || board.silent()) continue;
    if (board.flags() & SSW_SAFE) status |= kSafeValuesActive;
    if (board.flags() & SSW_LIMITED) status |= kLimited;
    if (board.flags() & SSW_SOFT_START) status |= kSoftStart;
    if (std::exchange(board.is_back, false)) status |= kAfterSilence;
  }
  for (std::uint64_t k = 0; k < std::min<std::uint64_t>(missed, 16); ++k) surface_->miss_deadline();
  counters_.missed_deadlines += missed;
  if (missed != 0) status |= kMissedDeadline;
  if (emergency_.active()) status |= kStopped;
  return status;
}

void TableBridge::close_tick() {
  fill_planes();
  measure_spread();
  status_ |= status_of_boards();
  const auto& channels = map_.channels();
  for (int i = 0; i < std::ssize(channels); ++i) {
    if (!channels[i].sensor) continue;
    if (channels[i].plain_u8)
      std::ranges::transform(planes_[i], surface_->sensor<std::uint8_t>(i).begin(),
                             [](float v) { return static_cast<std::uint8_t>(v); });
    else
      std::ranges::copy(planes_[i], surface_->sensor<float>(i).begin());
  }
  const int own = static_cast<int>(channels.size());
  std::ranges::copy(valid_, surface_->sensor<std::uint8_t>(own).begin());
  std::ranges::copy(age_, surface_->sensor<std::uint8_t>(own + 1).begin());
  publish_boards();
  const auto tick = static_cast<std::uint64_t>(tick_ - 1);
  if (surface_->publish(tick, static_cast<double>(tick) * static_cast<double>(period_us_) * 1e-6, status_) !=
      Status::kOk)
    return;
  published_at_ = Board::now();
  close_us_.add(static_cast<double>(published_at_ - tick_start(tick_)));
  surface_->set_state(State::kRunning);
  if (options_.is_recorder_ready) options_.is_recorder_ready();
  ++counters_.frames;
  status_ = 0;
  published_tick_ = tick;
  for (const auto& board : boards_) board->mark_published(static_cast<std::int64_t>(tick));
  if (driver_) return ask_driver();
  awaiting_answer_ = options_.mode == Mode::kTimeStep;
  if (!awaiting_answer_) keep_boards_alive();
}

// The controller is slow: it gets the next tick.
void TableBridge::skip_tick() {
  ++counters_.skipped;
  status_ |= kFramesLost;
  fill_planes();
  keep_boards_alive();
}

void TableBridge::publish_boards() {
  const auto words = [&](int channel) { return board_surface_->sensor<std::uint32_t>(channel); };
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const Board& board = *boards_[i];
    const auto phase = board.clock().phase_us();
    const auto in_force = board.tick_in_force();
    words(kTick)[i] = board.frame_tick();
    words(kDeviceTime)[i] = phase ? board.clock().board_clock(board.frame_tick()) : 0;
    board_surface_->sensor<float>(kOffset)[i] =
        static_cast<float>(phase.value_or(std::numeric_limits<double>::quiet_NaN()));
    words(kAge)[i] = std::min<std::uint32_t>(board_age_[i], 255);
    words(kValid)[i] = board_age_[i] == 0;
    words(kInForce)[i] = in_force ? static_cast<std::uint32_t>(*in_force) : SSW_NONE;
    words(kFlags)[i] = board.flags();
    words(kHeldBack)[i] = board.status().limited;
    publish_limits(i);
  }
  const auto tick = static_cast<std::uint64_t>(tick_ - 1);
  (void)board_surface_->publish(tick, static_cast<double>(tick) * static_cast<double>(period_us_) * 1e-6,
                                status_);
}

// The limits that the board keeps itself; 0: none.
void TableBridge::publish_limits(std::size_t board) {
  int channel = kOwnChannels;
  for (const std::size_t c : shown_limits_) {
    ssw_limits limits{};
    for (const BoardChannel& own : map_.boards()[board].channels)
      if (own.table_channel == c) limits = map_.boards()[board].device->channels[own.device_channel].limits;
    for (const float value :
         {limits.slew, limits.acceleration, limits.soft_start, static_cast<float>(limits.most_moving)})
      board_surface_->sensor<float>(channel++)[board] = value;
  }
}

// The spread: how far apart the boards in phase begin their periods.
void TableBridge::measure_spread() {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  int known = 0;
  for (const auto& board : boards_) {
    if (board->silent() || !board->clock().phase_us()) continue;
    const double phase = *board->clock().phase_us();
    least = std::min(least, phase);
    most = std::max(most, phase);
    phase_quantiles_.add(std::abs(phase));
    ++known;
  }
  if (known < 2) return;
  spread_us_ = most - least;
  if (tick_ * period_us_ > 3'000'000)
    spread_quantiles_.add(spread_us_);  // boards need a moment to come into phase
}

// ---- answers

void TableBridge::poll_answer() {
  // At most until the next tick closes.
  const Status got = surface_->await_actuators(published_tick_, {milliseconds(1), &stop_});
  switch (got) {
    case Status::kTimeout:
    case Status::kInterrupted:
    case Status::kTorn:
      return;
    case Status::kControllerDead:
    case Status::kControllerClosed:
      log_.add(std::string(shm_protocol::text(got)) +
               (options_.hold_last_frame ? "; its last frame stands" : "; safe values stand"));
      break;
    case Status::kOk:
      answer_us_.add(static_cast<double>(Board::now() - published_at_));
      break;
    default:
      break;
  }
  awaiting_answer_ = false;
  counters_.answers += send_answers(published_tick_) && got == Status::kOk;
}

void TableBridge::poll_latest() {
  const Status newest = surface_->latest_actuators();
  if (newest == Status::kControllerDead || newest == Status::kControllerClosed)
    log_.add(std::string(shm_protocol::text(newest)) +
             (options_.hold_last_frame ? "; its last frame stands" : "; safe values stand"));
  else if (newest != Status::kOk)
    return;
  if (newest == Status::kOk) answer_us_.add(static_cast<double>(Board::now() - published_at_));
  const std::uint64_t answered = newest == Status::kOk ? surface_->actuator_info().tick : published_tick_;
  counters_.answers += send_answers(answered) && newest == Status::kOk;
}

// The controller's frame, as commands for the boards.
void TableBridge::receive_commands() {
  const auto& channels = map_.channels();
  for (int i = 0; i < std::ssize(channels); ++i) {
    if (channels[i].sensor) continue;
    if (channels[i].plain_u8)
      std::ranges::copy(surface_->actuator<std::uint8_t>(i), planes_[i].begin());
    else
      std::ranges::copy(surface_->actuator<float>(i), planes_[i].begin());
  }
}

// The commands to the board's calibrated cells.
void TableBridge::correct_commands(const Board& board, const MountedBoard& mounted) {
  for (const BoardChannel& c : mounted.channels) {
    const DeviceChannel& device = board.description().channels[c.device_channel];
    if (device.sensor || device.name != calibration_->actuator) continue;
    if (board.flags() & SSW_SAFE) calibration_->note_own_command(mounted, device.safe);
    calibration_->correct_commands(mounted, planes_[c.table_channel]);
  }
}

void TableBridge::ask_driver() {
  const auto answer = driver_->drive(
      {static_cast<std::int64_t>(published_tick_), map_, boards_, board_age_, planes_, emergency_.active()});
  driver_ended_ = answer == TableDriver::Answer::kEnd;
  if (answer == TableDriver::Answer::kNothing) return keep_boards_alive();
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    boards_[i]->is_driven = true;
    // One answer to each frame, so that what is in force is known.
    if (driver_ended_ || !boards_[i]->accepted() || boards_[i]->silent()) continue;
    if (board_age_[i] != 0)
      boards_[i]->send_heartbeat();
    else
      send_commands(*boards_[i], map_.boards()[i], published_tick_);
  }
}

// Returns whether a board got the controller's commands.
bool TableBridge::send_answers(std::uint64_t answered) {
  const bool own_safe_values = surface_->actuator_info().frame == 0;
  bool sent = false;
  if (!own_safe_values) receive_commands();
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    Board& board = *boards_[i];
    if (!board.accepted() || board.silent() || board_age_[i] > kPatience) continue;
    if (emergency_.active() || own_safe_values) {
      board.send_safe();
      continue;
    }
    if (calibration_) correct_commands(board, map_.boards()[i]);
    if (send_commands(board, map_.boards()[i], answered)) sent = true;
  }
  return sent;
}

// Elements without a channel of the table get their safe values.
bool TableBridge::send_commands(Board& board, const MountedBoard& mounted, std::uint64_t answered) {
  frame_.assign(board.actuator_elements(), 0.0F);
  for (const DeviceChannel& c : board.description().channels)
    if (!c.sensor) std::fill_n(frame_.begin() + c.first_element, c.elements, c.safe);
  for (const BoardChannel& c : mounted.channels) {
    const DeviceChannel& device = board.description().channels[c.device_channel];
    if (!device.sensor)
      copy_to_board(mounted, c, device.components, planes_[c.table_channel].data(), valid_.size(),
                    frame_.data() + device.first_element);
  }
  return board.send(frame_, static_cast<std::int64_t>(answered));
}

// Boards on which safe values are to be in force, but are not reported to be, get them in each tick: any
// frame may be damaged on the line.
void TableBridge::keep_boards_alive() {
  const bool is_safe = !driver_ && surface_->actuator_info().frame == 0;
  for (const auto& board : boards_) {
    if (!board->accepted() || board->silent()) continue;
    const bool needs_safe_frame = (is_safe && !(board->flags() & SSW_SAFE)) ||
                                  (emergency_.active() && board->description().version < 2);
    if (needs_safe_frame && !board->wants_to_write())
      board->send_safe();
    else
      board->send_heartbeat();
  }
}

// ---- emergency stop and status

void TableBridge::check_emergency_stop() {
  for (const auto& board : boards_) {
    if (!board->accepted() || board->silent()) continue;
    const bool was_active = emergency_.active();
    const std::uint8_t packet = emergency_.packet_for(board->flags(), board->counters().frames,
                                                      spec_.period_us, board->release, board->title());
    if (!was_active && emergency_.active()) log_.add("emergency stop by " + emergency_.cause());
    // Repeated each period until the board's frames show that it has arrived.
    if (packet == 0 || board->description().version < 2 || board->stop_sent_tick == tick_) continue;
    board->stop_sent_tick = tick_;
    board->send_reason(packet, packet == SSW_STOP_NOW ? emergency_.reason() : SSW_NONE);
  }
}

ControlAnswer TableBridge::answer(const std::string& command) {
  if (command == "stop") {
    emergency_.stop(SSW_STOP_BY_HOST, "the user");
    for (const auto& board : boards_) {
      if (!board->accepted()) continue;
      board->discard_pending();
      if (board->description().version >= 2) board->send_reason(SSW_STOP_NOW, SSW_STOP_BY_HOST);
      board->send_safe();
    }
    log_.add("emergency stop by the user");
    return {"stopped\n"};
  }
  if (command == "arm") return {"armed\n", [this] { arm(); }};
  if (command == "status") return {status_text()};
  return {"error: unknown command\n"};
}

void TableBridge::arm() {
  if (emergency_.active()) log_.add("the emergency stop is released");
  emergency_.arm();
  for (const auto& board : boards_) {
    if (!board->accepted() || board->description().version < 2) continue;
    board->send_reason(SSW_ARM, SSW_NONE);
    board->release = EmergencyStop::Release(board->counters().frames);
  }
}

std::string TableBridge::status_text() const {
  char line[256];
  std::string text = "table " + spec_.name + " tick " + std::to_string(tick_) + " frames " +
                     std::to_string(counters_.frames) + "\nemergency_stop " +
                     (emergency_.active() ? "by " + emergency_.cause() : std::string("none")) + "\n";
  if (calibration_) text += "calibration " + calibration_->file + "\n";
  std::snprintf(line, sizeof line, "spread_us %.0f\n", spread_us_);
  text += line;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const Board& b = *boards_[i];
    const char* state = !b.connected()  ? "unplugged"
                        : !b.accepted() ? "refused"
                        : b.silent()    ? "silent"
                                        : "live";
    const BoardCounters c = b.counters();
    std::snprintf(line, sizeof line,
                  " %s age %u phase_us %.0f round_trip_us %.0f%s%s%s%s frames %llu lost %llu late %llu "
                  "dropped %u clamped %u limited %u\n",
                  state, std::min<std::uint32_t>(board_age_[i], 255), b.clock().phase_us().value_or(0),
                  b.clock().round_trip_us(), b.flags() & SSW_SAFE ? " safe" : "",
                  b.flags() & SSW_STOPPED ? " stopped" : "", b.flags() & SSW_LIMITED ? " limited" : "",
                  b.flags() & SSW_SOFT_START ? " soft_start" : "", static_cast<unsigned long long>(c.frames),
                  static_cast<unsigned long long>(c.lost), static_cast<unsigned long long>(c.late),
                  b.status().dropped, b.status().clamped, b.status().limited);
    text += "board " + b.title() + line;
    if (!b.described()) continue;
    for (const DeviceChannel& channel : b.description().channels)
      if (!channel.sensor) text += limits_text(channel);
  }
  return text;
}

std::string TableBridge::report() const {
  BoardCounters sum;
  double least = 1;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    const BoardCounters c = boards_[i]->counters();
    sum.frames += c.frames;
    sum.lost += c.lost;
    sum.late += c.late;
    sum.missed += c.missed;
    sum.unsent += c.unsent;
    sum.silences += c.silences;
    sum.reconnections += c.reconnections;
    sum.restarts += c.restarts;
    if (filled_ticks_ > 0)
      least = std::min(least, static_cast<double>(valid_ticks_[i]) / static_cast<double>(filled_ticks_));
  }
  const auto n = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  char text[1024];
  std::snprintf(
      text, sizeof text,
      "boards %zu board_frames %llu board_lost %llu board_late %llu board_missed %llu board_unsent %llu "
      "board_silences %llu board_reconnections %llu board_restarts %llu least_valid %.4f\n"
      "close_us %s\nanswer_us %s\nspread_us %s\nphase_us %s\ncpu_s %.2f\n",
      boards_.size(), n(sum.frames), n(sum.lost), n(sum.late), n(sum.missed), n(sum.unsent), n(sum.silences),
      n(sum.reconnections), n(sum.restarts), least, close_us_.text().c_str(), answer_us_.text().c_str(),
      spread_quantiles_.text().c_str(), phase_quantiles_.text().c_str(), cpu_seconds());
  char last[512];
  std::snprintf(last, sizeof last,
                "frames %llu answers %llu lost %llu passed_over %llu missed %llu unsent %llu silences %llu "
                "reconnections %llu damaged_packets %llu lost_packets %llu\n",
                n(counters_.frames), n(counters_.answers), n(sum.lost), n(counters_.skipped), n(sum.missed),
                n(sum.unsent), n(sum.silences), n(sum.reconnections), n(counters_.damaged_packets),
                n(counters_.lost_packets));
  return std::string(text) + last;
}

}  // namespace hardware
