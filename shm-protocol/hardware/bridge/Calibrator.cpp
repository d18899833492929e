#include "shm-protocol/hardware/bridge/Calibrator.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "shm-protocol/hardware/firmware/device.h"

namespace hardware {
namespace {

constexpr double kLowest = 0.15, kHighest = 0.85, kBelow = 0.05;  // of the range
constexpr int kSteps = 6, kShortSteps = 64;
constexpr double kShortStep = 0.04;
constexpr int kTail = 16;                           // ticks after the plan, for late frames
constexpr std::int64_t kMaxGap = SSD_PATIENCE / 2;  // periods; safe values come into effect after twice that
constexpr std::size_t kRestSamples = 200;
constexpr std::int64_t kMaxSettling_s = 120, kMaxDisturbed_s = 10;
constexpr double kSure = 6;            // standard errors
constexpr int kLongestHold = 50;       // of a level, in times --hold
constexpr std::size_t kMaxLength = 4;  // of a recording with its repeats, in plans

const BoardChannel* channel_of(const MountedBoard& board, std::size_t table_channel) {
  for (const BoardChannel& c : board.channels)
    if (c.table_channel == table_channel) return &c;
  return nullptr;
}

}  // namespace

void Stillness::reset(std::size_t cells, int window) {
  window_ = window;
  count_ = windows_ = 0;
  last_.resize(cells);
  mean_.assign(cells, 0);
  sum_.assign(cells, 0);
  squares_.assign(cells, 0);
}

bool Stillness::add(std::span<const float> readings) {
  for (std::size_t cell = 0; cell < readings.size(); ++cell) {
    const auto y = static_cast<double>(readings[cell]);
    sum_[cell] += y;
    if (count_ > 0) squares_[cell] += (y - last_[cell]) * (y - last_[cell]);
    last_[cell] = y;
  }
  if (++count_ < window_) return false;
  bool still = windows_++ > 0;
  const double n = window_;
  for (std::size_t cell = 0; cell < readings.size(); ++cell) {
    const double mean = sum_[cell] / n, variance = squares_[cell] / (2 * (n - 1));
    still = still && std::abs(mean - mean_[cell]) <= kSure * std::sqrt(2 * variance / n);
    mean_[cell] = mean;
    sum_[cell] = squares_[cell] = 0;
  }
  count_ = 0;
  return still;
}

std::vector<float> calibration_plan(int hold) {
  std::vector<float> plan;
  const auto stay = [&](double value, int periods) {
    plan.insert(plan.end(), periods, static_cast<float>(value));
  };
  const auto level = [](int step) { return kLowest + (kHighest - kLowest) * step / kSteps; };
  for (int step = 0; step <= kSteps; ++step) stay(level(step), hold);
  for (int step = kSteps - 1; step >= 0; --step) stay(level(step), hold);
  for (int k = 0; k < 2; ++k) {
    stay(kHighest, hold);
    stay(kLowest, hold);
  }
  const double middle = 0.5 * (kLowest + kHighest);
  stay(middle, hold);
  std::mt19937 random(1);
  for (int k = 0; k < kShortSteps; ++k)
    stay(middle + (k % 2 == 0 ? kShortStep : -kShortStep), 1 + static_cast<int>(random() % 16));
  stay(kLowest, hold);
  for (const int periods : {2 * hold, hold, std::max(hold / 2, 1)}) {
    for (int k = 1; k <= periods; ++k) stay(kLowest + (kHighest - kLowest) * k / periods, 1);
    for (int k = periods - 1; k >= 0; --k) stay(kLowest + (kHighest - kLowest) * k / periods, 1);
  }
  stay(kLowest, hold);
  return plan;
}

Calibrator::Calibrator(const TableSpec& spec, CalibratorOptions options)
    : spec_(spec), options_(std::move(options)) {
  hold_ = std::max(static_cast<int>(std::lround(options_.hold_s * 1e6 / spec.period_us)), 8);
  plan_ = calibration_plan(hold_);
}

// The channels that are named, or the only actuator and the only sensor with its unit.
void Calibrator::choose_channels(const TableTick& tick) {
  const auto& channels = tick.map.channels();
  const auto fail = [&](const std::string& what) { throw std::invalid_argument(spec_.file + ": " + what); };
  const auto choose = [&](bool sensor, const std::string& name, const char* flag, auto may) {
    std::vector<std::size_t> found;
    std::string names;
    for (std::size_t i = 0; i < channels.size(); ++i) {
      if (channels[i].sensor != sensor || channels[i].components != 1) continue;
      if (name.empty() ? may(channels[i]) : channels[i].name == name) found.push_back(i);
      names += (names.empty() ? "" : ", ") + channels[i].name;
    }
    if (found.size() != 1)
      fail(std::string(name.empty() ? (found.empty() ? "no " : "more than one ")
                                    : "no channel '" + name + "' that is a ") +
           (sensor ? "sensor with the actuator's unit" : "actuator") + " of one component; give " + flag +
           ", one of: " + (names.empty() ? "none" : names));
    return found[0];
  };
  actuator_ = choose(false, options_.actuator, "--actuator", [](const TableChannel&) { return true; });
  const TableChannel& actuator = channels[actuator_];
  unit_ = actuator.unit;
  sensor_ = choose(true, options_.sensor, "--sensor", [&](const TableChannel& c) { return c.unit == unit_; });
  if (channels[sensor_].unit != unit_)
    fail("sensor '" + channels[sensor_].name + "' is in '" + channels[sensor_].unit + "', actuator '" +
         actuator.name + "' in '" + unit_ + "'");
  actuator_name_ = actuator.name;
  sensor_name_ = channels[sensor_].name;
  lowest_ = static_cast<double>(actuator.minimum);
  highest_ = static_cast<double>(actuator.maximum);
  if (options_.rest && !(*options_.rest >= lowest_ && *options_.rest <= highest_))
    fail("--rest " + std::to_string(*options_.rest) + " is beyond the range of '" + actuator.name + "', " +
         std::to_string(lowest_) + " to " + std::to_string(highest_));
}

void Calibrator::begin(const TableTick& tick) {
  choose_channels(tick);
  rows_ = tick.map.rows();
  columns_ = tick.map.columns();
  mounted_ = tick.map.boards();
  records_.resize(mounted_.size());
  for (std::size_t i = 0; i < records_.size(); ++i) {
    BoardRecord& r = records_[i];
    const BoardChannel *drive = channel_of(mounted_[i], actuator_), *sense = channel_of(mounted_[i], sensor_);
    r.has_channels = drive && sense;
    if (!r.has_channels) continue;
    const DeviceChannel& u = mounted_[i].device->channels[drive->device_channel];
    const DeviceChannel& y = mounted_[i].device->channels[sense->device_channel];
    r.drive = u;
    r.resolution = y.dtype == SSW_F32 ? 0 : static_cast<double>(y.scale);
    const std::size_t ticks = kMaxLength * (plan_.size() + kTail);
    r.valid.reserve(ticks);
    r.in_force.reserve(ticks);
    r.readings.reserve(ticks * mounted_[i].cells.size());
    r.at_rest.reserve(kRestSamples * mounted_[i].cells.size());
  }
  commands_.reserve(kMaxLength * (plan_.size() + kTail));
  enter(options_.rest ? Phase::kRest : Phase::kApproach, tick);
}

void Calibrator::enter(Phase phase, const TableTick& tick) {
  phase_ = phase;
  phase_began_ = last_good_ = tick.tick;
  settling_since_.reset();
}

// The command of the next answer, as a fraction of the range.
double Calibrator::level() const {
  if (phase_ == Phase::kApproach) return kBelow;
  if (phase_ == Phase::kDown) return kLowest;
  if (phase_ == Phase::kUp) return kHighest;
  const std::int64_t last = std::ssize(plan_) - 1;
  return static_cast<double>(plan_[std::clamp<std::int64_t>(position_, 0, last)]);
}

// The command, as a height, that answered a tick of the table.
double Calibrator::command_of(std::int64_t tick) const {
  const std::int64_t last = std::ssize(commands_) - 1;
  const std::size_t index = std::clamp<std::int64_t>(tick - first_command_, 0, last);
  return lowest_ + static_cast<double>(commands_[index]) * (highest_ - lowest_);
}

// Why commands or readings since the last tick are not known; "": they are.
std::string Calibrator::disturbance(const TableTick& tick) const {
  if (tick.tick - last_tick_ >= kMaxGap) return "the host was suspended, or too busy";
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const BoardRecord& r = records_[i];
    const Board& board = *tick.boards[i];
    const auto says = [&](const char* what) { return "board '" + board.title() + "' " + what; };
    if (!r.begun) continue;
    if (board.silent() || board.counters().silences != r.silences || tick.board_age[i] >= kMaxGap)
      return says("was silent");
    if ((board.flags() & SSW_SAFE) != 0) return says("applied its safe values");
    if (tick.board_age[i] != 0) continue;
    if (!board.in_force_since(board.frame_tick())) return says("got no answers");
    const std::int64_t passed = board.frame_tick() - r.last_tick;
    if (std::abs(passed - (tick.tick - r.last_table_tick)) >= kMaxGap) return says("lost its time");
  }
  return "";
}

