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
constexpr std::size_t kMostGuessed = SSD_PATIENCE;  // periods in a row
constexpr std::size_t kRestSamples = 200;
constexpr std::int64_t kMostSettling_s = 120;

const BoardChannel* channel_of(const MountedBoard& board, std::size_t table_channel) {
  for (const BoardChannel& c : board.channels)
    if (c.table_channel == table_channel) return &c;
  return nullptr;
}

}  // namespace

std::vector<float> calibration_plan(int hold) {
  std::vector<float> plan;
  const auto stay = [&](double value, int periods) {
    plan.insert(plan.end(), static_cast<std::size_t>(periods), static_cast<float>(value));
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
    r.has_channels = drive && sense && tick.boards[i]->described();
    if (!r.has_channels) continue;
    const DeviceChannel& u = tick.boards[i]->description().channels[drive->device_channel];
    const DeviceChannel& y = tick.boards[i]->description().channels[sense->device_channel];
    r.scale = u.dtype == SSW_F32 ? 0 : static_cast<double>(u.scale);
    r.offset = static_cast<double>(u.offset);
    r.safe = static_cast<double>(u.safe);
    r.resolution = y.dtype == SSW_F32 ? 0 : static_cast<double>(y.scale);
    const std::size_t ticks = plan_.size() + kTail;
    r.valid.assign(ticks, 0);
    r.in_force.assign(ticks, std::nullopt);
    r.readings.assign(ticks * mounted_[i].cells.size(), 0.0F);
    r.at_rest.reserve(kRestSamples * mounted_[i].cells.size());
  }
  phase_ = options_.rest ? Phase::kRest : Phase::kApproach;
  phase_began_ = tick.tick;
}

// The command, as a height, that answers a tick of the table.
double Calibrator::command_of(std::int64_t tick) const {
  double fraction = kBelow;
  if (phase_ == Phase::kPlan || phase_ == Phase::kDone) {
    const auto last = static_cast<std::int64_t>(plan_.size()) - 1;
    fraction = static_cast<double>(
        plan_[static_cast<std::size_t>(std::clamp<std::int64_t>(tick - plan_began_, 0, last))]);
  } else if (phase_ == Phase::kSettle) {
    fraction = static_cast<double>(plan_.front());
  }
  return lowest_ + fraction * (highest_ - lowest_);
}

bool Calibrator::has_settled(const TableTick& tick) const {
  if (tick.tick - phase_began_ < hold_) return false;
  return std::ranges::all_of(tick.boards, [](const auto& board) {
    return board->silent() || (board->flags() & (SSW_LIMITED | SSW_SOFT_START)) == 0;
  });
}

// Returns whether all boards are as they were.
bool Calibrator::record(const TableTick& tick) {
  for (std::size_t i = 0; i < records_.size(); ++i) {
    BoardRecord& r = records_[i];
    if (!r.has_channels || tick.board_age[i] != 0) continue;
    const Board& board = *tick.boards[i];
    const auto& cells = mounted_[i].cells;
    const auto& plane = tick.planes[sensor_];
    if (phase_ == Phase::kRest) {
      for (const std::uint32_t cell : cells) r.at_rest.push_back(plane[cell]);
      continue;
    }
    if (!r.begun) r.first_tick = board.frame_tick();
    if (r.begun && board.frame_tick() <= r.last_tick) {
      failure_ = "board '" + board.title() + "' was restarted; calibrate again";
      return false;
    }
    // Frames that were too late to be taken say what was in force too.
    for (std::uint32_t t = r.begun ? r.last_tick + 1 : r.first_tick; t <= board.frame_tick(); ++t)
      if (t - r.first_tick < r.in_force.size()) r.in_force[t - r.first_tick] = board.in_force_since(t);
    const bool safe = (board.flags() & SSW_SAFE) != 0 || board.counters().silences != r.silences;
    if (r.begun && safe) {
      failure_ =
          "board '" + board.title() +
          "' was silent or applied its safe values meanwhile, as if the host was suspended; calibrate again";
      return false;
    }
    r.silences = board.counters().silences;
    r.begun = true;
    r.last_tick = board.frame_tick();
    const std::size_t k = r.last_tick - r.first_tick;
    if (k >= r.valid.size()) continue;
    r.valid[k] = 1;
    for (std::size_t cell = 0; cell < cells.size(); ++cell)
      r.readings[k * cells.size() + cell] = plane[cells[cell]];
  }
  return true;
}