// True if all cells rest at the level: the commands in force belong to this phase, and the readings of two
// successive holds agree.
bool Calibrator::has_settled(const TableTick& tick, bool disturbed) {
  bool settles = !disturbed, late = false;
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const Board& board = *tick.boards[i];
    if (!records_[i].has_channels || board.silent()) continue;
    late = late || tick.board_age[i] != 0;
    if ((board.flags() & (SSW_SAFE | SSW_LIMITED | SSW_SOFT_START)) != 0 ||
        board.tick_in_force().value_or(-1) < phase_began_)
      settles = false;
  }
  if (!settles) settling_since_.reset();
  if (!settles || late) return false;
  if (!settling_since_) {
    settling_since_ = tick.tick;
    stillness_.reset(tick.planes[sensor_].size(), hold_);
  }
  // Some cells never come to rest.
  return stillness_.add(tick.planes[sensor_]) || tick.tick - *settling_since_ >= kLongestHold * hold_;
}

void Calibrator::record_rest(const TableTick& tick) {
  for (std::size_t i = 0; i < records_.size(); ++i) {
    if (!records_[i].has_channels || tick.board_age[i] != 0) continue;
    for (const std::uint32_t cell : mounted_[i].cells)
      records_[i].at_rest.push_back(tick.planes[sensor_][cell]);
  }
}

// While the first level of the plan is held; cells of a board that comes later do not begin at rest.
void Calibrator::begin_boards(const TableTick& tick) {
  for (std::size_t i = 0; i < records_.size(); ++i) {
    BoardRecord& r = records_[i];
    if (r.begun || !r.has_channels || tick.board_age[i] != 0 || position_ >= hold_) continue;
    r.begun = true;
    r.first_tick = tick.boards[i]->frame_tick();
    r.last_tick = r.first_tick - 1;
    r.last_table_tick = tick.tick - 1;
    r.silences = tick.boards[i]->counters().silences;
    r.restarts = tick.boards[i]->counters().restarts;
  }
}

// Records which command was in force in each tick of the boards, also from frames that came too late to be
// taken. With `leave_out`, the ticks since the last record are left out as if time had stood still.
void Calibrator::note_in_force(const TableTick& tick, bool leave_out) {
  for (std::size_t i = 0; i < records_.size(); ++i) {
    BoardRecord& r = records_[i];
    const Board& board = *tick.boards[i];
    if (!r.begun) continue;
    if (board.counters().restarts != r.restarts ||
        (tick.board_age[i] == 0 && board.frame_tick() <= r.last_tick)) {
      failure_ = "board '" + board.title() + "' was restarted; calibrate again";
      return;
    }
    r.silences = board.counters().silences;
    if (tick.board_age[i] != 0) continue;
    if (leave_out) r.first_tick += board.frame_tick() - r.last_tick;
    const std::uint32_t known = board.frame_tick() - r.first_tick + 1;  // 0: all is left out
    r.in_force.resize(known);
    r.valid.resize(known);
    r.readings.resize(known * mounted_[i].cells.size());
    if (!leave_out)
      for (std::uint32_t t = r.last_tick + 1; t <= board.frame_tick(); ++t)
        r.in_force[t - r.first_tick] = board.in_force_since(t);
    r.last_tick = board.frame_tick();
    r.last_table_tick = tick.tick;
  }
}