TableDriver::Answer Calibrator::drive(TableTick tick) {
  if (phase_ == Phase::kStart) begin(tick);
  if (tick.stopped) failure_ = "an emergency stop ended the calibration";
  if (!failure_.empty()) return Answer::kEnd;
  const std::int64_t elapsed = tick.tick - phase_began_;
  const auto next = [&](Phase phase) {
    phase_ = phase;
    phase_began_ = tick.tick;
  };
  switch (phase_) {
    case Phase::kRest:
      record(tick);
      if (elapsed < static_cast<std::int64_t>(kRestSamples)) return Answer::kNothing;
      next(Phase::kApproach);
      break;
    case Phase::kApproach:
    case Phase::kSettle:
      if (elapsed * spec_.period_us > kMostSettling_s * 1'000'000) {
        failure_ = "the cells do not come to rest within " + std::to_string(kMostSettling_s) +
                   " s: a limit of a board holds them back";
        return Answer::kEnd;
      }
      if (!has_settled(tick)) break;
      next(phase_ == Phase::kApproach ? Phase::kSettle : Phase::kPlan);
      plan_began_ = tick.tick;
      if (phase_ != Phase::kPlan) break;
      [[fallthrough]];
    case Phase::kPlan:
      if (!record(tick)) return Answer::kEnd;
      if (tick.tick - plan_began_ >= static_cast<std::int64_t>(plan_.size()) + kTail) {
        phase_ = Phase::kDone;
        return Answer::kEnd;
      }
      break;
    default:
      return Answer::kEnd;
  }
  std::ranges::fill(tick.planes[actuator_], static_cast<float>(command_of(tick.tick)));
  return Answer::kCommands;
}

// What was in force, period by period. A frame that did not come had no answer, so that what the next one
// says holds for it too.
std::vector<std::int64_t> Calibrator::commands_in_force(const BoardRecord& r, std::size_t ticks) {
  std::vector<std::int64_t> in_force(ticks, Board::kSafeValues);
  for (std::size_t k = ticks; k-- > 0;)
    in_force[k] = r.in_force[k] ? *r.in_force[k] : k + 1 < ticks ? in_force[k + 1] : Board::kSafeValues;
  return in_force;
}

// A board may have applied its safe values in periods that are not known: the readings of these, and those
// until the cells have forgotten them, are left out.
void Calibrator::leave_out_guesses(const BoardRecord& r, std::vector<std::uint8_t>& valid) const {
  std::size_t unknown = 0;
  for (std::size_t k = 0; k < valid.size(); ++k) {
    if (!r.in_force[k]) {
      ++unknown;
      continue;
    }
    if (unknown > 0 && (unknown >= kMostGuessed || *r.in_force[k] == Board::kSafeValues)) {
      const std::size_t end = std::min(k + static_cast<std::size_t>(2 * hold_), valid.size());
      std::fill(valid.begin() + static_cast<std::ptrdiff_t>(k - unknown),
                valid.begin() + static_cast<std::ptrdiff_t>(end), std::uint8_t{0});
    }
    unknown = 0;
  }
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
  CellFit absent;
  absent.state = CellState::kGood;
  all.fits.assign(all.cells(), absent);
  for (std::size_t i = 0; i < records_.size(); ++i) {
    const BoardRecord& r = records_[i];
    const std::size_t cells = mounted_[i].cells.size();
    if (!r.has_channels || !r.begun) {
      for (const std::uint32_t cell : mounted_[i].cells) all.fits[cell] = CellFit{};
      continue;
    }
    const std::size_t ticks = std::min<std::size_t>(r.valid.size(), r.last_tick - r.first_tick + 1);
    const std::vector<std::int64_t> in_force = commands_in_force(r, ticks);
    std::vector<float> command(ticks - 1), reading(ticks - 1);
    std::vector<std::uint8_t> valid(ticks - 1);
    for (std::size_t k = 0; k + 1 < ticks; ++k) {
      double u = in_force[k] < 0 ? r.safe : command_of(in_force[k]);
      if (r.scale > 0) u = r.offset + r.scale * std::round((u - r.offset) / r.scale);
      command[k] = static_cast<float>(u);
      valid[k] = r.valid[k + 1];
    }
    leave_out_guesses(r, valid);
    std::vector<float> at_rest(r.at_rest.size() / cells);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (!mounted_[i].exists[cell]) continue;
      for (std::size_t k = 0; k + 1 < ticks; ++k) reading[k] = r.readings[(k + 1) * cells + cell];
      for (std::size_t k = 0; k < at_rest.size(); ++k) at_rest[k] = r.at_rest[k * cells + cell];
      all.fits[mounted_[i].cells[cell]] = fit_cell({1e-6 * spec_.period_us, command, reading, valid, true,
                                                    at_rest, options_.rest.value_or(0), r.resolution});
    }
  }
  return all;
}

}  // namespace hardware