void Calibrator::record(const TableTick& tick) {
  for (std::size_t i = 0; i < records_.size(); ++i) {
    BoardRecord& r = records_[i];
    const auto& cells = mounted_[i].cells;
    const std::size_t k = r.last_tick - r.first_tick;
    if (!r.begun || tick.board_age[i] != 0 || k >= r.valid.size()) continue;
    r.valid[k] = 1;
    for (std::size_t cell = 0; cell < cells.size(); ++cell)
      r.readings[k * cells.size() + cell] = tick.planes[sensor_][cells[cell]];
  }
}

void Calibrator::repeat(const TableTick& tick) {
  ++repeats_;
  position_ -= tick.tick - last_tick_ + hold_;
  if (position_ >= hold_) return enter(Phase::kDown, tick);
  position_ = 0;
  for (BoardRecord& r : records_) {
    r.begun = false;
    r.valid.clear();
    r.in_force.clear();
    r.readings.clear();
  }
  enter(Phase::kApproach, tick);
}

TableDriver::Answer Calibrator::drive(TableTick tick) {
  if (phase_ == Phase::kStart) {
    last_tick_ = tick.tick;
    begin(tick);
  }
  if (tick.stopped) failure_ = "an emergency stop ended the calibration";
  if (phase_ == Phase::kPlan) begin_boards(tick);
  const std::int64_t elapsed = tick.tick - last_tick_;
  const std::string why = disturbance(tick);
  note_in_force(tick, !why.empty() || phase_ == Phase::kDown);
  if (!why.empty()) last_disturbance_ = why;
  if (why.empty() || elapsed >= kMaxGap) last_good_ = tick.tick;
  if ((tick.tick - last_good_) * spec_.period_us > kMaxDisturbed_s * 1'000'000)
    failure_ = why + " for " + std::to_string(kMaxDisturbed_s) + " s; calibrate again";
  if (phase_ > Phase::kSettle) spent_ += std::min(elapsed, kMaxGap);
  if (spent_ > static_cast<std::int64_t>(kMaxLength * plan_.size()))
    failure_ = "parts were repeated " + std::to_string(repeats_) + " times, the last one because " +
               last_disturbance_ + "; calibrate again when the host is less busy and the lines are sound";
  if (!failure_.empty()) return Answer::kEnd;

  switch (phase_) {
    case Phase::kRest:
      record_rest(tick);
      if (tick.tick - phase_began_ >= static_cast<std::int64_t>(kRestSamples)) enter(Phase::kApproach, tick);
      break;
    case Phase::kApproach:
    case Phase::kSettle:
    case Phase::kDown:
    case Phase::kUp:
      if (has_settled(tick, !why.empty())) {
        enter(phase_ == Phase::kApproach ? Phase::kSettle
              : phase_ == Phase::kDown   ? Phase::kUp
                                         : Phase::kPlan,
              tick);
      } else if ((tick.tick - phase_began_) * spec_.period_us > kMaxSettling_s * 1'000'000) {
        failure_ = "the cells do not come to rest within " + std::to_string(kMaxSettling_s) + " s: " +
                   (last_disturbance_.empty() ? "a limit of a board holds them back" : last_disturbance_);
        return Answer::kEnd;
      }
      break;
    default:
      position_ += elapsed;
      if (!why.empty())
        repeat(tick);
      else
        record(tick);
      if (position_ >= std::ssize(plan_) + kTail) {
        phase_ = Phase::kDone;
        return Answer::kEnd;
      }
  }
  last_tick_ = tick.tick;
  if (phase_ == Phase::kRest) return Answer::kNothing;
  if (commands_.empty()) first_command_ = tick.tick;
  commands_.resize(tick.tick - first_command_ + 1);
  commands_.back() = static_cast<float>(level());
  std::ranges::fill(tick.planes[actuator_], static_cast<float>(command_of(tick.tick)));
  return Answer::kCommands;
}

// The command in force in each period. A lost frame was not answered: what the next frame reports was in
// force already.
std::vector<std::int64_t> Calibrator::commands_in_force(const BoardRecord& r, std::size_t ticks) {
  std::vector<std::int64_t> in_force(ticks, Board::kSafeValues);
  for (std::size_t k = ticks; k-- > 0;)
    in_force[k] = r.in_force[k] ? *r.in_force[k] : k + 1 < ticks ? in_force[k + 1] : Board::kSafeValues;
  return in_force;
}

std::vector<std::string> Calibrator::absent_boards() const {
  std::vector<std::string> boards;
  for (std::size_t i = 0; i < records_.size(); ++i)
    if (records_[i].is_absent()) boards.push_back("board '" + spec_.boards[i].title() + "'");
  return boards;
}

Calibration Calibrator::fit() const {
  Calibration all;
  all.table = spec_.name;
  all.actuator = actuator_name_;
  all.sensor = sensor_name_;
  all.unit = unit_;
  all.rows = rows_;
  all.columns = columns_;
  all.period_us = spec_.period_us;
  all.has_rest = options_.rest.has_value();
  for (const TableBoard& b : spec_.boards) all.boards.push_back({b.id, b.row, b.column, b.turn, b.mirror, 0});
  all.fits.resize(all.cells());
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const BoardRecord& r = records_[i];
    const std::size_t cells = mounted_[i].cells.size();
    if (r.is_absent()) continue;
    const std::size_t ticks = std::min<std::size_t>(r.valid.size(), r.last_tick - r.first_tick + 1);
    const std::vector<std::int64_t> in_force = commands_in_force(r, ticks);
    std::vector<float> command(ticks - 1), reading(ticks - 1);
    std::vector<std::uint8_t> valid(ticks - 1);
    for (std::size_t k = 0; k + 1 < ticks; ++k) {
      const double u = in_force[k] < 0 ? static_cast<double>(r.drive.safe) : command_of(in_force[k]);
      command[k] = rounded(r.drive, static_cast<float>(u));
      valid[k] = r.valid[k + 1];
    }
    std::vector<float> at_rest(r.at_rest.size() / cells);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (!mounted_[i].exists[cell]) continue;
      for (std::size_t k = 0; k + 1 < ticks; ++k) reading[k] = r.readings[(k + 1) * cells + cell];
      for (std::size_t k = 0; k < at_rest.size(); ++k) at_rest[k] = r.at_rest[k * cells + cell];
      CellFit& fit = all.fits[mounted_[i].cells[cell]];
      fit = fit_cell({1e-6 * spec_.period_us, command, reading, valid, true, at_rest,
                      options_.rest.value_or(0), r.resolution});
      if (is_usable(fit, highest() - lowest())) continue;
      fit = CellFit{};
      fit.state = CellState::kStuck;
    }
  }
  return all;
}

}  // namespace hardware
